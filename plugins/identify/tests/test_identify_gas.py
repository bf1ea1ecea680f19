"""Gas in an object: the combinations that a squeeze determines, and what it does not."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from attrs import evolve
from squeezes import WIDTH_M, grasped, recorded

from graspsense_identify.choose import choose
from graspsense_identify.fit import fit
from graspsense_identify.forward import RIGID_PADS, ForwardModel
from graspsense_identify.gas import AREA_M2, combinations, without_combinations
from graspsense_identify.laws import DataScale, static_candidates
from graspsense_identify.prepare import prepared
from graspsense_identify.refuse import undetermined
from graspsense_identify.run import identify
from graspsense_identify.share import WHOLE
from graspsense_identify.spread import _scale_errors, uncertainty
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.contact import PadCompliance
from graspsense_sim_gripper.scene.terms.gas import Gas

AIR = {"area_slope_m": 0.0, "pressure_pa": 101325.0, "exponent": 1.0, "bulge_m3_pa": 0.0}


@pytest.mark.parametrize(
    "combined",
    [
        {"stiffness_n_m": 1500.0, "length_m": 0.012},
        {"stiffness_n_m": 1500.0, "resistance_n_s2_m2": 6000.0},
    ],
)
def test_a_gas_made_from_combinations_has_them(combined):
    own = without_combinations({"area_m2": AREA_M2, **AIR, **combined})
    assert combinations(Gas(**own)) == pytest.approx(combined)


def test_a_gas_that_is_hardly_compressed_is_not_told_from_a_spring():
    squeeze = prepared(recorded(), 0.0)
    depth = squeeze.depth_m
    scale = DataScale(squeeze.peak_n, depth, 0.4, 1.4, 0.01)
    model = ForwardModel(pads=RIGID_PADS)
    with_gas = static_candidates(scale)[-1]
    assert with_gas.name == "elastic (k1) + gas (closed)"
    rng = np.random.default_rng(0)
    for length, chosen in ((500.0, "elastic (k1)"), (1.5, "elastic (k1) + gas (closed)")):
        clean = model.forces(squeeze, with_gas, (300.0, 600.0, length * depth), WIDTH_M, 1.0)
        noisy = evolve(squeeze, force_n=clean + 0.005 * rng.standard_normal(len(clean)))
        done = choose(model, [noisy], scale, False, lambda done, total: None)
        assert done.fitted.candidate.name == chosen
    assert done.fitted.values == pytest.approx((300.0, 600.0, 1.5 * depth), rel=0.05)


def behind_pads(length, noise_n):
    """Return a squeeze of a shell with a closed gas behind fingertips that harden, and what made it."""
    squeeze = prepared(recorded(period_s=1.0 / 60.0), 0.0)
    depth = squeeze.depth_m
    model = ForwardModel(pads=PadCompliance(15000.0, 0.0, 0.0, 1.0, 0.002, 2.0))
    law = static_candidates(DataScale(squeeze.peak_n, depth, 0.4, 1.4, 0.01))[-1]
    true = (300.0, 600.0, length * depth)
    clean = model.forces(squeeze, law, true, WIDTH_M, 1.0)
    noise_n = noise_n * np.random.default_rng(0).standard_normal(len(clean))
    return evolve(squeeze, force_n=clean + noise_n), model, law, true


@pytest.mark.slow
def test_intervals_of_a_gas_are_wide_where_the_shell_and_the_gas_do_nearly_the_same():
    squeeze, model, law, true = behind_pads(3.0, 0.03)
    fitted = fit(model, law, [squeeze])
    intervals = uncertainty(fitted)
    assert all(
        low < value < high for low, value, high in zip(intervals.low, true, intervals.high, strict=True)
    )
    # The stiffness of the shell is not determined beside that of the gas.
    assert intervals.high[0] > 4.0 * intervals.low[0]
    (shell,) = [part for part in undetermined(fitted, intervals, WHOLE) if part.what == "elastic.k1_n_m"]
    assert "open" in shell.remedy


@pytest.mark.slow
def test_a_shell_that_the_fit_leaves_out_has_an_interval_in_proportion_to_the_force():
    squeeze, model, law, true = behind_pads(2.0, 0.02)
    softest = 1e-3
    none = evolve(fit(model, law, [squeeze]), values=(softest, 900.0, true[2]))
    assert uncertainty(none).high[0] > 100.0


def test_an_error_of_the_scale_of_the_force_changes_lengths_behind_compliant_fingertips():
    squeeze, model, law, _ = behind_pads(1.3, 0.0)
    errors = np.sqrt(np.diag(_scale_errors(fit(model, law, [squeeze]), 0.05)))
    assert errors[2] > 2e-3
    rigid = ForwardModel(pads=RIGID_PADS)
    errors = np.sqrt(np.diag(_scale_errors(fit(rigid, law, [squeeze]), 0.05)))
    assert errors == pytest.approx((0.05, 0.05, 0.0), abs=1e-4)


@pytest.mark.slow
def test_a_vented_gas_comes_back_by_its_combinations_and_says_what_is_conventional():
    true = Gas(area_m2=1.3e-3, volume_m3=1.1e-4, vent_m2=7e-7, **AIR)
    numbers = "\n".join(f"{key} = {value}" for key, value in true._asdict().items() if value != float("inf"))
    scene = (
        f'width_m = 0.05\n[[terms]]\ntype = "elastic"\nk1_n_m = 1300.0\n[[terms]]\ntype = "gas"\n{numbers}\n'
    )
    gripper = {"sensor": "ideal"}
    result = identify(SimConfig(), grasped([scene] * 3, gripper), lambda *_: None)
    assert [candidate.terms for candidate in result.candidates if candidate.chosen] == [
        "elastic (k1) + gas (vented)"
    ]
    named = {parameter.name: parameter for parameter in result.parameters}
    for name, value in combinations(true).items():
        assert named[f"gas.{name}"].value == pytest.approx(value, rel=0.05)
        assert named[f"gas.{name}"].low < value < named[f"gas.{name}"].high
    (gas,) = [term for term in tomllib.loads(result.scene)["terms"] if term["type"] == "gas"]
    assert gas["area_m2"] == AREA_M2
    (refused,) = [part for part in result.undetermined if part.what.startswith("gas")]
    assert "area_m2 = 0.001" in refused.reason
    # The scene is one that the simulator takes.
    grasped([result.scene], gripper)
