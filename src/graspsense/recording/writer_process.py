"""The process that writes a recording: reads ticks from its standard input, writes the file, says how it went.

It is another process because a thread that compresses a chunk holds the interpreter for milliseconds. It reads
every 10 ms instead of at every tick, so that it does not wake up in the middle of the control loop's work.

    python -m graspsense.recording.writer_process FILE.mcap
"""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from pathlib import Path
from typing import Final

from graspsense.recording.layout import (
    IS_END,
    IS_METADATA,
    IS_PADS,
    IS_TICK,
    LENGTH_WIRE,
    PADS_WIRE,
    READY,
    TICK_WIRE,
)
from graspsense.recording.writer import RecordingFile

READ_EVERY_S: Final = 0.01
READ_BYTES: Final = 1 << 20
BEHIND: Final = 1 << 16
"""After so many bytes in one read there is more to come, so there is no rest before the next."""


def main(path: str) -> int:
    """Write the recording; print a line when ready, and one of JSON at the end: what was written, or the error."""
    # Ctrl-C is for the program that grasps; this one ends with its input.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        # On Linux: its waking up then does not take the processor from the control loop. It is no nicer than that:
        # on a busy machine a nice process falls further behind than a crash may cost.
        if hasattr(os, "SCHED_BATCH"):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        answer = _write(Path(path))
    except OSError as error:
        answer = {"error": error.strerror or str(error), "errno": error.errno}
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()
    return 1 if "error" in answer else 0


def _write(path: Path) -> dict[str, object]:
    file = RecordingFile(path)
    sys.stdout.write(READY)
    sys.stdout.flush()
    buffer = bytearray()
    while True:
        data = os.read(0, READ_BYTES)
        if not data:
            # The program that grasps ended without a word that the trial is over.
            if file.ticks:
                file.leave()
            else:
                file.remove()
            return {"left": True, "ticks": file.ticks}
        buffer += data
        if _take(file, buffer):
            written = file.finish()
            return {
                "sha256": written.sha256,
                "size": written.size,
                "ticks": written.ticks,
                "images": written.images,
            }
        if len(data) < BEHIND:
            time.sleep(READ_EVERY_S)


def _take(file: RecordingFile, buffer: bytearray) -> bool:
    """Write every whole message in the buffer and remove it from there; return whether the trial is over."""
    at, end = 0, len(buffer)
    try:
        while at < end:
            kind = bytes(buffer[at : at + 1])
            if kind == IS_END:
                return True
            if kind in (IS_TICK, IS_PADS):
                wire = TICK_WIRE if kind == IS_TICK else PADS_WIRE
                if at + wire.size > end:
                    break
                t_s = wire.unpack_from(buffer, at)[1]
                body = bytes(buffer[at + 1 : at + wire.size])
                (file.tick if kind == IS_TICK else file.pads)(t_s, body)
                at += wire.size
            else:
                if at + LENGTH_WIRE.size > end:
                    break
                assert kind == IS_METADATA
                length = LENGTH_WIRE.unpack_from(buffer, at)[1]
                start = at + LENGTH_WIRE.size
                if start + length > end:
                    break
                name, values = json.loads(buffer[start : start + length])
                file.metadata(name, values)
                at = start + length
    finally:
        del buffer[:at]
    return False


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
