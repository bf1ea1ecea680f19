"""A model is tried before it is used: levels from large to small tolerances, and a refusal where none suffices."""

import math
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from attrs import evolve, frozen
from cases import slow
from random_scenes import record_of

from graspsense.core.grasp.runner import run_grasp
from graspsense.core.learn.checkpoints import with_checkpoints
from graspsense.plugin_api import HOLD, Channel, ConfigError, Feature, FeatureSet, create
from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy import select as selection
from graspsense_sim_gripper.run.accuracy import verify
from graspsense_sim_gripper.run.accuracy.error import deviation
from graspsense_sim_gripper.run.accuracy.levels import CONTROLLED, PLAIN
from graspsense_sim_gripper.run.accuracy.propose import grip_of, propose
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.run.batch.job import Job, grasp_plain
from graspsense_sim_gripper.run.build import Problem, instantiate
from graspsense_sim_gripper.run.problem import GraspController
from graspsense_sim_gripper.run.sampled_loop import instability
from graspsense_sim_gripper.scene.library import catalogue, find
from graspsense_sim_gripper.scene.spec import ObjectSpec
from graspsense_sim_gripper.scene.terms import Term
from graspsense_sim_gripper.scene.terms.registry import TERMS

CONFIG = SimConfig(sensor="ideal", spread=False)
NEAR = evolve(CONFIG, open_gap_m=0.053, rate_hz=250.0)
"""The fingers close from 3 mm away on what is `made up`, in few ticks."""
UNSURE = ["peak", "trace", "features"]
SHELL = ("elastic", {"k1_n_m": 2000.0, "k3_n_m3": 2e6})


@pytest.fixture(autouse=True)
def _nothing_kept(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def hybrid(**settings):
    return GraspController(create("controller", "hybrid", **settings), RunConfig())


def selected(config, spec, controller):
    return select(Problem(config, spec), controller)


def thing(*terms):
    return ObjectSpec(name="made up", width_m=0.05, terms=terms)


@pytest.mark.slow
@pytest.mark.parametrize("accuracy", [0.1, 0.001])
def test_without_spread_the_trial_grasp_is_the_grasp_that_runs(accuracy):
    config, law = evolve(CONFIG, accuracy=accuracy, open_gap_m=0.062), hybrid()
    problem = Problem(config, find("odwalla:full_closed"))
    model = select(problem, law)
    trial = verify.trial_grasps(problem, law, compiled=False, padding=None)
    job = Job(config=config, controller=law.controller, run=law.run, extract=None, traces=True)
    ran = record_of(grasp_plain(job, instantiate(problem, model, 0)), 1.0 / config.rate_hz)
    assert deviation(trial.record(model), ran) == (0.0, "nothing")


@pytest.mark.parametrize(
    ("accuracy", "change", "part"),
    [slow(0.1, {"spread": True}, 0.5), slow(0.001, {"spread": True}, 0.5), slow(0.001, {}, 0.8)],
)
def test_a_verified_model_says_what_a_trial_grasp_found(accuracy, change, part):
    """Where the grasp is to differ from what is tried it has the rest of the accuracy."""
    config = evolve(CONFIG, accuracy=accuracy, open_gap_m=0.065, **change)
    model = selected(config, find("naked:full_open"), hybrid())
    assert model.verification.error <= part * accuracy
    assert model.verification.grasps >= 2
    assert model.as_values()["verified"].keys() == {"error", "quantity", "grasps", "features"}


@frozen
class Zero:
    force_n: float


class ForceAbove(FeatureSet[Zero]):
    """The steady force above a given one: the nearer this is, the more accurate the force has to be."""

    requires = (Channel("force_left", "N"),)
    features = (Feature("above", "", "Force at the end of the hold, less that of the setting."),)

    def extract(self, trace):
        held_n = float(trace.force_left_n[trace.phase == HOLD][-1])
        return self.result({"above": held_n - self.config.force_n})


RINGING = thing(SHELL, ("surface", {"mass_kg": 0.02, "k_n_m": 3e3, "damping_n_s_m": 0.5, "contact_n_m": 2e4}))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spec", "above_n", "flagged"), [(RINGING, 1.0, ()), (thing(SHELL), 1e-7, ("above",))]
)
def test_the_features_of_the_pipeline_are_verified_too(spec, above_n, flagged):
    law = hybrid()
    reference = evolve(CONFIG, fidelity="reference", accuracy=1e-4)
    setup = instantiate(Problem(reference, spec), selected(reference, spec, law), 0)
    job = Job(config=reference, controller=law.controller, run=law.run, extract=None, traces=True)
    trace = grasp_plain(job, setup).trace
    steady_n = ForceAbove(Zero(0.0)).extract(trace)["above"]
    theirs = evolve(law, features=ForceAbove(Zero(steady_n - above_n)))
    coarse, fine = (selected(CONFIG, spec, controller) for controller in (law, theirs))
    assert coarse.not_verified == ()
    assert fine.not_verified == flagged
    if not flagged:
        # Per cent of one newton, not of the twenty that the fingers press with.
        job = evolve(job, config=CONFIG)
        done = grasp_plain(job, instantiate(Problem(CONFIG, spec), fine, 0))
        assert theirs.features.extract(done.trace)["above"] == pytest.approx(above_n, rel=CONFIG.accuracy)


