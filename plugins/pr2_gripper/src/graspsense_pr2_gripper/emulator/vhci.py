"""A USB device through the kernel module vhci-hcd: USB/IP within this computer, over a socket pair without a network.

The device disappears when the socket is closed, and so at the latest with this process.
"""

from __future__ import annotations

import errno
import socket
import threading
from typing import Final, final

from graspsense.plugin_api import NoDevice
from graspsense_pr2_gripper.emulator.port import Device, Plug, Port
from graspsense_pr2_gripper.emulator.reasons import VHCI
from graspsense_pr2_gripper.emulator.usbip import UsbipServer

_DEVICE_ID: Final = 1 << 16 | 2
_FULL_SPEED: Final = 2
_FREE_PORT: Final = "004"
"""State of a free port in the status file (VDEV_ST_NULL)."""


@final
class VhciPort(Port):
    """A port through vhci-hcd, which `why_no_vhci` says can be used."""

    def __init__(self, device: Device, plug: Plug) -> None:
        self._server = UsbipServer(device, plug)
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def plug(self) -> None:
        """Attach the device to a free port of the virtual host controller."""
        with self._lock:
            if self._thread is not None:
                return
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
            with theirs:
                try:
                    text = f"{_free_port()} {theirs.fileno()} {_DEVICE_ID} {_FULL_SPEED}"
                    (VHCI / "attach").write_text(text)
                except OSError as error:
                    ours.close()
                    raise NoDevice(f"{VHCI / 'attach'} refuses a device: {error}") from error
            self._server.connect(ours)
            self._thread = threading.Thread(target=self._serve, args=(ours,), name="USB/IP", daemon=True)
            self._thread.start()

    def unplug(self) -> None:
        """Close the connection; the kernel then removes the device."""
        with self._lock:
            thread, self._thread = self._thread, None
            if thread is not None:
                self._server.hang_up()
                thread.join()

    def send(self, report: bytes) -> bool:
        """Complete a pending read of the host with this report, or buffer it."""
        return self._server.send(report)

    def halt(self) -> bool:
        """Stall the interrupt IN endpoint."""
        self._server.halt()
        return True

    def close(self) -> None:
        """Unplug."""
        self.unplug()

    def _serve(self, connection: socket.socket) -> None:
        with connection:
            self._server.serve()


def _free_port() -> int:
    for line in (VHCI / "status").read_text().splitlines()[1:]:
        hub, port, state, *_ = line.split()
        if hub == "hs" and state == _FREE_PORT:
            return int(port)
    raise OSError(errno.EBUSY, "all ports of the virtual USB hub are taken")
