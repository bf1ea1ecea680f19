"""Search for grippers behind USB converters, whose numbers tell the chip and not what hangs on it."""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator, Sequence
from glob import glob
from typing import Final, Protocol

from graspsense.core.components.entries import Finding, FoundDevice

NO_PERMISSION: Final = (
    "add your user to the group dialout (`sudo usermod -aG dialout $USER`), and log in again"
)


BY_ID: Final = "/dev/serial/by-id"


class SerialPort(Protocol):
    """A serial port of this computer, as `serial.tools.list_ports.comports` of pyserial gives it."""

    device: str
    vid: int | None
    pid: int | None
    serial_number: str | None


def found_converters(
    ports: Iterable[SerialPort], backend: str, usb_numbers: Collection[tuple[int, int]], words: str
) -> list[FoundDevice]:
    """Return the ports with one of these USB numbers (vendor, product); `words` say what they may be."""
    converters = []
    for port in ports:
        if (port.vid, port.pid) in usb_numbers:
            ready = os.access(port.device, os.R_OK | os.W_OK)
            converters.append(
                FoundDevice(
                    backend=backend,
                    serial=port.serial_number or "",
                    where=port.device,
                    ready=ready,
                    advice=words if ready else NO_PERMISSION,
                )
            )
    return converters


def converter_findings(converters: Sequence[FoundDevice], backend: str, gripper: str) -> Iterator[Finding]:
    """Return the findings of `graspsense doctor` about these converters of a gripper."""
    if not converters:
        yield Finding(backend, "note", f"no USB converter of {gripper}")
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
