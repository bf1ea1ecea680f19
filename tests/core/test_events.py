"""Events that a controller tells: of an inherited step, of a part of a trace, and of a grasp that is cut off."""

from __future__ import annotations

from cases import every_case
from grippers import Scripted, bottle, squeezing

from graspsense.core.components.run_config import RunConfig
from graspsense.core.control.tick import events_of
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.errors import DeviceLost
from graspsense.core.values.signals import Phase
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController


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


def test_a_part_of_a_trace_has_the_events_until_then():
    trace = grasped(HybridController).trace
    touched = trace.t_s[trace.phase == Phase.SQUEEZE][0]
    assert [(event.what, event.t_s) for event in trace.events] == [("contact", touched)]
    assert trace.until(touched - 0.01).events == ()
