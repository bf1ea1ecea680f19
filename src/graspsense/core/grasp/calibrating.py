"""Moving a gripper to calibrate it: images of unloaded cells, and the effort at which the fingers begin to move.

Every command passes the guard with the limits of a first use, because nothing is to be touched.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from graspsense.core.components.roles import SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.control.contact import CONTACT_FORCE_N, RestState, at_rest, update_rest
from graspsense.core.control.guard import GuardParams, GuardState, guard
from graspsense.core.control.tick import OPEN_SPEED_M_S, OPEN_WINDOW_S
from graspsense.core.grasp.opened_gripper import frame_timeout_s, no_frame
from graspsense.core.grasp.protection.reports import Reports
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import DeviceLost, ExitCode, GraspsenseError
from graspsense.core.values.signals import EFFORT, Command, Pads, Phase, Reading

RAMP_N_S: Final = 2.0
"""Rate at which the effort rises; the authors' stiction test used 1 N/s."""
MOVED_M: Final = 5e-6
"""Change of the gap at which the fingers count as moving; about fifteen encoder ticks of a PR2."""
BETWEEN_M_S: Final = 0.01
"""Speed from one gap to the next."""


class CalibrationFailed(GraspsenseError):
    """The gripper did not do what the calibration requires."""

    exit_code = ExitCode.NOT_FINISHED


class Breakaway(NamedTuple):
    """Efforts (N, positive) that began to move the fingers at this gap (m)."""

    gap_m: float
    closing_n: float
    opening_n: float


class Rig:
    """An opened gripper with the guard that limits its commands."""

    def __init__(self, backend: SensorBackend[Any], info: DeviceInfo, run: RunConfig) -> None:
        self._backend, self._info, self._run = backend, info, run
        self._guard = GuardParams(
            effort_limit_n=info.effort_limit_n,
            speed_limit_m_s=info.speed_limit_m_s,
            first_effort_n=run.first_effort_n,
            first_speed_m_s=run.first_speed_m_s,
            contact_force_n=float("inf"),
        )
        self._last: Reading | None = None
        self._reports = Reports(info.rate_hz, 0.0)

    def tick(self, command: Command) -> Reading:
        """Apply a limited command, and return the next reading. Raises DeviceLost, CalibrationFailed."""
        last = self._last if self._last is not None else self._read()
        guarded, _ = guard(self._guard, GuardState(0, 0, 0), last.frame, command)
        self._backend.apply(guarded)
        self._last = self._read()
        return self._last

    def open(self) -> Reading:
        """Open the fingers until they are at rest."""
        if self._info.opening is None:
            raise CalibrationFailed(f"{self._info.name} cannot be opened, so it cannot be calibrated")
        return self._until_rest(self._info.opening)

    def let_go(self) -> Reading:
        """Relax until the fingers are at rest."""
        return self._until_rest(self._info.relaxed)

    def relax(self) -> Reading:
        """Relax for one tick."""
        return self.tick(self._info.relaxed)

    def _until_rest(self, command: Command) -> Reading:
        reading = self.tick(command)
        began_s = reading.frame.t_s
        still = RestState(began_s + self._backend.command_delay_s, reading.frame.gap_m)
        while not at_rest(still, reading.frame.t_s, OPEN_WINDOW_S):
            if reading.frame.t_s - began_s > self._run.opening_timeout_s:
                raise CalibrationFailed(
                    f"the fingers did not come to rest within run.opening_timeout_s = {self._run.opening_timeout_s} s"
                )
            reading = self.tick(command)
            still = update_rest(still, reading.frame.t_s, reading.frame.gap_m, OPEN_SPEED_M_S, OPEN_WINDOW_S)
        return reading

    def _read(self) -> Reading:
        reading = self._backend.read(frame_timeout_s(self._run, self._info))
        if reading is None:
            raise DeviceLost(no_frame(self._run, self._info))
        # The time limits of a motion are those of the gripper's clock.
        fault = self._reports.see(reading, Phase.OPENING)
        if fault is not None:
            raise CalibrationFailed(fault.told)
        return reading


def unloaded_images(rig: Rig, count: int, timeout_s: float) -> list[Pads]:
    """Open the fingers, relax, and return the next `count` cell images.

    Raises CalibrationFailed if they do not come within `timeout_s` by the clock of the gripper.
    """
    rig.open()
    reading = rig.let_go()
    began_s = reading.frame.t_s
    seen = reading.pads.counter
    images: list[Pads] = []
    while len(images) < count:
        reading = rig.relax()
        if reading.pads.counter > seen:
            seen = reading.pads.counter
            images.append(reading.pads)
        if reading.frame.t_s - began_s > timeout_s:
            raise CalibrationFailed(
                f"{len(images)} of {count} cell images came in {timeout_s:g} s: check the fingertips' cables"
            )
    return images


def breakaways(rig: Rig, gaps_m: Sequence[float], most_n: float) -> list[Breakaway]:
    """Return the efforts at which the fingers begin to close and to open, at each gap from wide to narrow.

    The effort rises at `RAMP_N_S` until the gap has changed by `MOVED_M`. Raises CalibrationFailed if this takes more
    than `most_n`, or if a pad is touched.
    """
    rig.open()
    frictions = []
    push_n = most_n
    for gap_m in sorted(gaps_m, reverse=True):
        _move_to(rig, gap_m, push_n)
        at_m = rig.let_go().frame.gap_m
        closing = _ramp(rig, +1.0, most_n)
        rig.let_go()
        opening = _ramp(rig, -1.0, most_n)
        rig.let_go()
        push_n = min(most_n, closing * 1.5)
        frictions.append(Breakaway(at_m, closing, opening))
    return frictions


def _move_to(rig: Rig, gap_m: float, effort_n: float) -> None:
    began_s: float | None = None
    while True:
        frame = rig.tick(Command(EFFORT, effort_n, float("inf"), BETWEEN_M_S)).frame
        began_s = frame.t_s if began_s is None else began_s
        if frame.gap_m <= gap_m:
            return
        _untouched(frame.force_left_n, frame.force_right_n)
        if frame.t_s - began_s > 30.0:
            raise CalibrationFailed(f"the fingers did not get to a gap of {gap_m * 1e3:.1f} mm in 30 s")


def _ramp(rig: Rig, direction: float, most_n: float) -> float:
    frame = rig.tick(Command(EFFORT, 0.0, float("inf"), float("inf"))).frame
    began_s, gap_m = frame.t_s, frame.gap_m
    while True:
        effort = RAMP_N_S * (frame.t_s - began_s)
        if effort > most_n:
            raise CalibrationFailed(
                f"{most_n:g} N did not move the fingers at a gap of {gap_m * 1e3:.1f} mm: is something in their way? "
                "Else raise run.first_effort_n"
            )
        frame = rig.tick(Command(EFFORT, direction * effort, float("inf"), float("inf"))).frame
        _untouched(frame.force_left_n, frame.force_right_n)
        if abs(frame.gap_m - gap_m) > MOVED_M:
            return effort


def _untouched(left_n: float, right_n: float) -> None:
    if max(left_n, right_n) >= CONTACT_FORCE_N:
        raise CalibrationFailed(
            "something touches a pad: take everything out of the gripper, tare it, and try again"
        )
