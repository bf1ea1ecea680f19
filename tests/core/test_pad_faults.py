"""Faults of pads that features would carry on: scale, zero, noise, a force that is late, and one that stands still."""

from math import nan, pi, sin
from random import Random

from cases import every_case
from grippers import Scripted, bottle, squeezing

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.protection.drift import Drift
from graspsense.core.grasp.protection.opening import Opening
from graspsense.core.grasp.protection.pad_curves import PadCurves
from graspsense.core.grasp.protection.reports import PADS_ABSENT, Absence
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.signals import (
    APPROACH,
    HOLD,
    NO_PADS,
    SQUEEZE,
    Frame,
    Outcome,
    Phase,
    Reading,
)
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController

CONTACT_N = 0.625
PADS_HZ = 25.0
STIFFNESS_N_M = 2000.0
CONTACT_M, REST_M = 0.058, 0.055
CLOSING_S, REST_S, RELEASE_S, END_S = 1.0, 1.3, 1.8, 2.4
"""The fingers close by 10 mm a second, touch, rest, and open by 50 mm a second."""


def gap_m(t_s):
    if t_s < RELEASE_S:
        return CONTACT_M + 0.01 * (CLOSING_S - min(t_s, REST_S))
    return REST_M + 0.05 * (t_s - RELEASE_S)


def phase_of(t_s):
    if t_s < CLOSING_S:
        return APPROACH
    if t_s < REST_S:
        return SQUEEZE
    return HOLD if t_s < RELEASE_S else Phase.RELEASE


def force_n(t_s):
    """The force of a spring of 2 N/mm, 6 N at rest."""
    return STIFFNESS_N_M * max(CONTACT_M - gap_m(t_s), 0.0)


def sound(t_s, sound_n):
    return sound_n


def told(left=sound, right=sound, noise_n=0.03, pads_hz=PADS_HZ, gap_late_s=0.0):
    """Return the names of the faults in a grasp whose pads give these forces, sampled at `pads_hz`."""
    curves, drift = PadCurves(CONTACT_N, pads_hz), Drift(CONTACT_N)
    opening = Opening(1000.0, 0.0, None, tells_gap=True, contact_n=CONTACT_N)
    gauss, faults = Random(0).gauss, []
    last, forces = -1, (0.0, 0.0)
    for k in range(round(END_S * 1000)):
        t_s = k / 1000
        sample = int(t_s * pads_hz)
        if sample != last:
            last = sample
            # Measured half a period ago.
            sound_n = force_n(max(t_s - 0.5 / pads_hz, 0.0))
            forces = tuple(pad(t_s, sound_n + gauss(0.0, noise_n)) for pad in (left, right))
        frame = Frame(t_s, 0.001, gap_m(t_s - gap_late_s), 0.0, 0.0, *forces, 0.0, 0.0, 0)
        phase, reading = phase_of(t_s), Reading(frame, NO_PADS)
        seen = [*curves.see(reading, phase), opening.see(frame, phase)]
        if phase == APPROACH and max(forces) < CONTACT_N:
            seen += drift.see(reading)
        faults += [fault.name for fault in seen if fault is not None]
    return {*faults, *(fault.name for fault in curves.released(END_S))}


@every_case("pads_hz", [10.0, 25.0, 1000.0])
def test_sound_pads_are_not_accused(pads_hz):
    assert told(pads_hz=pads_hz) == set()


@every_case(
    ("right", "names"),
    [
        # What friction holds from the contact on is the same at each force; what a scale adds is not.
        (lambda t, f: 0.25 * f + 0.6 * (CLOSING_S + 0.02 < t < RELEASE_S), set()),
        (lambda t, f: 1.4 * 0.25 * f, {"pads disagree"}),
    ],
)
def test_friction_in_a_light_squeeze_is_no_scale(right, names):
    assert told(lambda t, f: 0.25 * f, right) == names


@every_case(("late_s", "is_told"), [(0.0, False), (0.05, False), (0.12, True)])
def test_a_gap_that_stands_still_after_both_pads_have_let_go_is_late(late_s, is_told):
    """The object follows the fingers by 3 mm, for 0.06 s: by so much, a gap can be late and not show it."""
    assert ("gap late" in told(pads_hz=1000.0, gap_late_s=late_s)) == is_told


def late(t_s, late_s):
    return force_n(max(t_s - late_s, 0.0))


