"""Faults of the gap: it jumps, is no number any more, or does not change when the fingers are told to open."""

from math import inf, nan

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from grippers import REST_S, Scripted, bottle, squeezing

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.protection.motor import Motor
from graspsense.core.grasp.protection.opening import Opening
from graspsense.core.grasp.protection.reports import GAP_ABSENT, Absence
from graspsense.core.grasp.protection.speed import GapJump
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


def frame(k, gap_m, velocity_m_s=0.0):
    return Frame(k / RATE_HZ, 1.0 / RATE_HZ, gap_m, velocity_m_s, nan, nan, nan, nan, nan, 0)


def jumps(command, gap_of, velocity_m_s=0.0, rate_hz=RATE_HZ):
    """Return in which frames the gap jumps under this command, of a gripper that declares this rate."""
    watch, seen = GapJump(0.2, rate_hz), []
    for k in range(100):
        now = frame(k, gap_of(k), velocity_m_s)
        if watch.see(now) is not None:
            seen.append(k)
        watch.apply(now, command)
    return seen


CLOSES, PUSHES = Command(POSITION, 0.0, 20.0, 0.02), Command(EFFORT, 20.0, inf, inf)


def closing(k):
    """Fingers that close at 20 mm/s."""
    return 0.08 - 0.02 * k / RATE_HZ


@every_case(
    ("command", "gap_of", "seen"),
    [
        (CLOSES, lambda k: closing(k) + 0.004 * (k >= 50), [50]),
        (CLOSES, lambda k: closing(k) - 0.004 * (k == 50), [50, 51]),
        (Command(VELOCITY, -0.02, 20.0, inf), lambda k: closing(k) - 0.004 * (k >= 50), [50]),
        (Command(FORCE, 20.0, inf, 0.02), lambda k: closing(k) - 0.004 * (k >= 50), [50]),
        # A gap in steps of 1 mm, and one that is measured at each fifth frame.
        (CLOSES, lambda k: round(closing(k), 3), []),
        (CLOSES, lambda k: closing(k - k % 5), []),
        # How fast fingers move under an effort is not known.
        (PUSHES, lambda k: closing(k) + 0.004 * (k >= 50), []),
        (CLOSES, lambda k: nan if k > 50 else closing(k), []),
    ],
)
def test_a_gap_that_changes_faster_than_the_fingers_were_told_jumps(command, gap_of, seen):
    assert jumps(command, gap_of) == seen


@every_case(("rate_hz", "seen"), [(RATE_HZ, []), (1000.0, [50])])
def test_in_a_shorter_period_an_object_that_breaks_explains_a_shorter_way(rate_hz, seen):
    assert jumps(CLOSES, lambda k: closing(k) - 0.0018 * (k >= 50), rate_hz=rate_hz) == seen


@every_case(
    ("is_absent", "expected", "ends"),
    [
        (lambda k: 50 <= k < 54, False, set()),
        (lambda k: k >= 50, False, {True}),
        # Never known: only a gap that was declared is missed.
        (lambda k: True, False, set()),
        (lambda k: True, True, {True}),
        (lambda k: k < 4, True, set()),
        # Again and again.
        (lambda k: k % 4 == 0, True, {False}),
        (lambda k: k % 30 == 0, True, set()),
    ],
)
def test_a_gap_that_is_none_for_a_tenth_of_a_second_ends_the_grasp(is_absent, expected, ends):
    for none in (nan, inf):
        watch, faults = Absence(GAP_ABSENT, RATE_HZ, expected=expected), []
        for k in range(100):
            now = frame(k, none if is_absent(k) else 0.05)
            faults.append(watch.see(now.gap_m, now))
        assert {fault.ends for fault in faults if fault is not None} == ends


@every_case(("velocity_m_s", "seen"), [(-0.02, [50]), (nan, []), (0.0, [])])
def test_under_an_effort_a_gap_that_jumps_is_known_by_a_velocity_that_is_measured(velocity_m_s, seen):
    assert jumps(PUSHES, lambda k: closing(k) - 0.004 * (k >= 50), velocity_m_s) == seen


