"""What `run --explain-model` says that a scene would lose without a term is what a scene without it gives."""

import math

import pytest

from graspsense.cli.model_table import print_without
from graspsense.core.grasp.runner import run_grasp
from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend

pytestmark = pytest.mark.slow
SHELL = 'type = "elastic"\nk1_n_m = 1500.0\nk3_n_m3 = 2e6\n'
CREEP = 'type = "maxwell"\nk_n_m = 300.0\ntau_s = 0.3\n'
FOAM = 'type = "foam"\nforce_n = 8.0\nat_m = 0.01\nexponent = 1.5\narm1_n_m = 60.0\ntau1_s = 0.2\n'
SNAP = 'type = "snap"\nk1_n_m = 2000.0\ncritical_m = 2e-3\ndrop_n = 2.0\nfall_m = 5e-4\nk2_n_m = 4000.0\n'
DRY = 'type = "loss"\ndamping_n_s_m = 0.01\n'


def scene_of(*terms):
    return "\n".join(["width_m = 0.05", *(f"[[terms]]\n{term}" for term in terms)])


def kind_of(term):
    return term.split('"')[1]


def config_of(scene, **settings):
    return SimConfig(object=scene, spread=False, sensor="ideal", open_gap_m=0.055, **settings)


def explained(scene):
    backend = SimBackend(config_of(scene, explain=True))
    grasp = run_grasp(backend, create("controller", "hybrid"), RunConfig())
    return {row["term"]: row for row in grasp.report["model"]["without"]}


def features_of(scene):
    grasp = run_grasp(SimBackend(config_of(scene)), create("controller", "hybrid"), RunConfig())
    extracted = create("feature-set", "chitta").extract(grasp.trace).as_dict()
    return {**extracted, "peak": grasp.report["true_peak_force_n"]}


@pytest.mark.parametrize("terms", [(SHELL, FOAM), (SHELL, SNAP, DRY)], ids=["foam", "snap"])
def test_a_term_changes_what_a_scene_without_it_changes(terms):
    rows = explained(scene_of(*terms))
    assert set(rows) == {kind_of(term) for term in terms}
    without = terms[1]
    expected = features_of(scene_of(*(term for term in terms if term is not without)))
    row = rows[kind_of(without)]
    assert row["same_outcome"]
    assert set(row["changes"]) == set(expected)
    for feature, change in row["changes"].items():
        # The feature set reads values at ticks, and a rest lasts some ticks.
        assert change["without"] == pytest.approx(expected[feature], rel=0.02), feature
        scale = max(abs(change["value"]), 1e-9)
        assert change["change"] == pytest.approx((change["without"] - change["value"]) / scale, abs=1e-2)
    assert max(abs(change["change"]) for change in row["changes"].values()) > 0.02


def test_a_term_that_changes_nothing_can_be_left_out_and_one_that_breaks_the_grasp_is_said_to(capsys):
    rows = explained(scene_of(SHELL, DRY))
    print_without(rows.values(), 0.01)
    shown = capsys.readouterr().out
    assert max(abs(change["change"]) for change in rows["loss"]["changes"].values()) < 1e-3
    assert "loss" in shown
    assert "left out" in shown
    # Without its shell there is no object: the fingers meet nothing.
    assert not rows["elastic"]["same_outcome"]
    assert rows["elastic"]["changes"]["p_first"]["without"] is None
    assert "the outcome" in shown


def test_changes_are_those_of_the_pipelines_own_features():
    backend = SimBackend(config_of(scene_of(SHELL, CREEP), explain=True))
    backend.expect_features(create("feature-set", "curve"))
    grasp = run_grasp(backend, create("controller", "hybrid"), RunConfig())
    (row,) = [row for row in grasp.report["model"]["without"] if row["term"] == "maxwell"]
    names = {feature.name for feature in create("feature-set", "curve").features}
    assert {"peak"} < set(row["changes"]) <= names | {"peak"}
    changes = [change["change"] for change in row["changes"].values()]
    assert all(change is None or math.isfinite(change) for change in changes)
