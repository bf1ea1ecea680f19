"""The law for a gripper that closes by itself, on a body that does: it keeps going to its target between commands."""

import sys
from math import inf

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from parts import HandConfig

from graspsense import WiringError, load_pipeline
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.signals import EFFORT, FORCE, POSITION, VELOCITY, Command, Outcome, Phase, Reading
from graspsense.plugin_api import (
    Channel,
    DeviceLost,
    ObjectKind,
    SensorBackend,
    SensorBackendEntry,
    create,
    hookimpl,
)
from graspsense.plugins.controllers.force import ForceConfig, ForceController
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController
from graspsense.plugins.controllers.send_and_watch import SendAndWatchConfig, SendAndWatchController
from graspsense.plugins.controllers.velocity import VelocityConfig, closing_effort
from graspsense.simulator_api import CHANNELS, params_of
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
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                (PADLESS, "a hard object", "velocity"),
                (PADLESS, "a soft object", "force"),
                (WITH_PADS, "a hard object", "position"),
                (WITH_PADS, "a soft object", "velocity"),
            )
        ),
    ],
)
def test_it_approaches_gently_stops_raises_the_force_in_steps_and_waits_for_rest(names, thing, sends):
    body, grasp = grasped(names, thing, sends=sends)
    assert grasp.outcome is Outcome.STEADY, grasp.reason
    trace = grasp.trace
    kind = {"position": POSITION, "velocity": VELOCITY, "force": FORCE}[sends]
    closing = [
        command
        for command in body.sent
        if command.kind == kind and (kind == FORCE or command.effort_limit_n < 25.0)
    ]
    forces = [command.value if kind == FORCE else command.effort_limit_n for command in closing]
    assert list(dict.fromkeys(forces)) == [5.0, 10.0, 15.0, 20.0]
    approach = trace.phase == Phase.APPROACH
    assert -trace.velocity_m_s[approach].min() < 0.0105
    held = trace.effort_n[trace.phase == Phase.HOLD]
    assert held == pytest.approx(20.0, rel=0.1)
    # Until the first step, the fingers stay within what the approach presses.
    contact_s = trace.t_s[trace.phase == Phase.SQUEEZE][0]
    before_step = (trace.t_s >= contact_s) & (trace.t_s < contact_s + 0.1)
    assert trace.effort_n[before_step].max() < 8.0


def held_n(trace):
    return trace.force_left_n[trace.phase == Phase.HOLD][-1]


HYBRIDS = [{"sends": "position"}, {"sends": "position", "loop": "closed"}]


@every_case("keys", HYBRIDS)
@every_case("thing", ["a soft object", "a hard object"])
def test_hybrid_approaches_gently_and_raises_the_force_in_steps(thing, keys):
    body = Body(WITH_PADS, thing)
    grasp = run_grasp(body, HybridController(HybridConfig(**keys)), RUN)
    assert grasp.outcome is Outcome.STEADY, grasp.reason
    trace = grasp.trace
    assert -trace.velocity_m_s[trace.phase == Phase.APPROACH].min() < 0.0105
    closing = [command.effort_limit_n for command in body.sent if command.effort_limit_n < 25.0]
    assert [force for force in dict.fromkeys(closing) if force < 19.5] == [5.0, 10.0, 15.0]
    assert held_n(trace) == pytest.approx(20.0, abs=0.5)
    # Until the first step, the fingers stop where both pads touched.
    contact_s = trace.t_s[trace.phase == Phase.SQUEEZE][0]
    assert trace.force_left_n[(trace.t_s >= contact_s) & (trace.t_s < contact_s + 0.1)].max() < 8.0


class OwnLoop(SensorBackend):
    """The simulated gripper as one that closes to a target on its own at 1 kHz, and answers at a lower rate."""

    accepts = ("position",)
    closes_itself = {"position": "the target, with its speed and force"}  # noqa: RUF012
    body_hz = 1000.0
    friction_n = 7.0
    """What the own loop adds to the force that it is sent, so that this force reaches the fingers."""
    near_s = 0.02
    """The own loop slows down over the way of this time at its speed."""

    def __init__(self, body, rate_hz):
        super().__init__(body.config)
        self._body, self._rate_hz, self._ticks = body, rate_hz, round(self.body_hz / rate_hz)
        self._loop = params_of(VelocityConfig())

    @property
    def channels(self):
        return tuple(
            evolve(channel, rate_hz=min(channel.rate_hz, self._rate_hz)) for channel in self._body.channels
        )

    def open(self, seed):
        self._integral_n, self._last, self._command = 0.0, None, None
        return evolve(self._body.open(seed), rate_hz=self._rate_hz, channels=self.channels)

    def read(self, timeout_s):
        for _ in range(1 if self._last is None else self._ticks):
            if self._last is not None:
                self._body.apply(self._effort(self._last.frame))
            self._last = self._body.read(timeout_s)
        frame = self._last.frame
        return self._last._replace(frame=frame._replace(dt_s=1.0 / self._rate_hz))

    def apply(self, command):
        self._command = command

    def tare(self, images):
        self._body.tare(images)

    def close(self):
        self._body.close()

    def _effort(self, frame):
        kind, target_m, force_n, speed_m_s = self._command
        if kind != POSITION:
            return self._command
        speed = min(max((frame.gap_m - target_m) / self.near_s, -speed_m_s), speed_m_s)
        loop = self._loop._replace(closing_speed_m_s=speed)
        effort, integral = closing_effort(loop, self._integral_n, frame.velocity_m_s, 1.0 / self.body_hz)
        most_n = force_n + self.friction_n
        if abs(effort) < most_n:
            self._integral_n = integral
        return Command(EFFORT, min(max(effort, -most_n), most_n), inf, inf)


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [100.0, pytest.param(1000.0, marks=pytest.mark.slow)])
def test_hybrid_with_the_simulated_body_behind_such_an_interface(rate_hz):
    body = OwnLoop(create("sensor-backend", "sim", object="block"), rate_hz)
    grasp = run_grasp(body, HybridController(HybridConfig(sends="position")), RunConfig(seed=1))
    assert grasp.outcome is Outcome.STEADY, grasp.reason
    trace = grasp.trace
    assert -trace.velocity_m_s[trace.phase == Phase.APPROACH].min() < 0.0125
    contact_s = trace.t_s[trace.phase == Phase.SQUEEZE][0]
    # The drive of this body takes 7 N, and what is left of the force is on the pads.
    assert trace.force_left_n[(trace.t_s >= contact_s) & (trace.t_s < contact_s + 0.1)].max() < 10.0
    assert 10.0 < held_n(trace) < 21.0


