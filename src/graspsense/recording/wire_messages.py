"""The process on the other side of the pipe of a `Feed`: its messages, and how it behaves beside a control loop."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator

from graspsense.recording.layout import HEAD_WIRE


def complete_messages(buffer: bytearray) -> Iterator[tuple[bytes, int, bytes]]:
    """Remove every complete message from the buffer, and yield its kind, the number of its topic (or 0), its body."""
    offset = 0
    try:
        while offset + HEAD_WIRE.size <= len(buffer):
            kind, length, number = HEAD_WIRE.unpack_from(buffer, offset)
            start = offset + HEAD_WIRE.size
            if start + length > len(buffer):
                break
            offset = start + length
            yield kind, number, bytes(buffer[start:offset])
    finally:
        del buffer[:offset]


def leave_control_alone() -> None:
    """Make this process ignore Ctrl-C, which is meant for the grasping program, and never preempt the control loop.

    On Linux, a batch process does not preempt another one when it wakes up. Its nice value is unchanged: on a busy
    machine, a nice process would fall behind further than a crash may lose.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "SCHED_BATCH"):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