@every_case(
    ("left", "names"),
    [
        # 20 % of the scale are allowed: half of them reach the mean of the pads.
        (lambda t, f: 0.85 * f, set()),
        (lambda t, f: 0.7 * f, {"pads disagree"}),
        (lambda t, f: 1.4 * f, {"pads disagree"}),
        # From the middle of the squeeze on.
        (lambda t, f: f * (0.7 if t > 1.15 else 1.0), {"pads disagree"}),
        # Friction holds what one finger has pushed: more, and as much from before the contact on.
        (lambda t, f: f + 1.0 * (0.8 < t < RELEASE_S), set()),
        (lambda t, f: f + 0.9 * (t > 1.4), {"left pad off its zero"}),
        (lambda t, f: f - 0.9 * (t > 1.4), {"left pad off its zero"}),
        (lambda t, f: f + 0.4 * (t > 1.4), set()),
        (lambda t, f: late(t, 0.2), {"left pad feels more on opening"}),
        (lambda t, f: late(t, 0.04), set()),
        # Late in the squeeze alone: the other pad shows it.
        (lambda t, f: late(t, 0.2) if t < REST_S else f, {"pads disagree"}),
        (lambda t, f: f + 4.0 * (t > 1.4), {"left pad jumps", "left pad off its zero"}),
        (lambda t, f: f + 4.0 * (abs(t - 1.4) < 0.02), {"left pad noisy"}),
        # Twice in free air; once can be an object that is knocked away.
        (lambda t, f: f + 4.0 * (min(abs(t - 0.3), abs(t - 0.7)) < 0.02), {"left pad noisy"}),
        (lambda t, f: f + 4.0 * (abs(t - 0.3) < 0.02), set()),
        (lambda t, f: -f, {"left pad below zero"}),
        (lambda t, f: f + Random(t).gauss(0.0, 0.3), {"left pad noisy"}),
    ],
)
def test_a_fault_of_one_pad_names_it(left, names):
    faults = told(left)
    assert faults >= names
    assert names or not faults


@every_case(
    ("both", "noise_n", "fault"),
    [
        # Late, at the end of its range, and of half the force on opening, as an object can lose it.
        (lambda t, f: late(t, 0.2), 0.03, "feels more on opening"),
        (lambda t, f: min(f, 2.0), 0.03, "stands still"),
        (lambda t, f: 0.5 * f if t > RELEASE_S else f, 0.03, None),
        # Without noise, a force that stands still is no fault.
        (lambda t, f: min(f, 2.0), 0.0, None),
    ],
)
def test_a_fault_of_both_pads_that_the_way_back_shows_is_told(both, noise_n, fault):
    faults = told(both, both, noise_n)
    assert faults >= {f"{side} pad {fault}" for side in ("left", "right")} if fault else not faults


@every_case(("share", "name"), [(0.2, "left pad absent"), (0.02, None)])
def test_a_force_that_is_no_number_now_and_then_is_told_and_does_not_end_the_grasp(share, name):
    absence, chance, faults = Absence(PADS_ABSENT[0], PADS_HZ, expected=True), Random(0).random, []
    for k in range(1000):
        left_n = nan if chance() < share else 3.0
        frame = Frame(k / 1000, 0.001, 0.05, 0.0, 0.0, left_n, 3.0, 0.0, 0.0, 0)
        faults.append(absence.see(left_n, frame))
    seen = {(fault.name, fault.ends) for fault in faults if fault is not None}
    assert seen == ({(name, False)} if name else set())


def test_pads_that_differ_while_an_arm_moves_what_they_hold_are_not_accused():
    """Half a kilogram that is shaken by 10 m/s2, 3 times a second, from a second after the rest on."""
    curves, gauss = PadCurves(CONTACT_N, PADS_HZ), Random(0).gauss
    for k in range(round(PADS_HZ * 6.0)):
        t_s = k / PADS_HZ
        more_n = 5.0 * sin(2.0 * pi * 3.0 * t_s) if t_s > REST_S + 1.1 else 0.0
        pressed_n = force_n(min(t_s, REST_S))
        forces = (pressed_n + more_n + gauss(0.0, 0.03), pressed_n + gauss(0.0, 0.03))
        frame = Frame(t_s, 1.0 / PADS_HZ, gap_m(min(t_s, REST_S)), 0.0, 0.0, *forces, 0.0, 0.0, 0)
        phase = phase_of(min(t_s, REST_S))
        assert curves.see(Reading(frame, NO_PADS), phase) == []


def test_a_side_impact_says_which_edge_felt_how_much():
    class FaultyEdge(Scripted):
        """A gripper whose left edge feels 0.4 N from half a second on."""

        def read(self, timeout_s):
            reading = super().read(timeout_s)
            edge_n = 0.4 if reading.frame.t_s > 0.5 else 0.05
            return reading._replace(frame=reading.frame._replace(edge_left_n=edge_n))

    grasp = run_grasp(FaultyEdge(squeezing, bottle), HybridController(HybridConfig()), RunConfig())
    assert grasp.outcome is Outcome.SIDE_IMPACT
    assert "felt 0.40 N" in grasp.reason
