"""The protection of a grasp: what a healthy gripper may do, and each fault that warns or ends the grasp."""

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
from graspsense.core.grasp.protection.pad_forces import EmptyHold, StuckForce
from graspsense.core.grasp.protection.reports import Reports, StatusWatch
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


def gripper(**changes):
    given_ = {
        "name": "test",
        "clock": "device",
        "rate_hz": 1000.0,
        "effort_limit_n": 100.0,
        "speed_limit_m_s": 0.2,
        "opening": Command(EFFORT, -20.0, inf, inf),
        "relaxed": Command(EFFORT, 0.0, inf, inf),
        "friction_n": 7.0,
    }
    return DeviceInfo(**{**given_, **changes})


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

    def __init__(self, seconds=2.0):
        self.touch = Touch(CONTACT_N)
        self.t, self.gap = 0.0, 0.09
        self.go(seconds)

    def go(self, seconds, left=0.0, right=0.0, speed=0.01, effort=8.0, phase=APPROACH):
        """Return the name of the first fault in these seconds and the time until it; `effort` may be a function."""
        for k in range(round(seconds * 1000)):
            self.t += 0.001
            self.gap -= speed * 0.001
            effort_n = effort() if callable(effort) else effort
            now = frame(self.t, self.gap, -speed, effort_n, left, right)
            fault = self.touch.see(now, phase, CLOSING._replace(value=effort_n))
            if fault is not None:
                assert fault.ends
                assert fault.outcome is (
                    Outcome.ONE_FINGER if "finger alone" in fault.name else Outcome.ABORTED
                )
                return fault.name, (k + 1) * 0.001
        return None, seconds

    def drift(self):
        """Both pads rise with the drift of their zeros: over 6 mm, to just below a contact."""
        for force in (0.2, 0.3, 0.4, 0.5, 0.6):
            self.go(0.12, left=force, right=force)
        return self


def test_an_approach_has_no_fault_and_no_limit():
    approach = Approach()
    assert approach.go(1.0) == (None, 1.0)
    assert approach.touch.closing_limit_n() == inf
    # In the catalogue one finger pushes a heavy bottle up to 13 mm, with up to 2 N, before the other one touches.
    assert approach.go(1.3, right=2.0) == (None, 1.3)


@every_case(
    ("finger", "felt"),
    [
        ("left", {"left": 3.0, "speed": 0.002}),
        ("right", {"right": 3.0, "speed": 0.002}),
        # It stands still, whatever little it feels.
        ("right", {"right": 0.7, "speed": 0.0}),
    ],
)
def test_a_finger_that_presses_alone_is_released_after_three_tenths_of_a_second(finger, felt):
    assert Approach().go(2.0, **felt) == (f"{finger} finger alone", pytest.approx(0.3, abs=0.02))


def test_a_pad_that_falls_silent_in_the_squeeze_ends_it():
    approach = Approach()
    assert approach.go(0.3, left=4.0, right=4.0, speed=0.001, phase=SQUEEZE)[0] is None
    name, after_s = approach.go(2.0, right=4.0, speed=0.0, phase=SQUEEZE)
    assert name == "right finger alone"
    assert after_s < 0.35


def test_while_one_finger_touches_the_effort_is_that_of_the_approach():
    approach = Approach()
    approach.go(0.05, right=1.0)
    # 8 N in the approach: a quarter more, and twice the contact force.
    assert approach.touch.closing_limit_n() == pytest.approx(1.25 * 8.0 + 2 * CONTACT_N, rel=0.01)


RNG = np.random.default_rng(0)


@every_case("effort", [8.0, lambda: 10.0 + 0.05 * float(RNG.standard_normal())])
def test_a_contact_in_free_air_is_not_squeezed_even_if_the_effort_is_noisy(effort):
    assert Approach().drift().go(1.0, left=0.7, right=0.7, effort=effort, phase=SQUEEZE) == (
        "contact in free air",
        pytest.approx(0.3, abs=0.02),
    )


@every_case("phase", [APPROACH, SQUEEZE])
def test_fingers_that_stop_without_a_feeling_are_released_whatever_phase_the_law_claims(phase):
    name, after_s = Approach().go(1.0, speed=0.0, phase=phase)
    assert name == "stalled"
    assert after_s < 0.3


