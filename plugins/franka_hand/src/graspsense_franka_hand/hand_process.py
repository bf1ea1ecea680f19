"""pylibfranka in a process of its own: `python -m graspsense_franka_hand.hand_process HOST`.

pylibfranka holds the lock of the interpreter until a command has ended, so the process that gives one can do nothing
else. A fork of this process, with the same connection, gives the command; this one reads states meanwhile. Each line of
the input is an order, each line of the output a state or an error, in JSON. When the input ends, because the program
that wrote it has ended in whatever way, the fingers are told to stop.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time
from contextlib import suppress
from typing import Any, Final

LEAST_PERIOD_S: Final = 0.04
"""A faster hand is read 25 times a second."""
STOP_S: Final = 1.0
"""Longest wait until the hand has answered that it stops."""
TOLERANCE_M: Final = 1.0


class HandProcess:
    """A hand at this address, and the fork that gives it a command."""

    def __init__(self, host: str) -> None:
        self._host = host
        self._hand = _connected(host)
        self._fork: tuple[int, int] | None = None
        self._done = 0
        self._ordered = False
        self._refused = ""
        self._text = b""

    def serve(self) -> None:
        """Read states and take orders until the input ends. Raises what pylibfranka raises."""
        try:
            while True:
                state = self._hand.read_once()
                now_s = time.monotonic()
                self._look_at_fork()
                _tell(
                    {
                        "host_s": now_s,
                        "width_m": state.width,
                        "widest_m": state.max_width,
                        "grasped": bool(state.is_grasped),
                        "temperature_c": float(state.temperature),
                        "done": self._done,
                        "refused": self._refused,
                    }
                )
                if not self._take_orders(now_s + LEAST_PERIOD_S):
                    return
        finally:
            # Who only looks does not let go of what the hand holds.
            if self._ordered:
                self._stop()

    def _take_orders(self, until_s: float) -> bool:
        """Give the orders that come by this time; return False at the end of the input."""
        while select.select([0], [], [], max(until_s - time.monotonic(), 0.0))[0]:
            more = os.read(0, 4096)
            if not more:
                return False
            *lines, self._text = (self._text + more).split(b"\n")
            # Of several that came at once, the last is meant.
            if lines:
                self._give(json.loads(lines[-1]), len(lines))
        return True

    def _give(self, order: list[Any], orders: int) -> None:
        self._done += orders - 1
        self._ordered = True
        if self._fork is not None:
            self._stop()
            self._done += 1
            # An answer to what was given up could be taken for that to the next command.
            self._hand = None
            self._hand = _connected(self._host)
        self._refused = ""
        self._begin(order)

    def _begin(self, order: list[Any]) -> None:
        reading, writing = os.pipe()
        process = os.fork()
        if process == 0:
            said = "the command could not be given"
            try:
                said = _given(self._hand, *order)
            except BaseException as error:
                said = f"{error}"
            finally:
                os.write(writing, said.encode()[:500])
                os._exit(0)
        os.close(writing)
        self._fork = process, reading

    def _look_at_fork(self) -> None:
        if self._fork is not None and os.waitpid(self._fork[0], os.WNOHANG)[0]:
            self._refused = os.read(self._fork[1], 500).decode(errors="replace")
            os.close(self._fork[1])
            self._fork = None
            self._done += 1

    def _stop(self) -> None:
        """Give up what the hand does, and tell it to stop, in a bounded time."""
        if self._fork is not None:
            os.kill(self._fork[0], signal.SIGKILL)
            os.waitpid(self._fork[0], 0)
            os.close(self._fork[1])
            self._fork = None
        if self._hand is None:
            return
        self._begin(["stop", 0.0, 0.0, 0.0])
        assert self._fork is not None
        process, reading = self._fork
        self._fork = None
        select.select([reading], [], [], STOP_S)
        with suppress(ProcessLookupError):
            os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
        os.close(reading)


def _connected(host: str) -> Any:
    import pylibfranka

    return pylibfranka.Gripper(host)


def _given(hand: Any, kind: str, width_m: float, speed_m_s: float, force_n: float) -> str:
    """Give a command and return an empty text once it has ended. Raises what pylibfranka raises."""
    if kind == "grasp":
        hand.grasp(width_m, speed_m_s, force_n, TOLERANCE_M, TOLERANCE_M)
    elif kind == "move":
        hand.move(width_m, speed_m_s)
    else:
        hand.stop()
    return ""


def _tell(message: dict[str, Any]) -> None:
    os.write(1, json.dumps(message).encode() + b"\n")


def main() -> None:
    """Serve the hand at the address of the command line."""
    # Ctrl-C is for the program that drives the hand: it opens the fingers, and then ends this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        HandProcess(sys.argv[1]).serve()
    except BrokenPipeError:
        pass
    except Exception as error:
        with suppress(BrokenPipeError):
            _tell({"error": f"{error}"})


if __name__ == "__main__":
    main()
