"""The features on curves whose answers can be written down."""

import math

import numpy as np
import pytest
from attrs import evolve

from graspsense.plugin_api import HOLD, create
from graspsense.testing_api import parametrize_checks, squeeze, with_channels


@parametrize_checks("graspsense-grasp-curve")
def test_conformance(check):
    check.run()


def curve(trace):
    return create("feature-set", "grasp-curve").extract(trace)


def pressed(law):
    """The sample grasp with the force that `law` gives for each compression (m), without relaxation."""
    trace = squeeze()
    force = np.array([law(max(0.06 - gap, 0.0)) for gap in trace.gap_m])
    return evolve(trace, force_left_n=force, force_right_n=force)


def test_a_linear_spring_has_a_ratio_of_one_and_gives_everything_back():
    features = curve(pressed(lambda d: 3000.0 * d))

    assert features["peak_force"] == pytest.approx(12.0, rel=1e-3)
    assert features["gap_at_peak"] == pytest.approx(0.056, abs=1e-5)
    assert features["stiffness_ratio"] == pytest.approx(1.0, rel=1e-6)
    # Between two images the force is a line, also over the instants at which a hold or a contact ends.
    assert features["hysteresis"] == pytest.approx(0.0, abs=0.06)
    assert features.reasons["relaxation_time"] == "the force lost less than 2% of its peak"


def test_a_stiffening_spring_has_the_ratio_of_its_law():
    # F = k d^3 from d1 = (0.625/k)^(1/3) to 4 mm; fits of d^3 over halves of the way, done by hand of numpy.
    k = 2e8
    d = np.linspace((0.625 / k) ** (1 / 3), 4e-3, 4001)
    half = 0.5 * (d[0] + d[-1])
    slopes = [np.polyfit(d[part], k * d[part] ** 3, 1)[0] for part in (d <= half, d >= half)]

    assert curve(pressed(lambda d: k * d**3))["stiffness_ratio"] == pytest.approx(
        slopes[1] / slopes[0], rel=0.02
    )


def test_a_force_that_is_an_image_old_does_not_give_back_more_than_was_put_in():
    trace = pressed(lambda d: 3000.0 * d)
    newest = np.searchsorted(trace.pad_t_s, trace.t_s, side="right") - 1
    held = trace.force_left_n[np.searchsorted(trace.t_s, trace.pad_t_s)][newest]

    stale = curve(evolve(trace, force_left_n=held, force_right_n=held))

    assert stale["hysteresis"] == pytest.approx(0.0, abs=0.06)


def test_what_is_kept_is_the_share_of_the_work():
    trace = pressed(lambda d: 3000.0 * d)
    back = np.where(trace.phase > HOLD, 0.4, 1.0)
    lossy = evolve(trace, force_left_n=trace.force_left_n * back, force_right_n=trace.force_right_n * back)

    assert curve(lossy)["hysteresis"] == pytest.approx(0.6, abs=0.06)


def test_the_relaxation_time_is_that_of_the_exponential():
    # The sample relaxes to 85 % with 0.1 s, over a hold of 0.4 s.
    seen = 0.1 * -math.log(1.0 - (1.0 - math.exp(-1.0)) * (1.0 - math.exp(-4.0)))

    assert curve(squeeze())["relaxation_time"] == pytest.approx(seen, abs=0.01)


def test_the_contact_is_where_the_cells_say():
    features = curve(squeeze())

    assert features["contact_row"] == pytest.approx(2.0, abs=0.01)
    assert 0.7 < features["contact_spread"] < 1.0
    lower = squeeze()
    rolled = np.zeros_like(lower.pad_left)
    rolled[:, 10:] = lower.pad_left[:, 7:-3]
    assert curve(evolve(lower, pad_left=rolled, pad_right=rolled))["contact_row"] > 2.5


def test_a_grasp_that_is_not_over_says_what_it_lacks():
    features = curve(squeeze().until(1.3))

    assert features.reasons["hysteresis"].startswith("the trace ends before the release")
    assert not math.isnan(features["peak_force"])


def test_a_gripper_without_cells_has_the_rest():
    features = curve(with_channels(squeeze(), {"gap", "force_left", "force_right"}))

    assert features.reasons["contact_area"] == "there are no cell images"
    assert features["peak_force"] > 10.0
