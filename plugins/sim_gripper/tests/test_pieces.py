"""Exact maps where a scene is not linear: curves in straight pieces, the linkage and friction as they are in the middle
of each tick. And what is compiled of a model: what it keeps."""

import math
from itertools import pairwise

import numpy as np
import pytest
from attrs import evolve
from hypothesis import given
from hypothesis import strategies as st
from selection import error_of

from graspsense.plugin_api import RunConfig, create
from graspsense_sim_gripper.batch import run_many
from graspsense_sim_gripper.batch.job import Job, chooser_of, composition_of
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.kernel import plant_of
from graspsense_sim_gripper.linear import move_of
from graspsense_sim_gripper.linear_scene import _straightened, linear_of
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.selection import BOLD, growth, tolerance
from graspsense_sim_gripper.setting import choice_of, set_scene, setting_of
from graspsense_sim_gripper.terms.registry import laws_of
from graspsense_sim_gripper.terms.rigid import TERM as RIGID
from graspsense_sim_gripper.terms.rigid import Rigid

CONFIG = SimConfig(spread=False, sensor="ideal", open_gap_m=0.0505)
SHELL = ("elastic", {"k1_n_m": 5e3, "k3_n_m3": 1e9})
ARM = ("maxwell", {"k_n_m": 3e3, "tau_s": 0.05})
HARD = ("rigid", {"hertz_n_m15": 1e7})
FOAM = ("foam", {"force_n": 20.0, "at_m": 0.005, "exponent": 2.0, "arm1_n_m": 2e3, "tau1_s": 0.1})
SURFACE = ("surface", {"mass_kg": 5.0, "k_n_m": 2e4, "damping_n_s_m": 50.0, "contact_n_m": 2e4})


def thing(*terms, **more):
    return ObjectSpec(name="thing", width_m=0.05, **{"friction": 0.0, "terms": terms, **more})


def in_pieces(config, spec):
    """Return the choice of a bold rung, by maps in thirty-two pieces."""
    choice = choice_of(config, spec, rung=BOLD, force_n=45.0)
    assert choice.pieces in (1, 32)
    return choice


def along(config, spec, efforts, *, pieces, speed_m_s=0.02):
    """Return gap and force at each tick under these efforts, by maps or by steps, and the last state."""
    choice = in_pieces(config, spec)
    if not pieces:
        fine = choice.steps._replace(tolerance=tolerance(1e-4), growth=growth(1e-4))
        choice = evolve(choice, pieces=0, steps=fine)
    setting = setting_of(config, spec, 0, chooser=lambda config, spec: choice)
    move, params = plant_of(laws_of(setting.kinds)), setting.plant
    found = linear_of(config, setting)
    assert (found is not None) == pieces
    if found is not None:
        params, shape = found
        move = move_of(setting.kinds, shape, move)
    state = setting.body._replace(speed_rev_s=-speed_m_s / setting.body.rate_m_rev)
    rows = []
    for effort in efforts:
        state = move(params, state, effort, setting.dt_s)
        rows.append((state.gap_m, state.left_n))
    return *np.array(rows).T, state


def efforts(ticks):
    """Yield efforts that press, swing, let go and press again."""
    for i in range(ticks):
        x = i / ticks
        swings = 25.0 + 12.0 * math.sin(0.05 * i)
        yield 25.0 if x < 0.35 else swings if x < 0.5 else 10.0 if x < 0.6 else -12.0 if x < 0.75 else 30.0


@given(reach=st.floats(1e-6, 1e-2), pieces=st.sampled_from([8, 16, 32]), place=st.floats(0.0, 1.0))
def test_the_pieces_of_a_curve_meet_and_are_as_near_to_it_as_is_said(reach, pieces, place):
    form = RIGID.linear(Rigid(1e7))
    found = _straightened([form], reach, pieces)
    assert len(found) == pieces
    knots = [reach * (k / pieces) ** 2 for k in range(1, pieces)]
    for d, (before, after) in zip(knots, pairwise(found), strict=True):
        one, other = (piece.offset_n + piece.slope_n_m * d for piece in (before, after))
        assert one == pytest.approx(other, rel=1e-9)
    d = reach * place
    piece = found[min(int(pieces * math.sqrt(place)), pieces - 1)]
    # A force that goes with d^1.5 bends by 3/4 of its slope over a root: 0.4 over the square of how many there are.
    assert abs(piece.offset_n + piece.slope_n_m * d - form.curve(d)) <= 0.4 / pieces**2 * form.curve(reach)


