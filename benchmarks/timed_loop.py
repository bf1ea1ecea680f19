"""Compiled loops that count the time they take, for benchmarks."""

from __future__ import annotations

import time
from typing import Any

from graspsense_sim_gripper.compiled.compose import Composition
from graspsense_sim_gripper.compiled.loop_code import CompiledLoop, CompiledLoops
from graspsense_sim_gripper.loop import LoopEnd


class TimedLoop(CompiledLoop):
    """The same loop; the seconds of this thread in it, with the conversion of arguments and results, add up."""

    def __init__(self, loop: CompiledLoop) -> None:
        self._loop, self._types, self.spent_s = loop, None, 0.0

    def run_from(self, *arguments: Any) -> LoopEnd:
        began = time.thread_time()
        end = self._loop.run_from(*arguments)
        self.spent_s += time.thread_time() - began
        return end


class TimedLoops(CompiledLoops):
    """The same loops; the seconds of this thread in all of them add up."""

    def __init__(self, loops: CompiledLoops) -> None:
        self._of, self._timed = loops, dict[Composition, TimedLoop]()

    def of(self, composition: Composition) -> CompiledLoop:
        if composition not in self._timed:
            self._timed[composition] = TimedLoop(self._of.of(composition))
        return self._timed[composition]

    @property
    def spent_s(self) -> float:
        return sum(loop.spent_s for loop in self._timed.values())

    @spent_s.setter
    def spent_s(self, seconds: float) -> None:
        for loop in self._timed.values():
            loop.spent_s = seconds
