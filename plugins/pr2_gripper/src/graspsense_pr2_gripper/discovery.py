"""Search for the gripper among the HID devices of this computer, and the udev rules that give access to it.

`uaccess` in a rule gives access to the user who is logged in at the machine.
"""

from __future__ import annotations

import os
import sys
from glob import glob
from importlib import import_module
from pathlib import Path
from typing import Final

from attrs import frozen

from graspsense.plugin_api import PluginUnavailable
from graspsense_pr2_gripper.config import Pr2Config

BACKEND = "pr2"
# On Linux the module `hid` uses libusb, which detaches the kernel driver; `hidraw` does not.
LIBRARY = "hidraw" if sys.platform == "linux" else "hid"
RULES_FILE: Final = "/etc/udev/rules.d/70-graspsense.rules"
"""Before 73-seat-late.rules, which is what gives `uaccess` its effect."""
RELOAD: Final = "sudo udevadm control --reload && sudo udevadm trigger"
UHID_RULE: Final = 'KERNEL=="uhid", SUBSYSTEM=="misc", TAG+="uaccess", OPTIONS+="static_node=uhid"'
"""For `graspsense emulate pr2` without root."""


@frozen
class HidDevice:
    """A HID device as the operating system lists it: its serial number, and the node that is opened."""

    serial: str
    path: str

    @property
    def readable(self) -> bool:
        """Whether the user has permission to open it. Only Linux can tell before opening."""
        return sys.platform != "linux" or os.access(self.path, os.R_OK | os.W_OK)


@frozen
class Search:
    """The result of a search: the devices with the USB ids of the config, and the number of all HID devices."""

    config: Pr2Config
    matching: tuple[HidDevice, ...]
    total: int

    @property
    def wanted(self) -> str:
        """The device of the config in words."""
        serial = f" with serial number {self.config.serial!r}" if self.config.serial else ""
        return f"USB HID device {self.config.vendor_id:04x}:{self.config.product_id:04x}{serial}"

    @property
    def looked(self) -> str:
        """How it was searched, and what exists, in words."""
        seen = f"searched with the module {LIBRARY} of hidapi, which lists {self.total} HID device(s)"
        if sys.platform != "linux":
            return seen
        return f"{seen}; nodes present: {', '.join(sorted(glob('/dev/hidraw*'))) or 'no /dev/hidraw*'}"


def search(config: Pr2Config) -> Search:
    """Return the HID devices with these USB ids and serial number. Raises PluginUnavailable without hidapi."""
    try:
        listed = import_module(LIBRARY).enumerate()
    except ImportError as error:
        raise PluginUnavailable(
            f"the PR2 gripper needs the module {LIBRARY} of hidapi: {error}\n  try: pip install hidapi"
        ) from error
    matching = tuple(
        HidDevice(serial=row["serial_number"] or "", path=os.fsdecode(row["path"]))
        for row in listed
        if (row["vendor_id"], row["product_id"]) == (config.vendor_id, config.product_id)
        and config.serial in ("", row["serial_number"])
    )
    return Search(config, matching, len(listed))


def on_the_bus(config: Pr2Config) -> list[str]:
    """Return the places on the USB bus with a device of these USB ids, as Linux lists them without a library."""
    places = []
    for folder in glob("/sys/bus/usb/devices/*"):
        try:
            numbers = tuple(
                int((Path(folder) / file_name).read_text(), 16) for file_name in ("idVendor", "idProduct")
            )
        except (OSError, ValueError):
            continue
        if numbers == (config.vendor_id, config.product_id):
            places.append(os.path.basename(folder))
    return sorted(places)


def hidraw_rule(config: Pr2Config) -> str:
    """Return the rule for transport hidraw, by the name of the HID device: one through uhid has no USB parent."""
    return (
        f'KERNEL=="hidraw*", KERNELS=="0003:{config.vendor_id:04X}:{config.product_id:04X}.*", TAG+="uaccess"'
    )


def usb_rule(config: Pr2Config) -> str:
    """Return the rule for transport pyusb."""
    return (
        f'SUBSYSTEM=="usb", ATTR{{idVendor}}=="{config.vendor_id:04x}", ATTR{{idProduct}}=="{config.product_id:04x}", '
        'TAG+="uaccess"'
    )