class Shaken(ForceAbove):
    """The same of a set that needs a signal which the simulator does not have."""

    requires = (Channel("force_left", "N"), Channel("acceleration", "m/s2"))


class Silent(ForceAbove):
    """A set that fails on every trace."""

    def extract(self, trace):
        raise ZeroDivisionError


@pytest.mark.slow
def test_features_that_no_trial_grasp_has_are_not_verified():
    without = selected(NEAR, thing(SHELL), hybrid())
    for kind in (Shaken, Silent):
        model = selected(NEAR, thing(SHELL), evolve(hybrid(), features=kind(Zero(0.0))))
        assert model.not_verified == ("features",), kind
        # No finer model is tried, since none would have them.
        assert model.steps == without.steps, kind


def test_features_at_checkpoints_are_verified_as_those_of_the_whole_grasp():
    features = with_checkpoints(create("feature-set", "chitta"), (0.2, 0.4))
    model = selected(NEAR, thing(SHELL), evolve(hybrid(), features=features))
    assert model.verification is not None
    assert model.not_verified == ()


@pytest.mark.slow
def test_selecting_that_takes_long_reports_how_far_it_is(monkeypatch, caplog):
    monkeypatch.setattr(verify, "PROGRESS_S", float("inf"))
    selected(CONFIG, thing(SHELL), hybrid())
    assert caplog.messages == []
    monkeypatch.setattr(verify, "PROGRESS_S", 0.0)
    selected(CONFIG, thing(SHELL, ("loss", {"damping_n_s_m": 1.0})), hybrid())
    assert any("simulation: 1 %" in message for message in caplog.messages)


class Ragged(NamedTuple):
    k_n_m: float


def ragged(params, state, d0, d1, h, v1):
    return params.k_n_m * d1 * (1.0 + 0.03 * math.log(1e-3 / h) if h > 0.0 else 1.0), state


@pytest.mark.slow
def test_a_law_that_hangs_on_its_steps_is_refused_by_name(monkeypatch):
    term = Term(name="ragged", summary="", params=Ragged, law=ragged)
    monkeypatch.setitem(TERMS, "ragged", term)
    spec = thing(SHELL, ("ragged", {"k_n_m": 1000.0}))
    # The finest levels would find the same, and take seconds in the interpreter.
    monkeypatch.setattr(selection, "CONTROLLED", CONTROLLED[:2])
    with pytest.raises(ConfigError) as refused:
        selected(CONFIG, spec, hybrid())
    for word in ("'made up'", "'ragged'", "gripper.accuracy", 'gripper.fidelity = "reference"'):
        assert word in str(refused.value)
    # As a reference it is what it is, and says that nothing was checked.
    assert selected(evolve(CONFIG, fidelity="reference"), spec, hybrid()).verification is None


STIFF = 'width_m = 0.05\n[[terms]]\ntype = "elastic"\nk1_n_m = 1e5\n[[terms]]\ntype = "loss"\ndamping_n_s_m = 200.0\n'


def course(config, contact_force_n):
    """Return a grasp of this config's object that squeezes from this force on."""
    law = create("controller", "hybrid", closing_speed_m_s=0.0125, contact_force_n=contact_force_n)
    grasp = run_grasp(SimBackend(config), law, RunConfig())
    state = SimpleNamespace(peak_n=grasp.report["true_peak_force_n"])
    ran = SimpleNamespace(outcome=grasp.outcome, trace=grasp.trace, state=state)
    return record_of(ran, 1.0 / config.rate_hz)


