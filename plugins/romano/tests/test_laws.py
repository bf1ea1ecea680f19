"""The laws and the conditions of events, against the figures that Romano et al. print."""

from __future__ import annotations

from itertools import pairwise
from math import inf, nan
from typing import NamedTuple

import pytest
from cases import every_case

from graspsense.plugin_api import (
    EFFORT,
    HOLD,
    NO_PADS,
    POSITION,
    RUNNING,
    STEADY,
    VELOCITY,
    Frame,
    Reading,
    Samples,
    create,
)
from graspsense_romano.events import EVENTS, NOTHING, EventThresholds, begun, conditions, placed, slips
from graspsense_romano.filters import NOT_BEGUN
from graspsense_romano.laws import Servo, force_rate, grab_force, raised_force
from graspsense_romano.signals import FILTERS, NO_SIGNALS, PadSignal, updated

CONTROLLERS = ("find-contact", "force-servo", "slip-servo", "grab", "release", "pick-and-place")
THRESHOLDS = EventThresholds(1.2, 0.1, 0.007, 0.048, 0.18, 0.008, 0.2, 3.25, 1)


class Palm(NamedTuple):
    acceleration: Samples


class OtherSignals(NamedTuple):
    motor_temperature: float


def palm(*values):
    return Palm(Samples(0.0, len(values), len(values), tuple((0.0, 0.0, v) for v in values)))


def reading(t_s, force_n, signals=(), gap_m=0.05):
    return Reading(Frame(t_s, 0.001, gap_m, 0.0, 0.0, force_n, force_n, nan, nan, 0), NO_PADS, signals)


def test_grab_takes_its_force_from_the_contact():
    """1 N at 20 mm/s with the published gain of 0.03 gives 1.5 N; the floor is 1.2 N."""
    forces = [grab_force(felt_n, 0.02, 0.03, 1.2, 20.0) for felt_n in (1.0, 0.2, 50.0)]
    assert forces == pytest.approx([1.5, 1.2, 20.0])


def test_the_force_servo_looks_at_the_weaker_finger_and_closes_faster_than_it_opens():
    servo = Servo(0.0008, 0.0016, 0.5)
    rates = [force_rate(servo, *forces) for forces in ((5.0, 4.0, 9.0), (5.0, 6.0, 9.0), (1e6, 0.0, 0.0))]
    assert rates == pytest.approx([-0.0016, 0.0008, -0.5])


def test_a_slip_of_one_pad_sample_adds_as_much_force_at_every_tick_rate():
    """1.002 a millisecond: about 8.5 % in the 41 ms of an image."""
    for dt_s in (0.001, 0.0005, 0.041 / 8):
        force_n = 5.0
        for _ in range(round(0.041 / dt_s)):
            force_n = raised_force(force_n, 1, dt_s, 100.0)
        assert force_n / 5.0 == pytest.approx(1.085, abs=0.001)
    assert raised_force(5.0, 0, 0.001, 100.0) == 5.0
    assert raised_force(5.0, 1, 0.001, 5.0) == 5.0


def test_a_slip_is_a_disturbance_while_the_force_itself_is_quiet():
    quiet, loud = NOT_BEGUN, NOT_BEGUN._replace(y1=0.19)
    # 0.7 % of 10 N is 0.07 N; of 100 N it would be 0.7 N, and 0.2 N is the most.
    slipping = [(5.0, 0.05, quiet), (100.0, 0.21, quiet)]
    for signal in (*slipping, (5.0, 0.047, quiet), (5.0, 0.05, loud), (10.0, 0.06, quiet)):
        assert slips(PadSignal(1, *signal), 0.007, 0.048, 0.18) == (signal in slipping)


@every_case(("place_by", "with_shock", "with_slip"), [(0, 1, 0), (1, 0, 0), (2, 1, 1), (3, 0, 1), (4, 1, 0)])
def test_placing_is_told_by_the_published_conditions(place_by, with_shock, with_slip):
    params = THRESHOLDS._replace(place_by=place_by)
    shock, slip = NOTHING._replace(shock=1), NOTHING._replace(place_slip=1)
    assert placed(params, shock, 1) == bool(with_shock)
    assert placed(params, slip, 1) == bool(with_slip)
    assert placed(params, NOTHING._replace(shock=1, place_slip=1), 1)
    assert not placed(params, NOTHING, 1)
    # Without an acceleration, a slip stands for the shock.
    assert placed(params, slip, 0)


def test_gravity_is_no_shock_and_every_sample_of_a_tick_counts():
    """The published controller looks at the last sample of a tick alone, and begins its filter at zero."""
    signals = NO_SIGNALS
    for k in range(100):
        signals = updated(FILTERS, signals, reading(k * 0.001, 0.0, palm(9.8, 9.8, 9.8)))
        assert conditions(THRESHOLDS, signals).shock == 0
    signals = updated(FILTERS, signals, reading(0.1, 0.0, palm(9.8, 20.0, 9.8)))
    assert conditions(THRESHOLDS, signals).shock == 1


def test_a_gripper_with_other_signals_has_no_acceleration():
    for signals in ((), OtherSignals(20.0)):
        assert updated(FILTERS, NO_SIGNALS, reading(0.0, 0.0, signals)).acceleration.present == 0


