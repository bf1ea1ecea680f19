"""The steps of a scene: what they cannot resolve, and that they have the accuracy."""

import math

import numpy as np
import pytest
import random_scenes
import regimes
from attrs import evolve
from commands import answered

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.levels import PLAIN
from graspsense_sim_gripper.run.accuracy.propose import grip_of, propose
from graspsense_sim_gripper.run.build import Problem, instantiate
from graspsense_sim_gripper.scene.library import find
from graspsense_sim_gripper.scene.spec import ObjectSpec

CONFIG = SimConfig(sensor="ideal", spread=False)


def decided(term, config):
    """Return the decisions for an object of this term by their subjects."""
    problem = Problem(config, ObjectSpec(name="made up", width_m=0.05, terms=(term,)))
    return {decision.subject: decision for decision in propose(problem, grip_of(problem)).decisions}


def test_a_contact_too_stiff_for_the_tick_is_said_to_be():
    rigid = evolve(CONFIG, pad_stiffness_n_m=math.inf)
    soft, hard = (decided(("elastic", {"k1_n_m": k}), rigid)["contact"] for k in (1e5, 1e9))
    assert (soft.decision, hard.decision) == ("trace resolved", "trace not verified")
    assert hard.number > 1.0
    # Light as it is, what stands behind a contact does not make it less stiff.
    light = {"mass_kg": 1e-6, "k_n_m": 1e6, "damping_n_s_m": 0.2}
    for stiffness, said in ((1e6, "trace resolved"), (1e7, "trace not verified")):
        surface = ("surface", {**light, "contact_n_m": stiffness})
        assert decided(surface, rigid)["contact"].decision == said


def test_instances_share_the_steps_of_their_kind():
    problem = Problem(SimConfig(sensor="ideal"), find("odwalla:empty_open"))
    model = propose(problem, grip_of(problem))
    setup, other = (instantiate(problem, model, seed) for seed in (1, 2))
    assert setup.plant.steps == other.plant.steps == model.steps
    assert setup.terms != other.terms


def test_run_reports_each_decision_with_its_number():
    report = answered("run", "--object", "can:full_open")["report"]
    selection = report["selection"]
    assert (selection["accuracy"], selection["fidelity"], report["resolved"]) == (0.01, "scene", True)
    assert selection["level"] == PLAIN[0].level(0.01)._asdict()
    assert selection["verified"]["error"] <= 0.005
    # The probing force less friction.
    assert 10.0 < selection["expected_force_n"] < 25.0
    rows = {row["subject"]: row for row in selection["decisions"]}
    assert rows.keys() == {"steps", "contact"}
    assert all(row.keys() == {"subject", "decision", "what", "number"} for row in rows.values())


@pytest.fixture(scope="module")
def bench():
    return random_scenes.Bench()


def errors_of(row):
    """Return the error of each accuracy over it; a refusal has an infinite one."""
    return {accuracy: row[f"{accuracy:g}"]["error"] / accuracy for accuracy in regimes.ACCURACIES}


@pytest.mark.slow
@pytest.mark.parametrize("scenes", [8, pytest.param(20, marks=pytest.mark.long)])
def test_the_choice_keeps_its_word_on_random_scenes(bench, scenes):
    rows = [regimes.measured(bench, random_scenes.scene_of(number)) for number in range(scenes)]
    stable = [errors_of(row) for row in rows if row["stable"]]
    for accuracy in regimes.ACCURACIES:
        errors = [row[accuracy] for row in stable]
        assert np.mean(np.array(errors) <= 1.0) >= 0.95
        assert max(errors) <= 3.0


@pytest.mark.slow
@pytest.mark.parametrize("number", [24, 63, 69, 87, 128, 141, 198, 605, 1968, 2164])
def test_scenes_on_which_it_was_once_broken(bench, number):
    # Gas pressed out of its container, light surfaces that bounce, contacts that come to rest within a tick or two, a
    # second finger that meets what the first pushes or presses, a contact that is sensitive to the approach.
    row = regimes.measured(bench, random_scenes.scene_of(number))
    assert row["stable"]
    assert max(errors_of(row).values()) <= 1.0
