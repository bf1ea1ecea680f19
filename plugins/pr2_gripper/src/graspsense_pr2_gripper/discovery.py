"""Finding the gripper among the HID devices of this machine."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from glob import glob
from importlib import import_module
from pathlib import Path

from attrs import frozen

from graspsense.plugin_api import FoundDevice, PluginUnavailable
from graspsense_pr2_gripper.config import Pr2Config

BACKEND = "pr2"
# On Linux the module `hid` goes through libusb, which takes the device from the kernel; `hidraw` shares it.
LIBRARY = "hidraw" if sys.platform == "linux" else "hid"


@frozen
class HidDevice:
    """A HID device as the operating system lists it: its serial number, and the node it is opened by."""

    serial: str
    path: str

    @property
    def readable(self) -> bool:
        """Whether this user may open it. Only Linux says so beforehand."""
        return sys.platform != "linux" or os.access(self.path, os.R_OK | os.W_OK)


@frozen
class Search:
    """What was looked for, and what there was: `matching` under the wanted numbers, `total` HID devices."""

    config: Pr2Config
    matching: tuple[HidDevice, ...]
    total: int

    @property
    def wanted(self) -> str:
        """The device looked for, as a person writes it."""
        serial = f" with serial number {self.config.serial!r}" if self.config.serial else ""
        return f"USB HID device {self.config.vendor_id:04x}:{self.config.product_id:04x}{serial}"

    @property
    def looked(self) -> str:
        """Where it was looked for, and what was seen there."""
        seen = f"looked with the module {LIBRARY} of hidapi, which lists {self.total} HID device(s)"
        if sys.platform != "linux":
            return seen
        return f"{seen}; nodes present: {', '.join(sorted(glob('/dev/hidraw*'))) or 'no /dev/hidraw*'}"


def search(config: Pr2Config) -> Search:
    """List the HID devices and keep those wanted. Raises PluginUnavailable where hidapi is missing."""
    try:
        listed = import_module(LIBRARY).enumerate()
    except ImportError as error:
        raise PluginUnavailable(
            f"the PR2 gripper needs the module {LIBRARY} of hidapi: {error}\n  try: pip install hidapi"
        ) from error
    matching = tuple(
        HidDevice(serial=one["serial_number"] or "", path=os.fsdecode(one["path"]))
        for one in listed
        if (one["vendor_id"], one["product_id"]) == (config.vendor_id, config.product_id)
        and config.serial in ("", one["serial_number"])
    )
    return Search(config, matching, len(listed))


def on_the_bus(config: Pr2Config) -> list[str]:
    """Return the places on the bus that have a device of these numbers, as Linux lists them without any library."""
    found = []
    for folder in glob("/sys/bus/usb/devices/*"):
        try:
            numbers = tuple(int((Path(folder) / one).read_text(), 16) for one in ("idVendor", "idProduct"))
        except (OSError, ValueError):
            continue
        if numbers == (config.vendor_id, config.product_id):
            found.append(os.path.basename(folder))
    return sorted(found)


def found_devices() -> Sequence[FoundDevice]:
    """Return the devices under the default numbers, as `graspsense devices` lists them."""
    return [
        FoundDevice(
            backend=BACKEND,
            serial=one.serial,
            where=one.path,
            ready=one.readable,
            advice=""
            if one.readable
            else f"no permission on {one.path}: `graspsense doctor` gives the udev rule",
        )
        for one in search(Pr2Config()).matching
    ]
