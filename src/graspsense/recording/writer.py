"""Writing a recording: an MCAP file with one chunk per 50 ms, named `.part` until it is complete.

Closed chunks survive the death of this process. Before `finish`, data that was not flushed to the disk does not
survive a loss of power.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import struct
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from mcap.writer import CompressionType, Writer

from graspsense import __version__
from graspsense.core.files.whole_file import locked, sync_folder
from graspsense.recording.layout import (
    CDR_HEADER,
    IS_END,
    IS_SIGNAL,
    IS_TICK,
    IS_TOPIC,
    PADS_TOPIC,
    PART,
    TICK_SCHEMA,
    TICK_TOPIC,
    LogClock,
    Topic,
)
from graspsense.recording.recording_info import RecordingInfo
from graspsense.recording.wire_messages import complete_messages

CHUNK_NS: Final = 50_000_000
_T_S: Final = struct.Struct("<d")


class RecordingWriter:
    """Writes one recording.

    Messages are logged at the times of a `LogClock` with `base_ns`. Raises FileExistsError if the recording already
    exists, and OSError from every method if the disk cannot be written.
    """

    def __init__(self, path: Path, base_ns: int | None = None) -> None:
        self.path, self.part = path, path.with_name(path.name + PART)
        self._out = _Hashed(os.open(self.part, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o644))
        # Only now: another writer of the same recording may have finished until `part` was free.
        if path.exists():
            self.remove()
            raise FileExistsError(errno.EEXIST, "the recording already exists", str(path))
        # A process that cannot get this lock leaves the file alone: it is being written.
        if locked(self._out.fd) is False:
            raise BlockingIOError(errno.EAGAIN, "another program has locked it", str(self.part))
        self._mcap = Writer(
            self._out,  # type: ignore[arg-type]
            chunk_size=1 << 24,
            compression=CompressionType.ZSTD,
            enable_data_crcs=True,
        )
        self._mcap.start(profile="ros2", library=f"graspsense {__version__}")
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._topics: list[str] = []
        self._register(TICK_TOPIC, *TICK_SCHEMA)
        self._clock = LogClock(base_ns)
        self._chunk_log_ns = self._chunk_wall_ns = 0
        self._open_chunk = False

    @property
    def ticks(self) -> int:
        """Number of ticks written."""
        return self._counts[TICK_TOPIC]

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record, outside of any chunk."""
        self._mcap.add_metadata(name, dict(values))

    def tick(self, body: bytes) -> None:
        """Write a tick, packed as `layout.TICK`."""
        self._add(TICK_TOPIC, body)

    def topic(self, topic: Topic) -> int:
        """Add a topic, and return its number."""
        self._register(topic.name, topic.type_name, topic.definition.encode())
        self._topics.append(topic.name)
        return len(self._topics) - 1

    def signal(self, number: int, body: bytes) -> None:
        """Write a message of the topic with this number, packed as `Topic.wire`."""
        self._add(self._topics[number], body)

    def messages(self, buffer: bytearray) -> bool:
        """Write every complete message and remove it from the buffer. Return whether the trial is over."""
        for kind, number, body in complete_messages(buffer):
            if kind == IS_END:
                return True
            if kind == IS_TICK:
                self.tick(body)
            elif kind == IS_SIGNAL:
                self.signal(number, body)
            elif kind == IS_TOPIC:
                self.topic(Topic(*json.loads(body)))
            else:
                self.metadata(*json.loads(body))
        return False

    def finish(self) -> RecordingInfo:
        """Finish the file, wait until the disk has it, and give it its final name."""
        self._end()
        os.replace(self.part, self.path)
        sync_folder(self.path.parent)
        self._out.close()
        return RecordingInfo(
            path=self.path,
            sha256=self._out.hash.hexdigest(),
            size=self._out.size,
            ticks=self._counts[TICK_TOPIC],
            images=self._counts.get(PADS_TOPIC, 0),
        )

    def leave(self) -> None:
        """Finish the file but leave it named `.part`: the trial has not ended."""
        self._end()
        self._out.close()

    def remove(self) -> None:
        """Delete the unfinished file."""
        self.part.unlink(missing_ok=True)
        self._out.close()

    def _register(self, topic: str, type_name: str, definition: bytes) -> None:
        schema = self._mcap.register_schema(type_name, "ros2msg", definition)
        self._channels[topic] = self._mcap.register_channel(topic, "cdr", schema)
        self._counts[topic] = 0

    def _end(self) -> None:
        self._mcap.finish()  # type: ignore[no-untyped-call]
        os.fsync(self._out.fd)

    def _add(self, topic: str, body: bytes) -> None:
        now_ns, (t_s,) = time.time_ns(), _T_S.unpack_from(body)
        log_ns = self._clock.log_ns(t_s, now_ns)
        if not self._open_chunk:
            self._open_chunk, self._chunk_log_ns, self._chunk_wall_ns = True, log_ns, now_ns
        number = self._counts[topic]
        self._mcap.add_message(self._channels[topic], log_ns, CDR_HEADER + body, log_ns, number & 0xFFFFFFFF)
        self._counts[topic] = number + 1
        if log_ns - self._chunk_log_ns >= CHUNK_NS or now_ns - self._chunk_wall_ns >= CHUNK_NS:
            self._mcap.flush()  # type: ignore[no-untyped-call]
            self._open_chunk = False


class _Hashed:
    """An unbuffered file that computes the hash of its content while it is written."""

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
        """Do nothing: writes are not buffered."""

    def close(self) -> None:
        os.close(self.fd)
