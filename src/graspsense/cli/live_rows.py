"""A grasp in the terminal while it goes on: gap, force and phase."""

from __future__ import annotations

import sys
from typing import Final

from graspsense.cli.terminal import block, talk, terminal_width
from graspsense.core.values.signals import Command, GraspEvent, Phase, Reading

BAR: Final = 24
"""Characters of the bar of the widest gap, where the terminal has room for it."""
_ROW: Final = 50
"""Characters of a row without its bar."""


class LiveRows:
    """Prints a row of gap, force and phase whenever one of them has changed enough to be worth a line."""

    def __init__(self) -> None:
        self._phase = -1
        self._t_s = self._gap_m = self._force_n = 0.0
        self._widest_m = 0.0
        self._quiet_s = 0.5
        self._bar = BAR

    def take(self, reading: Reading, phase: int, command: Command) -> None:
        """Take one tick."""
        del command
        frame = reading.frame
        force = frame.force_left_n + frame.force_right_n
        if (
            phase == self._phase
            and frame.t_s - self._t_s < self._quiet_s
            and not abs(force - self._force_n) >= 4.0  # of a gripper without pads it is NaN
            and not abs(frame.gap_m - self._gap_m) >= 0.01  # NaN where it could not be measured
        ):
            return
        if self._phase == -1:
            # On a clock of frames, not seconds, every frame is worth a line.
            self._quiet_s = max(0.5, frame.dt_s) if frame.dt_s < 0.5 else 0.0
            room = (terminal_width(sys.stderr) or _ROW + BAR) - _ROW
            self._bar = min(max(room, 0), BAR)
            gap = f"{'gap':<{self._bar + 13}}"
            talk(f"      t  phase       {gap}  left     right")
        self._phase, self._t_s, self._gap_m, self._force_n = phase, frame.t_s, frame.gap_m, force
        if self._widest_m == 0.0:
            self._widest_m = max(0.0, frame.gap_m)
        share = min(max(0.0, frame.gap_m / self._widest_m), 1.0) if self._widest_m else 0.0
        bar = block(sys.stderr) * round(self._bar * share)
        talk(
            f"{frame.t_s:7.3f}  {Phase(phase).name.lower():<10}{_millimetres(frame.gap_m)}  {bar:<{self._bar}}"
            f"{_newtons(frame.force_left_n)} {_newtons(frame.force_right_n)}"
        )

    def event(self, event: GraspEvent) -> None:
        """Print a prediction that was made while the grasp goes on."""
        if event.source == "model":
            talk(f"{event.t_s:7.3f}  {event.phase.name.lower():<10}{event.what}")


def _millimetres(gap_m: float) -> str:
    return f"{gap_m * 1e3:6.1f} mm" if gap_m == gap_m else f"{'-':>6}   "


def _newtons(force_n: float) -> str:
    return f"{force_n:z7.2f} N" if force_n == force_n else f"{'-':>7}  "
