"""Spreads of single parameters between objects: claimed where there are some, and not claimed where there are none."""

import math
import tomllib

import numpy as np
import pytest
from attrs import evolve
from squeezes import WIDTH_M, grasped, ready

from graspsense_identify.fit import Fitted
from graspsense_identify.forward import ForwardModel
from graspsense_identify.individual import alone
from graspsense_identify.laws import DataScale, memories, static_candidates
from graspsense_identify.random_effects import between, own_spreads
from graspsense_identify.run import identify
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.pads import PadCompliance

MODEL = ForwardModel(pads=PadCompliance(15000.0, 0.0, 0.0, 1.0))
OBJECTS = 6
NOISE = 0.0025
"""Of the peak, as of PR2 pads."""


def of_objects(law, values, varying, spread, seed):
    """Return the fit of the common values to noisy squeezes of objects whose stiffness differs by 10 %, and a parameter
    by its spread."""
    rng = np.random.default_rng(seed)
    squeeze = ready(period_s=1.0 / 60.0)
    factors = np.exp(0.1 * rng.standard_normal(OBJECTS))
    squeezes = []
    for k, factor in enumerate(factors):
        own = list(values)
        own[varying] *= math.exp(spread * rng.standard_normal())
        forces = MODEL.forces(squeeze, law, own, WIDTH_M, float(factor))
        noisy = forces + NOISE * forces.max() * rng.standard_normal(len(forces))
        squeezes.append(evolve(squeeze, force_n=noisy, instance=f"cup#{k}"))
    of_each = {"squeezes": squeezes, "widths_m": (WIDTH_M,) * OBJECTS, "factors": tuple(factors.tolist())}
    return Fitted(model=MODEL, candidate=law, values=tuple(values), residuals=np.zeros(1), **of_each)


def laws():
    squeeze = ready(period_s=1.0 / 60.0)
    scale = DataScale(squeeze.peak_n, squeeze.depth_m, 0.4, 1.4, 1.0 / 60.0)
    spring, _, stiffening = static_candidates(scale)[:3]
    relaxing = spring.joined(memories(scale)[1])
    return {"tau_s": (relaxing, (900.0, 500.0, 0.2), 2), "k3_n_m3": (stiffening, (800.0, 1.5e7), 1)}


def claimed(name, spread, seed):
    law, values, varying = laws()[name]
    fitted = of_objects(law, values, varying, spread, seed)
    spreads = own_spreads(fitted, alone(fitted), 0.0)
    return {spread.name.split(".")[1]: spread for spread in spreads}


@pytest.mark.slow
def test_scatter_that_the_errors_make_is_not_claimed_and_other_scatter_is():
    rng = np.random.default_rng(0)
    errors = np.array([0.02, 0.05, 0.1, 0.03, 0.04])
    null = [between(errors * rng.standard_normal(5), errors**2, 0.05) for _ in range(1000)]
    # Two standard deviations of the number of 1000 tests of probability 0.05.
    assert sum(scatter is not None for scatter in null) == pytest.approx(50, abs=14)
    held = [
        scatter
        for _ in range(300)
        if (scatter := between(np.hypot(0.3, errors) * rng.standard_normal(5), errors**2, 0.05))
    ]
    assert len(held) > 285
    covered = sum(index.low <= 0.3 <= index.high for index in held)
    assert covered / len(held) == pytest.approx(0.9, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tau_s", "k3_n_m3"])
def test_a_parameter_that_varies_has_a_spread_and_no_other_has(name):
    claims = [claimed(name, 0.3, seed) for seed in range(10)]
    assert sum(name in claim for claim in claims) >= 9
    # Their interval for the true spread is of probability 0.9.
    assert sum(claim[name].low <= 0.3 <= claim[name].high for claim in claims if name in claim) >= 7
    assert sum(bool(claim.keys() - {name}) for claim in claims) <= 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tau_s", "k3_n_m3"])
def test_where_only_the_stiffness_varies_no_other_spread_is_claimed(name):
    # With the probability 0.05, more than four of twenty are claimed once in 400 times.
    assert sum(bool(claimed(name, 0.0, seed)) for seed in range(20)) <= 4


def test_objects_without_names_have_no_spreads_of_their_own():
    law, values, varying = laws()["k3_n_m3"]
    fitted = of_objects(law, values, varying, 0.3, 0)
    nameless = evolve(fitted, squeezes=[evolve(squeeze, instance="") for squeeze in fitted.squeezes])
    assert alone(nameless) == []
    assert own_spreads(nameless, [], 0.0) == []


@pytest.mark.slow
def test_the_scene_of_objects_that_relax_at_different_rates_has_the_spread_and_is_taken_by_the_simulator():
    scene = (
        'width_m = 0.05\n[[terms]]\ntype = "elastic"\nk1_n_m = 1200.0\n'
        '[[terms]]\ntype = "maxwell"\nk_n_m = 500.0\ntau_s = 0.2\nspread = { tau_s = 0.4 }\n'
    )
    gripper = {"sensor": "ideal"}
    squeezes = grasped([f"{scene}#{k}" for k in range(4)], gripper)
    recordings = [evolve(squeeze, label="cup", instance=f"cup#{k}") for k, squeeze in enumerate(squeezes)]
    result = identify(SimConfig(), recordings, lambda *_: None)
    (spread,) = [parameter for parameter in result.parameters if parameter.name.endswith(".spread")]
    assert spread.name == "maxwell.tau_s.spread"
    assert spread.low < 0.4 < spread.high
    (maxwell,) = [term for term in tomllib.loads(result.scene)["terms"] if term["type"] == "maxwell"]
    assert maxwell["spread"] == {"tau_s": pytest.approx(spread.value, rel=1e-4)}
    grasped([result.scene], gripper)