@every_case("felt", [{"left": 0.7, "right": 0.7, "speed": 0.001}, {"left": 1.3, "right": 0.7}])
def test_a_contact_with_a_witness_is_squeezed(felt):
    """The fingers are slower, or a force rises."""
    approach = Approach().drift()
    assert approach.go(0.5, **felt, phase=SQUEEZE)[0] is None
    assert approach.touch.closing_limit_n() == inf


def test_a_contact_that_rises_within_a_millimetre_is_squeezed_at_once():
    approach = Approach()
    approach.go(0.04, left=0.3, right=0.3)
    assert approach.go(0.001, left=0.7, right=0.7, phase=SQUEEZE)[0] is None
    assert approach.touch.closing_limit_n() == inf


def test_a_finger_that_first_pushes_an_object_that_yields_is_no_drift():
    """A soft full bottle: one pad feels it at once and pushes it, and both forces then rise by 0.2 N/mm."""
    approach = Approach()
    approach.go(0.6, left=0.03, right=0.55)
    assert approach.go(0.5, left=0.65, right=0.65, phase=SQUEEZE) == (None, 0.5)


@every_case(
    ("before_s", "effort"),
    [
        (8.8, 8.0),  # from 90 mm at 10 mm/s to the end of the stroke, without an object
        (0.0, 8.0),  # they have not moved yet
        (2.0, 0.0),  # the law pauses
    ],
)
def test_fingers_that_are_closed_or_are_not_driven_are_not_stalled(before_s, effort):
    assert Approach(seconds=before_s).go(2.0, speed=0.0, effort=effort)[0] is None


# ------------------------------------------------------------------------------------------------------- the motor


def answered(asked, answer, seconds=1.0, phase=APPROACH, gap=lambda t: 0.05, motor=None):
    """Return the faults of a motor that is asked for one effort and answers with another."""
    motor = motor or Motor(reports_effort=True, rate_hz=1000.0)
    seen = []
    for k in range(round(seconds * 1000)):
        t = 0.001 * k
        fault = motor.see(frame(t, gap(t), effort=answer), phase)
        if fault is not None:
            seen.append((t, fault))
        motor.apply(frame(t, gap(t)), Command(EFFORT, asked, inf, inf))
    return seen


def test_a_motor_within_a_quarter_of_its_command_is_sound():
    assert answered(20.0, 24.0) == answered(20.0, 16.0) == answered(-20.0, -17.0) == []


@every_case(
    ("asked", "answer", "name", "ends_first", "relaxes"),
    [
        (20.0, 100.0, "motor too strong", True, False),  # five times the command: at once
        (20.0, 29.0, "motor too strong", False, False),  # half as much again: warned of at first
        (20.0, 5.0, "motor too weak", False, False),
        (20.0, -20.0, "motor reversed", True, True),
        (-20.0, 20.0, "motor reversed", True, True),
    ],
)
def test_a_motor_that_gives_another_effort_warns_or_ends_the_grasp(asked, answer, name, ends_first, relaxes):
    seen = answered(asked, answer)
    ending_s = next(t for t, fault in seen if fault.ends)
    assert (ending_s < 0.1) == ends_first
    last = seen[-1][1]
    assert (last.name, last.ends, last.relaxes) == (name, True, relaxes)


def test_fingers_that_close_on_the_opening_command_are_relaxed():
    seen = answered(-20.0, -20.0, phase=int(Phase.RELEASE), gap=lambda t: 0.05 - 0.02 * t)
    assert seen[0][1].relaxes
    # After 3 mm, and some hundredths of a second to be sure.
    assert 0.05 - 0.02 * seen[0][0] > 0.0455


def test_fingers_that_a_spring_pushes_open_in_the_squeeze_are_not_reversed():
    assert answered(20.0, 20.0, phase=SQUEEZE, gap=lambda t: 0.05 + 0.01 * t) == []