@pytest.fixture(scope="module")
def stiff():
    """Return a config, and the force (N) that its reference meets at a tick of the approach."""
    config = evolve(CONFIG, object=STIFF, accuracy=0.003, open_gap_m=0.06, pad_stiffness_n_m=3e4)
    reference = evolve(config, fidelity="reference")
    # No threshold above it changes it.
    felt = course(reference, 5.0).left_n
    met_n = float(felt[np.flatnonzero(felt >= 0.4)[0]])
    return config, met_n


@pytest.mark.slow
def test_a_threshold_that_is_met_at_a_tick_within_rounding_or_nearly_is_met_in_it_or_in_the_next(stiff):
    config, met_n = stiff
    reference = evolve(config, fidelity="reference")
    # It matters in which: squeezed a tick later, the grasp is another.
    error, _ = deviation(course(reference, met_n - 0.08), course(reference, met_n + 0.08))
    assert error > 2.0 * config.accuracy
    below, above = (course(reference, met_n + off_n) for off_n in (-1e-4, 1e-4))
    for off_n in (0.0, 1e-9, -1e-9):
        grasp = course(config, met_n + off_n)
        assert min(deviation(grasp, side)[0] for side in (below, above)) <= config.accuracy, off_n
    # Where it is nearly met, the reference decides.
    for off_n, expected in ((-1e-4, below), (1e-4, above)):
        assert deviation(course(config, met_n + off_n), expected)[0] <= config.accuracy, off_n


@pytest.mark.slow
def test_every_object_of_the_catalogue_has_a_model_of_ordinary_steps():
    for spec in catalogue().values():
        # Without spread, the trial grasps are among these, and may differ by more.
        config = evolve(CONFIG, spread=True, open_gap_m=min(spec.width_m + 0.01, CONFIG.open_gap_m))
        model = selected(config, spec, hybrid())
        assert model.verification is not None, spec.name
        ordinary = [scale.level(config.accuracy) for scale in (*PLAIN, CONTROLLED[0])]
        assert model.level in ordinary, spec.name


STIFF_AND_SLOW = thing(("elastic", {"k1_n_m": 5e5}), ("maxwell", {"k_n_m": 2e5, "tau_s": 0.01}))
DAMPED = thing(SHELL, ("loss", {"damping_n_s_m": 3e5}))
RIGID = {"pad_stiffness_n_m": math.inf}
SPREAD = {"spread": True, **RIGID}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spec", "config", "level", "part"),
    [
        (thing(SHELL), evolve(CONFIG, accuracy=1e-4), PLAIN[0], 0.8),
        (STIFF_AND_SLOW, evolve(CONFIG, accuracy=1e-4, **RIGID), CONTROLLED[0], 0.8),
        # The nominal object passes; with a wide spread, an instance does not.
        (thing(("elastic", {"k1_n_m": 1e5})), evolve(CONFIG, accuracy=1e-3, **SPREAD), PLAIN[0], 0.5),
        (
            evolve(thing(("elastic", {"k1_n_m": 1e5})), stiffness_spread=1.0),
            evolve(CONFIG, accuracy=1e-3, **SPREAD),
            CONTROLLED[0],
            0.5,
        ),
        # A damper makes a step per tick unstable.
        (DAMPED, evolve(NEAR, rate_hz=CONFIG.rate_hz, **RIGID), CONTROLLED[0], 0.8),
    ],
)
def test_a_step_per_tick_is_chosen_where_it_is_accurate_enough_and_not_where_it_is_not(
    spec, config, level, part
):
    model = selected(config, spec, hybrid())
    assert model.level == level.level(config.accuracy)
    assert model.verification.error <= part * config.accuracy
    if level is PLAIN[0] and not config.spread:
        # Steps without an estimate of their error are valid for the forces that were tried.
        assert model.valid_for(model.force_n)
        assert not model.valid_for(10.0 * model.force_n)


