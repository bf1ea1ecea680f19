"""Grasps that compiled code draws are, to the bit, those that `build.instantiate` gives."""

from functools import cache
from itertools import product

import pytest
from cases import every_case
from hypothesis import given, settings
from hypothesis import strategies as st

from graspsense.core.components.run_config import RunConfig
from graspsense.core.values.errors import ConfigError
from graspsense.plugin_api import create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.propose import grip_of, propose
from graspsense_sim_gripper.run.batch.job import Job, started
from graspsense_sim_gripper.run.batch.scenes import (
    Scenes,
    compiled_drawing,
    draw_numbers,
    number_in,
    scene_key,
)
from graspsense_sim_gripper.run.build import build
from graspsense_sim_gripper.run.compiled.loop_code import loop_start
from graspsense_sim_gripper.run.compiled.padding import padded
from graspsense_sim_gripper.scene.library import catalogue
from graspsense_sim_gripper.scene.random_numbers import key_of

pytest.importorskip("numba", reason="grasps are drawn in compiled code with the extra `fast`")

HELD = """width_m = 0.04\nwidth_spread_m = 0.002\nstiffness_spread = 0.3\noffset_m = 0.001\noffset_spread_m = 0.001
share = 0.9\nshare_spread = 0.1\npatch = "point"\nheld = true
[[terms]]\ntype = "elastic"\nk1_n_m = 900.0\nk3_n_m3 = 1e6\nspread = { k3_n_m3 = 0.5 }
[[terms]]\ntype = "maxwell"\nk_n_m = 300.0\ntau_s = 0.2\nspread = { k_n_m = 0.2, tau_s = 0.4 }
"""
WIDE = """width_m = 0.084\nwidth_spread_m = 0.004
[[terms]]\ntype = "elastic"\nk1_n_m = 900.0\nk3_n_m3 = 0.0
"""
WORN = "odwalla_worn:empty_open#7"
NAMES = [*sorted(catalogue())[::4], "odwalla:full_open#3", WORN, HELD, f"{HELD}#4", WIDE, "none"]
CONFIGS = {
    "pads": SimConfig(),
    "ideal": SimConfig(sensor="ideal"),
    "no spread": SimConfig(spread=False),
    "few cells": SimConfig(pad_cells=5, pad_period_s=0.0161, transmission="pr2_paper"),
    "straight": SimConfig(transmission="straight", load_friction_coefficient=0.0, breakaway_n=3.0),
}
SEEDS = st.one_of(st.integers(0, 500), st.integers(0, 2**64 - 1))


def scenes_of(config):
    """Return the scenes with steps that no trial grasp verifies."""
    law, run = create("controller", "hybrid"), RunConfig()
    job = Job(config=config, controller=law, run=run, extract=None, traces=False)
    models = {}
    for name in NAMES:
        problem = build(config, name)
        if problem.spec is not None:
            models[scene_key(name)] = propose(problem, grip_of(problem))
    return Scenes(job, models)


@cache
def scenes_with(name):
    return scenes_of(CONFIGS[name])


@pytest.mark.slow
@every_case("config", CONFIGS)
@given(st.sampled_from([name for name in NAMES if name != WIDE]), st.lists(SEEDS, min_size=1, max_size=3))
@settings(max_examples=20)
def test_a_drawn_grasp_is_that_of_the_seed(config, name, seeds):
    scenes = scenes_with(config)
    drawn = scenes.find(name).drawn
    memory = drawn.memory()
    for drawing, seed in product((compiled_drawing(), draw_numbers), seeds):
        setup = padded(scenes.setup(name, seed))
        expected = loop_start(*started(scenes.job, setup))
        start = drawn.drawn(drawing, key_of(seed), number_in(name), memory)

        assert start.numbers.tobytes() == expected.numbers.tobytes()
        assert [array.tobytes() for array in start.arrays] == [array.tobytes() for array in expected.arrays]


def refusal(draw):
    """Return what is said against an instance that is drawn, or nothing."""
    try:
        draw()
    except ConfigError as error:
        return str(error)
    return ""


def test_an_instance_that_does_not_fit_is_refused_as_it_is_by_itself():
    scenes, drawing = scenes_with("ideal"), compiled_drawing()
    drawn = scenes.find(WIDE).drawn
    alone = [refusal(lambda seed=seed: scenes.setup(WIDE, seed)) for seed in range(40)]
    for seed, expected in enumerate(alone):
        key = key_of(seed)
        assert expected == refusal(lambda key=key: drawn.drawn(drawing, key, None, drawn.memory()))
    assert 0 < sum(map(bool, alone)) < 40


@pytest.mark.slow
def test_a_scene_is_drawn_of_which_one_grasp_does_not_fit():
    scenes = scenes_of(CONFIGS["ideal"])
    name = next(
        f"{WIDE}#{k}"
        for k in range(40)
        if all(refusal(lambda k=k, seed=seed: scenes.setup(f"{WIDE}#{k}", seed)) for seed in (0, 1))
    )
    assert scenes_of(CONFIGS["ideal"]).find(name).drawn.spec.file == scenes.find(WIDE).drawn.spec.file
