"""Free motion: ticks that are run at once give what every tick by itself gives, to the bit."""

import numpy as np
import pytest
from attrs import fields

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.plugin_api import Controller, Trace, create
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.run.batch import run_many
from graspsense_sim_gripper.scene.library import catalogue

CONTROLLERS = ("hybrid", "velocity", "force")
COLUMNS = [f.name for f in fields(Trace) if f.name not in ("units", "signals", "events")]


class CountingBackend(SimBackend):
    """A simulated gripper that counts the readings that the runner asks for."""

    reads = 0

    def read(self, timeout_s):
        self.reads += 1
        return super().read(timeout_s)


class Sink:
    """Keeps the times of the ticks that it is shown."""

    def __init__(self):
        self.times = []

    def take(self, reading, phase, command):
        self.times.append((reading.frame.t_s, phase, command.value))


def stepped(law):
    """Return the same controller without its law of free motion."""

    class Stepped(type(law)):
        free_motion = None

    return Stepped(law.config)


def assert_identical(left, other):
    assert left.outcome == other.outcome
    assert left.trace.events == other.trace.events
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(left.trace, name), getattr(other.trace, name), err_msg=name)


# In the quick run each controller, and each sensor, once.
@pytest.mark.parametrize(
    ("controller", "sensor"),
    [
        ("hybrid", "pads"),
        ("force", "ideal"),
        ("velocity", "pads"),
        *(
            pytest.param(*pair, marks=pytest.mark.slow)
            for pair in (("hybrid", "ideal"), ("force", "pads"), ("velocity", "ideal"))
        ),
    ],
)
def test_a_grasp_with_free_motion_is_the_grasp_tick_by_tick(controller, sensor):
    law = create("controller", controller)
    fast, slow = (CountingBackend(SimConfig(object="can:empty_open", sensor=sensor)) for _ in range(2))
    shown = Sink()
    leapt = run_grasp(fast, law, RunConfig(seed=3), sinks=[shown])
    every = run_grasp(slow, stepped(law), RunConfig(seed=3))
    assert_identical(leapt, every)
    fast_report, other = dict(fast.report()), dict(slow.report())
    # Verified by trial grasps of each controller, whose approach is in steps over several ticks with free motion only.
    selections = fast_report.pop("selection"), other.pop("selection")
    assert fast_report == other
    assert selections[0]["level"] == selections[1]["level"]
    assert selections[0]["steps"] == selections[1]["steps"]
    trace = leapt.trace
    assert shown.times == list(zip(trace.t_s, trace.phase, trace.command, strict=True))
    assert slow.reads >= len(trace.t_s)
    # Nearly everything but squeeze and hold is free motion.
    held = int(np.isin(trace.phase, (3, 4)).sum())
    assert fast.reads - held < 0.25 * (slow.reads - held)


# In CI one controller in the interpreter, where free motion is used.
@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["ideal", "pads"])
@pytest.mark.parametrize(
    "controller",
    ["hybrid", *(pytest.param(name, marks=pytest.mark.long) for name in CONTROLLERS if name != "hybrid")],
)
def test_free_motion_changes_no_bit_of_the_catalogue(controller, sensor):
    law, names = create("controller", controller), sorted(catalogue())
    # With steps over several ticks, the law of free motion serves whole approaches instead.
    config = SimConfig(sensor=sensor, fidelity="fixed")
    seeds = range(len(names))
    every = run_many(config, stepped(law), names, seeds, compiled=False)
    for workers in (1, 2):
        for free, tick_by_tick in zip(
            run_many(config, law, names, seeds, compiled=False, workers=workers), every, strict=True
        ):
            assert_identical(free, tick_by_tick)
            assert free.state == tick_by_tick.state


@pytest.mark.parametrize(
    "settings",
    [
        {"drive_lag_s": 0.01},
        {"object": "none"},
        pytest.param({"explain": True}, marks=pytest.mark.slow),
    ],
)
def test_settings_under_which_motion_is_not_free_give_the_same_too(settings):
    law = create("controller", "hybrid", closing_speed_m_s=0.03)
    config = SimConfig(**{"object": "block", "sensor": "ideal", **settings})
    grasps = [
        run_grasp(SimBackend(config), controller, RunConfig(seed=1)) for controller in (law, stepped(law))
    ]
    assert_identical(*grasps)


def test_a_subclass_with_another_step_does_not_inherit_the_law_of_free_motion():
    hybrid = type(create("controller", "hybrid"))

    def gentler(params, state, reading):
        command, state = hybrid.step(params, state, reading)
        return command._replace(value=0.9 * command.value), state

    class Gentler(hybrid):
        step = staticmethod(gentler)

    law = Gentler(create("controller", "hybrid").config)
    assert getattr(Gentler.step, "free_motion", None) is None
    backend = CountingBackend(SimConfig(object="block", sensor="ideal"))
    grasp = run_grasp(backend, law, RunConfig(seed=1))
    assert backend.reads >= len(grasp.trace.t_s)
    assert isinstance(law, Controller)
