"""Why the board cannot be emulated as a device here: platform, kernel module or permission; and remedies."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

from graspsense_pr2_gripper.discovery import RELOAD, RULES_FILE, UHID_RULE

UHID_NODE: Final = "/dev/uhid"
VHCI: Final = Path("/sys/devices/platform/vhci_hcd.0")


def why_no_uhid() -> str:
    """Return the reason why a device through uhid is impossible, "" if it is possible."""
    if reason := _not_in_the_kernel("uhid", UHID_NODE):
        return reason
    if not os.access(UHID_NODE, os.R_OK | os.W_OK):
        return (
            f"no permission on {UHID_NODE}\n"
            f"  try: this line in {RULES_FILE}, then `{RELOAD}`:\n"
            f"         {UHID_RULE}\n"
            "       or run it as root"
        )
    try:
        os.close(os.open(UHID_NODE, os.O_RDWR | os.O_CLOEXEC))
    except OSError as error:
        return (
            f"{UHID_NODE} cannot be opened: {error.strerror}\n"
            f"  try: run it as root; start a container with --device {UHID_NODE}"
        )
    return ""


def why_no_vhci() -> str:
    """Return the reason why a USB device through vhci-hcd is impossible, "" if it is possible."""
    attach = VHCI / "attach"
    if reason := _not_in_the_kernel("vhci-hcd", str(attach)):
        return reason
    if os.geteuid() != 0:
        return f"no permission on {attach}, which only root may write to\n  try: run it as root"
    if not os.access(attach, os.W_OK):
        return (
            f"{attach} cannot be written to\n  try: start the container with a writable /sys (--privileged)"
        )
    return ""


def _not_in_the_kernel(module: str, path: str) -> str:
    """Return the reason if a kernel module does not offer this path, else ""."""
    if sys.platform != "linux":
        return f"{module} is of the Linux kernel, and this is {sys.platform}, which has no way in for such a program"
    if os.path.exists(path):
        return ""
    return (
        f"there is no {path}: the kernel module {module} is not loaded\n"
        f"  try: `modprobe {module}` as root, for a container on its host, which then has to give it {path};\n"
        "       a distribution's usual kernel has the module, one for clouds may not"
    )
