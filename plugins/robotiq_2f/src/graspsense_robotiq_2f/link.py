"""The connection to a gripper: one exchange writes the output registers and returns the input registers.

Modbus RTU by pymodbus, on a serial port or through a socket. RTU numbers no requests: what came late is thrown away
before the next request, which pymodbus does on a serial port only.
"""

from __future__ import annotations

import logging
import select
import socket
from collections.abc import Sequence
from typing import Any, Final, final

from graspsense.gripper_api import why_not_opened
from graspsense_robotiq_2f.registers import COUNT, INPUT, OUTPUT

BAUD: Final = 115200

# It prints what it also raises.
logging.getLogger("pymodbus.logging").setLevel(logging.CRITICAL)


class NoReply(Exception):
    """No reply came in time, or an invalid one; the text describes it."""


@final
class ModbusLink:
    """A gripper at `/dev/...` or `socket:HOST:PORT`. Raises OSError if it cannot be opened, ValueError for the text."""

    def __init__(self, port: str, address: int, timeout_s: float) -> None:
        self._address = address
        self._client: Any = _client(port, timeout_s)
        if not self._client.connect():
            raise OSError(
                "nothing answers at this host and port"
                if port.startswith("socket:")
                else why_not_opened(port)
            )

    def exchange(self, values: Sequence[int]) -> list[int]:
        """Write the output registers and return the input registers. Raises NoReply, OSError."""
        return self._registers(
            "readwrite_registers",
            read_address=INPUT,
            read_count=COUNT,
            write_address=OUTPUT,
            values=list(values),
        )

    def status(self) -> list[int]:
        """Return the input registers, without a request to the gripper to move. Raises NoReply, OSError."""
        return self._registers("read_input_registers", address=INPUT, count=COUNT)

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    def _registers(self, call: str, **given: object) -> list[int]:
        from pymodbus.exceptions import ConnectionException, ModbusException

        if not self._client.connected:
            raise OSError("the connection was lost")
        discard_late(self._client.socket)
        try:
            reply = getattr(self._client, call)(device_id=self._address, **given)
        except ConnectionException as error:
            raise OSError("the connection was lost") from error
        except ModbusException as error:
            raise NoReply("no reply, or a damaged one") from error
        if reply.isError():
            raise NoReply(f"the gripper refuses the request with Modbus exception {reply.exception_code}")
        if len(reply.registers) != COUNT:
            raise NoReply(f"a reply of {len(reply.registers)} registers instead of {COUNT}")
        return list(reply.registers)


def discard_late(connection: object) -> None:
    """Throw away what came late through a socket; what else is a connection does so itself. Raises OSError."""
    if not isinstance(connection, socket.socket):
        return
    while select.select([connection], [], [], 0.0)[0]:
        if not connection.recv(4096):
            raise ConnectionResetError("the other side closed the connection")


def _client(port: str, timeout_s: float) -> Any:
    from pymodbus import FramerType
    from pymodbus.client import ModbusSerialClient, ModbusTcpClient

    kind, _, where = port.partition(":")
    if kind != "socket":
        return ModbusSerialClient(port, baudrate=BAUD, timeout=timeout_s, retries=0)
    host, _, number = where.rpartition(":")
    if not host or not number.isdecimal():
        raise ValueError(f"{port!r} is not socket:HOST:PORT")
    return ModbusTcpClient(host, port=int(number), framer=FramerType.RTU, timeout=timeout_s, retries=0)
