"""An emulated gripper on a pseudo-terminal and on TCP, for tests and first trials.

    python -m graspsense_robotiq_2f85.fake

prints where it can be reached, and answers until it is interrupted.
"""

from __future__ import annotations

import os
import select
import socket
import struct
import threading
import time
from math import inf
from typing import Any, Final

from graspsense_robotiq_2f85.modbus import crc
from graspsense_robotiq_2f85.registers import (
    ACTIVE,
    AMPERES_A_STEP,
    CLOSED_BYTE,
    COUNT,
    FORCES_N,
    INPUT,
    MOVING,
    OPEN_BYTE,
    OUTPUT,
    SPEEDS_M_S,
    STOPPED_CLOSING,
    THERE,
    gap_of,
    position_of,
    request_of,
    value_of,
)

UNIT: Final = 9
ACTIVATION_S: Final = 0.2
FREE_RUNNING_A: Final = 0.05
NEWTONS_PER_AMPERE: Final = 150.0
READ: Final = (3, 4)
WRITE: Final = 16
READ_AND_WRITE: Final = 23
THINGS: Final = {"block": (0.06, 10000.0), "sponge": (0.06, 3000.0)}
"""Width (m) and stiffness (N/m) of the things that the emulated gripper can hold."""


class Fingers:
    """The fingers and an elastic object between them, at the time that each call gives."""

    def __init__(self, thing_m: float, stiffness_n_m: float, vanishes_s: float) -> None:
        self.registers = [0] * COUNT
        self._thing_m, self._stiffness_n_m, self._vanishes_s = thing_m, stiffness_n_m, vanishes_s
        self._gap_m = gap_of(OPEN_BYTE)
        self._now_s = self._active_since_s = 0.0
        self._object = MOVING

    def vanished(self, now_s: float) -> bool:
        """Return whether the cable is pulled at this time after activation."""
        return bool(self.registers[0] >> 8 & 1) and now_s - self._active_since_s > self._vanishes_s

    def write(self, at: int, values: list[int], now_s: float) -> None:
        """Receive output registers."""
        was_active = request_of(self.registers).active
        self.look(now_s)
        self.registers[at : at + len(values)] = values
        if request_of(self.registers).active and not was_active:
            self._active_since_s = now_s

    def look(self, now_s: float) -> list[int]:
        """Move up to the present time, and return the input registers."""
        request, passed = request_of(self.registers), now_s - self._now_s
        self._now_s = now_s
        up = request.active and now_s - self._active_since_s >= ACTIVATION_S
        state = (ACTIVE if up else 1) if request.active else 0
        current = 0.0
        if up and request.go:
            current = self._moved(request.position, request.speed, request.force, passed)
        status = request.active | request.go << 3 | state << 4 | self._object << 6
        amperes = min(round(current / AMPERES_A_STEP), 255)
        return [status << 8, request.position, position_of(self._gap_m) << 8 | amperes]

    def _moved(self, position: int, speed: int, force: int, passed_s: float) -> float:
        """Move the fingers and return the current of the motor."""
        nearest = min(max(position, OPEN_BYTE), CLOSED_BYTE)
        wanted = gap_of(nearest)
        step = value_of(speed, SPEEDS_M_S) * passed_s
        # The position at which the spring balances the motor.
        stop = self._thing_m - value_of(force, FORCES_N) / self._stiffness_n_m
        before = self._gap_m
        if wanted < before:
            reached = max(wanted, before - step, min(stop, before))
            self._object = STOPPED_CLOSING if reached > wanted and reached <= stop + 1e-9 else MOVING
        else:
            reached = min(wanted, before + step)
            self._object = MOVING
        # A target beyond the stroke is reached at the end of the stroke.
        if position_of(reached) == nearest:
            self._object = THERE
        self._gap_m = reached
        moving = FREE_RUNNING_A if abs(reached - before) > 1e-9 else 0.0
        return moving + self._stiffness_n_m * max(self._thing_m - reached, 0.0) / NEWTONS_PER_AMPERE


