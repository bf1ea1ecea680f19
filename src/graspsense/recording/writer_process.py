"""The process that writes a recording: it reads messages from standard input and writes the MCAP file.

It is a separate process because a thread that compresses a chunk would hold the interpreter lock for milliseconds.
It reads every 10 ms rather than at every tick, so that it does not interrupt the control loop.

    python -m graspsense.recording.writer_process FILE.mcap
"""

from __future__ import annotations

import json
import os
import sys
import time
from pathlib import Path
from typing import Final

from graspsense.recording.layout import IS_END, IS_SIGNAL, IS_TICK, IS_TOPIC, READY, Topic
from graspsense.recording.recording_info import WRITTEN
from graspsense.recording.wire_messages import complete_messages, leave_control_alone
from graspsense.recording.writer import RecordingWriter

READ_EVERY_S: Final = 0.01
READ_BYTES: Final = 1 << 20
BEHIND: Final = 1 << 16
"""A read of this many bytes or more is followed by the next read without a pause."""


def main(path: str) -> int:
    """Write the recording. Print `READY` once the file exists, and at its end the result or the error as JSON."""
    leave_control_alone()
    try:
        answer = _write(Path(path))
    except OSError as error:
        answer = {"error": error.strerror or str(error), "errno": error.errno}
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()
    return 1 if "error" in answer else 0


def _write(path: Path) -> dict[str, object]:
    file = RecordingWriter(path)
    sys.stdout.write(READY)
    sys.stdout.flush()
    buffer = bytearray()
    while True:
        data = os.read(0, READ_BYTES)
        if not data:
            # The grasping program ended without the message IS_END.
            if file.ticks:
                file.leave()
            else:
                file.remove()
            return {"left": True, "ticks": file.ticks}
        buffer += data
        if _write_messages(file, buffer):
            written = file.finish()
            return {name: getattr(written, name) for name in WRITTEN}
        if len(data) < BEHIND:
            time.sleep(READ_EVERY_S)


def _write_messages(file: RecordingWriter, buffer: bytearray) -> bool:
    """Write every complete message and remove it from the buffer. Return whether the trial is over."""
    for kind, number, body in complete_messages(buffer):
        if kind == IS_END:
            return True
        if kind == IS_TICK:
            file.tick(body)
        elif kind == IS_SIGNAL:
            file.signal(number, body)
        elif kind == IS_TOPIC:
            file.topic(Topic(*json.loads(body)))
        else:
            file.metadata(*json.loads(body))
    return False


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
