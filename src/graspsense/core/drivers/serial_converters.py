"""Search for grippers behind USB converters, whose numbers tell the chip and not what hangs on it."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterable, Iterator
from glob import glob
from typing import Any, Final

from attrs import frozen

from graspsense.core.components.entries import Finding, FoundDevice
from graspsense.core.drivers.emulated_body import EmulatorSettings

NO_PERMISSION: Final = (
    "add your user to the group dialout (`sudo usermod -aG dialout $USER`), and log in again"
)
BY_ID: Final = "/dev/serial/by-id"


@frozen(kw_only=True)
class GripperAtPort:
    """A kind of gripper behind a USB converter: how it is searched for, and examined without a motion.

    Other devices have the USB numbers (vendor, product) of its converters too. `asked` yields the findings about the
    gripper at the port of these settings, within a time (s).
    """

    backend: str
    gripper: str
    converter: str
    usb_numbers: Collection[tuple[int, int]]
    settings: type[EmulatorSettings]
    asked: Callable[[Any, float], Iterable[Finding]]

    def found_devices(self, timeout_s: float) -> list[FoundDevice]:
        """Return the converters, to which nothing is sent: what hangs on them is not known before it is asked."""
        from serial.tools.list_ports import comports

        converters = []
        for port in comports():
            if (port.vid, port.pid) in self.usb_numbers:
                ready = os.access(port.device, os.R_OK | os.W_OK)
                converters.append(
                    FoundDevice(
                        backend=self.backend,
                        serial=port.serial_number or "",
                        where=port.device,
                        ready=ready,
                        advice=f"{self.converter}, perhaps of {self.gripper}" if ready else NO_PERMISSION,
                    )
                )
        return converters

    def diagnose(self, config: object, timeout_s: float) -> Iterator[Finding]:
        """Return the findings about the gripper of these settings, by default about the converters. Nothing moves."""
        backend = self.backend
        if isinstance(config, self.settings):
            if config.emulated:
                yield Finding(backend, "note", "gripper.port is emulated, so no device is searched")
            else:
                yield from self.asked(config, timeout_s)
        elif config is None:
            converters = self.found_devices(timeout_s)
            if not converters:
                yield Finding(backend, "note", f"no USB converter of {self.gripper}")
            for device in converters:
                words = f"a converter at {device.where}"
                yield Finding(backend, "ok" if device.ready else "problem", words, device.advice)


def why_not_opened(port: str) -> str:
    """Return in words why this serial port could not be opened."""
    if not os.path.exists(port):
        return "there is no such port"
    if not os.access(port, os.R_OK | os.W_OK):
        return "no permission to open it"
    return "it cannot be opened: it is no serial port, or another program uses it"


def lasting_port(port: str) -> str:
    """Return the name under which udev gives this port again after it was unplugged; the port itself without one."""
    links = (link for link in glob(f"{BY_ID}/*") if os.path.realpath(link) == os.path.realpath(port))
    return next(links, port)


def port_failed(backend: str, port: str, error: Exception) -> Finding:
    """Return the finding about a port that cannot be opened."""
    advice = NO_PERMISSION if "permission" in str(error) else "look at gripper.port, power and cable"
    return Finding(backend, "problem", f"{port}: {error}", advice)
