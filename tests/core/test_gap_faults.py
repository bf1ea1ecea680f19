"""Faults of the gap: it jumps, is no number any more, or does not change when the fingers are told to open."""

from math import inf, nan

import numpy as np
from cases import every_case
from grippers import REST_S, Scripted, bottle, squeezing

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.protection.motor import Motor
from graspsense.core.grasp.protection.speed import GapAbsent, GapJump, Opening
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.signals import (
    EFFORT,
    FORCE,
    POSITION,
    SQUEEZE,
    VELOCITY,
    Command,
    Frame,
    Outcome,
    Phase,
)
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController

RATE_HZ = 100.0


def frame(k, gap_m):
    return Frame(k / RATE_HZ, 1.0 / RATE_HZ, gap_m, 0.0, nan, nan, nan, nan, nan, 0)


def jumps(command, gap_of, frames=100):
    """Return in which frames the gap jumps under this command."""
    watch, seen = GapJump(0.2), []
    for k in range(frames):
        if watch.see(frame(k, gap_of(k))) is not None:
            seen.append(k)
        watch.apply(frame(k, gap_of(k)), command)
    return seen


CLOSES = Command(POSITION, 0.0, 20.0, 0.02)


def closing(k):
    """Fingers that close at 20 mm/s."""
    return 0.08 - 0.02 * k / RATE_HZ


@every_case(
    ("command", "gap_of", "seen"),
    [
        (CLOSES, closing, []),
        (CLOSES, lambda k: closing(k) + 0.004 * (k >= 50), [50]),
        (CLOSES, lambda k: closing(k) - 0.004 * (k == 50), [50, 51]),
        (Command(VELOCITY, -0.02, 20.0, inf), lambda k: closing(k) - 0.004 * (k >= 50), [50]),
        (Command(FORCE, 20.0, inf, 0.02), lambda k: closing(k) - 0.004 * (k >= 50), [50]),
        # A gap in steps of 1 mm, and one that is measured at each fifth frame.
        (CLOSES, lambda k: round(closing(k), 3), []),
        (CLOSES, lambda k: closing(k - k % 5), []),
        # How fast fingers move under an effort is not known.
        (Command(EFFORT, 20.0, inf, inf), lambda k: closing(k) + 0.004 * (k >= 50), []),
        (CLOSES, lambda k: nan if k > 50 else closing(k), []),
    ],
)
def test_a_gap_that_changes_faster_than_the_fingers_were_told_jumps(command, gap_of, seen):
    assert jumps(command, gap_of) == seen


@every_case(("absent_from", "absent_to", "ends"), [(50, 55, False), (50, 100, True), (0, 100, False)])
def test_a_gap_that_was_known_and_is_none_for_a_tenth_of_a_second_ends_the_grasp(
    absent_from, absent_to, ends
):
    watch = GapAbsent(RATE_HZ)
    faults = [watch.see(frame(k, nan if absent_from <= k < absent_to else 0.05)) for k in range(100)]
    assert any(fault is not None and fault.ends for fault in faults) is ends


@every_case(("velocity_m_s", "seen"), [(-0.02, [50]), (nan, []), (0.0, [])])
def test_under_an_effort_a_gap_that_jumps_is_known_by_a_velocity_that_is_measured(velocity_m_s, seen):
    watch, jumped = GapJump(0.2), []
    for k in range(100):
        now = frame(k, closing(k) - 0.004 * (k >= 50))._replace(velocity_m_s=velocity_m_s)
        if watch.see(now) is not None:
            jumped.append(k)
        watch.apply(now, Command(EFFORT, 20.0, inf, inf))
    assert jumped == seen


def test_a_gap_that_is_declared_and_never_a_number_ends_the_grasp():
    watch = GapAbsent(RATE_HZ, declared=True)
    faults = [watch.see(frame(k, nan)) for k in range(100)]
    assert faults[-1] is not None
    assert faults[-1].ends


def test_a_gap_that_jumps_is_no_motor_that_turns_the_wrong_way():
    """Against the command and back, as a spike does: the motor is judged by the motion without the jumps."""
    jump, motor = GapJump(0.2), Motor(False, RATE_HZ)
    for k in range(100):
        now = frame(k, closing(k) + 0.004 * (k == 30) + 0.004 * (k >= 60))
        jump.see(now)
        motor.shift(jump.step_m)
        assert motor.see(now, Phase.APPROACH) is None
        motor.apply(now, CLOSES)
        jump.apply(now, CLOSES)
    assert jump.jumps == 3


def opened(gap_of, start_m=0.08, delay_s=0.02):
    """Return the names of the faults in a release of a second, after a squeeze at 50 mm."""
    watch = Opening(RATE_HZ, delay_s)
    gaps = [*np.linspace(start_m, 0.05, 100), *(gap_of(k / RATE_HZ) for k in range(100))]
    phases = [SQUEEZE] * 100 + [Phase.RELEASE] * 100
    faults = [
        watch.see(frame(k, gap), phase) for k, (gap, phase) in enumerate(zip(gaps, phases, strict=True))
    ]
    return sorted({fault.name for fault in faults if fault is not None and not fault.ends})


@every_case(
    ("gap_of", "start_m", "names"),
    [
        (lambda t: 0.05 + 0.05 * t, 0.08, []),
        (lambda t: 0.05 + 0.05 * max(t - 0.15, 0.0), 0.08, []),
        (lambda t: 0.05 + 0.05 * max(t - 0.3, 0.0), 0.08, ["gap late"]),
        (lambda t: 0.05, 0.08, ["fingers did not open"]),
        (lambda t: nan, 0.08, ["fingers did not open"]),
        # Fingers that never closed need not open.
        (lambda t: 0.05, 0.051, []),
    ],
)
def test_fingers_that_closed_have_to_open_when_they_are_told_to(gap_of, start_m, names):
    assert opened(gap_of, start_m) == names


class LateGap(Scripted):
    """A gripper whose gap is told this much later (s)."""

    def __init__(self, late_s):
        super().__init__(squeezing, bottle)
        self.late_s = late_s

    def gap_m(self, t):
        return super().gap_m(t - self.late_s)


@every_case(("late_s", "names"), [(0.0, ()), (0.3, ("gap late",)), (inf, ("fingers did not open",))])
def test_a_gap_that_follows_late_or_never_is_told_and_the_fingers_open_nevertheless(late_s, names):
    """A gap that is late stands still at first, which is no sign of open fingers. Its grasp stays steady."""
    gripper = LateGap(late_s)
    if late_s == inf:
        gripper.gap_m = lambda t: squeezing(min(t, REST_S))
    grasp = run_grasp(gripper, HybridController(HybridConfig()), RunConfig())
    assert grasp.outcome is Outcome.STEADY
    assert tuple(warning.split(":")[0] for warning in grasp.warnings) == names
    assert gripper.commands[-1].value == 0.0
    if late_s < inf:
        assert grasp.trace.gap_m[-1] > 0.078