def test_commands_of_a_velocity_are_not_compared_but_fingers_that_open_on_one_that_closes_are_reversed():
    for reports, gap_m, reversed_ in (
        (True, lambda k: 0.05, False),
        (False, lambda k: 0.05 + 0.00001 * k, True),
    ):
        motor, faults = Motor(reports_effort=reports, rate_hz=1000.0), []
        for k in range(1000):
            now = frame(0.001 * k, gap=gap_m(k), effort=50.0 if reports else 8.0)
            faults.append(motor.see(now, APPROACH))
            motor.apply(now, Command(VELOCITY, -0.01, inf, inf))
        assert any(fault is not None and fault.relaxes for fault in faults) == reversed_
        assert reversed_ or faults == [None] * 1000


@every_case(
    ("closes_m", "opens_m", "kind", "name"),
    [
        (0.05, 0.0076, POSITION, None),
        (0.05, 0.02, POSITION, "gap against the command"),
        (0.05, 0.02, EFFORT, "motor reversed"),
        (0.0, 0.02, POSITION, "motor reversed"),
    ],
)
def test_fingers_that_rebound_from_what_they_met_in_the_approach_are_not_reversed(
    closes_m, opens_m, kind, name
):
    """The widest rebound of the simulated catalogue is 7.6 mm, of the block at 100 mm/s.

    A motor that keeps a position, and has closed the fingers before, turns the right way: they can be opened.
    """
    motor, faults = Motor(reports_effort=False, rate_hz=100.0), []
    met_m = 0.08 - closes_m
    for gap_m in (*np.linspace(0.08, met_m, 200), *np.linspace(met_m, met_m + opens_m, 100)):
        now = frame(0.01 * len(faults), gap=gap_m, dt=0.01)
        faults.append(motor.see(now, APPROACH))
        motor.apply(now, Command(kind, 0.0 if kind == POSITION else 8.0, 10.0, 0.035))
    seen = [fault for fault in faults if fault is not None]
    assert {fault.name for fault in seen} == ({name} if name else set())
    assert all(fault.ends and fault.relaxes == (name == "motor reversed") for fault in seen)


@every_case(("answer_n", "told"), [(20.0, False), (18.5, False), (17.0, True), (23.0, True)])
def test_a_motor_that_answers_a_tenth_less_or_more_in_the_hold_is_told_and_does_not_end_the_grasp(
    answer_n, told
):
    motor, faults = Motor(reports_effort=True, rate_hz=1000.0), []
    for k in range(300):
        now = frame(0.001 * k, velocity=0.0, effort=answer_n)
        faults.append(motor.see(now, HOLD))
        motor.apply(now, Command(EFFORT, 20.0, inf, inf))
    assert {(fault.name, fault.ends) for fault in faults if fault is not None} == (
        {("motor off", False)} if told else set()
    )


