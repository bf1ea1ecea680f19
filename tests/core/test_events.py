"""Events that a controller tells: of an inherited step, of a part of a trace, and of a grasp that is cut off."""

from __future__ import annotations

import subprocess
import sys
import textwrap

import pytest
from cases import every_case
from grippers import Scripted, bottle, squeezing

from graspsense.core.components.run_config import RunConfig
from graspsense.core.control.tick import events_of
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.errors import DeviceLost
from graspsense.core.values.signals import Phase
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController
from graspsense.recording.reader import read_recorded
from graspsense.store.recover import recover_store
from graspsense.store.store import Store


def step(params, state, reading):
    return HybridController.step(params, state, reading)


class Untold(HybridController):
    """The hybrid controller as a class that names no events, with a step that is not marked."""

    events = ()
    step = staticmethod(step)


class Inheriting(Untold):
    """A class that has no step of its own, and names the event of the state."""

    events = ("touched",)


def grasped(controller, gripper=Scripted):
    return run_grasp(gripper(squeezing, bottle), controller(HybridConfig()), RunConfig())


@pytest.mark.slow
def test_a_class_that_inherits_its_step_tells_its_events():
    class Renamed(HybridController):
        pass

    (event,) = grasped(Inheriting).trace.events
    assert (event.what, event.phase) == ("touched", Phase.SQUEEZE)
    # The class that it inherits from still tells none.
    assert grasped(Untold).trace.events == ()
    assert events_of(Inheriting.step) is not events_of(Untold.step)
    # One without events of its own inherits step and events.
    assert Renamed.step is HybridController.step
    assert [event.what for event in grasped(Renamed).trace.events] == ["contact"]


class Lost(Scripted):
    """A gripper that is lost shortly after both pads touched; `how` is what the loss raises."""

    how: type[BaseException] = DeviceLost

    def read(self, timeout_s):
        reading = super().read(timeout_s)
        self.touching = getattr(self, "touching", 0) + (reading.frame.force_left_n > 1.0)
        if self.touching == 100:
            raise self.how("gone")
        return reading


@every_case(("how", "outcome"), [(DeviceLost, "device lost"), (KeyboardInterrupt, "aborted")])
def test_a_grasp_that_is_cut_off_keeps_its_events(how, outcome):
    grasp = grasped(HybridController, type("Lost", (Lost,), {"how": how}))
    assert grasp.outcome.words == outcome
    assert [event.what for event in grasp.trace.events] == ["contact"]


KILLED = """
    import os, signal, sys
    from graspsense import load_pipeline
    from graspsense.core.components.registry import installed
    from graspsense.store.record_grasp import record_grasp
    from graspsense.store.store import Store

    class Killer:
        ticks = 0

        def take(self, reading, phase, command):
            self.ticks += phase >= 3
            if self.ticks == 200:
                os.kill(os.getpid(), signal.SIGKILL)

    settings = load_pipeline(options=["gripper.object=block", "classifier.type=none"]).settings
    with Store.open(sys.argv[1]) as store:
        record_grasp(store, settings, installed(), labels={}, origin="run", sinks=[Killer()])
"""


@pytest.mark.slow
def test_a_killed_grasp_keeps_its_events(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(KILLED), str(tmp_path / "trials")], check=False, timeout=120
    )
    assert done.returncode == -9
    with Store.open(tmp_path / "trials") as store:
        while (recovered := recover_store(store))[0].what == "busy":
            pass
        assert [recovery.what for recovery in recovered] == ["recovered"]
        recording = store.trial(1).recording
    trace = read_recorded(recording).trace()
    (event,) = trace.events
    assert (event.what, event.source, event.phase) == ("contact", "controller", Phase.SQUEEZE)
    assert event.t_s == trace.t_s[trace.phase == Phase.SQUEEZE][0]


def test_a_part_of_a_trace_has_the_events_until_then():
    trace = grasped(HybridController).trace
    touched = trace.t_s[trace.phase == Phase.SQUEEZE][0]
    assert [(event.what, event.t_s) for event in trace.events] == [("contact", touched)]
    assert trace.until(touched - 0.01).events == ()
