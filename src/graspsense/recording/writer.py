"""A recording as it is written: MCAP, a chunk every 50 ms, under the name `.part` until it is whole.

What is in a chunk that was closed survives the death of this process; what was not flushed to the disk does not
survive the loss of power before `finish`.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from attrs import frozen
from mcap.writer import CompressionType, Writer

from graspsense import __version__
from graspsense.recording.layout import CDR_HEADER, PADS_TOPIC, PART, SCHEMAS, TICK_TOPIC

CHUNK_NS: Final = 50_000_000


@frozen(kw_only=True)
class Written:
    """A finished recording: its hash, its size in bytes, and what is in it."""

    sha256: str
    size: int
    ticks: int
    images: int


class RecordingFile:
    """Writes one recording. Times are those of the gripper's clock, laid on the wall clock at the first of them.

    `base_ns` is the wall clock at time 0 of the gripper's, where that is known already.
    Raises OSError from every method where the disk does not take it, FileExistsError where it is there.
    """

    def __init__(self, path: Path, base_ns: int | None = None) -> None:
        self.path, self.part = path, path.with_name(path.name + PART)
        if path.exists():
            raise FileExistsError(17, "there is such a recording already", str(path))
        self._out = _Hashed(os.open(self.part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644))
        # Whoever cannot get this lock leaves the file alone: it is being written.
        fcntl.flock(self._out.fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._mcap = Writer(
            self._out,  # type: ignore[arg-type]
            chunk_size=1 << 24,
            compression=CompressionType.ZSTD,
            enable_data_crcs=True,
        )
        self._mcap.start(profile="ros2", library=f"graspsense {__version__}")
        self._channels = {}
        for topic, (name, definition) in SCHEMAS.items():
            schema = self._mcap.register_schema(name, "ros2msg", definition)
            self._channels[topic] = self._mcap.register_channel(topic, "cdr", schema)
        self._counts = dict.fromkeys(SCHEMAS, 0)
        self._base_ns = base_ns
        self._chunk_log_ns = self._chunk_wall_ns = 0
        self._open_chunk = False

    @property
    def ticks(self) -> int:
        """Number of ticks written."""
        return self._counts[TICK_TOPIC]

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record; it is on its way to the disk at once."""
        self._mcap.add_metadata(name, dict(values))

    def tick(self, t_s: float, body: bytes) -> None:
        """Write a tick, packed as `layout.TICK`."""
        self._add(TICK_TOPIC, t_s, body)

    def pads(self, t_s: float, body: bytes) -> None:
        """Write a cell image, packed as `layout.PADS`."""
        self._add(PADS_TOPIC, t_s, body)

    def finish(self) -> Written:
        """End the file, wait until the disk has it, and give it its name."""
        self._end()
        os.replace(self.part, self.path)
        _sync_folder(self.path.parent)
        self._out.close()
        return Written(
            sha256=self._out.hash.hexdigest(),
            size=self._out.size,
            ticks=self._counts[TICK_TOPIC],
            images=self._counts[PADS_TOPIC],
        )

    def leave(self) -> None:
        """End the file as far as it goes and leave it as `.part`: nobody said that the trial is over."""
        self._end()
        self._out.close()

    def remove(self) -> None:
        """Remove the file: there is nothing to keep."""
        self.part.unlink(missing_ok=True)
        self._out.close()

    def _end(self) -> None:
        self._mcap.finish()  # type: ignore[no-untyped-call]
        os.fsync(self._out.fd)

    def _add(self, topic: str, t_s: float, body: bytes) -> None:
        now_ns = time.time_ns()
        if self._base_ns is None:
            self._base_ns = now_ns - _ns(t_s)
        log_ns = max(0, self._base_ns + _ns(t_s))
        if not self._open_chunk:
            self._open_chunk, self._chunk_log_ns, self._chunk_wall_ns = True, log_ns, now_ns
        number = self._counts[topic]
        self._mcap.add_message(self._channels[topic], log_ns, CDR_HEADER + body, log_ns, number & 0xFFFFFFFF)
        self._counts[topic] = number + 1
        if log_ns - self._chunk_log_ns >= CHUNK_NS or now_ns - self._chunk_wall_ns >= CHUNK_NS:
            self._mcap.flush()  # type: ignore[no-untyped-call]
            self._open_chunk = False


class _Hashed:
    """An unbuffered file that hashes what is written to it."""

    def __init__(self, fd: int) -> None:
        self.fd, self.size, self.hash = fd, 0, hashlib.sha256()

    def write(self, data: bytes) -> int:
        view = memoryview(data)
        while view:
            view = view[os.write(self.fd, view) :]
        self.hash.update(data)
        self.size += len(data)
        return len(data)

    def tell(self) -> int:
        return self.size

    def flush(self) -> None:
        """Do nothing: it is written."""

    def close(self) -> None:
        os.close(self.fd)


def _ns(t_s: float) -> int:
    return round(t_s * 1e9) if abs(t_s) < 1e9 else 0


def _sync_folder(folder: Path) -> None:
    fd = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
