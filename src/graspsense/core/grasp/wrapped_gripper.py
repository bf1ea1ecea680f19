"""A gripper that is used through an object around it, which sees or changes what passes."""

from __future__ import annotations

from abc import update_abstractmethods
from typing import Any

from graspsense.core.components.roles import SensorBackend
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.signals import Command, Reading


class WrappedGripper(SensorBackend[Any]):
    """A gripper around `gripper`: all that a subclass does not define is that of `gripper`, also what it declares."""

    def __init__(self, gripper: SensorBackend[Any]) -> None:
        super().__init__(gripper.config)
        self.gripper = gripper

    def open(self, seed: int) -> DeviceInfo:
        """Open the gripper."""
        return self.gripper.open(seed)

    def read(self, timeout_s: float) -> Reading | None:
        """Read the gripper."""
        return self.gripper.read(timeout_s)

    def apply(self, command: Command) -> None:
        """Command the gripper."""
        self.gripper.apply(command)

    def close(self) -> None:
        """Close the gripper."""
        self.gripper.close()


def _of_gripper(name: str) -> property:
    return property(lambda wrapped: getattr(wrapped.gripper, name))


# Taken from the role, so that nothing that a gripper may declare is forgotten here.
for _name in set(vars(SensorBackend)) - set(vars(WrappedGripper)):
    if not _name.startswith("_"):
        setattr(WrappedGripper, _name, _of_gripper(_name))
update_abstractmethods(WrappedGripper)