def test_pads_are_sampled_every_41_ms_whatever_the_tick():
    for dt_s in (0.001, 0.0003):
        signals, times = NO_SIGNALS, []
        for k in range(int(0.5 / dt_s)):
            frame = reading(k * dt_s, 1.0).frame._replace(dt_s=dt_s)
            signals = updated(FILTERS, signals, Reading(frame, NO_PADS))
            if signals.fresh:
                times.append(k * dt_s)
        assert all(abs(b - a - 0.041) <= dt_s for a, b in pairwise(times))


def test_events_are_told_once():
    both = NOTHING._replace(left=1, right=1)
    assert EVENTS[:3] == ("left contact", "right contact", "both in contact")
    assert (begun(NOTHING, both), begun(both, both)) == (0b111, 0)


def spring(controller, *, ends_s=6.0, stiffness_n_m=2000.0, lost_s=inf, **settings):
    """Run a law that commands rates on a spring of 50 mm without mass; return its states and forces."""
    law = create("controller", controller, sends="velocity", **settings)
    state, params, gap_m, states, forces = law.init(), law.params(), 0.06, [], []
    for k in range(int(ends_s / 0.001)):
        force_n = max(0.05 - gap_m, 0.0) * stiffness_n_m if k * 0.001 < lost_s else 0.0
        command, state = law.step(params, state, reading(k * 0.001, force_n, gap_m=gap_m))
        assert command.kind == VELOCITY
        gap_m += command.value * 0.001
        states.append(state)
        forces.append(force_n)
    return states, forces


def test_find_contact_stops_where_both_pads_touch():
    states, forces = spring("find-contact", ends_s=2.0)
    assert (states[-1].outcome, states[-1].phase) == (STEADY, HOLD)
    # The high band tells of 20 mm/s * 2000 N/m = 40 N/s at the first image of the contact, within 41 ms.
    assert 0.1 < forces[-1] <= 40.0 * 0.083
    assert forces[-1] == forces[-500]


def test_the_force_servo_reaches_its_force():
    states, forces = spring("force-servo", force_n=5.0)
    assert states[-1].outcome == STEADY
    assert forces[-1] == pytest.approx(5.0, abs=0.05)


def test_grab_grips_a_hard_thing_harder_than_a_soft_one():
    (_, soft), (_, hard) = spring("grab", stiffness_n_m=500.0), spring("grab", stiffness_n_m=3000.0)
    assert hard[-1] > 1.5 * soft[-1]


@every_case(("limit_n", "said"), [(20.0, "lost at 5.0 N"), (5.0, "for 5 N")])
def test_a_thing_that_is_lost_ends_the_grasp_with_a_reason(limit_n, said):
    states, _ = spring("slip-servo", force_n=5.0, lost_s=4.0, force_limit_n=limit_n)
    assert states[-1].outcome not in (RUNNING, STEADY)
    law = create("controller", "slip-servo", force_n=5.0, force_limit_n=limit_n)
    assert said in law.reason(states[-1])
    limits = [k for k, state in enumerate(states) if state.events >> 8 & 1]
    assert "force limit" in EVENTS[8]
    assert len(limits) == (limit_n == 5.0)


def detected(*readings):
    """Return the time and the name of each event that the detector tells."""
    law = create("controller", "event-detector")
    state, told = law.init(), []
    for reading in readings:
        command, state = law.step(law.params(), state, reading)
        assert (command.kind, command.value) == (EFFORT, 0.0)
        told += [(reading.frame.t_s, name) for k, name in enumerate(EVENTS) if state.events >> k & 1]
    return told


def test_the_detector_tells_contact_slip_and_what_it_cannot_tell_whatever_the_grasp_does():
    def force_n(t_s):
        return 0.0 if t_s < 1.0 else 5.0 + (0.15 if 4.0 <= t_s < 4.1 else 0.0)

    told = detected(*(reading(k * 0.001, force_n(k * 0.001)) for k in range(6000)))
    assert [name for t_s, name in told if 1.0 <= t_s <= 1.042][:3] == list(EVENTS[:3])
    begin, end = [t_s for t_s, name in told if name == "slip" and t_s > 2.0]
    assert (begin, end) == pytest.approx((4.02, 4.12), abs=0.025)  # the disturbance begins, and ends
    assert [name for _, name in told].count(EVENTS[7]) == 1


def test_the_detector_tells_placing_once_by_an_acceleration_of_one_or_three_axes():
    for shock in ((30.0,), (0.0, 0.0, 30.0)):
        still = tuple(0.0 for _ in shock)
        samples = [Palm(Samples(k * 0.001, k, 1, (shock if k == 500 else still,))) for k in range(1000)]
        told = detected(
            *(reading(k * 0.001, 5.0 + 0.15 * (k >= 480), sample) for k, sample in enumerate(samples))
        )
        assert [name for _, name in told].count("acceleration") == 1
        assert [round(t_s, 3) for t_s, name in told if name == "place"] == [0.5]
        assert EVENTS[7] not in [name for _, name in told]


@every_case("sends", ["effort", "velocity", "position"])
@every_case("name", CONTROLLERS)
def test_each_law_sends_each_kind(name, sends):
    law = create("controller", name, sends=sends)
    command, _ = law.step(law.params(), law.init(), reading(0.0, 0.0))
    assert command.kind == {"effort": EFFORT, "velocity": VELOCITY, "position": POSITION}[sends]


def test_pick_and_place_says_that_it_has_no_acceleration():
    states, _ = spring("pick-and-place")
    assert "no acceleration" in EVENTS[7]
    assert any(state.events >> 7 & 1 for state in states)