@pytest.mark.parametrize(
    "law", [HybridController, pytest.param(SendAndWatchController, marks=pytest.mark.slow)]
)
def test_an_approach_with_the_force_of_the_squeeze_closes_on_after_the_contact(law):
    config = {HybridController: HybridConfig, SendAndWatchController: SendAndWatchConfig}[law]
    body = Body(WITH_PADS)
    grasp = run_grasp(body, law(config(sends="position", approach_force_n=20.0)), RUN)
    assert grasp.outcome is Outcome.STEADY, grasp.reason
    assert held_n(grasp.trace) == pytest.approx(20.0, abs=0.5)


@pytest.mark.parametrize("sends", ["position", "force"])
def test_force_sends_its_force_with_the_closed_position(sends):
    body = Body(WITH_PADS, "a hard object", width_m=0.05)
    grasp = run_grasp(body, ForceController(ForceConfig(sends=sends)), RUN)
    assert grasp.outcome is Outcome.STEADY, grasp.reason
    assert held_n(grasp.trace) == pytest.approx(20.0, abs=0.5)
    closing = body.sent[len(body.sent) // 4]
    assert closing[:2] == ((POSITION, 0.0) if sends == "position" else (FORCE, 20.0))


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
            self.sent.append(command)
            closes = command.kind == EFFORT and command.value >= 0.0
            super(Body, self).apply(Command(POSITION, 0.0, 20.0, 0.136) if closes else command)

    body = Rushing(WITH_PADS, "nothing")
    grasp = run_grasp(body, ForceController(ForceConfig()), RunConfig())
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


class Plugin:
    GRASPSENSE_API = (2, 0)

    @hookimpl
    def graspsense_sensor_backends(self):
        yield SensorBackendEntry(name="closing-hand", target=f"{__name__}:Hand", summary="closes by itself")


@pytest.fixture
def pipeline(monkeypatch):
    monkeypatch.setitem(sys.modules, __name__, HERE)
    with IsolatedPlugins(Plugin()) as plugins:

        def pipeline(*options):
            fixed = ["gripper.type=closing-hand", "features.type=chitta", "classifier.type=none"]
            return load_pipeline(options=[*fixed, "run.first_effort_n=30", *options], plugins=plugins)

        yield pipeline


def test_what_its_commands_become_is_told_with_the_grasp(pipeline):
    notes = pipeline("controller.type=send-and-watch", "controller.sends=velocity").grasp().device.notes
    assert "the gripper closes by itself: a velocity becomes a far target" in notes
    assert any(note.startswith("as a velocity, the controller sends the closing speed") for note in notes)


SENT = {
    "hybrid": ("position", "velocity"),
    "velocity": ("position", "velocity"),
    "force": ("position", "force"),
    "send-and-watch": ("position", "velocity", "force"),
}


@every_case(("law", "sends"), [(law, kind) for law, kinds in SENT.items() for kind in kinds])
def test_what_every_law_becomes_is_told(pipeline, monkeypatch, law, sends):
    def lost(self, timeout_s):
        raise DeviceLost("its cable was pulled")

    monkeypatch.setattr(Hand, "read", lost)  # it is told before anything moves
    notes = pipeline(f"controller.type={law}", f"controller.sends={sends}").grasp().device.notes
    assert any(f"as a {sends}, the controller sends" in note for note in notes)


@pytest.mark.parametrize("law", ["hybrid", "send-and-watch"])
def test_steps_shorter_than_the_delay_of_a_command_are_refused(pipeline, law, monkeypatch):
    monkeypatch.setattr(Hand, "command_delay_s", 0.15)
    options = [f"controller.type={law}", "controller.sends=position"]
    with pytest.raises(WiringError, match="150 ms"):
        pipeline(*options)
    notes = pipeline(*options, "controller.step_time_s=0.2").grasp().device.notes
    assert "the gripper acts on a command up to 150 ms after it is sent" in notes


def test_an_effort_is_refused_where_the_gripper_closes_by_itself(pipeline):
    with pytest.raises(WiringError, match=r"graspsense/force .*effort"):
        pipeline("controller.type=send-and-watch", "controller.type=force")


def test_its_settings_are_checked(pipeline):
    with pytest.raises(ConfigError, match="sends"):
        pipeline("controller.type=send-and-watch", "controller.sends=effort")
    assert np.isfinite(SendAndWatchController(SendAndWatchConfig()).params().closing_speed_m_s)
