"""The protection of a grasp: what a healthy gripper may do, and each fault that warns or ends the grasp."""

from functools import partial
from math import inf, nan

import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.protection.cells import Fingertips
from graspsense.core.grasp.protection.drift import Drift, PadDrift
from graspsense.core.grasp.protection.effort_ceiling import effort_ceiling_n, limited
from graspsense.core.grasp.protection.motor import FeltForce, FreeEffort, Motor
from graspsense.core.grasp.protection.pad_forces import PadBalance
from graspsense.core.grasp.protection.reports import PADS_ABSENT, Absence, Reports, StatusWatch
from graspsense.core.grasp.protection.speed import GapSpeed, Standstill
from graspsense.core.grasp.protection.touch import Touch
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.faults import StatusBit
from graspsense.core.values.signals import (
    APPROACH,
    EFFORT,
    FORCE,
    HOLD,
    POSITION,
    SQUEEZE,
    VELOCITY,
    Command,
    Frame,
    Outcome,
    Pads,
    Phase,
    Reading,
)
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController
from graspsense.plugins.controllers.velocity import VelocityConfig, VelocityController

CONTACT_N = 0.625
CLOSING = Command(EFFORT, 8.0, inf, inf)


def frame(t, gap=0.05, velocity=-0.01, effort=8.0, left=0.0, right=0.0, dt=0.001, status=0):
    return Frame(t, dt, gap, velocity, effort, left, right, 0.0, 0.0, status)


def course(seconds, dt=0.001, **columns):
    """Return the frames of so many seconds; a column is a number or a function of time."""
    times = [dt * k for k in range(round(seconds / dt))]
    return [frame(t, dt=dt, **{key: c(t) if callable(c) else c for key, c in columns.items()}) for t in times]


def faults_of(see, frames, *given):
    """Return the faults that are seen in these frames, in their order, each with its time (s)."""
    seen = [(now.t_s, see(now, *given)) for now in frames]
    return [(t_s, fault) for t_s, fault in seen if fault is not None]


def names_of(faults):
    return {(fault.name, fault.ends) for fault in faults if fault is not None}


def gripper(friction_n=7.0):
    return DeviceInfo(
        name="test",
        clock="device",
        rate_hz=1000.0,
        effort_limit_n=100.0,
        speed_limit_m_s=0.2,
        opening=Command(EFFORT, -20.0, inf, inf),
        relaxed=Command(EFFORT, 0.0, inf, inf),
        friction_n=friction_n,
    )


@every_case(
    ("controller", "run", "ceiling_n"),
    [
        # A quarter over the probing force, plus the friction.
        (HybridController(HybridConfig()), RunConfig(), 1.25 * 20.0 + 7.0),
        # A law without a force: as for the paper's 20 N.
        (VelocityController(VelocityConfig()), RunConfig(), 1.25 * 20.0 + 7.0),
        (HybridController(HybridConfig(probing_force_n=2.0)), RunConfig(), 1.25 * 2.0 + 7.0),
        (HybridController(HybridConfig()), RunConfig(effort_ceiling_n=60.0), 60.0),
        # The gripper's own limit holds too.
        (HybridController(HybridConfig(probing_force_n=90.0)), RunConfig(), 100.0),
    ],
)
def test_the_ceiling_follows_from_what_was_asked(controller, run, ceiling_n):
    assert effort_ceiling_n(gripper(), controller, run) == pytest.approx(ceiling_n)


@given(
    st.sampled_from([EFFORT, FORCE, VELOCITY, POSITION]),
    st.floats(allow_nan=False, allow_infinity=False),
    st.floats(min_value=0.0, allow_nan=False),
)
def test_no_command_closes_with_more_than_the_ceiling(kind, value, own_limit):
    allowed = limited(Command(kind, value, own_limit, inf), 30.0, 40.0)
    effort = allowed.value if kind in (EFFORT, FORCE) else allowed.effort_limit_n
    assert effort <= 30.0
    if kind == EFFORT:
        assert allowed.value >= -40.0


