"""What an experiment prints about the choice of models: measured, and said plainly where nothing is saved."""

import re

import pytest

from graspsense.plugin_api import RunConfig, create
from graspsense_sim_gripper.backend import SimBackend
from graspsense_sim_gripper.batch.savings import in_words
from graspsense_sim_gripper.config import SimConfig


def test_a_choice_that_saves_time_says_from_how_many_grasps_on_it_pays():
    words = in_words([0.4e-3, 0.45e-3, 0.5e-3], 0.05, 1)
    assert words.startswith(
        "0.40 ms a grasp in the chosen models, 0.45 with every term, 0.50 in fixed steps of 1 ms"
    )
    # 0.1 ms less than fixed steps, which need no choice, for 50 ms.
    assert words.endswith("Choosing the models of 1 object takes 0.05 s, once, and pays from 500 grasps on")


@pytest.mark.parametrize("fixed_s", [0.4e-3, 0.3e-3])
def test_a_choice_that_saves_nothing_is_said_to_save_nothing(fixed_s):
    assert "It saves no time here" in in_words([0.4e-3, 0.6e-3, fixed_s], 0.05, 3)


@pytest.mark.parametrize(
    ("settings", "grasps"),
    [({"fidelity": "full"}, 60), ({"step_s": 1e-3}, 60), ({"compile": "never"}, 60), ({}, 10)],
    ids=["every term asked for", "forced steps", "interpreter", "few grasps"],
)
def test_nothing_is_measured_where_nothing_is_chosen_or_compiled(settings, grasps):
    gripper = SimBackend(SimConfig(**settings))
    scenes, seeds = ["toy"] * grasps, list(range(grasps))
    assert gripper.savings(create("controller", "hybrid"), scenes, seeds, RunConfig()) == ""


@pytest.mark.slow
def test_the_grasps_of_a_batch_are_measured_in_each_way():
    gripper = SimBackend(SimConfig())
    scenes, seeds = ["toy", "block"] * 30, list(range(60))
    words = gripper.savings(create("controller", "hybrid"), scenes, seeds, RunConfig())
    times = [float(one) for one in re.findall(r"\d+\.\d\d", words)[:3]]
    assert all(0.01 < ms < 100.0 for ms in times)
    assert "the models of 2 objects" in words
