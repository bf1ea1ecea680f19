"""The PR2 gripper as a sensor backend. This version looks for it; the driver for its reports comes later."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NoReturn, final

from graspsense.plugin_api import Command, DeviceInfo, DeviceLost, NoDevice, Pads, Reading, SensorBackend
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.discovery import search


@final
class Pr2Backend(SensorBackend[Pr2Config]):
    """Looks for the gripper and says what is missing; nothing can be read before it is open."""

    def open(self, seed: int) -> DeviceInfo:
        """Look for the gripper. Raises NoDevice, also where it is found, for want of a driver."""
        found = search(self.config)
        if not found.matching:
            raise NoDevice(
                f"no PR2 gripper: looked for {found.wanted}\n"
                f"  {found.looked}\n"
                "  try: plug it in and switch it on, then `graspsense devices`\n"
                "       other numbers: -o gripper.vendor_id=0x1209 -o gripper.product_id=0x0001\n"
                "       no gripper at hand: `graspsense run --gripper sim`"
            )
        paths = ", ".join(one.path for one in found.matching)
        raise NoDevice(
            f"the PR2 gripper was found ({found.wanted}, at {paths}), but this version of "
            "graspsense-pr2-gripper cannot drive it yet: it only looks for the device\n"
            "  try: a later version, or `graspsense run --gripper sim`"
        )

    def read(self, timeout_s: float) -> Reading | None:
        """Raise DeviceLost: it is never open."""
        self._not_open()

    def apply(self, command: Command) -> None:
        """Raise DeviceLost: it is never open."""
        self._not_open()

    def tare(self, images: Sequence[Pads]) -> None:
        """Raise DeviceLost: it is never open."""
        self._not_open()

    def close(self) -> None:
        """Do nothing: there is nothing to let go of."""

    def _not_open(self) -> NoReturn:
        raise DeviceLost("the PR2 gripper is not open")
