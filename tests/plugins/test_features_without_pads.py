"""The features of grippers without pads."""

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from traces import made_trace

from graspsense.core.values.signals import Phase
from graspsense.plugins.features.without_pads import WithoutPads, WithoutPadsConfig, _without_start

FEATURES = WithoutPads(WithoutPadsConfig())
DT_S = 0.01
CONTACT_M, REST_M = 0.056, 0.050


def grasp(effort_of):
    """A grasp at 20 mm/s of an object of 60 mm that reaches 10.5 N at 56 mm and 20 N at 50 mm, then 25 N.

    `effort_of(effort_n, gap_m)` is the effort that is told.
    """
    gaps = [*(0.08 - 0.02 * DT_S * k for k in range(150)), *[REST_M] * 60]
    sound = [
        float(np.interp(gap, (REST_M, CONTACT_M, 0.0600, 0.0601), (20.0, 10.5, 5.0, 4.5))) for gap in gaps
    ]
    sound[180:] = [25.0] * 30
    phases = [Phase.APPROACH] * 165 + [Phase.SQUEEZE] * 20 + [Phase.HOLD] * 25
    told = np.array([effort_of(effort_n, gap) for effort_n, gap in zip(sound, gaps, strict=True)])
    trace = made_trace([(gap, 0.0, 0.0) for gap in gaps], dt=DT_S, phases=phases)
    return evolve(trace, effort_n=told)


@every_case(
    "effort_of",
    [
        lambda effort_n, gap_m: 20.0,
        lambda effort_n, gap_m: effort_n + 12.0,
        lambda effort_n, gap_m: effort_n + 12.0 * (gap_m < 0.07),
        # One spike, and noise in free air.
        lambda effort_n, gap_m: 20.0 if abs(gap_m - 0.07) < 1e-4 else effort_n,
        lambda effort_n, gap_m: effort_n + 8.0 * (round(gap_m * 1e4) % 3 == 0),
        # With half the scale, the 10.5 N of a contact are reached under the 25 N of the squeeze, at 50 mm, and after
        # the fingers have stopped.
        lambda effort_n, gap_m: 0.5 * effort_n,
    ],
)
def test_an_effort_that_fingers_pass_unhindered_is_no_contact(effort_of):
    features = FEATURES.extract(grasp(effort_of))
    assert set(features.reasons) == {"p_first", "delta_t", "dp_dt"}
    assert features["p_steady"] == pytest.approx(REST_M, abs=4e-4)


@every_case(
    ("effort_of", "contact_m"),
    [
        (lambda effort_n, gap_m: effort_n, CONTACT_M),
        # What sets the fingers in motion; and steps of a coarse current.
        (lambda effort_n, gap_m: 20.0 if gap_m > 0.0795 else effort_n, CONTACT_M),
        (lambda effort_n, gap_m: 1.5 * round(effort_n / 1.5), CONTACT_M),
        # An effort at the limit of the approach need not rise before the squeeze: a soft object takes all of 11 N from
        # 60 mm on, and the fingers move on to 50 mm; the squeeze allows 25 N.
        (lambda effort_n, gap_m: effort_n if effort_n > 20.0 or gap_m > 0.06 else 11.0, 0.06),
    ],
)
def test_an_effort_that_rises_with_the_resistance_tells_the_contact(effort_of, contact_m):
    features = FEATURES.extract(grasp(effort_of))
    assert not features.reasons
    assert features["p_first"] == pytest.approx(contact_m, abs=1e-3 if contact_m == CONTACT_M else 5e-4)


def test_the_effort_that_starts_the_fingers_is_not_a_contact():
    gap_m = np.array([0.085, 0.085, 0.084, 0.080, 0.070, 0.0695])
    effort_n = np.array([0.0, 20.0, 7.0, 7.0, 15.0, 20.0])
    assert _without_start(gap_m, effort_n, 10.5).tolist() == [0.0, 0.0, 7.0, 7.0, 15.0, 20.0]
    touching = np.array([0.0, 20.0, 20.0, 20.0, 20.0, 20.0])
    assert _without_start(gap_m, touching, 10.5).tolist() == touching.tolist()