class Approach:
    """A touch that watches an approach at 10 mm/s with 8 N, which goes on as the test says."""

    def __init__(self, *steps):
        self.touch = Touch(CONTACT_N)
        self.t, self.gap = 0.0, 0.09
        for step in steps:
            self.go(**step)

    def go(self, seconds=2.0, left=0.0, right=0.0, speed=0.01, effort=8.0, phase=APPROACH):
        """Return the name of the first fault in these seconds and the time until it; `effort` may be a function."""
        for k in range(round(seconds * 1000)):
            self.t += 0.001
            self.gap -= speed * 0.001
            effort_n = effort() if callable(effort) else effort
            now = frame(self.t, self.gap, -speed, effort_n, left, right)
            fault = self.touch.see(now, phase, CLOSING._replace(value=effort_n))
            if fault is not None:
                assert fault.ends
                assert (fault.outcome is Outcome.ONE_FINGER) == ("finger alone" in fault.name)
                return fault.name, (k + 1) * 0.001
        return None, seconds


RNG = np.random.default_rng(0)
DRIFT = [{}, *({"seconds": 0.12, "left": n, "right": n} for n in (0.2, 0.3, 0.4, 0.5, 0.6))]
"""Both pads rise with the drift of their zeros: over 6 mm, to just below a contact."""
HELD = {"seconds": 0.3, "left": 4.0, "right": 4.0, "speed": 0.001, "phase": SQUEEZE}
WEAK = {"left": 0.7, "right": 0.7, "phase": SQUEEZE}


@every_case(
    ("steps", "felt", "name"),
    [
        ([{}], {"left": 3.0, "speed": 0.002}, "left finger alone"),
        ([{}], {"right": 3.0, "speed": 0.002}, "right finger alone"),
        # It stands still, whatever little it feels.
        ([{}], {"right": 0.7, "speed": 0.0}, "right finger alone"),
        # A pad falls silent in the squeeze.
        ([{}, HELD], {"right": 4.0, "speed": 0.0, "phase": SQUEEZE}, "right finger alone"),
        (DRIFT, WEAK, "contact in free air"),
        (DRIFT, {**WEAK, "effort": lambda: 10.0 + 0.05 * RNG.standard_normal()}, "contact in free air"),
    ],
)
def test_fingers_that_press_alone_or_squeeze_free_air_are_released_after_0_3_s(steps, felt, name):
    assert Approach(*steps).go(**felt) == (name, pytest.approx(0.3, abs=0.02))


@every_case("phase", [APPROACH, SQUEEZE])
def test_fingers_that_stop_without_a_feeling_are_released_whatever_phase_the_law_claims(phase):
    name, after_s = Approach({}).go(speed=0.0, phase=phase)
    assert (name, after_s < 0.3) == ("stalled", True)


@every_case(
    ("steps", "felt"),
    [
        ([{}], {"seconds": 1.0}),
        # In the catalogue one finger pushes a heavy bottle up to 13 mm, with up to 2 N, before the other one touches.
        ([{}], {"seconds": 1.3, "right": 2.0}),
        # A contact with a witness: the fingers are slower, or a force rises, or both within a millimetre.
        (DRIFT, {**WEAK, "seconds": 0.5, "speed": 0.001}),
        (DRIFT, {**WEAK, "seconds": 0.5, "left": 1.3}),
        ([{}, {"seconds": 0.04, "left": 0.3, "right": 0.3}], {**WEAK, "seconds": 0.001}),
        # A soft full bottle: one pad feels it at once and pushes it, and both forces then rise by 0.2 N/mm.
        ([{}, {"seconds": 0.6, "left": 0.03, "right": 0.55}], {**WEAK, "left": 0.65, "seconds": 0.5}),
        # From 90 mm at 10 mm/s to the end of the stroke, without an object.
        ([{"seconds": 8.8}], {"speed": 0.0}),
        # They have not moved yet; the law pauses.
        ([], {"speed": 0.0}),
        ([{}], {"speed": 0.0, "effort": 0.0}),
        # A bump is no contact that lasts.
        ([*DRIFT, {"seconds": 0.005, "left": 0.7, "right": 0.7}], {"seconds": 1.0}),
    ],
)
def test_an_approach_a_contact_with_a_witness_and_fingers_that_rest_or_pause_have_no_fault(steps, felt):
    approach = Approach(*steps)
    assert approach.go(**felt) == (None, felt.get("seconds", 2.0))
    assert approach.touch.closing_limit_n() == inf or felt == {"seconds": 1.3, "right": 2.0}


