"""How long a gripper takes from a command to the first motion, and from a command to the first force.

Times are those of the gripper's frames: a frame is measured before the command is given, and the motion or force is in
a later one. A latency is therefore the largest that it can be, and can be shorter by the time of a frame.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from math import inf, isnan
from statistics import median
from typing import Any, Final, NamedTuple

from attrs import evolve

from graspsense.core.components.entries import KINDS, Finding
from graspsense.core.components.roles import SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.calibrating import CalibrationFailed, Rig
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.signals import EFFORT, FORCE, POSITION, VELOCITY, Command, Frame

QUIET_S: Final = 0.2
"""Time without a change of the command, from which the noise of gap and force is known."""
NOISES: Final = 2.0
"""Motion or force counts from so many times the largest deviation of the quiet frames."""
SHARES: Final = (1 / 2, 2 / 3, 5 / 6, 1.0)
"""Shares of the greatest force with which the fingers are tried to close, the lightest first."""
LEAST_M: Final = 1e-5
LEAST_N: Final = 0.05
"""Least motion and force that count, where there is no noise."""
ANSWER_S: Final = 2.0
"""A command has no effect if none is seen in this time."""
CLOSING_S: Final = 30.0
CLOSED_M: Final = 2e-3


class Latency(NamedTuple):
    """Latencies (s) to the first motion and to the first force, of each repetition; why there is no force, or empty."""

    motion_s: tuple[float, ...]
    force_s: tuple[float, ...]
    no_force: str


def measured_latency(
    backend: SensorBackend[Any], accepts: Sequence[str], info: DeviceInfo, run: RunConfig, repetitions: int
) -> Latency:
    """Move an open gripper so many times, and squeeze what is between its fingers with the limits of a first use.

    `accepts` are the kinds of command that it declares. Raises CalibrationFailed if the fingers do not move.
    """
    meter = _Meter(backend, accepts, info, run)
    motion, force, no_force = [], [], ""
    for _ in range(repetitions):
        meter.rig.open()
        motion.append(meter.motion_s())
        if not no_force:
            latency_s, no_force = meter.force_s()
            force += [] if no_force else [latency_s]
        meter.rig.open()
    return Latency(tuple(motion), tuple(force), no_force)


def latency_findings(
    backend: SensorBackend[Any], accepts: Sequence[str], info: DeviceInfo, run: RunConfig, repetitions: int
) -> tuple[Finding, ...]:
    """Return the median and the largest latencies, compared with what the gripper declares. Raises as above."""
    measured = measured_latency(backend, accepts, info, run, repetitions)
    # A motion shows late on a coarse gap and heavy fingers, so that it says nothing of a delay of the commands.
    findings = [_finding("command to first motion", measured.motion_s, 0.0, info)]
    if measured.no_force:
        findings.append(Finding("command to first force", "note", "not measured", measured.no_force))
    else:
        findings.append(_finding("command to first force", measured.force_s, backend.command_delay_s, info))
    return tuple(findings)


def _finding(subject: str, latencies_s: tuple[float, ...], declared_s: float, info: DeviceInfo) -> Finding:
    largest_s, frame_s = max(latencies_s), 1.0 / info.rate_hz
    slow = declared_s > 0.0 and min(latencies_s) > declared_s + frame_s
    return Finding(
        subject,
        "problem" if slow else "ok",
        f"{median(latencies_s) * 1e3:.1f} ms (median of {len(latencies_s)}), at most {largest_s * 1e3:.1f} ms; of this "
        f"up to {frame_s * 1e3:.1f} ms are the time of a frame",
        f"it declares {declared_s * 1e3:g} ms: look at the load of this computer and at the latency timer of the port"
        if slow
        else "",
        numbers={
            "median_s": median(latencies_s),
            "largest_s": largest_s,
            "declared_s": declared_s,
            "frame_s": frame_s,
        },
    )


class _Meter:
    def __init__(
        self, backend: SensorBackend[Any], accepts: Sequence[str], info: DeviceInfo, run: RunConfig
    ) -> None:
        # At the speed of a first use, a wide gripper needs its time to open.
        patient = evolve(run, opening_timeout_s=max(run.opening_timeout_s, CLOSING_S))
        self.rig = Rig(backend, info, patient)
        self._speed_m_s = run.first_speed_m_s
        self._moved_m = LEAST_M
        self._most_n = run.first_effort_n
        lightest_n = max(backend.least_force_n, 0.0)
        # As little as moves the fingers, so that there is more to ask for on what they meet.
        self._light_n = [max(share * self._most_n, lightest_n) for share in SHARES]
        kinds = [KINDS.index(name) for name in accepts]
        self._kind = next(kind for kind in (VELOCITY, POSITION, EFFORT, FORCE) if kind in kinds)

    def motion_s(self) -> float:
        """Return the time until the open fingers close. Raises CalibrationFailed."""
        while True:
            latency_s = self._motion_s(self._light_n[0])
            if latency_s is not None:
                return latency_s
            if len(self._light_n) == 1:
                raise CalibrationFailed(
                    f"the fingers did not move within {ANSWER_S:g} s under {self._light_n[0]:g} N: raise "
                    "run.first_effort_n"
                )
            del self._light_n[0]

    def _motion_s(self, force_n: float) -> float | None:
        quiet = [self.rig.relax().frame]
        while quiet[-1].t_s - quiet[0].t_s < QUIET_S:
            quiet.append(self.rig.relax().frame)
        start = quiet[-1]
        self._moved_m = max(_noise(frame.gap_m for frame in quiet), LEAST_M)
        return self._until(force_n, start, lambda frame: start.gap_m - frame.gap_m > self._moved_m)

    def force_s(self) -> tuple[float, str]:
        """Return the time until a larger force shows on what the fingers have met, and why there is none."""
        light_n, more_n = self._light_n[0], self._most_n
        if more_n <= light_n:
            return (
                inf,
                f"raise run.first_effort_n: it is {more_n:g} N, and {light_n:g} N only close the fingers",
            )
        quiet = self._until_they_stand(light_n)
        if not quiet:
            return inf, f"the fingers did not come to rest in {CLOSING_S:g} s"
        start = quiet[-1]
        if start.gap_m < CLOSED_M:
            return inf, "there is nothing between the fingers: put a block there"
        noise_n = _noise(map(_force_n, quiet))
        level_n = max(map(_force_n, quiet))
        answer_s = self._until(more_n, start, lambda frame: _force_n(frame) - level_n > max(noise_n, LEAST_N))
        if answer_s is None:
            return inf, f"no force followed within {ANSWER_S:g} s: raise run.first_effort_n"
        return answer_s, ""

    def _closing(self, force_n: float) -> Command:
        value = {EFFORT: force_n, VELOCITY: -self._speed_m_s, POSITION: 0.0, FORCE: force_n}[self._kind]
        return Command(self._kind, value, force_n, self._speed_m_s)

    def _until_they_stand(self, force_n: float) -> list[Frame]:
        """Close until the fingers stand still, and return the frames of that time; none if they do not."""
        quiet = [self.rig.tick(self._closing(force_n)).frame]
        end_s = quiet[0].t_s + CLOSING_S
        while quiet[-1].t_s < end_s:
            now = self.rig.tick(self._closing(force_n)).frame
            if abs(now.gap_m - quiet[0].gap_m) > self._moved_m:
                quiet = []
            quiet.append(now)
            if now.t_s - quiet[0].t_s > 2.0 * QUIET_S:
                return quiet
        return []

    def _until(self, force_n: float, start: Frame, seen: Callable[[Frame], bool]) -> float | None:
        """Return the time from `start` to the frame in which it is seen, None if that takes too long."""
        while True:
            frame = self.rig.tick(self._closing(force_n)).frame
            if seen(frame):
                return frame.t_s - start.t_s
            if frame.t_s - start.t_s > ANSWER_S:
                return None


def _force_n(frame: Frame) -> float:
    """Return the force of the pads, or of the motor where there are none."""
    pads = min(frame.force_left_n, frame.force_right_n)
    return frame.effort_n if isnan(pads) else pads


def _noise(values: Iterable[float]) -> float:
    numbers = list(values)
    return NOISES * (max(numbers) - min(numbers))
