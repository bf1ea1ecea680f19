"""`graspsense hold`: hold an object with little force, without letting it slip."""

from __future__ import annotations

from math import inf, nan
from typing import Any, Final

import click

from graspsense.cli.options import pipeline_options, sets_key, settings_of, time_range
from graspsense.cli.run import finish, grasped, print_trial
from graspsense.cli.terminal import talk
from graspsense.core.pipeline.wiring import check
from graspsense.core.values.signals import HOLD, Command, GraspEvent, Reading

PIPELINE: Final = "hold"
LONGEST_S: Final = 3500.0
LETTING_GO: Final = ("release", "opened", "let go")
"""How the events of the runner begin that tell what becomes of the fingers at the end."""
TO_GRASP_S: Final = 60.0
"""Time that is allowed for the grasp itself."""


@click.command()
@click.option(
    "--seconds",
    type=time_range(LONGEST_S),
    default=60.0,
    show_default=True,
    help="Time from the grip until the fingers open.",
)
@pipeline_options
def hold(seconds: float, **asked: Any) -> None:
    """Close on an object, hold it with little force, add force whenever it slips, and open at the end.

    Without --pipeline it is the pipeline hold of graspsense-romano, with a simulated gripper. The fingers open at the
    end, on Ctrl-C, and when the gripper or the object is lost. Exit codes are those of run.
    """
    if sets_key(asked["options"], "run.hold_s"):
        raise click.UsageError("--seconds sets run.hold_s: leave out -o run.hold_s")
    lasting = (f"run.hold_s={seconds}", f"run.grasp_timeout_s={max(seconds + TO_GRASP_S, 300.0)}")
    options = (*lasting, *asked["options"])
    settings = settings_of(**{**asked, "pipeline": asked["pipeline"] or PIPELINE, "options": options})
    check(settings)
    rows = HoldRows()
    trial, interrupted = grasped(settings, (rows,))
    print_trial(trial, events=False)
    talk(rows.summary())
    finish(trial, interrupted)


for _option in hold.params:
    if isinstance(_option, click.Option) and _option.name == "pipeline":
        _option.help = f"Name of a pipeline, or a .toml file.  [default: {PIPELINE}]"


class HoldRows:
    """Prints what the controller tells, the weaker finger's force beside it, and that force every second."""

    def __init__(self) -> None:
        self._force_n, self._t_s, self._greatest_n, self._slips, self._shown = 0.0, -inf, 0.0, 0, ""

    def take(self, reading: Reading, phase: int, command: Command) -> None:
        """Take one tick."""
        del command
        frame = reading.frame
        forces = [force_n for force_n in (frame.force_left_n, frame.force_right_n) if force_n == force_n]
        self._force_n = min(forces, default=nan)
        if phase == HOLD:
            self._greatest_n = max(self._greatest_n, self._force_n)
            if frame.t_s - self._t_s >= 1.0:
                self._row(frame.t_s, "holds")

    def event(self, event: GraspEvent) -> None:
        """Print how the fingers open, and an event of the controller; a slip each time, others once for each second."""
        if event.source == "runner" and event.what.startswith(LETTING_GO):
            self._row(event.t_s, event.what)
        if event.source != "controller":
            return
        slip = event.what == "slip"
        self._slips += slip and event.phase == HOLD
        if slip or event.what != self._shown or event.t_s - self._t_s >= 1.0:
            self._row(event.t_s, event.what)

    def _row(self, t_s: float, what: str) -> None:
        self._t_s, self._shown = t_s, what
        force = " no pads" if self._force_n != self._force_n else f"{self._force_n:z6.2f} N"
        talk(f"{t_s:8.3f} s  {force}  {what}")

    def summary(self) -> str:
        """Return the number of slips, and the greatest force while it was held."""
        if self._force_n != self._force_n:
            return "neither slips nor forces were measured: this gripper has no pads"
        return f"slips: {self._slips}; greatest force while holding: {self._greatest_n:.2f} N"
