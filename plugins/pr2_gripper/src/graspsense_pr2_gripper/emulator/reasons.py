"""Why the board cannot be emulated as a device here: kernel module, permission, container or platform; and remedies."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path
from typing import Final

from graspsense_pr2_gripper.udev import RELOAD, RULES_FILE, UHID_RULE

UHID_NODE: Final = "/dev/uhid"
VHCI: Final = Path("/sys/devices/platform/vhci_hcd.0")
MODULES: Final = Path("/lib/modules")


def why_no_uhid() -> str:
    """Return the reason why a device through uhid is impossible, "" if it is possible."""
    if reason := _not_linux("uhid"):
        return reason
    if not os.path.exists(UHID_NODE):
        return _no_module("uhid", UHID_NODE)
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
        return f"{UHID_NODE} cannot be opened: {error.strerror}\n  try: {_let_in(f'--device {UHID_NODE}')}"
    return ""


def why_no_vhci() -> str:
    """Return the reason why a USB device through vhci-hcd is impossible, "" if it is possible."""
    if reason := _not_linux("vhci-hcd"):
        return reason
    attach = VHCI / "attach"
    if not attach.exists():
        return _no_module("vhci-hcd", str(VHCI))
    if os.geteuid() != 0:
        return f"no permission on {attach}, which only root may write to\n  try: run it as root"
    if not os.access(attach, os.W_OK):
        return f"{attach} cannot be written to\n  try: {_let_in('a writable /sys (--privileged)')}"
    return ""


def container() -> str:
    """Return the kind of container that this process runs in, "" if it is none."""
    for path, kind in (("/.dockerenv", "docker"), ("/run/.containerenv", "podman")):
        if os.path.exists(path):
            return kind
    try:
        environment = Path("/proc/1/environ").read_bytes().split(b"\0")
    except OSError:
        return ""
    return next(
        (
            variable[10:].decode(errors="replace")
            for variable in environment
            if variable.startswith(b"container=")
        ),
        "",
    )


def release() -> str:
    """Return the release of the running kernel."""
    return platform.release()


def _not_linux(what: str) -> str:
    if sys.platform == "linux":
        return ""
    name = {"darwin": "macOS", "win32": "Windows"}.get(sys.platform, sys.platform)
    return f"{what} is of the Linux kernel, and this is {name}, which has no way in for a program such as this one"


def _no_module(module: str, path: str) -> str:
    if kind := container():
        return (
            f"there is no {path}, and this is a container ({kind}), which has the kernel of its host\n"
            f"  try: `modprobe {module}` on the host, then give the container {path}"
        )
    if not (MODULES / release()).is_dir():
        return (
            f"there is no {path}, and no modules of the running kernel {release()} are installed\n"
            f"  try: a kernel with the module {module}: a distribution's usual one has it, one for clouds may not"
        )
    return f"there is no {path}: the kernel module {module} is not loaded\n  try: `modprobe {module}` as root"


def _let_in(what: str) -> str:
    return f"start the container ({container()}) with {what}" if container() else "run it as root"
