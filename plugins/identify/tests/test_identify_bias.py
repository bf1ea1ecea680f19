"""Errors that all squeezes have in common, which no scatter shows, and how wide intervals are."""

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from identify import SCENES, scene_text, squeezes_of
from scipy.stats import chi2, norm
from squeezes import ready

from graspsense_identify.fit import fit
from graspsense_identify.forward import RIGID_PADS, ForwardModel
from graspsense_identify.interval import NORMAL, interval_of_mean, student
from graspsense_identify.laws import scale_of, static_candidates
from graspsense_identify.parts import parts_of
from graspsense_identify.prepare import prepared
from graspsense_identify.share import measured_share
from graspsense_identify.spread import at_least, uncertainty
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.build import drive_and_pads


def squeeze_of(name, seed=7, **gripper):
    """Return a simulated squeeze of a scene of the benchmark, whose cells measure a share of 0.6 of the force."""
    text = scene_text(SCENES[name], 0.0).replace("share_spread = 0.01", "share_spread = 0.0")
    (squeeze,) = squeezes_of(text, name, gripper, ["1"], [seed])
    return squeeze


@pytest.mark.slow
@pytest.mark.parametrize("name", ["spring", "stiffening"])
def test_the_balance_of_energy_gives_the_share_of_the_cells_without_bias(name):
    # The friction is that of the settings: with a spread, it would scatter the share by 4 %.
    drive, _ = drive_and_pads(SimConfig())
    ideal = squeeze_of(name, sensor="ideal", coulomb_spread_n=0.0)
    assert measured_share(ideal.trace, prepared(ideal, 0.0), drive) == pytest.approx(1.0, rel=5e-4)
    squeezes = [squeeze_of(name, seed, sensor="pads", coulomb_spread_n=0.0) for seed in (7, 8)]
    shares = [measured_share(squeeze.trace, prepared(squeeze, 0.0), drive) for squeeze in squeezes]
    # The noise of the cells scatters the share of a squeeze by 0.3 %.
    assert np.mean(shares) == pytest.approx(0.6, rel=4e-3)


def coverage(squeezes, ratio):
    """Return the coverage of the interval of a mean by quadrature, for errors that are normal.

    The variance of a squeeze is `ratio` times that of its fit: 1 where the objects are alike.
    """
    degrees = squeezes - 1
    levels = (np.arange(2000) + 0.5) / 2000
    scatter = ratio * chi2.ppf(levels, degrees) / degrees
    least = np.array([[(NORMAL / student(degrees)) ** 2]])
    variances = np.array([at_least(np.array([[variance]]), least)[0, 0] for variance in scatter])
    half = np.sqrt(variances / ratio) * student(degrees)
    return float(np.mean(2.0 * norm.cdf(half) - 1.0))


@pytest.mark.slow
def test_a_stiffness_that_the_fit_leaves_out_has_an_interval_in_proportion_to_the_force():
    rng = np.random.default_rng(0)
    squeeze = ready(lambda closure: 2e7 * closure**3 + 0.02 * rng.standard_normal(len(closure)))
    cubic = static_candidates(scale_of([squeeze]))[2]
    fitted = fit(ForwardModel(pads=RIGID_PADS), cubic, [squeeze])
    none = evolve(fitted, values=(1e-3, fitted.values[1]))
    # The linearised change of the logarithm is thousands of times 1.
    assert 1.0 < uncertainty(none, parts_of(none)).high[0] < 100.0


@every_case("squeezes", [2, 3, 10])
@every_case("ratio", [1.0, 3.0, 100.0])
def test_an_interval_covers_at_least_what_it_says_however_much_objects_differ(squeezes, ratio):
    assert 0.899 < coverage(squeezes, ratio) < 0.98


def test_the_interval_of_a_mean_is_that_of_student():
    # t(2, 0.95) = 2.920, and the standard error of 1, 2, 3 is 1 / sqrt(3).
    low, high = interval_of_mean([1.0, 2.0, 3.0])
    assert (low + high) / 2.0 == pytest.approx(2.0)
    assert high - low == pytest.approx(2.0 * 2.91999 / np.sqrt(3.0), rel=1e-5)
    assert np.isnan(interval_of_mean([1.0])).all()
    assert pytest.approx(1.644854, rel=1e-6) == NORMAL
    assert student(10**6) == pytest.approx(NORMAL, rel=1e-5)
