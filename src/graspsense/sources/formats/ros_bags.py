"""Opening ROS bags with rosbags, within the limit on what a file may unpack to.

rosbags unpacks without a limit, and builds the objects of a message as its definition says. So its functions that
unpack are replaced while a bag is open, and definitions are checked before the first message. A SQLite file may hold
tables only, because a view could compute without end.
"""

from __future__ import annotations

import io
import re
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final
from urllib.parse import quote

from attrs import field, frozen

from graspsense.core.values.errors import DataDamaged, PluginUnavailable
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.unpacked import Unpacked

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

LONGEST_ARRAY: Final = 10_000
"""Limit on the fixed length of an array of messages or texts; rosbags writes a line of code for each of its items."""
_OBJECT_BYTES: Final = 32
"""Bytes that a byte of a sequence of messages or texts becomes in memory, about."""
_NO_FIELD: Final = "structure_needs_at_least_one_member"
"""The field that rosbags gives to a type without fields. It takes no place in a message of ROS 1."""
_SQLITE: Final = b"SQLite format 3\0"
_NOT_A_TABLE: Final = re.compile(r"\bvirtual\b|\bgenerated\b|\bas\s*\(", re.IGNORECASE)


@frozen(eq=False)
class Bag:
    """A bag that is open."""

    path: Path
    reader: AnyReader
    _raw: Unpacked

    @property
    def topics(self) -> frozenset[str]:
        """The topics that have messages or could have them."""
        return frozenset(self.reader.topics)

    def messages(self, wanted: Callable[[str], bool]) -> Iterator[tuple[str, int, Any]]:
        """Yield topic, time of recording (ns) and message of the topics that are wanted.

        Raises ConfigError, TooLarge, DataDamaged.
        """
        connections: list[Connection] = [
            connection for connection in self.reader.connections if wanted(connection.topic)
        ]
        if not connections:
            return
        definitions = Definitions(self.path, self.reader.typestore.fielddefs)
        with readable(self.path):
            for connection, recorded_ns, raw in self.reader.messages(connections=connections):
                self._raw.add(len(raw))
                definitions.check(connection.msgtype, len(raw))
                message = self.reader.deserialize(raw, connection.msgtype)
                yield connection.topic, recorded_ns, message


