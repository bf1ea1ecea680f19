"""A compiled loop that counts the time it takes, for benchmarks."""

from __future__ import annotations

import time
from typing import Any

from graspsense_sim_gripper.compiled.loop_code import CompiledLoop
from graspsense_sim_gripper.loop import LoopEnd


class TimedLoop(CompiledLoop):
    """The same loop; the seconds of this thread in it, with the conversion of arguments and results, add up."""

    def __init__(self, loop: CompiledLoop) -> None:
        self._loop, self.spent_s = loop, 0.0

    def run(self, *arguments: Any) -> LoopEnd:
        began = time.thread_time()
        end = self._loop.run(*arguments)
        self.spent_s += time.thread_time() - began
        return end