def test_gas_that_is_spent_is_reported():
    scene = (
        'width_m = 0.05\n[[terms]]\ntype = "elastic"\nk1_n_m = 500.0\n[[terms]]\ntype = "gas"\narea_m2 = 1e-3\n'
        "area_slope_m = 0.0\nvolume_m3 = 2e-6\npressure_pa = 101325.0\nexponent = 1.4\nbulge_m3_pa = 2e-9\n"
        "vent_m2 = 1e-5\n"
    )
    config = evolve(CONFIG, object=scene, open_gap_m=0.055, step_s=1e-3)
    for force_n, beyond in ((2.0, ""), (20.0, "gas: more than its volume was displaced")):
        law = create("controller", "hybrid", probing_force_n=force_n)
        told = run_grasp(SimBackend(config), law, RunConfig()).report["beyond"]
        assert told[: len(beyond) or None] == beyond


def test_trial_grasps_end_at_a_limit_of_work_and_the_grasp_runs(monkeypatch):
    monkeypatch.setattr(verify, "MOST_WORK", 2000)
    problem = Problem(CONFIG, ObjectSpec(name="shell", width_m=0.05, terms=(SHELL,)))
    chosen = select(problem, hybrid(closing_speed_m_s=0.0117))
    assert chosen.verification is None
    assert chosen.not_verified == tuple(UNSURE)
    told = next(d for d in chosen.decisions if d.subject == "trial grasps")
    assert "limit" in told.decision


SLOSH = '\n[[terms]]\ntype = "slosh"\nmass_kg = '


@pytest.mark.parametrize(
    ("terms", "further", "unsure"),
    [
        slow("k1_n_m = 1000.0", {}, []),
        ("k1_n_m = 1000.0", {"step_s": 1e-3}, UNSURE),
        slow("k1_n_m = 1000.0", {"fidelity": "reference"}, []),
        ("k1_n_m = 1e7", {"pad_stiffness_n_m": math.inf}, UNSURE[1:]),
        slow(f"k1_n_m = 1000.0{SLOSH}1.0\nfrequency_hz = 1e5", {}, UNSURE),
        # Too fast for its ticks: the finest trial grasps miss it too, and agree.
        slow(f"k1_n_m = 3200.0{SLOSH}0.05\nfrequency_hz = 1480.0", {"rate_hz": 465.0}, UNSURE),
    ],
)
def test_the_report_says_which_quantities_are_not_verified(terms, further, unsure):
    scene = f'width_m = 0.05\n[[terms]]\ntype = "elastic"\n{terms}\n'
    config = evolve(CONFIG, object=scene, open_gap_m=0.052, **further)
    hybrid, gripper = create("controller", "hybrid"), SimBackend(config)
    (grasped,) = gripper.run_many(hybrid, [scene], [0])
    assert run_grasp(gripper, hybrid, RunConfig()).report["not_verified"] == unsure
    assert grasped.report["not_verified"] == unsure


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gripper", "gain", "growth"),
    [
        # On a free mass of 1 kg, the gain times the tick may be at most 2 kg: 1 - 4 is -3.
        ({}, 1900.0, ""),
        ({}, 4000.0, "factor of 2.99"),
        ({"drive_lag_s": 1e-3}, 4000.0, "factor of 1.19"),
    ],
)
def test_an_unstable_sampled_loop_is_named_in_the_report(gripper, gain, growth):
    scene = 'width_m = 0.05\n[[terms]]\ntype = "elastic"\nk1_n_m = 1000.0\n'
    light = {"transmission": "straight", "moving_mass_kg": 1.0, **gripper}
    config = evolve(CONFIG, object=scene, open_gap_m=0.052, fidelity="fixed", **light)
    law = create("controller", "hybrid", velocity_gain_n_s_m=gain)
    report = run_grasp(SimBackend(config), law, RunConfig()).report
    (grasped,) = SimBackend(config).run_many(law, [scene], [0])
    assert grasped.report["unstable_loop"] == report["unstable_loop"]
    assert growth in report["unstable_loop"]
    assert bool(growth) == bool(report["unstable_loop"])


def test_no_object_of_the_catalogue_has_an_unstable_loop():
    for spec in catalogue().values():
        problem = Problem(CONFIG, spec)
        model = propose(problem, grip_of(problem))
        for name in ("hybrid", "velocity", "force"):
            controller = GraspController(create("controller", name), RunConfig())
            assert instability(instantiate(problem, model, 0), controller, model) == "", (spec.name, name)
