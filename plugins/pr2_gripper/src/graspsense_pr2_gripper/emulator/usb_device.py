"""The board as a USB device: its descriptors and its control endpoint (USB 2.0, chapter 9; HID 1.11)."""

from __future__ import annotations

import struct
from typing import Final

from graspsense_pr2_gripper.emulator.port import Device, Plug
from graspsense_pr2_gripper.protocol import REPORT_DESCRIPTOR, REPORT_SIZE

SETUP: Final = struct.Struct("<BBHHH")
"""bmRequestType, bRequest, wValue, wIndex, wLength."""
IN_ENDPOINT: Final = 0x81
OUT_ENDPOINT: Final = 0x01

_DEVICE, _CONFIGURATION, _STRING = 1, 2, 3
_HID, _REPORT = 0x21, 0x22
_ENGLISH: Final = 0x0409
_ENDPOINT_HALT: Final = 0

_GET_DESCRIPTOR: Final = (0x80, 6)
_GET_INTERFACE_DESCRIPTOR: Final = (0x81, 6)
_GET_CONFIGURATION: Final = (0x80, 8)
_GET_STATUS: Final = ((0x80, 0), (0x81, 0), (0x82, 0))
_CLEAR_ENDPOINT_FEATURE: Final = (0x02, 1)
_GET_REPORT: Final = (0xA1, 1)
_SET_REPORT: Final = (0x21, 9)
_ACCEPTED: Final = frozenset(
    {
        (0x00, 5),  # set address
        (0x00, 9),  # set configuration
        (0x01, 11),  # set interface
        (0x02, 3),  # set endpoint feature
        (0x21, 10),  # HID set idle
        (0x21, 11),  # HID set protocol
    }
)
_FEATURE: Final = 3


class UsbDevice:
    """A full-speed device with one HID interface and two interrupt endpoints of 64 bytes each millisecond."""

    def __init__(self, device: Device, plug: Plug) -> None:
        self.halted = False
        """Whether the interrupt IN endpoint answers with a stall."""
        self._device = device
        self._strings = ("graspsense", plug.product, plug.serial)
        self._about = struct.pack(
            "<BBHBBBBHHHBBBB", 18, _DEVICE, 0x0200, 0, 0, 0, 64, plug.vendor_id, plug.product_id, 0x0100, 1, 2, 3, 1
        )  # fmt: skip
        self._hid = struct.pack("<BBHBBBH", 9, _HID, 0x0111, 0, 1, _REPORT, len(REPORT_DESCRIPTOR))
        endpoints = b"".join(
            struct.pack("<BBBBHB", 7, 5, address, 3, REPORT_SIZE, 1)
            for address in (IN_ENDPOINT, OUT_ENDPOINT)
        )
        interface = struct.pack("<BBBBBBBBB", 9, 4, 0, 0, 2, 3, 0, 0, 0)
        behind = interface + self._hid + endpoints
        self._configuration = (
            struct.pack("<BBHBBBBB", 9, _CONFIGURATION, 9 + len(behind), 1, 1, 0, 0x80, 50) + behind
        )

    def control(self, setup: bytes, data: bytes) -> bytes | None:
        """Return the answer of the device: empty bytes if it only accepts the request, None for a stall."""
        kind, request, value, index, length = SETUP.unpack(setup)
        asked = (kind, request)
        high, low = value >> 8, value & 0xFF
        answer: bytes | None = None
        if asked == _GET_DESCRIPTOR:
            answer = self._descriptor(high, low)
        elif asked == _GET_INTERFACE_DESCRIPTOR:
            answer = {_REPORT: REPORT_DESCRIPTOR, _HID: self._hid}.get(high)
        elif asked == _GET_CONFIGURATION:
            answer = b"\1"
        elif asked in _GET_STATUS:
            answer = bytes((int(self.halted and index == IN_ENDPOINT), 0))
        elif asked == _CLEAR_ENDPOINT_FEATURE:
            if value == _ENDPOINT_HALT and index == IN_ENDPOINT:
                self.halted = False
            answer = b""
        elif asked == _GET_REPORT:
            answer = self._device.feature(low) if high == _FEATURE else None
        elif asked == _SET_REPORT:
            self._device.output(data)
            answer = b""
        elif asked in _ACCEPTED:
            answer = b""
        return None if answer is None else answer[:length]

    def _descriptor(self, kind: int, number: int) -> bytes | None:
        if kind == _DEVICE:
            return self._about
        if kind == _CONFIGURATION:
            return self._configuration
        if kind == _STRING and number <= len(self._strings):
            text = self._strings[number - 1].encode("utf-16-le") if number else struct.pack("<H", _ENGLISH)
            return bytes((2 + len(text), _STRING)) + text
        return None