@every_case(
    ("gap_of", "name", "relaxes"),
    [
        # A spike and a slip: the motor is judged by the motion without the jumps.
        (lambda k: closing(k) + 0.004 * (k == 30) + 0.004 * (k >= 60), None, False),
        # It goes the other way after a jump: the motor must still open the fingers.
        (
            lambda k: closing(min(k, 40)) + (k > 40) * (0.004 + 0.0002 * (k - 40)),
            "gap against the command",
            False,
        ),
        # Fingers that open faster than any command.
        (lambda k: 0.05 + 0.006 * max(k - 20, 0), "motor reversed", True),
    ],
)
def test_a_gap_that_jumps_is_no_motor_that_turns_the_wrong_way(gap_of, name, relaxes):
    jump, motor, faults = GapJump(0.2, RATE_HZ), Motor(False, RATE_HZ), []
    for k in range(100):
        now = frame(k, gap_of(k))
        if jump.see(now) is not None:
            motor.shift(nan if jump.is_motion else jump.step_m)
        faults.append(motor.see(now, Phase.APPROACH))
        motor.apply(now, CLOSES)
        jump.apply(now, CLOSES)
    seen = [(fault.name, fault.relaxes) for fault in faults if fault is not None]
    assert seen[:1] == ([] if name is None else [(name, relaxes)])


OPENS = Command(POSITION, 0.08, inf, 0.05)


def opened(gap_of, start_m=0.08, delay_s=0.02):
    """Return the names of the faults in a release of a second, after a squeeze that rested at 50 mm for 0.2 s."""
    watch = Opening(RATE_HZ, delay_s, OPENS, tells_gap=True)
    gaps = [*np.linspace(start_m, 0.05, 80), *[0.05] * 20, *(gap_of(k / RATE_HZ) for k in range(100))]
    faults = [watch.see(frame(k, gap), Phase.RELEASE if k >= 100 else SQUEEZE) for k, gap in enumerate(gaps)]
    return sorted({fault.name for fault in faults if fault is not None and not fault.ends})


@every_case(
    ("gap_of", "start_m", "names"),
    [
        (lambda t: 0.05 + 0.05 * t, 0.08, []),
        (lambda t: 0.05 + 0.05 * max(t - 0.15, 0.0), 0.08, []),
        (lambda t: 0.05 + 0.05 * max(t - 0.2, 0.0), 0.08, ["gap late"]),
        (lambda t: 0.05, 0.08, ["fingers did not open"]),
        (lambda t: nan, 0.08, ["fingers did not open"]),
        # Frames that come late tell the end of the squeeze first, which is no opening.
        (lambda t: 0.05 - 0.01 * min(t, 0.2) + 0.05 * max(t - 0.3, 0.0), 0.08, ["gap late"]),
        # An encoder that stopped after the first 1.7 mm of the closing.
        (lambda t: 0.05, 0.0517, ["fingers did not open"]),
        # A gap that never changed, while the fingers closed for a second.
        (lambda t: 0.05, 0.05, ["fingers stand still"]),
        # Fingers that never closed need not open.
        (lambda t: 0.05, 0.051, []),
    ],
)
def test_fingers_that_closed_have_to_open_when_they_are_told_to(gap_of, start_m, names):
    assert opened(gap_of, start_m) == names


def test_fingers_that_brake_first_are_not_late():
    """They close at 50 mm/s when they are told to open, brake over 4 mm, and turn round after 0.2 s."""
    watch = Opening(RATE_HZ, 0.02, OPENS, tells_gap=True)
    for k in range(100):
        watch.see(frame(k, 0.08 - 0.05 * k / RATE_HZ), Phase.APPROACH)
    braking = [0.03 - 0.004 + 0.1 * (0.01 * k - 0.2) ** 2 for k in range(60)]
    assert all(watch.see(frame(100 + k, gap_m), Phase.RELEASE) is None for k, gap_m in enumerate(braking))


class Misread(Scripted):
    """A gripper whose gap is told this much later (s), stands still from one time on, and is no number from another."""

    def __init__(self, path, late_s=0.0, stands_from_s=inf, none_from_s=inf):
        super().__init__(path, bottle)
        self.late_s, self.stands_from_s, self.none_from_s = late_s, stands_from_s, none_from_s

    def gap_m(self, t):
        return nan if t >= self.none_from_s else super().gap_m(min(t, self.stands_from_s) - self.late_s)


class ByPosition(Misread):
    """One that is strong and opens to a width."""

    def open(self, seed):
        return evolve(super().open(seed), opening=OPENS, effort_limit_n=235.0)

    def apply(self, command):
        opens = command.kind == POSITION
        super().apply(command._replace(kind=EFFORT, value=-1.0) if opens else command)
        self.commands[-1] = command

    def opening_effort_n(self):
        return max(command.effort_limit_n for command in self.commands if command.kind == POSITION)


def grasp_of(gripper):
    return run_grasp(gripper, HybridController(HybridConfig()), RunConfig())