def test_while_one_finger_touches_the_effort_is_that_of_the_approach():
    approach = Approach({}, {"seconds": 0.05, "right": 1.0})
    # 8 N in the approach: a quarter more, and twice the contact force.
    assert approach.touch.closing_limit_n() == pytest.approx(1.25 * 8.0 + 2 * CONTACT_N, rel=0.01)


# ------------------------------------------------------------------------------------------------------- the motor


def motor_faults(frames, command, phase=APPROACH, reports_effort=True, rate_hz=1000.0):
    """Return the faults, with their times, of a motor that is given this command and answers with these frames."""
    motor = Motor(reports_effort=reports_effort, rate_hz=rate_hz)

    def see(now):
        fault = motor.see(now, phase)
        motor.apply(now, command)
        return fault

    return faults_of(see, frames)


def answered(asked, answer, phase=APPROACH, gap=0.05):
    """Return the faults of a motor that is asked for one effort for a second and answers with another."""
    return motor_faults(course(1.0, gap=gap, effort=answer), Command(EFFORT, asked, inf, inf), phase)


def test_a_motor_within_a_quarter_of_its_command_or_that_a_spring_pushes_open_in_the_squeeze_is_sound():
    assert answered(20.0, 24.0) == answered(20.0, 16.0) == answered(-20.0, -17.0) == []
    assert answered(20.0, 20.0, phase=SQUEEZE, gap=lambda t: 0.05 + 0.01 * t) == []


@every_case(
    ("answer", "tells", "ends"),
    [(30.0, False, False), (50.0, True, False), (200.0, True, True)],
)
def test_a_gripper_that_closes_by_itself_keeps_the_limit_of_its_effort(answer, tells, ends):
    closes = Command(POSITION, 0.0, 20.0, 0.05)
    seen = motor_faults(course(1.0, gap=0.05, effort=answer), closes, SQUEEZE)
    assert (
        {fault.name for _, fault in seen} == {"motor too strong"},
        any(fault.ends for _, fault in seen),
    ) == (tells, ends)


@every_case(
    ("asked", "answer", "name", "ends_first", "relaxes"),
    [
        (20.0, 100.0, "motor too strong", True, False),  # five times the command: at once
        (20.0, 29.0, "motor too strong", False, False),  # half as much again: warned of at first
        (20.0, 5.0, "motor too weak", False, False),
        # By the effort alone, whose sign can be wrong: the fingers are opened.
        (20.0, -20.0, "motor reversed", True, False),
        (-20.0, 20.0, "motor reversed", True, False),
    ],
)
def test_a_motor_that_gives_another_effort_warns_or_ends_the_grasp(asked, answer, name, ends_first, relaxes):
    seen = answered(asked, answer)
    assert (next(t_s for t_s, fault in seen if fault.ends) < 0.1) == ends_first
    last = seen[-1][1]
    assert (last.name, last.ends, last.relaxes) == (name, True, relaxes)


def test_fingers_that_close_on_the_opening_command_are_relaxed():
    (t_s, fault), *_ = answered(-20.0, -20.0, phase=int(Phase.RELEASE), gap=lambda t: 0.05 - 0.02 * t)
    # After 3 mm, and some hundredths of a second to be sure.
    assert (fault.relaxes, 0.05 - 0.02 * t_s > 0.0455) == (True, True)


def test_commands_of_a_velocity_are_not_compared_but_fingers_that_open_on_one_that_closes_are_reversed():
    command = Command(VELOCITY, -0.01, inf, inf)
    assert motor_faults(course(1.0, effort=50.0), command) == []
    opening = course(1.0, gap=lambda t: 0.05 + 0.01 * t)
    assert any(fault.relaxes for _, fault in motor_faults(opening, command, reports_effort=False))


@every_case(
    ("closes_m", "opens_m", "kind", "names"),
    [
        (0.05, 0.0076, POSITION, set()),
        (0.05, 0.02, POSITION, {"gap against the command"}),
        (0.05, 0.02, EFFORT, {"motor reversed"}),
        (0.0, 0.02, POSITION, {"motor reversed"}),
    ],
)
def test_fingers_that_rebound_in_the_approach_are_not_reversed(closes_m, opens_m, kind, names):
    """The widest rebound of the simulated catalogue is 7.6 mm, of the block at 100 mm/s.

    A motor that keeps a position, and has closed the fingers before, turns the right way: they can be opened.
    """
    met_m = 0.08 - closes_m
    gaps = ([0.0, 2.0, 3.0], [0.08, met_m, met_m + opens_m])
    command = Command(kind, 0.0 if kind == POSITION else 8.0, 10.0, 0.035)
    frames = course(3.0, 0.01, gap=lambda t: np.interp(t, *gaps))
    faults = [fault for _, fault in motor_faults(frames, command, APPROACH, False, 100.0)]
    assert {fault.name for fault in faults} == names
    assert all(fault.ends and fault.relaxes == (fault.name == "motor reversed") for fault in faults)