@every_case(("slows", "is_reversed"), [(True, False), (False, True)])
def test_fingers_that_were_fast_and_slow_down_under_an_opening_command_are_not_reversed(slows, is_reversed):
    """From 100 mm/s at 0.3 m/s2, as after an egg that broke; a reversed motor closes faster and faster."""
    motor, faults, gap_m = Motor(reports_effort=False, rate_hz=1000.0), [], 0.05
    for k in range(330):
        speed_m_s = 0.1 + (-0.0003 if slows else 0.0003) * k
        gap_m -= 0.001 * speed_m_s
        now = frame(0.001 * k, gap=gap_m, velocity=-speed_m_s)
        faults.append(motor.see(now, int(Phase.RELEASE)))
        motor.apply(now, Command(EFFORT, -20.0, inf, inf))
    assert any(fault is not None and fault.relaxes for fault in faults) == is_reversed


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
    _, frozen = first_end([reading(1.0, dt=0.0)] * 200, HOLD)
    assert frozen == pytest.approx(100, abs=2)
    _, stopped = first_end(
        [reading(0.001 * k, counter=min(1 + k // 40, 5)) for k in range(1000)], SQUEEZE, 25.0
    )
    # The fifth image came at 0.16 s, and five periods are allowed.
    assert stopped == pytest.approx(160 + 200, abs=2)


def test_lost_frames_are_told_with_their_share_and_end_the_grasp_from_one_half_on():
    # Two of three frames come, then one of three; frames that only come unevenly are not lost.
    faults, end = first_end([reading(0.0015 * k, dt=0.001 + 0.001 * (k % 2)) for k in range(400)], APPROACH)
    assert end is None
    assert "33 %" in faults[-1].words
    assert first_end([reading(0.003 * k, dt=0.003) for k in range(400)], APPROACH)[1] is not None
    uneven = [reading(0.001 * k, dt=0.0005 + 0.001 * (k % 2)) for k in range(1000)]
    assert first_end(uneven, APPROACH) == ([None] * 1000, None)


@every_case(("rate", "told"), [(1.0, False), (0.97, False), (0.8, True), (0.5, True)])
def test_a_clock_that_is_slow_for_the_frames_that_come_is_told(rate, told):
    faults, end = first_end([reading(0.001 * rate * k, dt=0.001 * rate) for k in range(400)], APPROACH)
    assert end is None
    assert [fault.name for fault in faults[-1:] if fault is not None] == ["clock slow"] * told


def test_a_clock_that_becomes_slow_late_is_told():
    """10 % slow from the contact on, after a sound approach of three seconds."""
    clock_s = [0.001] * 3000 + [0.0009] * 900
    faults, _ = first_end([reading(sum(clock_s[:k]), dt=clock_s[k]) for k in range(3900)], SQUEEZE)
    assert {fault.name for fault in faults if fault is not None} == {"clock slow"}


@every_case(("jump_s", "ends"), [(1.0, False), (4.0, True), (-0.1, False)])
def test_a_clock_that_jumps_is_told_and_ends_the_grasp_where_it_is_half_of_its_time(jump_s, ends):
    now = [reading(0.001 * k + jump_s * (k >= 2000), dt=0.001 + jump_s * (k == 2000)) for k in range(2100)]
    faults, _ = first_end(now, APPROACH)
    assert [(fault.name, fault.ends) for fault in faults if fault is not None] == [("clock jumps", ends)]


def images(n, frozen=(), noise=15.0, seed=0):
    """Return images of 22 noisy cells a side; `frozen` cells of the left side keep their first value."""
    rng = np.random.default_rng(seed)
    left = np.round(3000.0 + noise * rng.standard_normal((n, 22)))
    right = np.round(3000.0 + noise * rng.standard_normal((n, 22)))
    left[:, list(frozen)] = left[0, list(frozen)]
    return [Pads(0.04 * k, k + 1, tuple(left[k]), tuple(right[k])) for k in range(n)]


def seen(pads):
    tips = Fingertips()
    return [tips.see(image, True) for image in pads][-1]


@every_case("noise", [0.0, 0.4, 2.0, 15.0])
@every_case("seed", range(2))
def test_sound_cells_are_never_frozen(noise, seed):
    assert seen(images(100, noise=noise, seed=seed)) == []


def test_a_frozen_cell_is_named_and_only_a_fingertip_whose_cells_all_stand_still_ends_the_grasp():
    (fault,) = seen(images(60, frozen=(15,)))
    assert "(15)" in fault.words
    assert not fault.ends
    # As dark pixels of a camera.
    assert [fault.ends for fault in seen(images(60, frozen=range(7)))] == [False]
    (fault,) = seen(images(60, frozen=range(22)))
    assert (fault.name, fault.ends) == ("left fingertip stuck", True)


def test_a_fingertip_that_goes_blank_ends_the_grasp_with_the_second_image():
    tips = Fingertips()
    for image in images(10):
        assert tips.see(image, True) == []
    blank = images(12)[10:]
    assert tips.see(blank[0]._replace(right=(0.0,) * 22), True) == []
    (fault,) = tips.see(blank[1]._replace(right=(0.0,) * 22), True)
    assert fault.name == "right fingertip without signal"


@every_case(("speed_m_s", "name"), [(0.01, "left pad stuck"), (0.0, "pads disagree")])
def test_a_force_that_stands_still_while_the_other_one_rises_is_stuck(speed_m_s, name):
    """Where the fingers rest, it can also be the one that rises that is wrong."""
    stuck = StuckForce(pads_hz=24.0)
    faults = [stuck.see(frame(0.001 * k, left=2.0, right=2.0 + 0.01 * (k // 40))) for k in range(200)]
    assert faults == [None] * 200
    for k in range(400):
        now = frame(0.2 + 0.001 * k, 0.05 - 0.001 * speed_m_s * k, left=2.0, right=2.0 + 0.01 * k)
        faults.append(stuck.see(now))
    fault = next(fault for fault in faults if fault is not None)
    assert (fault.name, fault.ends) == (name, True)


# ------------------------------------------------------------------------------------------------------------ drift


def drifted(force, cells=None, seconds=2.0, speed=0.01, seed=1):
    """Return the first fault of a pad whose force (N) is `force(t)`, with the usual noise, at 10 mm/s."""
    rng, pad = np.random.default_rng(seed), PadDrift("left", CONTACT_N)
    t = 0.0
    while t < seconds:
        image = () if cells is None else tuple(cells(t) + 15.0 * rng.standard_normal(22))
        fault = pad.see(force(t) + 0.03 * rng.standard_normal(), 0.09 - speed * t, image)
        if fault is not None and fault.ends:
            return fault
        t += 0.04
    return None


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
        drift.see(
            Reading(frame(t, 0.09 - 0.01 * t, left=force_n, right=force_n), Pads(t, k + 1, image, image))
        )
    assert drift.on_some_cells() is touched


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_slow_change_of_all_cells_is_drift(sign):
    fault = drifted(lambda t: sign * 0.47 * t, lambda t: 6000.0 - all_cells(t) if sign < 0 else all_cells(t))
    assert fault.name == "left pad drifts"


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
    assert drifted(force, **more) is None


# ------------------------------------------------------------------------------- grippers of other rates and channels


def test_a_bump_is_no_contact_that_lasts():
    approach = Approach(seconds=1.0).drift()
    approach.go(0.005, left=0.7, right=0.7)
    assert approach.go(1.0)[0] is None
    assert approach.touch.closing_limit_n() == inf


@pytest.mark.parametrize("speed", [0.001, 0.003])
def test_a_slow_approach_may_push_an_object_as_far(speed):
    touch, t, gap = Touch(CONTACT_N), 0.0, 0.09
    for k in range(round(0.016 / speed * 100)):
        t, gap = t + 0.01, gap - 0.01 * speed
        pushes = gap < 0.088
        now = Frame(t, 0.01, gap, nan, 8.0, 1.0 if pushes else 0.0, 0.0, 0.0, 0.0, 0)
        # 14 mm of pushing, from gaps alone: this gripper has no velocity.
        assert touch.see(now, APPROACH, CLOSING) is None, k


def test_forces_that_become_no_number_end_the_grasp_and_each_pad_is_named():
    approach = Approach()
    approach.go(0.3, left=4.0, right=4.0, speed=0.001, phase=SQUEEZE)
    for k in range(102):
        now = frame(approach.t + 0.001 * k, approach.gap, 0.0, 8.0, nan, nan)
        assert approach.touch.see(now, SQUEEZE, CLOSING) is None
        faults = approach.touch.absent(now)
    assert [(fault.name, fault.ends) for fault in faults] == [
        ("left pad absent", True),
        ("right pad absent", True),
    ]


def test_a_contact_that_is_not_clear_without_a_known_effort_is_held_at_the_usual_one():
    touch = Touch(CONTACT_N, usual_effort_n=12.0)
    touch.see(frame(0.0, left=1.0), APPROACH, Command(VELOCITY, -0.01, inf, inf))
    assert touch.closing_limit_n() == 12.0


def test_a_slow_gripper_may_answer_a_frame_late():
    motor = Motor(reports_effort=True, rate_hz=10.0)
    answers = [10.0, 10.0, 10.0, 10.0, -10.0, -10.0, -10.0]
    asked = [10.0, 10.0, 10.0, -10.0, -10.0, -10.0, -10.0]
    for k, (answer, value) in enumerate(zip(answers, asked, strict=True)):
        now = Frame(0.1 * k, 0.1, 0.05, 0.0, answer, 0.0, 0.0, 0.0, 0.0, 0)
        assert motor.see(now, APPROACH) is None
        motor.apply(now, Command(EFFORT, value, inf, inf))


@every_case("share", [0.5, 0.8])
@every_case("seed", range(3))
def test_cells_that_change_now_and_then_are_not_frozen(share, seed):
    rng, tips = np.random.default_rng(seed), Fingertips()
    cells = 1000.0 * np.arange(1.0, 9.0).reshape(2, 4)
    for k in range(240):
        cells += (rng.random((2, 4)) < share) * 1.0
        assert tips.see(Pads(0.04 * k, k + 1, tuple(cells[0]), tuple(cells[1])), True) == []


def test_cells_at_the_end_of_their_range_or_without_noise_are_not_stuck():
    tips = Fingertips()
    for image in images(20):
        tips.see(image, True)
    pressed = [image._replace(left=(4095.0,) * 7 + image.left[7:]) for image in images(40)[20:]]
    assert [tips.see(image, False) for image in pressed] == [[]] * 20

    tips = Fingertips()
    for k in range(20):
        left = (0.0,) * 15 + (float(k == 5),)
        assert tips.see(Pads(0.04 * k, k + 1, left, (0.0,) * 16), True) == []
    # A fingertip may have no cells.
    assert Fingertips().see(Pads(0.0, 1, (), (1.0, 2.0)), True) == []


@pytest.mark.parametrize("asked", [nan, -1.0, inf])
def test_a_force_that_is_none_does_not_lift_the_ceiling(asked):
    class Careless(HybridController):
        def asked_force_n(self):
            return asked

    assert effort_ceiling_n(gripper(friction_n=nan), Careless(HybridConfig()), RunConfig()) == 25.0


# ------------------------------------------------------------ a motor that reports what it was told, and gaps


def felt(left, right, commands=(20.0,), seconds=0.5, velocity=0.0):
    """Return the last fault of pads that feel these forces after these commands, at this velocity."""
    felt_force = FeltForce(1000.0, 24.39, 7.0)
    for value in commands:
        felt_force.apply(Command(EFFORT, value, inf, inf))
    faults = [
        felt_force.see(frame(0.001 * k, left=left, right=right, velocity=velocity))
        for k in range(round(seconds * 1000))
    ]
    return faults[-1]


def test_pads_that_both_feel_more_than_the_motor_was_told():
    # A quarter and 1.5 N more are told, a half and 3 N more end the grasp.
    assert felt(33.0, 60.0) is None
    assert not felt(35.0, 35.0).ends
    assert felt(41.0, 60.0).ends
    # Fingers that are being braked press with their mass; those that hold by themselves, with the largest command.
    assert felt(100.0, 100.0, velocity=-0.01) is None
    assert felt(25.0, 25.0, commands=(30.0, 0.0)) is None
    # One image that is wrong is no force.
    assert felt(100.0, 100.0, seconds=0.041) is None
    # The default hold lasts 0.25 s: it is told within that, and ends the grasp only if it lasts longer.
    assert not felt(41.0, 60.0, seconds=0.2).ends


def eased(effort, friction=7.0, speed=0.01, kind=EFFORT):
    free_effort = FreeEffort(friction)
    faults = [
        free_effort.see(frame(0.001 * k, velocity=-speed), Command(kind, effort, inf, inf))
        for k in range(1500)
    ]
    return next((fault for fault in reversed(faults) if fault is not None), None)


def test_fingers_that_move_with_less_than_their_friction():
    assert not eased(4.0).ends
    assert eased(2.4).ends
    for sound in (
        {"effort": 5.0},
        {"effort": 1.0, "friction": 0.0},
        # Fingers that are braked, on a drive whose friction is not known.
        {"effort": -6.0, "friction": 0.0},
        {"effort": 0.0, "speed": 0.0},
        {"effort": 1.0, "kind": FORCE},
    ):
        assert eased(**sound) is None, sound


def travelled(velocity, gap, seconds=1.0, dt=0.001, declared=False):
    """Return the last fault of this velocity (m/s) and this gap (m), each a function of time, or one that ends."""
    gap_speed, told = GapSpeed(1.0 / dt, declared), None
    for k in range(round(seconds / dt)):
        fault = gap_speed.see(frame(dt * k, gap=gap(dt * k), velocity=velocity(dt * k), dt=dt))
        if fault is not None and fault.ends:
            return fault
        told = told or fault
    return told


def closing(t):
    return 0.09 - 0.01 * t


@every_case(
    ("velocity", "gap", "agrees"),
    [
        *((lambda t, said=said: said, closing, False) for said in (-0.001, 0.01, -1.0)),
        (lambda t: -0.01, lambda t: closing(min(t, 0.4)), False),
        # A velocity that is 0 or no number from the beginning on is not measured.
        (lambda t: 0.0, closing, True),
        (lambda t: nan, closing, True),
        (lambda t: -0.01 if t < 0.2 else 0.0, closing, False),
    ],
)
def test_a_velocity_that_is_not_that_of_the_gap_ends_the_grasp(velocity, gap, agrees):
    fault = travelled(velocity, gap)
    assert fault is None if agrees else fault.ends


def test_a_velocity_that_is_declared_and_stays_0_ends_the_grasp_and_one_of_half_the_scale_is_told():
    assert travelled(lambda t: 0.0, closing, declared=True).ends
    fault = travelled(lambda t: -0.0055, closing, 2.0)
    assert fault is not None
    assert not fault.ends
    assert travelled(lambda t: -0.0085, closing, 2.0) is None


@every_case("speed", [0.002, 0.01, 0.1])
@every_case(("dt", "step", "late_s"), [(0.001, 0.0, 0.02), (0.01, 0.0004, 0.05), (0.04, 0.0004, 0.08)])
def test_a_late_velocity_and_a_gap_in_steps_agree(speed, dt, step, late_s):
    def gap(t):
        exact = 0.2 - speed * t
        return step * round(exact / step) if step else exact

    assert travelled(lambda t: -speed * (t >= late_s), gap, dt=dt) is None


def standing(command, seconds, gap=0.05, jitter=0.0):
    """Return how long (s) the fingers stand still under this command until a fault, or None."""
    watch = Standstill()
    for k in range(round(seconds * 100)):
        fault = watch.see(frame(k / 100, gap + jitter * (k % 2), velocity=0.0), command)
        if fault is not None:
            assert fault.ends
            return k / 100
    return None


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
    assert standing(command, 20.0, jitter=0.0007) == (
        None if after_s is None else pytest.approx(after_s, abs=0.02)
    )


def test_fingers_that_are_closed_or_move_do_not_stand_still():
    command = Command(VELOCITY, -0.01, 20.0, inf)
    assert standing(command, 20.0, gap=0.002) is None
    assert standing(command, 20.0, gap=nan) is None
    watch = Standstill()
    assert not any(watch.see(frame(k / 100, 0.05 - 0.005 * k / 1000), command) for k in range(2000))


@every_case(
    ("left_n", "right_n", "told"),
    [(0.0, 0.0, True), (-20.0, -20.0, True), (0.0, 5.0, False), (0.4, 0.4, False)],
)
def test_pads_that_both_feel_nothing_in_the_hold_are_told(left_n, right_n, told):
    watch = EmptyHold(CONTACT_N)
    faults = [watch.see(frame(0.001 * k, left=left_n, right=right_n)) for k in range(200)]
    assert any(fault is not None and not fault.ends for fault in faults) is told


@every_case(("pads_hz", "ends"), [(0.0, True), (24.4, False)])
def test_fast_fingers_have_two_images_of_the_pads_to_show_a_contact(pads_hz, ends):
    """At 100 mm/s they move by 3 mm within an image, as when an egg breaks."""
    touch, seen = Touch(CONTACT_N, pads_hz=pads_hz), []
    for k in range(360):
        # Between free and a contact for longer than a sharp rise takes.
        force_n = 0.0 if k < 270 else 0.3 if k < 300 else 0.8
        now = frame(0.001 * k, 0.08 - 1e-4 * k, velocity=-0.1, left=force_n, right=force_n)
        seen.append(touch.see(now, APPROACH, CLOSING))
    assert any(fault is not None and fault.ends for fault in seen) is ends


@every_case(("rises_n", "ends"), [(0.0, True), (5.0, False)])
def test_a_force_that_is_there_before_the_fingers_close_is_a_contact_only_if_it_rises(rises_n, ends):
    """Both pads feel 3 N from the beginning, while the fingers close by 10 mm."""
    touch = Touch(CONTACT_N)
    seen = [
        touch.see(
            frame(0.001 * k, 0.08 - 1e-5 * k, left=3.0 + rises_n * k / 1e3, right=3.0), APPROACH, CLOSING
        )
        for k in range(1000)
    ]
    assert any(fault is not None and fault.ends for fault in seen) is ends