@pytest.mark.slow
@every_case(
    ("fault", "names"),
    [
        ({}, ()),
        ({"late_s": 0.3}, ("gap late",)),
        ({"stands_from_s": REST_S}, ("fingers did not open",)),
    ],
)
def test_a_gap_that_follows_late_or_never_is_told_and_the_fingers_open_nevertheless(fault, names):
    """A gap that is late stands still at first, which is no sign of open fingers. Its grasp stays steady."""
    gripper = Misread(squeezing, **fault)
    grasp = grasp_of(gripper)
    assert grasp.outcome is Outcome.STEADY
    assert tuple(warning.split(":")[0] for warning in grasp.warnings) == names
    assert gripper.commands[-1].value == 0.0
    assert (grasp.trace.gap_m[-1] > 0.078) == ("stands_from_s" not in fault)


@every_case(
    ("gap_m", "told"),
    [
        *((gap_m, None) for gap_m in (0.08, 0.077)),
        *((gap_m, ("opened to another width", False)) for gap_m in (0.06, 0.09)),
        *((gap_m, ("fingers not open", True)) for gap_m in (0.0, nan)),
    ],
)
def test_fingers_that_are_not_as_open_as_they_were_told_are_named_before_they_close(gap_m, told):
    fault = Opening(RATE_HZ, 0.02, OPENS, tells_gap=True).before_closing(frame(0, gap_m))
    assert (fault and (fault.name, fault.ends)) == told


def test_a_gripper_without_a_gap_or_a_told_width_may_close():
    assert Opening(RATE_HZ, 0.02, OPENS, tells_gap=False).before_closing(frame(0, nan)) is None
    by_effort = Opening(RATE_HZ, 0.02, Command(EFFORT, -20.0, inf, inf), tells_gap=True)
    assert by_effort.before_closing(frame(0, 0.03)) is None


STRONGLY, WEAKLY = (Command(EFFORT, effort_n, inf, inf) for effort_n in (-20.0, -10.0))


@every_case(
    ("opens", "end_m", "is_told"),
    [
        (OPENS, 0.0791, False),
        (OPENS, 0.0788, True),
        (OPENS, 0.085, True),
        (OPENS, nan, False),
        # Twice the friction of 7 N opens the fingers until their stop.
        (STRONGLY, 0.077, True),
        (WEAKLY, 0.077, False),
    ],
)
def test_open_fingers_are_as_wide_after_a_grasp_as_before_it(opens, end_m, is_told):
    watch = Opening(RATE_HZ, 0.02, opens, tells_gap=True, friction_n=7.0)
    watch.before_closing(frame(0, 0.08))
    for k, gap_m in enumerate([0.08, 0.06, 0.05, 0.05, 0.06]):
        watch.see(frame(k, gap_m), SQUEEZE if k < 3 else Phase.RELEASE)
    assert (watch.released(frame(5, end_m)) is not None) is is_told


@pytest.mark.slow
def test_a_fault_opens_the_fingers_with_no_more_effort_than_a_release():
    sound, failing = ByPosition(squeezing), ByPosition(squeezing, none_from_s=REST_S)
    assert grasp_of(sound).outcome is Outcome.STEADY
    assert grasp_of(failing).outcome is Outcome.ABORTED
    assert failing.opening_effort_n() == sound.opening_effort_n() == 1.25 * HybridConfig().probing_force_n


def test_fingers_that_still_close_when_they_are_told_to_open_are_not_open_where_they_end():
    """They stand at the end of the stroke until they turn round, which is no rest of open fingers."""
    gripper = ByPosition(lambda t: max(0.08 - 0.04 * max(t - 0.3, 0.0), 0.0), late_s=0.3)
    gripper.felt = lambda t: (0.0, 0.0)
    grasp = grasp_of(gripper)
    assert grasp.outcome is Outcome.NOTHING_THERE
    assert grasp.trace.gap_m[-1] > 0.075


@pytest.mark.slow
@every_case(("stands_m", "outcome"), [(0.054, Outcome.STEADY), (nan, Outcome.ABORTED)])
def test_fingers_whose_gap_is_no_witness_open_for_as_long_as_they_need_from_any_width(stands_m, outcome):
    """Their encoder has stood still, or failed, since they rest: 80 mm at 50 mm/s take 1.6 s."""
    gripper = ByPosition(lambda t: squeezing(t) if t < REST_S else stands_m)
    grasp = grasp_of(gripper)
    assert grasp.outcome is outcome
    opening = [command.kind == POSITION for command in gripper.commands]
    assert sum(opening[-3000:]) / 1000.0 >= 1.6
