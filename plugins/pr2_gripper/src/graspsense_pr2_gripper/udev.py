"""The udev rules for the user to copy: `uaccess` gives access to the user who is logged in at the machine."""

from __future__ import annotations

from typing import Final

from graspsense_pr2_gripper.config import Pr2Config

RULES_FILE: Final = "/etc/udev/rules.d/70-graspsense.rules"
"""Before 73-seat-late.rules, which is what gives `uaccess` its effect."""
RELOAD: Final = "sudo udevadm control --reload && sudo udevadm trigger"
UHID_RULE: Final = 'KERNEL=="uhid", SUBSYSTEM=="misc", TAG+="uaccess", OPTIONS+="static_node=uhid"'
"""For `graspsense emulate pr2` without root."""


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
