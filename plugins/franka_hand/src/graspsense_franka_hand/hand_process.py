"""pylibfranka in a process of its own: `python -m graspsense_franka_hand.hand_process HOST`.

pylibfranka holds the lock of the interpreter until a call has ended, so a process that reads a state or gives a command
can do nothing else. Forks of this process, with the same connection, do both: one reads states, and one for each
command gives it. Each line of the input is an order, each line of the output a state or an error, in JSON.
When the input ends, because the program that wrote it has ended in whatever way, the fingers are told to stop.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final, NamedTuple

LEAST_PERIOD_S: Final = 0.04
"""A faster hand is read 25 times a second."""
SILENT_S: Final = 0.9
"""Time without a state after which the hand is given up. libfranka waits for 1 s, and then shuts the connection, by
which the fingers could be told to stop."""
STOP_S: Final = 1.0
"""Longest wait until the hand has answered that it stops."""
CONNECT_S: Final = 1.0
"""Time for which it is tried again to connect: a hand may take a while to notice that its last host has gone."""
TOLERANCE_M: Final = 1.0
"""A grasp counts at any width."""


class Fork(NamedTuple):
    """A fork of this process, and the end of the pipe from it."""

    process: int
    pipe: int

    def end(self) -> None:
        """Kill it."""
        os.kill(self.process, signal.SIGKILL)
        os.waitpid(self.process, 0)
        os.close(self.pipe)


class Gone(Exception):
    """The hand cannot be reached any more."""


class HandProcess:
    """A hand at this address, with the forks that read its states and give it a command.

    `ordered`: it was told something, so that its fingers have to stop in the end.
    """

    def __init__(self, host: str, *, ordered: bool = False) -> None:
        self._host = host
        self._hand = _connected(host)
        self._reader: Fork | None = _forked(self._read_states)
        self._giver: Fork | None = None
        self._orders = self._states = b""
        self._done = 0
        self._ordered = ordered
        self._refused = ""

    def serve(self) -> None:
        """Pass on states and give commands until the input ends. Raises Gone, and what pylibfranka raises."""
        heard_s = time.monotonic()
        try:
            while True:
                assert self._reader is not None
                states = self._reader.pipe
                sources = [0, states, *([] if self._giver is None else [self._giver.pipe])]
                left_s = heard_s + SILENT_S - time.monotonic()
                ready, _, _ = select.select(sources, [], [], max(left_s, 0.0))
                if self._giver is not None and self._giver.pipe in ready:
                    self._given()
                if states in ready:
                    self._pass_on(os.read(states, 65536))
                    heard_s = time.monotonic()
                elif left_s <= 0.0:
                    raise Gone(f"no state came for {SILENT_S:g} s")
                if 0 in ready:
                    data = os.read(0, 4096)
                    if not data:
                        return
                    self._take(data)
                    heard_s = time.monotonic()
        finally:
            if self._reader is not None:
                self._reader.end()
            # Who only looks does not let go of what the hand holds.
            if self._ordered:
                self._stop()

    def _pass_on(self, data: bytes) -> None:
        *lines, self._states = (self._states + data).split(b"\n")
        for line in lines:
            message = json.loads(line)
            if "error" in message:
                raise Gone(message["error"])
            _tell(1, {**message, "done": self._done, "refused": self._refused})
        if not data:
            raise Gone("the states ended")

    def _take(self, data: bytes) -> None:
        *lines, self._orders = (self._orders + data).split(b"\n")
        if not lines:
            return
        # Of several that came at once, the last is meant.
        self._done += len(lines) - 1
        self._ordered = True
        if self._giver is not None:
            self._done += 1
            self._stop()
            # An answer to what was given up could be taken for that to the next command.
            if self._reader is not None:
                self._reader.end()
            self._hand = self._reader = None
            self._hand = _connected(self._host)
            self._reader, self._states = _forked(self._read_states), b""
        self._refused = ""
        order = json.loads(lines[-1])
        self._giver = _forked(lambda pipe: self._give(pipe, *order), self._reader)

    def _given(self) -> None:
        assert self._giver is not None
        self._refused = os.read(self._giver.pipe, 500).decode(errors="replace")
        self._giver.end()
        self._giver = None
        self._done += 1

    def _stop(self) -> None:
        """Give up what the hand does, and tell it to stop, in a bounded time."""
        if self._giver is not None:
            self._giver.end()
            self._giver = None
        stopping = _forked(lambda pipe: self._give(pipe, "stop"))
        select.select([stopping.pipe], [], [], STOP_S)
        stopping.end()

    def _read_states(self, pipe: int) -> None:
        try:
            while True:
                state = self._hand.read_once()
                _tell(
                    pipe,
                    {
                        "host_s": time.monotonic(),
                        "width_m": state.width,
                        "widest_m": state.max_width,
                        "grasped": bool(state.is_grasped),
                        "temperature_c": float(state.temperature),
                    },
                )
                time.sleep(LEAST_PERIOD_S)
        except Exception as error:
            _tell(pipe, {"error": f"{error}"})

    def _give(
        self, pipe: int, kind: str, width_m: float = 0.0, speed: float = 0.0, force_n: float = 0.0
    ) -> None:
        """Give a command, and write why it was refused; nothing if it was not."""
        try:
            if kind == "grasp":
                self._hand.grasp(width_m, speed, force_n, TOLERANCE_M, TOLERANCE_M)
            elif kind == "move":
                self._hand.move(width_m, speed)
            else:
                self._hand.stop()
        except Exception as error:
            os.write(pipe, f"{error}".encode()[:500])


def _forked(work: Callable[[int], None], other: Fork | None = None) -> Fork:
    """Return a fork that does this with its end of a pipe, and then ends; `other` is one that runs already."""
    reading, writing = os.pipe()
    process = os.fork()
    if process:
        os.close(writing)
        return Fork(process, reading)
    try:
        # Who writes to a pipe learns that this process was killed only if no fork can read from it.
        os.close(reading)
        if other is not None:
            os.close(other.pipe)
        work(writing)
    finally:
        os._exit(0)


def _connected(host: str) -> Any:
    """Return a connection. Raises what pylibfranka raises."""
    import pylibfranka

    until_s = time.monotonic() + CONNECT_S
    while True:
        try:
            return pylibfranka.Gripper(host)
        except pylibfranka.NetworkException:
            if time.monotonic() > until_s:
                raise
            time.sleep(LEAST_PERIOD_S)


def _tell(pipe: int, message: dict[str, Any]) -> None:
    os.write(pipe, json.dumps(message).encode() + b"\n")


def stop(host: str) -> None:
    """Tell the hand at this address to stop, in a process whose input has ended. Raises what pylibfranka raises."""
    HandProcess(host, ordered=True).serve()


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
            _tell(1, {"error": f"{error}".rstrip(".")})


if __name__ == "__main__":
    main()
