"""The law for a gripper that closes by itself, on a body that does: it keeps going to its target between commands."""

import sys
from math import inf

import pytest
from attrs import evolve
from cases import every_case
from parts import HandConfig, offering

from graspsense import WiringError, load_pipeline
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.signals import EFFORT, FORCE, POSITION, VELOCITY, Command, Outcome, Phase, Reading
from graspsense.plugin_api import Channel, DeviceLost, ObjectKind, SensorBackend, SensorBackendEntry
from graspsense.plugins.controllers.force import ForceConfig, ForceController
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController
from graspsense.plugins.controllers.send_and_watch import SendAndWatchConfig, SendAndWatchController
from graspsense.simulator_api import CHANNELS
from graspsense.testing.model_gripper import OBJECTS, ModelGripper

HERE = sys.modules[__name__]
WITH_PADS = ("gap", "velocity", "effort", "force_left", "force_right")
PADLESS = ("gap", "velocity", "effort")


class Body(ModelGripper):
    """The model gripper as one that closes by itself: a real one, which takes a target, a speed and a force.

    A command is carried out for ten ticks before the next one is looked at.
    """

    accepts = ("position", "velocity", "force")

    def __init__(self, names, thing="a soft object", clock="device", width_m=0.075):
        channels = frozenset(Channel(name, CHANNELS[name], 1000.0) for name in names)
        # A wider object than that of the bench, which is reached in 0.3 s at 10 mm/s instead of three.
        super().__init__(channels, 0.0 if thing == "nothing" else width_m, OBJECTS[thing][1])
        self._declared, self.clock, self.sent, self.k = tuple(channels), clock, [], 0

    @property
    def channels(self):
        return self._declared

    def open(self, seed):
        info = super().open(seed)
        opening = Command(POSITION, 0.078, inf, 0.05)
        relaxed = Command(VELOCITY, 0.0, inf, inf)
        self.now = relaxed
        return evolve(info, clock=self.clock, opening=opening, relaxed=relaxed)

    def apply(self, command):
        self.sent.append(command)
        if self.k % 10 == 0:
            self.now = command
        self.k += 1
        super().apply(self.now)


RUN = RunConfig(first_effort_n=100.0, hold_s=0.05)


def grasped(names=PADLESS, thing="a soft object", run=RUN, **keys):
    body = Body(names, thing)
    keys = {"pads": "force_left" in names, **keys}
    return body, run_grasp(body, SendAndWatchController(SendAndWatchConfig(**keys)), run)


@pytest.mark.parametrize(
    ("names", "thing", "sends"),
    [
        (PADLESS, "a soft object", "position"),
        (WITH_PADS, "a hard object", "force"),
        (PADLESS, "a hard object", "velocity"),
        pytest.param(WITH_PADS, "a soft object", "velocity", marks=pytest.mark.slow),
    ],
)
def test_it_approaches_gently_stops_raises_the_force_in_steps_and_waits_for_rest(names, thing, sends):
    body, grasp = grasped(names, thing, sends=sends)
    assert grasp.outcome is Outcome.STEADY, grasp.reason
    trace = grasp.trace
    if sends == "force":
        forces = [command.value for command in body.sent if command.kind == FORCE]
    else:
        forces = [command.effort_limit_n for command in body.sent if command.effort_limit_n < 25.0]
    assert list(dict.fromkeys(forces)) == [5.0, 10.0, 15.0, 20.0]
    assert -trace.velocity_m_s[trace.phase == Phase.APPROACH].min() < 0.0105
    assert trace.effort_n[trace.phase == Phase.HOLD] == pytest.approx(20.0, rel=0.1)
    # Until the first step, the fingers stay within what the approach presses.
    assert trace.effort_n[after_contact(trace)].max() < 8.0


def after_contact(trace):
    """Return which ticks are within the first 0.1 s of the squeeze."""
    contact_s = trace.t_s[trace.phase == Phase.SQUEEZE][0]
    return (trace.t_s >= contact_s) & (trace.t_s < contact_s + 0.1)


def held_n(trace):
    return trace.force_left_n[trace.phase == Phase.HOLD][-1]


@pytest.mark.slow
@every_case("keys", [{}, {"loop": "closed"}])
@every_case("thing", ["a soft object", "a hard object"])
def test_hybrid_approaches_gently_and_raises_the_force_in_steps(thing, keys):
    body = Body(WITH_PADS, thing)
    grasp = run_grasp(body, HybridController(HybridConfig(sends="position", **keys)), RUN)
    assert grasp.outcome is Outcome.STEADY, grasp.reason
    trace = grasp.trace
    assert -trace.velocity_m_s[trace.phase == Phase.APPROACH].min() < 0.0105
    closing = [command.effort_limit_n for command in body.sent if command.effort_limit_n < 25.0]
    assert [force for force in dict.fromkeys(closing) if force < 19.5] == [5.0, 10.0, 15.0]
    assert held_n(trace) == pytest.approx(20.0, abs=0.5)
    # Until the first step, the fingers stop where both pads touched.
    assert trace.force_left_n[after_contact(trace)].max() < 8.0


