"""The socket of Robotiq's UR cap (port 63352 of a UR robot): lines such as `SET POS 255 SPE 10` and `GET POS`.

It passes a request on to the gripper, and knows all of its registers but the current of the motor.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Sequence
from contextlib import closing
from typing import Final, final

from graspsense_robotiq_2f.link import ModbusLink, NoReply, discard_late
from graspsense_robotiq_2f.registers import Request, request_of

PORT: Final = 63352
PREFIX: Final = "ur:"
ACKNOWLEDGED: Final = "ack"
_VALUE: Final = re.compile(r"([A-Z]{3}) (\d{1,3}|\?)")


def variables(request: Request) -> dict[str, int]:
    """Return the variables of a request."""
    return {
        "ACT": int(request.active),
        "GTO": int(request.go),
        "POS": request.position,
        "SPE": request.speed,
        "FOR": request.force,
    }


@final
class UrCapLink:
    """A gripper at `ur:HOST` or `ur:HOST:PORT`. Raises OSError if it cannot be reached, ValueError for the text."""

    def __init__(self, port: str, timeout_s: float) -> None:
        host, _, number = port.removeprefix(PREFIX).partition(":")
        if not host or (number and not number.isdecimal()):
            raise ValueError(f"{port!r} is not ur:HOST or ur:HOST:PORT")
        try:
            self._socket = socket.create_connection((host, int(number or PORT)), timeout_s)
        except OSError as error:
            raise OSError("nothing answers at this host and port") from error
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._sent: dict[str, int] = {}

    def exchange(self, values: Sequence[int]) -> list[int]:
        """Write the output registers, if they are others, and return the input registers. Raises NoReply, OSError."""
        wanted = variables(request_of(values))
        if wanted != self._sent:
            self._sent = {}
            said = self._ask("SET " + " ".join(f"{name} {value}" for name, value in wanted.items()))
            if not said.startswith(ACKNOWLEDGED):
                raise NoReply(f"the UR cap answers {said[:20]!r} to a request")
            self._sent = wanted
        return self.status()

    def status(self) -> list[int]:
        """Return the input registers, with a current of 0. Raises NoReply, OSError."""
        state, objects, fault, position = (self._value(name) for name in ("STA", "OBJ", "FLT", "POS"))
        status = (state > 0) | self._sent.get("GTO", 0) << 3 | (state & 3) << 4 | (objects & 3) << 6
        return [status << 8, (fault & 15) << 8 | self._sent.get("POS", 0), position << 8]

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _value(self, name: str) -> int:
        said = self._ask(f"GET {name}")
        match = _VALUE.fullmatch(said)
        if match is None or match[1] != name or match[2] == "?" or int(match[2]) > 255:
            hint = ": is the robot in an emergency stop?" if said.endswith("?") else ""
            raise NoReply(f"the UR cap answers {said[:20]!r} to GET {name}{hint}")
        return int(match[2])

    def _ask(self, line: str) -> str:
        discard_late(self._socket)
        self._socket.sendall(line.encode() + b"\n")
        try:
            data = self._socket.recv(1024)
        except TimeoutError as error:
            raise NoReply("no reply") from error
        if not data:
            raise ConnectionResetError("the other side closed the connection")
        return data.decode("ascii", errors="replace").partition("\n")[0].strip()


def opened_link(port: str, address: int, timeout_s: float) -> ModbusLink | UrCapLink:
    """Return the connection that the text of a port names. Raises OSError, ValueError."""
    return UrCapLink(port, timeout_s) if port.startswith(PREFIX) else ModbusLink(port, address, timeout_s)


def let_go(port: str, address: int, timeout_s: float) -> None:
    """Tell the gripper of a killed program to open, slowly. Raises OSError, NoReply.

    One that only stops holds on, since its drive locks itself.
    """
    with closing(opened_link(port, address, timeout_s)) as link:
        link.exchange(Request(active=True, go=True, position=0, speed=0, force=0).registers())