@pytest.mark.parametrize("transmission", ["pr2", "straight"])
@pytest.mark.parametrize(
    ("change", "spec"),
    [
        ({}, thing(SHELL, ARM)),
        ({}, thing(HARD)),
        ({}, thing(FOAM)),
        ({}, thing(SURFACE, SHELL)),
        ({"skin_creep_n_m": 2e4, "skin_damping_n_s_m": 50.0}, thing(SHELL)),
        ({"skin_n_m": math.inf}, thing(SHELL, ARM)),
        ({"drive_lag_s": 0.02}, thing(SHELL, ARM)),
        ({}, thing(SHELL, held=True)),
        ({"open_gap_m": 0.052}, thing(SHELL, ARM, offset_m=5e-4, friction=0.3, mass_kg=0.5)),
        ({"stribeck_m_s": 0.01, "breakaway_n": 12.0}, thing(SHELL)),
    ],
)
def test_pieces_agree_with_steps(change, spec, transmission):
    config = evolve(CONFIG, transmission=transmission, **change)
    ways = list(efforts(1200))
    gap, force, state = along(config, spec, ways, pieces=True)
    gap1, force1, state1 = along(config, spec, ways, pieces=False)
    assert force.max() > 10.0
    assert (force == 0.0).any()
    # In the free the fingers go 25 um a tick.
    np.testing.assert_allclose(gap, gap1, atol=5e-5)
    np.testing.assert_allclose(force, force1, atol=0.02 * force1.max())
    assert np.sqrt(np.mean((force - force1) ** 2)) < 0.005 * np.sqrt(np.mean(force1**2))
    assert state.peak_n == pytest.approx(state1.peak_n, rel=3e-3)
    assert state.unresolved == 0


def test_a_choice_in_pieces_is_as_exact_as_asked_for():
    """The toy is a power law with arms, the can a spring: under their own controller, on the PR2's linkage."""
    law = create("controller", "hybrid")
    for name, pieces in (("toy", 32), ("can:empty_open", 1)):
        config = SimConfig(object=name, spread=False, sensor="ideal")
        one, other = (
            run_many(evolve(config, fidelity=fidelity), law, [name], [0], compiled=False)[0]
            for fidelity in ("scene", "reference")
        )
        assert set_scene(config, name, 0, chooser_of(job_of(config, law))).choice.pieces == pieces
        error, quantity = error_of(one, other)
        assert error <= config.accuracy, (name, quantity)


def test_an_instance_by_its_number_has_the_model_of_all_of_its_kind():
    config = SimConfig(object="toy#2", spread=False, sensor="ideal")
    chooser = chooser_of(job_of(config, create("controller", "hybrid")))
    numbered, again = (set_scene(config, "toy#2", seed, chooser).choice for seed in (0, 1))
    spread = set_scene(evolve(config, spread=True), "toy", 0, chooser).choice
    assert numbered is again
    assert numbered.pieces == 0
    assert (numbered.made, numbered.steps) == (spread.made, spread.steps)


def job_of(config, law):
    return Job(config=config, controller=law, run=RunConfig(), draw=None, traces=True)


THINNED = """
summary = "a shell, and contents that are too little to matter"
width_m = 0.05

[[terms]]
type = "elastic"
k1_n_m = 2e4
k3_n_m3 = 1e9

[[terms]]
type = "slosh"
mass_kg = 1e-6
frequency_hz = 10.0
damping_ratio = 0.1

[[terms]]
type = "loss"
damping_n_s_m = 500.0
"""


@pytest.mark.slow
@pytest.mark.parametrize("spread", [False, True])
def test_what_a_model_leaves_out_is_not_compiled_and_changes_no_bit(tmp_path, spread):
    pytest.importorskip("numba", reason="the compiled loop needs the extra `fast`")
    path = tmp_path / "thinned.toml"
    path.write_text(THINNED)
    law, config = create("controller", "hybrid"), SimConfig(object=str(path), spread=spread, sensor="ideal")
    setting = set_scene(config, str(path), 1, chooser_of(job_of(config, law)))
    assert setting.kinds == ("elastic", "loss", "slosh")
    assert "slosh" not in composition_of(config, setting).kinds
    plain, fast = (
        run_many(config, law, [str(path)], [1], compiled=compiled)[0] for compiled in (False, True)
    )
    assert fast.body == plain.body
    assert np.array_equal(fast.trace.force_left_n, plain.trace.force_left_n)