@pytest.mark.slow
@every_case(("sends", "command"), [("position", (POSITION, 0.0)), ("force", (FORCE, 20.0))])
def test_force_sends_its_force_with_the_closed_position(sends, command):
    body = Body(WITH_PADS, "a hard object", width_m=0.05)
    grasp = run_grasp(body, ForceController(ForceConfig(sends=sends)), RUN)
    assert grasp.outcome is Outcome.STEADY, grasp.reason
    assert held_n(grasp.trace) == pytest.approx(20.0, abs=0.5)
    assert body.sent[len(body.sent) // 4][:2] == command


def test_nothing_between_the_fingers_is_said():
    run = evolve(RUN, first_speed_m_s=0.1)
    _, grasp = grasped(thing="nothing", run=run, closing_speed_m_s=0.05)
    assert grasp.outcome is Outcome.NOTHING_THERE


def test_with_pads_that_do_not_both_feel_it_is_one_finger():
    class OnePad(Body):
        def read(self, timeout_s):
            reading = super().read(timeout_s)
            return Reading(reading.frame._replace(force_right_n=0.0), reading.pads, reading.signals)

    body = OnePad(WITH_PADS, "a hard object")
    grasp = run_grasp(body, SendAndWatchController(SendAndWatchConfig(pads=True)), RUN)
    assert grasp.outcome is Outcome.ONE_FINGER


def test_an_effort_that_becomes_a_fast_closing_ends_the_grasp():
    """A driver that turns an effort into a target without a speed: it rushes, and that is told."""

    class Rushing(Body):
        accepts = ("effort",)

        def apply(self, command):
            closes = command.kind == EFFORT and command.value >= 0.0
            super(Body, self).apply(Command(POSITION, 0.0, 20.0, 0.136) if closes else command)

    grasp = run_grasp(Rushing(WITH_PADS, "nothing"), ForceController(ForceConfig()), RunConfig())
    assert grasp.outcome is Outcome.ABORTED
    assert "fingers rush" in grasp.reason
    assert "run.first_speed_m_s" in grasp.reason
    rushed = grasp.trace.t_s[grasp.trace.velocity_m_s < -0.045]
    assert rushed[-1] - rushed[0] < 0.2


class Hand(Body, SensorBackend[HandConfig]):
    """The same body as a plugin."""

    channels = tuple(Channel(name, CHANNELS[name], 1000.0) for name in WITH_PADS)
    closes_itself = {  # noqa: RUF012
        "position": "the target with force and speed",
        "velocity": "a far target",
        "force": "closing with this force",
        "effort": "a far target without a speed",
    }
    accepts = ("position", "velocity", "force", "effort")

    def __init__(self, config):
        Body.__init__(self, WITH_PADS)
        self.config = config

    def objects(self):
        return (ObjectKind(name="cup"),)


PLUGIN = offering(
    SensorBackendEntry(name="closing-hand", target=f"{__name__}:Hand", summary="closes by itself")
)


@pytest.fixture
def pipeline(monkeypatch):
    monkeypatch.setitem(sys.modules, __name__, HERE)
    with IsolatedPlugins(PLUGIN) as plugins:

        def pipeline(law, *options):
            fixed = ["gripper.type=closing-hand", "features.type=chitta", "classifier.type=none"]
            fixed += ["run.first_effort_n=30", f"controller.type={law}"]
            return load_pipeline(options=[*fixed, *options], plugins=plugins)

        yield pipeline


@every_case(
    ("law", "kinds"),
    [
        ("hybrid", ("position", "velocity")),
        ("velocity", ("position", "velocity")),
        ("force", ("position", "force")),
        ("send-and-watch", ("position", "velocity", "force")),
    ],
)
def test_what_every_law_becomes_is_told(pipeline, monkeypatch, law, kinds):
    def lost(self, timeout_s):
        raise DeviceLost("its cable was pulled")

    monkeypatch.setattr(Hand, "read", lost)  # it is told before anything moves
    for sends in kinds:
        notes = pipeline(law, f"controller.sends={sends}").grasp().device.notes
        assert any(f"as a {sends}, the controller sends" in note for note in notes), sends
        assert any(f" {sends} becomes {Hand.closes_itself[sends]}" in note for note in notes)


@pytest.mark.slow
@every_case("law", ["hybrid", "send-and-watch"])
def test_steps_shorter_than_the_delay_of_a_command_are_refused(pipeline, law, monkeypatch):
    monkeypatch.setattr(Hand, "command_delay_s", 0.15)
    with pytest.raises(WiringError, match="150 ms"):
        pipeline(law, "controller.sends=position")
    notes = pipeline(law, "controller.sends=position", "controller.step_time_s=0.2").grasp().device.notes
    assert any("150 ms" in note for note in notes)


def test_an_effort_is_refused_where_the_gripper_closes_by_itself(pipeline):
    with pytest.raises(WiringError, match=r"graspsense/force .*effort"):
        pipeline("force")


def test_its_settings_are_checked(pipeline):
    with pytest.raises(ConfigError, match="sends"):
        pipeline("send-and-watch", "controller.sends=effort")
