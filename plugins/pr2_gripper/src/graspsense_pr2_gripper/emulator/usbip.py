"""A USB device over USB/IP, the protocol of Documentation/usb/usbip_protocol.rst of Linux, on any stream socket.

An unlink request is always answered, even if nothing else is: a host that waits for that answer never recovers.
"""

from __future__ import annotations

import errno
import socket
import struct
import threading
from contextlib import suppress
from typing import Final, NamedTuple

from graspsense_pr2_gripper.emulator.port import Device, Plug
from graspsense_pr2_gripper.emulator.usb_device import UsbDevice

HEADER: Final = struct.Struct(">5I28s")
"""Command, sequence number, device, direction and endpoint of a request, and its parameters."""
SUBMITTED: Final = struct.Struct(">Iiiii8s")
"""Flags, length, fields that interrupt transfers do not use, and the setup packet."""
RETURN: Final = struct.Struct(">5Iiiiii8x")
"""The first five fields of the request, the status, the length, and fields that interrupt transfers do not use."""
SUBMIT, UNLINK = 1, 2
RET_SUBMIT, RET_UNLINK = 3, 4
IN: Final = 1
_VICTIM: Final = struct.Struct(">I")
_RETURN_UNLINK: Final = struct.Struct(">5Ii24x")


class _Waiting(NamedTuple):
    """A transfer of the host that has not completed."""

    number: int
    endpoint: int
    length: int
    is_in: bool
    setup: bytes
    data: bytes


class UsbipServer:
    """Serves one host at a time, with one interrupt endpoint in each direction."""

    def __init__(self, device: Device, plug: Plug) -> None:
        self._device = device
        self._usb = UsbDevice(device, plug)
        self._lock = threading.RLock()
        self._connection: socket.socket | None = None
        self._waiting: list[_Waiting] = []
        self._armed = b""

    def connect(self, connection: socket.socket) -> None:
        """Store the connection of a host; `serve` answers it."""
        with self._lock:
            self._connection = connection
            self._waiting.clear()
            self._armed, self._usb.halted = b"", False

    def serve(self) -> None:
        """Answer the host until it or `hang_up` closes the connection."""
        connection = self._connection
        if connection is None:
            return
        with suppress(OSError), connection.makefile("rb") as stream:
            while len(head := stream.read(HEADER.size)) == HEADER.size:
                command, number, _, direction, endpoint, asked = HEADER.unpack(head)
                if command == SUBMIT:
                    _, length, _, _, _, setup = SUBMITTED.unpack(asked)
                    is_in = direction == IN
                    data = b"" if is_in else stream.read(length)
                    with self._lock:
                        self._waiting.append(
                            _Waiting(
                                number=number,
                                endpoint=endpoint,
                                length=length,
                                is_in=is_in,
                                setup=setup,
                                data=data,
                            )
                        )
                        self._complete()
                elif command == UNLINK:
                    self._unlink(number, *_VICTIM.unpack_from(asked))

    def hang_up(self) -> None:
        """End `serve` immediately."""
        with self._lock:
            connection, self._connection = self._connection, None
        if connection is not None:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)

    def send(self, report: bytes) -> bool:
        """Complete a pending read of the host with this report, or buffer it; return whether it was lost.

        The buffer holds a single report, as the endpoint of a microcontroller does. A report is lost if it is full.
        """
        with self._lock:
            if self._connection is None:
                return False
            self._complete()
            if self._armed:
                return True
            self._armed = report
            self._complete()
            return False

    def halt(self) -> None:
        """Stall the interrupt IN endpoint until the host clears it."""
        with self._lock:
            self._usb.halted = True
            self._complete()

    def _unlink(self, number: int, victim: int) -> None:
        with self._lock:
            left = [submission for submission in self._waiting if submission.number != victim]
            status = -errno.ECONNRESET if len(left) < len(self._waiting) else 0
            self._waiting = left
            self._write(_RETURN_UNLINK.pack(RET_UNLINK, number, 0, 0, 0, status))

    def _complete(self) -> None:
        """Complete all transfers that can be completed. The caller holds the lock."""
        if self._device.stalled:
            return
        waiting, self._waiting = self._waiting, []
        for submission in waiting:
            if submission.endpoint == 0:
                self._return(submission, self._usb.control(submission.setup, submission.data))
            elif not submission.is_in:
                self._device.output(submission.data)
                self._return(submission, b"")
            elif self._usb.halted:
                self._return(submission, None)
            elif self._armed:
                report, self._armed = self._armed[: submission.length], b""
                self._return(submission, report)
            else:
                self._waiting.append(submission)

    def _return(self, waiting: _Waiting, answer: bytes | None) -> None:
        """Complete a transfer with this answer of the device, which a host that writes does not get; None: a stall."""
        status, data = (-errno.EPIPE, b"") if answer is None else (0, answer if waiting.is_in else b"")
        length = waiting.length if not (waiting.is_in or status) else len(data)
        self._write(RETURN.pack(RET_SUBMIT, waiting.number, 0, 0, 0, status, length, 0, 0, 0) + data)

    def _write(self, data: bytes) -> None:
        if self._connection is not None:
            with suppress(OSError):  # disconnected at this moment
                self._connection.sendall(data)