@contextmanager
def opened_bag(path: Path, definitions: Mapping[str, str] | None = None) -> Iterator[Bag]:
    """Open a ROS 1 bag, or the folder or a file of a ROS 2 bag.

    `definitions` are those of messages, for bags that contain none of their own. Raises PluginUnavailable without
    rosbags, ConfigError, TooLarge, DataDamaged.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError as error:
        raise PluginUnavailable(
            f'reading ROS bags needs rosbags: {error}\n  try: pip install "graspsense[ros]"'
        ) from error

    store = get_typestore(Stores.ROS2_HUMBLE)
    for name, definition in (definitions or {}).items():
        store.register(get_types_from_msg(definition, name))
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    for file in files:
        refuse_devices(file)
        with readable(file):
            if file.is_file():
                _refuse_views(file)
    size = sum(file.stat().st_size for file in files)
    with _unpacking_within(Unpacked(path)):
        with readable(path, "a ROS bag"):
            reader = AnyReader([path], default_typestore=store)
            reader.open()
        try:
            yield Bag(path, reader, Unpacked(path, size))
        finally:
            reader.close()


def stamp_ns(message: Any) -> int:
    """Return the time in the header of a message; 0 if it has none."""
    stamp = getattr(getattr(message, "header", None), "stamp", None)
    return stamp.sec * 1_000_000_000 + stamp.nanosec if stamp is not None else 0


@frozen(eq=False)
class Definitions:
    """The definitions of the messages in a file, by the names of their types, and which of them may be built."""

    path: Path
    fields: Mapping[str, Any]
    _has_objects: dict[str, bool] = field(factory=dict)

    def check(self, name: str, size: int) -> None:
        """Raise TooLarge or DataDamaged if a message of this type and of so many bytes must not be built."""
        if self._objects_in(name, ()):
            Unpacked(f"{self.path}: a message of the type {name}").expect(_OBJECT_BYTES * size)

    def _objects_in(self, name: str, within: Sequence[str]) -> bool:
        """Return whether a type has arrays of texts or of messages. Raises DataDamaged if it cannot be built."""
        if name in self._has_objects:
            return self._has_objects[name]
        if name in within or name not in self.fields:
            raise DataDamaged(f"{self.path}: the type {name} of a message contains itself, or is not defined")
        packed = [
            self._is_object(name, field_name, described, (*within, name))
            for field_name, described in self.fields[name][1]
        ]
        self._has_objects[name] = any(packed)
        return self._has_objects[name]

    def _is_object(self, name: str, field: str, described: Any, within: Sequence[str]) -> bool:
        from rosbags.interfaces import Nodetype

        kind, about = described
        if kind == Nodetype.NAME:
            return self._objects_in(about, within)
        if kind == Nodetype.BASE:
            return False
        (inner_kind, inner), length = about
        if inner_kind == Nodetype.BASE and inner[0] not in ("string", "wstring"):
            return False
        if kind == Nodetype.ARRAY and length > LONGEST_ARRAY:
            raise DataDamaged(
                f"{self.path}: {field} of {name} has {length} messages or texts; at most {LONGEST_ARRAY} can be"
            )
        if inner_kind == Nodetype.NAME:
            self._objects_in(inner, within)
            if [inner_field for inner_field, _ in self.fields[inner][1]] == [_NO_FIELD]:
                raise DataDamaged(f"{self.path}: {field} of {name} is a list of messages without fields")
        return True


def _refuse_views(source: str | Path, content: bytes | None = None) -> None:
    """Raise DataDamaged if a SQLite file, or this content of one, has anything but plain tables and indices."""
    if content is None:
        with Path(source).open("rb") as opened:
            if opened.read(len(_SQLITE)) != _SQLITE:
                return
        uri = f"file:{quote(str(Path(source).absolute()))}?mode=ro&immutable=1"
        connection = sqlite3.connect(uri, uri=True)
    else:
        connection = sqlite3.connect(":memory:")
        connection.deserialize(content)
    with closing(connection):
        connection.execute("PRAGMA trusted_schema = OFF")
        for kind, name, sql in connection.execute("SELECT type, name, sql FROM sqlite_schema"):
            if kind not in ("table", "index") or _NOT_A_TABLE.search(str(sql or "")):
                raise DataDamaged(
                    f"{source} is not a ROS bag: {str(name)[:40]!r} is computed, and a bag has tables only"
                )


@contextmanager
def _unpacking_within(unpacked: Unpacked) -> Iterator[None]:
    """Let rosbags unpack through `unpacked` while a bag is open."""
    from rosbags.rosbag1 import reader as ros1
    from rosbags.rosbag2 import reader
    from rosbags.rosbag2 import storage_mcap as mcap

    ros2: Any = reader
    originals = dict(ros1.decompressors), dict(mcap.DECOMPRESSORS), ros2.zstd
    ros1.decompressors.update({name: _unpacker(unpacked, name) for name in ("bz2", "lz4")})
    mcap.DECOMPRESSORS.update({name: _unpacker(unpacked, name) for name in ("zstd", "lz4")})
    ros2.zstd = _Zstd(unpacked)
    try:
        yield
    finally:
        ros1.decompressors.update(originals[0])
        mcap.DECOMPRESSORS.update(originals[1])
        ros2.zstd = originals[2]


def _unpacker(unpacked: Unpacked, compression: str) -> Callable[..., bytes]:
    def unpack(data: bytes, size: int = 0) -> bytes:
        unpacked.expect(size)
        return unpacked.unpack(compression, data)

    return unpack


@frozen
class _Zstd:
    """What rosbags uses of a module for zstd, for bags that are compressed as whole files or by the message."""

    unpacked: Unpacked

    def decompress(self, data: bytes) -> bytes:
        return self.unpacked.unpack("zstd", data)

    def open(self, file: IO[bytes], mode: str) -> IO[bytes]:
        assert mode == "rb"
        content = self.unpacked.unpack("zstd", file.read())
        if content.startswith(_SQLITE):
            _refuse_views(self.unpacked.source, content)
        return io.BytesIO(content)