class Fake:
    """Serves one gripper on a pseudo-terminal (`serial`), as RTU over TCP (`rtu_tcp`) and as Modbus TCP (`tcp`)."""

    def __init__(
        self, *, thing_m: float = 0.06, stiffness_n_m: float = 10000.0, vanishes_s: float = inf
    ) -> None:
        self._fingers = Fingers(thing_m, stiffness_n_m, vanishes_s)
        self._began_s = time.monotonic()
        self._ours, self._theirs = os.openpty()
        import tty

        tty.setraw(self._ours)
        tty.setraw(self._theirs)
        self._doors = [socket.create_server(("127.0.0.1", 0)) for _ in range(2)]
        self._wake = os.pipe()
        ports = [door.getsockname()[1] for door in self._doors]
        self.serial = os.ttyname(self._theirs)
        self.rtu_tcp, self.tcp = f"rtu-tcp:127.0.0.1:{ports[0]}", f"tcp:127.0.0.1:{ports[1]}"
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving; can be called twice."""
        if self._thread.is_alive():
            os.write(self._wake[1], b"x")
            self._thread.join()
            for handle in (self._ours, self._theirs, *self._wake):
                os.close(handle)
            for door in self._doors:
                door.close()

    def __enter__(self) -> Fake:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _serve(self) -> None:
        calls: dict[socket.socket, bool] = {}
        buffers: dict[int, bytes] = {}
        while True:
            watched: list[Any] = [self._wake[0], self._ours, *self._doors, *calls]
            ready, _, _ = select.select(watched, [], [])
            if self._wake[0] in ready:
                for call in calls:
                    call.close()
                return
            for door in self._doors:
                if door in ready:
                    calls[door.accept()[0]] = door is self._doors[0]
            for call, rtu in list(calls.items()):
                if call in ready and not self._heard(call.fileno(), rtu, buffers):
                    del calls[call]
                    buffers.pop(call.fileno(), None)
                    call.close()
            if self._ours in ready:
                self._heard(self._ours, True, buffers)

    def _heard(self, handle: int, rtu: bool, buffers: dict[int, bytes]) -> bool:
        """Answer the data of this handle; return whether the client is still connected."""
        data = os.read(handle, 512)
        reply, buffers[handle] = self._answer(buffers.get(handle, b"") + data, rtu)
        if reply and not self._fingers.vanished(self._now()):
            os.write(handle, reply)
        return bool(data)

    def _now(self) -> float:
        return time.monotonic() - self._began_s

    def _answer(self, data: bytes, rtu: bool) -> tuple[bytes, bytes]:
        """Return the reply to the data, and the remaining data: an incomplete request waits for its end."""
        if not rtu:
            if len(data) < 8 or len(data) < 6 + struct.unpack(">H", data[4:6])[0]:
                return b"", data
            end = 6 + struct.unpack(">H", data[4:6])[0]
            body = self._done(data[7:end])
            return data[:4] + struct.pack(">HB", len(body) + 1, data[6]) + body, data[end:]
        if len(data) < 8:
            return b"", data
        lengths = {WRITE: 9 + data[6], READ_AND_WRITE: 13 + (data[10] if len(data) > 10 else 255)}
        length = lengths.get(data[1], 8)
        if len(data) < length:
            return b"", data
        frame, rest = data[: length - 2], data[length:]
        if crc(frame) != data[length - 2 : length] or frame[0] != UNIT:
            return b"", b""
        body = frame[:1] + self._done(frame[1:])
        return body + crc(body), rest

    def _done(self, request: bytes) -> bytes:
        """Return the reply to a request, both without address and checksum."""
        function, now = request[0], self._now()
        try:
            if function in READ:
                at, count = struct.unpack(">HH", request[1:5])
                return self._read(function, at, count, now)
            if function == WRITE:
                at, count = struct.unpack(">HH", request[1:5])
                self._write(at, request[6:], count, now)
                return request[:5]
            if function == READ_AND_WRITE:
                at, count, to, wanted = struct.unpack(">HHHH", request[1:9])
                self._write(to, request[10:], wanted, now)
                return self._read(function, at, count, now)
        except IndexError:
            return bytes([function | 0x80, 2])
        return bytes([function | 0x80, 1])

    def _read(self, function: int, at: int, count: int, now: float) -> bytes:
        first = at - INPUT
        if first < 0 or first + count > COUNT:
            raise IndexError
        values = self._fingers.look(now)[first : first + count]
        return struct.pack(f">BB{count}H", function, 2 * count, *values)

    def _write(self, at: int, data: bytes, count: int, now: float) -> None:
        first = at - OUTPUT
        if first < 0 or first + count > COUNT:
            raise IndexError
        self._fingers.write(first, list(struct.unpack(f">{count}H", data[: 2 * count])), now)


def main() -> None:
    """Serve until interrupted."""
    with Fake() as fake:
        print(f"{fake.serial}  {fake.rtu_tcp}  {fake.tcp}", flush=True)  # noqa: T201 (what was asked for)
        threading.Event().wait()


if __name__ == "__main__":
    main()