@every_case(("answer_n", "told"), [(20.0, False), (18.5, False), (17.0, True), (23.0, True)])
def test_a_motor_that_answers_a_tenth_less_or_more_in_the_hold_is_only_told(answer_n, told):
    frames = course(0.3, velocity=0.0, effort=answer_n)
    faults = motor_faults(frames, Command(EFFORT, 20.0, inf, inf), HOLD)
    assert names_of(fault for _, fault in faults) == ({("motor off", False)} if told else set())


@every_case(("change_m_s2", "is_reversed"), [(-0.3, False), (0.3, True)])
def test_fast_fingers_that_slow_down_under_an_opening_command_are_not_reversed(change_m_s2, is_reversed):
    """From 100 mm/s at 0.3 m/s2, as after an egg that broke; a reversed motor closes faster and faster."""
    frames = course(
        0.33,
        gap=lambda t: 0.05 - 0.1 * t - 0.5 * change_m_s2 * t**2,
        velocity=lambda t: -0.1 - change_m_s2 * t,
    )
    faults = motor_faults(frames, Command(EFFORT, -20.0, inf, inf), int(Phase.RELEASE), False)
    assert any(fault.relaxes for _, fault in faults) == is_reversed


# ------------------------------------------------------------------------------------------------------- the status

HOT = StatusBit(mask=1, name="hot", meaning="it is too hot")
BROKEN = StatusBit(mask=4, name="encoder fault", meaning="the gap is not known", limit_s=0.01)


def test_a_bit_without_a_limit_warns_and_one_beyond_its_limit_refuses_or_ends_the_grasp():
    status = StatusWatch((HOT, BROKEN))
    assert [fault.name for fault in status.before_closing(frame(0.0, status=5))] == ["encoder fault"]
    assert status.before_closing(frame(0.0, status=1)) == []
    faults = [status.see(frame(0.001 * k, status=5), SQUEEZE) for k in range(20)]
    assert [(fault.name, fault.ends) for fault in faults[0]] == [("hot", False), ("encoder fault", False)]
    assert [(fault.name, fault.ends) for fault in faults[-1]] == [("hot", False), ("encoder fault", True)]
    # A bit that nobody declared is told.
    assert StatusWatch((HOT,)).see(frame(0.0, status=8), SQUEEZE)[0].name == "status 0x8"


# ------------------------------------------------------------------------------------------- frames, images and cells


def reading(t, counter=0, left=(), right=(), dt=0.001):
    return Reading(frame(t, dt=dt), Pads(t, counter, left, right))


def first_end(readings, phase, pads_hz=0.0):
    """Return the faults of these readings, and the number of the first that ends the grasp."""
    reports = Reports(1000.0, pads_hz)
    faults = [reports.see(read, phase) for read in readings]
    return faults, next((k for k, fault in enumerate(faults) if fault is not None and fault.ends), None)


