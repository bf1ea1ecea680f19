"""Ticks for another process: each is one non-blocking write to a pipe, and no tick waits.

What the pipe does not take waits, and is offered again with the next tick; messages beyond a limit are dropped and
counted.
"""

from __future__ import annotations

import fcntl
import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final

from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.signals import Command, Reading
from graspsense.recording.layout import IS_METADATA
from graspsense.recording.tick_messages import TickMessages, json_message

PIPE_BYTES: Final = 1 << 20

Data = bytes | memoryview


class Feed(TickMessages):
    """A sink of the runner that passes ticks, images and samples to `python -m MODULE ARGUMENTS` on its standard input.

    `queue_bytes` limits what waits for the pipe. Raises SaveFailed if the process cannot be started. After
    that, `take` never raises: another process must not stop a grasp.
    """

    def __init__(self, module: str, arguments: Sequence[str], queue_bytes: int) -> None:
        super().__init__(self._pass_on)
        # -P: do not import a file mcap.py from the current folder.
        command = [sys.executable, "-P", "-m", module, *arguments]
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
            raise SaveFailed(f"cannot start {module}: {error.strerror}") from error
        assert self._process.stdin is not None
        self._fd = self._process.stdin.fileno()
        os.set_blocking(self._fd, False)
        if hasattr(fcntl, "F_SETPIPE_SZ"):
            with suppress(OSError):  # the user's limit of pipe memory
                fcntl.fcntl(self._fd, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        self._waiting, self._queue_bytes = bytearray(), queue_bytes
        self.ticks = 0
        """Ticks that were taken."""
        self._broken = False
        self._deferred = self.dropped = 0
        """Messages that did not go at once, and that the process did not take."""

    def _first_line(self, timeout_s: float) -> bytes | None:
        """Return the first line that the process prints: empty if it ends without one, None if none comes in time."""
        assert self._process.stdout is not None
        out, said, until = self._process.stdout.fileno(), b"", time.monotonic() + timeout_s
        while not said.endswith(b"\n"):
            if not select.select([out], [], [], max(0.0, until - time.monotonic()))[0]:
                return None
            data = os.read(out, 4096)
            if not data:
                return b""
            said += data
        return said

    def take(self, reading: Reading, phase: int, command: Command) -> None:
        """Pass on one tick, with its images and samples if those are new."""
        data = self.packed(reading, phase, command)
        self._keep(data)
        if self._waiting or len(data) > select.PIPE_BUF:  # up to which a write is atomic
            self._send(data)
        elif not self._broken:
            # As `_send`, without the call.
            try:
                os.write(self._fd, data)
            except BlockingIOError:
                self._send(data)
            except OSError:
                self._broken = True
        self.ticks += 1

    def _keep(self, data: Data) -> None:
        """Take what is passed on, also if the pipe does not."""

    def _told(self, name: str, values: Any) -> None:
        """Pass on JSON values under a name."""
        self._pass_on(json_message(IS_METADATA, name, values))

    def _pass_on(self, data: Data) -> None:
        self._keep(data)
        self._send(data)

    def _send(self, data: Data) -> None:
        """Write what waits, and this, as far as the pipe takes it; without a reader, it counts as taking everything."""
        waiting = self._waiting
        if self._broken:
            return
        if len(waiting) + len(data) > self._queue_bytes:
            self.dropped += 1
        else:
            waiting += data
        try:
            del waiting[: os.write(self._fd, waiting)]
        except BlockingIOError:
            pass
        except OSError:
            self._broken = True
            return
        self._deferred += bool(waiting)

    def _drain(self, last: bytes, timeout_s: float) -> None:
        """Write the queue and this message, for at most `timeout_s`, while the pipe has a reader."""
        until = time.monotonic() + timeout_s
        view = memoryview(bytes(self._waiting) + last)
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
