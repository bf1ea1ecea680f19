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

from graspsense.recording.layout import READY
from graspsense.recording.recording_info import WRITTEN
from graspsense.recording.wire_messages import leave_control_alone
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
        if file.messages(buffer):
            written = file.finish()
            return {name: getattr(written, name) for name in WRITTEN}
        if len(data) < BEHIND:
            time.sleep(READ_EVERY_S)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
