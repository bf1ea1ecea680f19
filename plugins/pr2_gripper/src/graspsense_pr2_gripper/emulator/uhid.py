"""A HID device through /dev/uhid (linux/uhid.h), which has a hidraw node but is not on the USB bus."""

from __future__ import annotations

import errno
import os
import select
import struct
import threading
from contextlib import suppress
from typing import Final, final

from graspsense.plugin_api import NoDevice
from graspsense_pr2_gripper.emulator.port import Device, Plug, Port
from graspsense_pr2_gripper.emulator.reasons import UHID_NODE
from graspsense_pr2_gripper.protocol import REPORT_DESCRIPTOR

_DESTROY: Final = 1
_OUTPUT: Final = 6
_GET_REPORT: Final = 9
_GET_REPORT_REPLY: Final = 10
_CREATE2: Final = 11
_INPUT2: Final = 12
_SET_REPORT: Final = 13
_SET_REPORT_REPLY: Final = 14
_DATA: Final = 4096
_EVENT: Final = 4 + 4372
"""Size in bytes of `struct uhid_event`."""
_BUS_USB: Final = 3

_KIND: Final = struct.Struct("<I")
_CREATE2_REQUEST: Final = struct.Struct(f"<I128s64s64sHHIIII{_DATA}s")
_INPUT2_REQUEST: Final = struct.Struct("<IH")
_GET: Final = struct.Struct("<IBB")
_GET_REPLY: Final = struct.Struct("<IIHH")
_SET: Final = struct.Struct("<IBBH")
_SET_REPLY: Final = struct.Struct("<IIH")
_SIZE: Final = struct.Struct("<H")


@final
class UhidPort(Port):
    """A port through /dev/uhid, which `why_no_uhid` says can be used."""

    def __init__(self, device: Device, plug: Plug) -> None:
        self._device = device
        self._plug = plug
        self._node = os.open(UHID_NODE, os.O_RDWR | os.O_CLOEXEC)
        self._wake, self._woken = os.pipe()
        self._plugged = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._serve, name="uhid", daemon=True)
        self._thread.start()

    def plug(self) -> None:
        """Create the device."""
        plug = self._plug
        request = _CREATE2_REQUEST.pack(
            _CREATE2,
            plug.product.encode(),
            b"graspsense",
            plug.serial.encode(),
            len(REPORT_DESCRIPTOR),
            _BUS_USB,
            plug.vendor_id,
            plug.product_id,
            0x0100,
            0,
            REPORT_DESCRIPTOR,
        )
        with self._lock:
            if self._plugged:
                return
            try:
                os.write(self._node, request)
            except OSError as error:
                raise NoDevice(f"{UHID_NODE} refuses to create a device: {error}") from error
            self._plugged = True

    def unplug(self) -> None:
        """Destroy the device."""
        with self._lock:
            if self._plugged:
                self._plugged = False
                os.write(self._node, _KIND.pack(_DESTROY))

    def send(self, report: bytes) -> bool:
        """Pass a report to the kernel, which queues it for the programs that have opened the node."""
        with self._lock:
            if self._plugged:
                os.write(self._node, _INPUT2_REQUEST.pack(_INPUT2, len(report)) + report)
        return False

    def close(self) -> None:
        """Destroy the device and close the node."""
        with suppress(OSError):
            self.unplug()
        os.write(self._woken, b".")
        self._thread.join()
        for descriptor in (self._node, self._wake, self._woken):
            os.close(descriptor)

    def _serve(self) -> None:
        """Answer requests of the kernel, which waits five seconds for each answer, until the port is closed."""
        while True:
            ready, _, _ = select.select([self._node, self._wake], [], [])
            if self._wake in ready:
                return
            with suppress(OSError):  # for a device that has just been destroyed
                self._answer(os.read(self._node, _EVENT))

    def _answer(self, event: bytes) -> None:
        (kind,) = _KIND.unpack_from(event)
        device = self._device
        if kind == _OUTPUT:
            (size,) = _SIZE.unpack_from(event, _KIND.size + _DATA)
            device.output(event[_KIND.size : _KIND.size + size])
        elif kind == _GET_REPORT:
            request, number, _ = _GET.unpack_from(event, _KIND.size)
            report = device.feature(number)
            failed = 0 if report is not None else errno.EIO
            data = report or b""
            os.write(self._node, _GET_REPLY.pack(_GET_REPORT_REPLY, request, failed, len(data)) + data)
        elif kind == _SET_REPORT:
            request, _, _, size = _SET.unpack_from(event, _KIND.size)
            start = _KIND.size + _SET.size
            device.output(event[start : start + size])
            os.write(
                self._node, _SET_REPLY.pack(_SET_REPORT_REPLY, request, errno.EIO if device.stalled else 0)
            )