def test_a_clock_or_images_that_stand_still_end_the_grasp():
    _, stopped = first_end([reading(1.0, dt=0.0)] * 200, HOLD)
    assert stopped == pytest.approx(100, abs=2)
    images_stop = [reading(0.001 * k, counter=min(1 + k // 40, 5)) for k in range(1000)]
    # The fifth image came at 0.16 s, and five periods are allowed.
    assert first_end(images_stop, SQUEEZE, 25.0)[1] == pytest.approx(160 + 200, abs=2)


@every_case(
    ("sound_ticks", "rate", "told"),
    # In the last case 10 % slow from the contact on, after a sound approach of three seconds.
    [(0, 1.0, False), (0, 0.97, False), (0, 0.8, True), (0, 0.5, True), (3000, 0.9, True)],
)
def test_a_clock_that_is_slow_for_the_frames_that_come_is_told(sound_ticks, rate, told):
    steps = [0.001] * sound_ticks + [0.001 * rate] * (900 if sound_ticks else 400)
    times = np.cumsum([0.0, *steps])
    faults, end = first_end([reading(t, dt=dt) for t, dt in zip(times, steps, strict=False)], SQUEEZE)
    assert (names_of(faults), end) == ({("clock slow", False)} if told else set(), None)


@every_case(("jump_s", "ends"), [(1.0, False), (4.0, True), (-0.1, False), (-3600.0, True)])
def test_a_clock_that_jumps_is_told_and_ends_the_grasp_where_it_is_half_of_its_time(jump_s, ends):
    now = [reading(0.001 * k + jump_s * (k >= 2000), dt=0.001 + jump_s * (k == 2000)) for k in range(2100)]
    assert names_of(first_end(now, APPROACH)[0]) == {("clock jumps", ends)}


def images(n, frozen=(), noise=15.0, seed=0):
    """Return images of 22 noisy cells a side; `frozen` cells of the left side keep their first value."""
    rng = np.random.default_rng(seed)
    left = np.round(3000.0 + noise * rng.standard_normal((n, 22)))
    right = np.round(3000.0 + noise * rng.standard_normal((n, 22)))
    left[:, list(frozen)] = left[0, list(frozen)]
    return [Pads(0.04 * k, k + 1, tuple(left[k]), tuple(right[k])) for k in range(n)]


def seen(pads, moving=True):
    """Return what is told of the last of these images."""
    tips = Fingertips()
    return [tips.see(image, moving) for image in pads][-1]


def test_a_frozen_cell_is_named_and_only_a_fingertip_whose_cells_all_stand_still_ends_the_grasp():
    (fault,) = seen(images(60, frozen=(15,)))
    assert ("(15)" in fault.words, fault.ends) == (True, False)
    # As dark pixels of a camera.
    assert [fault.ends for fault in seen(images(60, frozen=range(7)))] == [False]
    assert names_of(seen(images(60, frozen=range(22)))) == {("left fingertip stuck", True)}


def test_a_fingertip_that_goes_blank_ends_the_grasp_with_the_second_image():
    sound, blank = images(10), [image._replace(right=(0.0,) * 22) for image in images(12)[10:]]
    assert seen(sound) == seen([*sound, blank[0]]) == []
    assert [fault.name for fault in seen([*sound, *blank])] == ["right fingertip without signal"]


@every_case(("speed_m_s", "name"), [(0.01, "left pad stuck"), (0.0, "pads disagree")])
def test_a_force_that_stands_still_while_the_other_one_rises_is_stuck(speed_m_s, name):
    """Where the fingers rest, it can also be the one that rises that is wrong."""
    see = partial(PadBalance(CONTACT_N, pads_hz=24.0).see, new=False)
    assert faults_of(see, course(0.2, left=2.0, right=lambda t: 2.0 + 0.01 * (t // 0.04)), SQUEEZE) == []
    rising = course(0.4, gap=lambda t: 0.05 - speed_m_s * t, left=2.0, right=lambda t: 2.0 + 10.0 * t)
    _, fault = faults_of(see, [now._replace(t_s=now.t_s + 0.2) for now in rising], SQUEEZE)[0]
    assert (fault.name, fault.ends) == (name, True)


# ------------------------------------------------------------------------------------------------------------ drift


def drifted(force, cells=None, seconds=2.0, speed=0.01, seed=1):
    """Return the names of what ends a grasp, for a pad of this force (N), with the usual noise, at 10 mm/s."""
    rng, pad = np.random.default_rng(seed), PadDrift("left", CONTACT_N)

    def see(now):
        image = () if cells is None else tuple(cells(now.t_s) + 15.0 * rng.standard_normal(22))
        return pad.see(now.force_left_n + 0.03 * rng.standard_normal(), now.gap_m, image)

    faults = faults_of(see, course(seconds, 0.04, gap=lambda t: 0.09 - speed * t, left=force))
    return {fault.name for _, fault in faults if fault.ends}


def all_cells(t):
    return np.full(22, 3000.0 + 50.0 * t)


def facing_cells(t):
    return 3000.0 + 50.0 * t * (np.arange(22) >= 7)


@every_case(("cells", "touched"), [(all_cells, False), (facing_cells, True)])
def test_forces_of_both_pads_that_rise_on_the_cells_that_face_the_object_are_a_contact(cells, touched):
    """Something soft raises the forces as slowly as drift does."""
    rng, drift = np.random.default_rng(0), Drift(CONTACT_N)
    for k in range(50):
        t = 0.04 * k
        image = tuple(cells(t) + 3.0 * rng.standard_normal(22))
        force_n = 15 * 50.0 * t / 1600.0
        now = frame(t, 0.09 - 0.01 * t, left=force_n, right=force_n)
        drift.see(Reading(now, Pads(t, k + 1, image, image)))
    assert drift.on_some_cells() is touched


@every_case("sign", [1.0, -1.0])
def test_a_slow_change_of_all_cells_is_drift(sign):
    names = drifted(lambda t: sign * 0.47 * t, lambda t: 3000.0 + sign * (all_cells(t) - 3000.0))
    assert names == {"left pad drifts"}


@every_case(
    ("force", "more"),
    [
        *((lambda t: 0.0, {"cells": all_cells if seed % 2 else None, "seed": seed}) for seed in range(5)),
        # A soft object on the facing cells; a contact within a millimetre, also of a gripper without a gap.
        (lambda t: 0.47 * t, {"cells": facing_cells, "seconds": 1.3}),
        (lambda t: max(0.0, 6.0 * (t - 1.0)), {"seconds": 1.1}),
        (lambda t: max(0.0, 4.5 * (t - 1.0)), {"seconds": 1.12, "speed": nan}),
        # An object of 80 g that one finger pushes, below the contact force, on a pad without cells.
        (lambda t: 0.31 * (t > 0.2), {}),
    ],
)
def test_noise_and_objects_are_no_drift(force, more):
    assert drifted(force, **more) == set()


# ------------------------------------------------------------------------------- grippers of other rates and channels


@every_case(
    ("speed", "step_m", "measured"),
    # From gaps alone: these grippers have no velocity. The last one has that over six gaps of a coarse encoder.
    [(0.001, 1e-7, False), (0.003, 1e-7, False), (0.01, 0.000375, True)],
)
def test_a_slow_approach_and_one_with_a_coarse_gap_may_push_an_object_as_far(speed, step_m, measured):
    """It is pushed over 14 mm."""

    def gap_m(t):
        return 0.09 - step_m * round(speed * max(t, 0.0) / step_m)

    frames = course(
        0.016 / speed,
        0.01,
        gap=gap_m,
        velocity=(lambda t: (gap_m(t) - gap_m(t - 0.05)) / 0.05) if measured else nan,
        left=lambda t: float(t * speed > 0.002),
    )
    assert faults_of(Touch(CONTACT_N, rate_hz=100.0).see, frames, APPROACH, CLOSING) == []


def test_forces_that_become_no_number_end_the_grasp_and_each_pad_is_named():
    approach = Approach({}, HELD)
    absences = [Absence(fault, 24.0, expected=True) for fault in PADS_ABSENT]
    for now in course(0.127, gap=approach.gap, velocity=0.0, left=nan, right=nan):
        now = now._replace(t_s=now.t_s + approach.t)
        assert approach.touch.see(now, SQUEEZE, CLOSING) is None
        faults = [absence.see(nan, now) for absence in absences]
    assert names_of(faults) == {("left pad absent", True), ("right pad absent", True)}


def test_a_contact_that_is_not_clear_without_a_known_effort_is_held_at_the_usual_one():
    touch = Touch(CONTACT_N, usual_effort_n=12.0)
    touch.see(frame(0.0, left=1.0), APPROACH, Command(VELOCITY, -0.01, inf, inf))
    assert touch.closing_limit_n() == 12.0


def test_a_slow_gripper_may_answer_a_frame_late():
    motor = Motor(reports_effort=True, rate_hz=10.0)
    for k in range(7):
        now = frame(0.1 * k, velocity=0.0, effort=10.0 if k < 4 else -10.0, dt=0.1)
        assert motor.see(now, APPROACH) is None
        motor.apply(now, Command(EFFORT, 10.0 if k < 3 else -10.0, inf, inf))


@every_case("seed", range(3))
def test_sound_cells_and_such_that_change_now_and_then_are_not_frozen(seed):
    for noise in (0.0, 0.4, 2.0, 15.0):
        assert seen(images(100, noise=noise, seed=seed)) == []
    for share in (0.5, 0.8):
        rng, tips = np.random.default_rng(seed), Fingertips()
        cells = 1000.0 * np.arange(1.0, 9.0).reshape(2, 4)
        for k in range(240):
            cells += (rng.random((2, 4)) < share) * 1.0
            assert tips.see(Pads(0.04 * k, k + 1, *map(tuple, cells)), True) == []


def test_cells_at_the_end_of_their_range_or_without_noise_are_not_stuck():
    tips = Fingertips()
    for image in images(20):
        tips.see(image, True)
    pressed = [image._replace(left=(4095.0,) * 7 + image.left[7:]) for image in images(40)[20:]]
    assert [tips.see(image, False) for image in pressed] == [[]] * 20
    quiet = [Pads(0.04 * k, k + 1, (0.0,) * 15 + (float(k == 5),), (0.0,) * 16) for k in range(20)]
    # A fingertip may have no cells.
    assert seen(quiet) == seen([Pads(0.0, 1, (), (1.0, 2.0))]) == []


@every_case("asked", [nan, -1.0, inf])
def test_a_force_that_is_none_does_not_lift_the_ceiling(asked):
    controller = HybridController(HybridConfig())
    controller.asked_force_n = lambda: asked
    assert effort_ceiling_n(gripper(friction_n=nan), controller, RunConfig()) == 25.0


# ------------------------------------------------------------ a motor that reports what it was told, and gaps


def felt(left, right, commands=(20.0,), seconds=0.5, velocity=0.0):
    """Return whether pads that feel these forces after these commands end the grasp, or None for no fault."""
    felt_force = FeltForce(1000.0, 24.39, 7.0)
    for value in commands:
        felt_force.apply(Command(EFFORT, value, inf, inf))
    faults = faults_of(felt_force.see, course(seconds, left=left, right=right, velocity=velocity))
    return faults[-1][1].ends if faults else None


def test_pads_that_both_feel_more_than_the_motor_was_told():
    # A quarter and 1.5 N more are told, a half and 3 N more end the grasp.
    assert (felt(33.0, 60.0), felt(35.0, 35.0), felt(41.0, 60.0)) == (None, False, True)
    # Fingers that are being braked press with their mass; those that hold by themselves, with the largest command.
    assert felt(100.0, 100.0, seconds=0.25, velocity=-0.01) is felt(25.0, 25.0, commands=(30.0, 0.0)) is None
    assert felt(100.0, 100.0, velocity=-0.01) is True
    # One image that is wrong is no force.
    assert felt(100.0, 100.0, seconds=0.041) is None
    # The default hold lasts 0.25 s: it is told within that, and ends the grasp only if it lasts longer.
    assert felt(41.0, 60.0, seconds=0.2) is False


def eased(effort, friction=7.0, speed=0.01, kind=EFFORT):
    """Return whether fingers that move by this effort end the grasp, or None for no fault."""
    command = Command(kind, effort, inf, inf)
    faults = faults_of(FreeEffort(friction).see, course(1.5, velocity=-speed), command)
    return faults[-1][1].ends if faults else None


def test_fingers_that_move_with_less_than_their_friction():
    assert (eased(4.0), eased(2.4)) == (False, True)
    assert eased(5.0) is eased(1.0, friction=0.0) is eased(0.0, speed=0.0) is eased(1.0, kind=FORCE) is None
    # Fingers that are braked, on a drive whose friction is not known.
    assert eased(-6.0, friction=0.0) is None


def travelled(velocity, gap, seconds=2.0, dt=0.001, declared=False):
    """Return whether this velocity (m/s) and this gap (m) end the grasp, or None for no fault."""
    frames = course(seconds, dt, gap=gap, velocity=velocity)
    faults = faults_of(GapSpeed(1.0 / dt, declared).see, frames)
    return any(fault.ends for _, fault in faults) if faults else None


def closing(t):
    return 0.09 - 0.01 * t


@every_case(
    ("velocity", "gap", "declared", "ends"),
    [
        *((said, closing, False, True) for said in (-0.001, 0.01, -1.0)),
        (-0.01, lambda t: closing(min(t, 0.4)), False, True),
        (lambda t: -0.01 if t < 0.2 else 0.0, closing, False, True),
        # A velocity that is 0 or no number from the beginning on is not measured, unless it is declared.
        (0.0, closing, False, None),
        (nan, closing, False, None),
        (0.0, closing, True, True),
        # One of half the scale is told.
        (-0.0055, closing, False, False),
        (-0.0085, closing, False, None),
    ],
)
def test_a_velocity_that_is_not_that_of_the_gap_is_told_or_ends_the_grasp(velocity, gap, declared, ends):
    assert travelled(velocity, gap, declared=declared) is ends


@every_case("speed", [0.002, 0.01, 0.1])
@every_case(("dt", "step", "late_s"), [(0.001, 1e-9, 0.02), (0.01, 0.0004, 0.05), (0.04, 0.0004, 0.08)])
def test_a_late_velocity_and_a_gap_in_steps_agree(speed, dt, step, late_s):
    def gap(t):
        return step * round((0.2 - speed * t) / step)

    assert travelled(lambda t: -speed * (t >= late_s), gap, 1.0, dt) is None


def standing(command, gap=0.05, jitter=0.0):
    """Return how long (s) the fingers stand still under this command until a fault, or None after 20 s."""
    frames = course(20.0, 0.01, gap=lambda t: gap + jitter * (round(100 * t) % 2), velocity=0.0)
    faults = faults_of(Standstill().see, frames, command)
    assert all(fault.ends for _, fault in faults)
    return faults[0][0] if faults else None


@every_case(
    ("command", "after_s"),
    [
        (Command(POSITION, 0.0, 20.0, 0.01), 3.0),
        (Command(VELOCITY, -0.01, 20.0, inf), 3.0),
        (Command(FORCE, 20.0, inf, inf), 3.0),
        # 3 mm at 0.2 mm/s.
        (Command(VELOCITY, -0.0002, 20.0, 0.01), 15.0),
        (Command(POSITION, 0.06, 20.0, 0.01), None),
        (Command(VELOCITY, 0.0, 20.0, 0.01), None),
        (Command(FORCE, 0.0, inf, 0.01), None),
        # What an effort should do is not known.
        (Command(EFFORT, 20.0, inf, inf), None),
        (Command(VELOCITY, nan, 20.0, 0.01), None),
    ],
)
def test_fingers_that_do_not_close_when_told_are_found(command, after_s):
    stood_s = standing(command, jitter=0.0007)
    assert stood_s is after_s is None or stood_s == pytest.approx(after_s, abs=0.02)


def test_fingers_that_are_closed_or_move_do_not_stand_still():
    command = Command(VELOCITY, -0.01, 20.0, inf)
    assert standing(command, gap=0.002) is standing(command, gap=nan) is None
    assert faults_of(Standstill().see, course(20.0, 0.01, gap=lambda t: 0.05 - 0.0005 * t), command) == []


@every_case(
    ("left_n", "right_n", "told"),
    [(0.0, 0.0, True), (-20.0, -20.0, True), (0.0, 5.0, False), (0.4, 0.4, False)],
)
def test_pads_that_both_feel_nothing_in_the_hold_are_told(left_n, right_n, told):
    see = partial(PadBalance(CONTACT_N).see, new=False)
    faults = faults_of(see, course(0.2, left=left_n, right=right_n), HOLD)
    name = "pads feel nothing in the hold"
    assert {fault.ends for _, fault in faults if fault.name == name} == ({False} if told else set())


@every_case(("pads_hz", "ends"), [(0.0, True), (24.4, False)])
def test_fast_fingers_have_two_images_of_the_pads_to_show_a_contact(pads_hz, ends):
    """At 100 mm/s they move by 3 mm within an image, as when an egg breaks."""

    def force_n(t):
        # Between free and a contact for longer than a sharp rise takes.
        return 0.0 if t < 0.27 else 0.3 if t < 0.3 else 0.8

    frames = course(0.36, gap=lambda t: 0.08 - 0.1 * t, velocity=-0.1, left=force_n, right=force_n)
    faults = faults_of(Touch(CONTACT_N, pads_hz=pads_hz).see, frames, APPROACH, CLOSING)
    assert any(fault.ends for _, fault in faults) is ends


@every_case(("rises_n", "ends"), [(0.0, True), (5.0, False)])
def test_a_force_that_is_there_before_the_fingers_close_is_a_contact_only_if_it_rises(rises_n, ends):
    """Both pads feel 3 N from the beginning, while the fingers close by 10 mm."""
    frames = course(1.0, gap=lambda t: 0.08 - 0.01 * t, left=lambda t: 3.0 + rises_n * t, right=3.0)
    faults = faults_of(Touch(CONTACT_N).see, frames, APPROACH, CLOSING)
    assert any(fault.ends for _, fault in faults) is ends
