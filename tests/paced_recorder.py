"""Records trials of 1 kHz until it is killed; the tests of kills start it as a program.

    python paced_recorder.py STORE PROGRESS SECONDS

A tick comes in real time, and later where the writing process has not read those before: so what is lost tells how
recordings are written, and not how busy the machine is.

Into the file PROGRESS goes, before each tick is handed over, the number of the trial and of the tick, and at the
start of each trial the writer process. Each stored trial is printed.
"""

import fcntl
import mmap
import struct
import sys
import termios
import time
from pathlib import Path

from kept import command, ended, frame, pads

from graspsense.core.values.signals import Reading
from graspsense.recording.layout import DEVICE, RESULT, START, TICK_WIRE
from graspsense.recording.recorder import Recorder
from graspsense.store.store import Store

PROGRESS = struct.Struct("<qqq")
"""Trial, tick handed over last, process id of the writer."""
MOST_UNREAD = 20 * TICK_WIRE.size
"""The writer reads every 10 ms, and may have as much again in its hands beside a chunk of 50 ms."""


def main(folder: str, progress: str, seconds: float) -> None:
    Path(progress).write_bytes(bytes(PROGRESS.size))
    with (
        Path(progress).open("r+b") as file,
        mmap.mmap(file.fileno(), 0) as shared,
        Store.open(folder) as store,
    ):
        trial = 0
        while True:
            trial += 1
            record_trial(store, trial, seconds, shared)


def record_trial(store: Store, trial: int, seconds: float, shared: mmap.mmap) -> None:
    record = ended(instance=f"can#{trial}")
    recorder = Recorder(store.new_recording(record.made_at))
    recorder.metadata(START, record.section(START))
    recorder.metadata(DEVICE, record.section(DEVICE))
    recorder.wait_ready()
    began = time.perf_counter()
    for k in range(round(seconds * 1000)):
        while (late := began + k * 0.001 - time.perf_counter()) > 0:
            time.sleep(late)
        while unread(recorder) > MOST_UNREAD:
            time.sleep(0.001)
        recorder.take(Reading(frame(k), pads(k)), 3, command(k))
        PROGRESS.pack_into(shared, 0, trial, k, recorder._process.pid)
    recorder.metadata(RESULT, record.section(RESULT))
    store.add(record, recorder.finish())
    sys.stdout.write(f"kept {trial}\n")
    sys.stdout.flush()


def unread(recorder: Recorder) -> int:
    """Return how many bytes lie in the pipe to the writer."""
    (size,) = struct.unpack("i", fcntl.ioctl(recorder._fd, termios.FIONREAD, bytes(4)))
    return int(size)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], float(sys.argv[3]))
