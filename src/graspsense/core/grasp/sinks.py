"""Who follows a grasp while it goes on: the sinks of its ticks, and the watcher that can end its squeeze."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from graspsense.core.components.roles import Viewer
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.features import Prediction
from graspsense.core.values.signals import Command, Frame, GraspEvent, Reading
from graspsense.core.values.trace import TraceRecorder

Tell = Callable[[float, int, str, Prediction | None], None]
"""Called with the time, the phase, a sentence and the prediction; None where there is none, for the reason told."""


class Watcher(Protocol):
    """What the runner shows each tick of a squeeze to, and asks whether to stop it."""

    def begin(self, recorder: TraceRecorder, info: DeviceInfo, tell: Tell) -> None:
        """Receive the recorder of the grasp, the opened gripper, and where to report predictions."""

    def watch(self, frame: Frame, phase: int) -> str:
        """Return the reason to stop the squeeze after this tick; empty if it goes on."""


class Sink(Protocol):
    """A receiver of every tick, such as a terminal or a recorder. It must not block.

    One that raises receives nothing more, and the reason of the outcome names it.
    """

    def take(self, reading: Reading, phase: int, command: Command) -> None:
        """Receive one tick."""


@runtime_checkable
class EventSink(Protocol):
    """A sink that also receives the events of a grasp. It must not block."""

    def event(self, event: GraspEvent) -> None:
        """Receive one event."""


@runtime_checkable
class DeviceSink(Protocol):
    """A sink that is told of the gripper before the fingers move."""

    def opened(self, device: DeviceInfo) -> None:
        """Receive the description of the opened gripper."""


@runtime_checkable
class PictureSink(Viewer, Protocol):
    """A sink that also receives pictures of the gripper, see `SensorBackend.see`."""
