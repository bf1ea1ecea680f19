"""The sink that records: hands each tick to another process and never waits for it.

A tick is one write to a pipe that does not block. What the pipe does not take is kept here and offered again with
the next ticks; how much that was stands in `Recorded`.
"""

from __future__ import annotations

import fcntl
import json
import os
import select
import subprocess
import sys
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from attrs import frozen

from graspsense.core.errors import GraspsenseError
from graspsense.core.signals import Command, Frame, Pads
from graspsense.recording.layout import (
    IS_END,
    IS_METADATA,
    IS_PADS,
    IS_TICK,
    LENGTH_WIRE,
    PADS_WIRE,
    PART,
    READY,
    TICK_WIRE,
)

PIPE_BYTES: Final = 1 << 20
OFFERED_AGAIN: Final = 8
"""Waiting messages that are offered with each new one, so that a tick stays short."""
MOST_WAITING: Final = 500_000
LAST_WORD_S: Final = 60.0


class NotKept(GraspsenseError):
    """A trial that could not be written where it was to be kept."""

    exit_code = 2


@frozen(kw_only=True)
class Recorded:
    """A recording that is whole on the disk, and how its writing went.

    `deferred` counts the messages that the pipe did not take at once, `most_waiting` how many waited at the worst
    moment, `dropped` those that were given up.
    """

    path: Path
    sha256: str
    size: int
    ticks: int
    images: int
    deferred: int
    most_waiting: int
    dropped: int

    @property
    def counts(self) -> dict[str, int]:
        """The counts, for a report."""
        return {
            "ticks": self.ticks,
            "images": self.images,
            "deferred": self.deferred,
            "most_waiting": self.most_waiting,
            "dropped": self.dropped,
        }


class Recorder:
    """Records one grasp into `path`; a sink of the runner.

    Raises NotKept where the writing process cannot be started. After that nothing raises before `finish`: a disk
    that is full must not stop a grasp.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        # -P: a file mcap.py in the folder where the user stands is not ours.
        command = [sys.executable, "-P", "-m", "graspsense.recording.writer_process", str(path)]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                bufsize=0,
                start_new_session=True,
            )
        except OSError as error:
            raise NotKept(f"cannot start the process that records: {error.strerror}") from error
        assert self._process.stdin is not None
        self._fd = self._process.stdin.fileno()
        os.set_blocking(self._fd, False)
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            with suppress(OSError):  # the user's limit of pipe memory
                fcntl.fcntl(self._fd, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        self._waiting: deque[bytes] = deque()
        self._counter = 0
        self._broken = False
        self._deferred = self._most_waiting = self._dropped = 0

    def take(self, frame: Frame, pads: Pads, phase: int, command: Command) -> None:
        """Hand over one tick, and its cell image if it is a new one."""
        data = TICK_WIRE.pack(IS_TICK, *frame, phase, *command)
        if pads.counter != self._counter:
            self._counter = pads.counter
            data = PADS_WIRE.pack(IS_PADS, pads.t_s, pads.counter, *pads.left, *pads.right) + data
        self._send(data)

    def wait_ready(self) -> None:
        """Wait until the writing process has its file, so that it is not behind when the fingers begin to move.

        Raises NotKept with the reason where it has none.
        """
        assert self._process.stdout is not None
        out = self._process.stdout.fileno()
        said = b""
        while not said.endswith(b"\n"):
            if not select.select([out], [], [], LAST_WORD_S)[0]:
                raise NotKept(f"the process that records {self.path} does not start")
            data = os.read(out, 4096)
            if not data:
                raise NotKept(f"the process that records {self.path} has died at its start")
            said += data
        if said.decode() != READY:
            raise self._not_kept(json.loads(said))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Hand over a metadata record and wait until it is taken: not while the fingers are under control."""
        body = json.dumps([name, dict(values)]).encode()
        self._drain(LENGTH_WIRE.pack(IS_METADATA, len(body)) + body)

    def finish(self) -> Recorded:
        """Wait until the recording is whole on the disk. Raises NotKept with the reason where it is not."""
        answer = self._last_word(IS_END)
        if answer is None or "sha256" not in answer:
            raise self._not_kept(answer)
        return Recorded(
            path=self.path,
            sha256=answer["sha256"],
            size=answer["size"],
            ticks=answer["ticks"],
            images=answer["images"],
            deferred=self._deferred,
            most_waiting=self._most_waiting,
            dropped=self._dropped,
        )

    def leave(self) -> None:
        """End without a word that the trial is over: what was felt stays as `.part`, and nothing if nothing was."""
        self._last_word(b"")

    def _not_kept(self, answer: Mapping[str, Any] | None) -> NotKept:
        reason = "its process has died" if answer is None else answer.get("error", "it was left")
        part = self.path.with_name(self.path.name + PART)
        hint = (
            f". What there is of it stands in {part.name}: see `graspsense recover`" if part.exists() else ""
        )
        return NotKept(f"the recording {self.path} could not be written: {reason}{hint}")

    def _send(self, data: bytes) -> None:
        waiting = self._waiting
        if waiting:
            self._defer(data)
            for _ in range(OFFERED_AGAIN):
                if not waiting or not self._write(waiting[0]):
                    return
                waiting.popleft()
        elif not self._write(data):
            self._defer(data)

    def _defer(self, data: bytes) -> None:
        if len(self._waiting) >= MOST_WAITING:
            self._dropped += 1
            return
        self._waiting.append(data)
        self._deferred += 1
        self._most_waiting = max(self._most_waiting, len(self._waiting))

    def _write(self, data: bytes) -> bool:
        """Write to the pipe and return whether it took it; a pipe that nobody reads any more takes everything."""
        if self._broken:
            return True
        try:
            os.write(self._fd, data)  # shorter than PIPE_BUF, so taken whole or not at all
        except BlockingIOError:
            return False
        except OSError:
            self._broken = True
        return True

    def _drain(self, last: bytes) -> None:
        """Write what waits and this, as long as somebody reads it, for at most a minute."""
        until = time.monotonic() + LAST_WORD_S
        view = memoryview(b"".join((*self._waiting, last)))
        self._waiting.clear()
        while view and not self._broken:
            if not select.select([], [self._fd], [], max(0.0, until - time.monotonic()))[1]:
                self._broken = True
                return
            try:
                view = view[os.write(self._fd, view) :]
            except BlockingIOError:
                continue
            except OSError:
                self._broken = True

    def _last_word(self, word: bytes) -> dict[str, Any] | None:
        """Send this word and return the answer; None where there is none within a minute."""
        self._drain(word)
        try:
            out, _ = self._process.communicate(timeout=LAST_WORD_S)
            answer = json.loads(out.decode().removeprefix(READY))
        except (subprocess.TimeoutExpired, ValueError):
            self._process.kill()
            self._process.communicate()
            return None
        return answer if isinstance(answer, dict) else None
