"""One law, three ways to run it: the runner, the plain loop and the compiled loop."""

import numpy as np
import pytest
from attrs import evolve, fields
from batches import run_many

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.plugin_api import Trace, create
from graspsense.simulator_api import bind
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.run.compiled.compose import sum_of
from graspsense_sim_gripper.run.compiled.jit import compile_part
from graspsense_sim_gripper.scene.library import catalogue
from graspsense_sim_gripper.scene.terms.elastic import Elastic, elastic
from graspsense_sim_gripper.scene.terms.loss import Loss, loss
from graspsense_sim_gripper.scene.terms.term import NoState

numba = pytest.importorskip("numba", reason="the compiled loop needs the extra `fast`")

HYBRID = create("controller", "hybrid")
TICK_BY_TICK = {"fidelity": "fixed"}
"""The settings with which no step lasts several ticks."""


def assert_same(trace, other):
    for name in {field.name for field in fields(Trace)} - {"units", "signals", "events"}:
        expected, given = (np.asarray(getattr(each, name), float) for each in (trace, other))
        np.testing.assert_allclose(given, expected, rtol=1e-9, atol=1e-15, err_msg=name)


@pytest.mark.parametrize(
    "controller", ["hybrid", *(pytest.param(law, marks=pytest.mark.slow) for law in ("velocity", "force"))]
)
def test_steps_over_several_ticks_give_the_features_of_single_ticks(controller):
    # Asked for is 1 %; the times of ticks are whole milliseconds.
    law, features = create("controller", controller), create("feature-set", "chitta")
    config = SimConfig(object="odwalla:full_closed", sensor="ideal")
    run = run_grasp(SimBackend(config), law, RunConfig(seed=5))
    many = run_many(config, law, [config.object], [5])[0]
    assert many.model.chosen.steps.macro_tolerance > 0.0
    assert run.outcome == many.outcome
    assert many.state.step.n_steps < 0.4 * len(run.trace.t_s)
    alone, among = (features.extract(trace).as_dict() for trace in (run.trace, many.trace))
    assert among == pytest.approx(alone, rel=0.01, abs=1e-3, nan_ok=True)


@pytest.mark.slow
@pytest.mark.parametrize("law_by_law", [False, pytest.param(True, marks=pytest.mark.long)])
@pytest.mark.parametrize(("number", "controller"), [(0, "velocity"), (1, "force"), (2, "hybrid")])
def test_every_object_and_law_gives_one_trace_plain_and_compiled(number, controller, law_by_law):
    """In CI each object has one of the laws, and each law a third of the objects."""
    law, names = create("controller", controller), sorted(catalogue())
    if not law_by_law:
        names = names[number::3]
    config = SimConfig(**TICK_BY_TICK)
    fast = run_many(config, law, names, range(len(names)), compiled=True)
    for seed, name in enumerate(names):
        run = run_grasp(SimBackend(evolve(config, object=name)), law, RunConfig(seed=seed))
        assert (run.outcome, name) == (fast[seed].outcome, name)
        assert_same(run.trace, fast[seed].trace)


# ------------------------------------------------------------------------- a law that cannot be compiled


def plain_only(params, state, reading):
    # An f-string of a float is outside the compiler's subset.
    label = f"{reading.frame.gap_m:.3f}"
    command, state = type(HYBRID).step(params, state, reading)
    return command._replace(value=command.value + 0.0 * len(label)), state


@pytest.mark.slow
def test_a_law_that_cannot_be_compiled_runs_plain_and_the_warning_says_why():
    class Odd(type(HYBRID)):
        step = staticmethod(plain_only)

    law, config = Odd(HYBRID.config), SimConfig(**TICK_BY_TICK)
    with pytest.warns(UserWarning, match=r"plain Python.*test_loop.py:\d+"):
        done = run_many(config, law, ["toy"] * 2, range(2), compiled=True)
    expected = run_many(config, HYBRID, ["toy"] * 2, range(2), compiled=False)
    for grasp, other in zip(done, expected, strict=True):
        assert_same(other.trace, grasp.trace)


# ------------------------------------------------------------------------------------------- sums of terms


def test_a_sum_of_many_terms_is_the_sum_of_each():
    laws = [elastic, loss, elastic, loss, elastic]
    params = (Elastic(1.0, 0.0), Loss(10.0), Elastic(100.0, 0.0), Loss(1e3), Elastic(1e4, 0.0))
    states = (NoState(),) * 5
    force, after = sum_of(laws)(params, states, 0.0, 1.0, 1.0, 1.0 / 1.0)
    assert force == pytest.approx(11111.0)
    assert after == states
    assert compile_part(sum_of(laws))(params, states, 0.0, 1.0, 1.0, 1.0 / 1.0)[0] == force
    assert sum_of([])((), (), 0.0, 1.0, 1.0, 1.0 / 1.0) == (0.0, ())


def test_bind_refuses_what_it_cannot_bind():
    with pytest.raises(TypeError, match="'nobody'"):
        bind(plain_only, nobody=1)
    with pytest.raises(TypeError, match="<built-in function len>"):
        bind(len)
