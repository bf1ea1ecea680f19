"""Small files that unpack to a lot: refused with the name of the limit, in a process that has little memory."""

import bz2
import io
import os
import sqlite3
import struct
import zipfile
from contextlib import closing
from functools import partial

import lz4.frame
import numpy as np
import pytest
import zstandard
from cases import every_case
from commands import python
from kept import ended, write_recording
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from graspsense.core.values.errors import ConfigError, DataDamaged, TooLarge
from graspsense.core.values.limits import UNPACKED_MB
from graspsense.recording.reader import read_recorded
from graspsense.recording.unpacked import Unpacked
from graspsense.sources.formats.array_format import read_arrays
from graspsense.sources.formats.numpy_files import npy_array, npz_arrays
from graspsense.sources.formats.ros_format import read_bag

MB = 1_000_000
BOMB = 700 * MB
"""More than a file may unpack to without the setting, and than the process below can have."""
MEMORY = 900 * MB
"""Address space that a process which reads a bomb may have beside what it has after its imports."""

READ = """
import resource, sys
from pathlib import Path
import scipy.io
from graspsense.recording.reader import read_recorded
from graspsense.sources.recordings.exported_grasp import read_exported
from graspsense.sources.formats.array_format import read_arrays
from graspsense.sources.formats.parquet_format import read_parquet
from graspsense.sources.formats.ros_format import read_bag
try:
    import pyarrow.parquet
    import rosbags.highlevel
except ImportError:
    pass
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + {memory}, used + {memory}))
from graspsense.core.values.errors import GraspsenseError
try:
    {call}
except GraspsenseError as error:
    print(type(error).__name__, error)
"""


def read_with_little_memory(call, memory=MEMORY):
    """Run a statement in a process with so much memory; return what it prints of an error of ours."""
    script = READ.format(call=call, memory=memory)
    ran = python("-c", script)
    assert ran.returncode == 0, ran.stderr[-2000:]
    return ran.stdout


def zeros(size):
    """Yield so many zero bytes in pieces."""
    piece = bytes(MB)
    for _ in range(size // MB):
        yield piece


def deflated_npz(path, size=BOMB):
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (size // 8,)}
    )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive, archive.open("a.npy", "w") as member:
        for piece in (header.getvalue(), *zeros(size)):
            member.write(piece)


def chunked_mcap(path, compression="zstd", size=BOMB, declared=BOMB):
    """Write an MCAP file with one chunk of so many zeros, which says another size, with a profile of ROS 2."""
    with path.open("wb") as file:
        writer = McapWriter(file, compression=CompressionType.NONE)
        writer.start(profile="ros2")
        writer.finish()
    whole, chunk = path.read_bytes(), compressed(compression, size)
    body = struct.pack("<QQQI", 0, 0, declared, 0)
    body += struct.pack("<I", len(compression)) + compression.encode() + struct.pack("<Q", len(chunk)) + chunk
    after_header = 8 + 9 + struct.unpack("<Q", whole[9:17])[0]
    record = struct.pack("<BQ", 6, len(body)) + body
    path.write_bytes(whole[:after_header] + record + whole[after_header:])


def compressed(kind, size):
    if kind == "zstd":
        writer = zstandard.ZstdCompressor().compressobj(size=size)
        return b"".join([*map(writer.compress, zeros(size)), writer.flush()])
    out = io.BytesIO()
    with lz4.frame.open(out, "wb") as file:
        file.writelines(zeros(size))
    return out.getvalue()


def test_the_limit_is_a_setting(monkeypatch):
    assert UNPACKED_MB.most == 512
    monkeypatch.setenv(UNPACKED_MB.variable, "3")
    unpacked = Unpacked("some.file")
    unpacked.add(2 * MB)
    unpacked.expect(MB)
    with pytest.raises(TooLarge, match=rf"some\.file.*4 MB.*3 MB.*{UNPACKED_MB.variable}"):
        unpacked.add(2 * MB)
    for wrong in ("0", "many", "-1", "1e3", "9" * 40):
        monkeypatch.setenv(UNPACKED_MB.variable, wrong)
        with pytest.raises(ConfigError, match=UNPACKED_MB.variable):
            Unpacked("some.file")


@every_case("kind", ["zstd", "lz4", "bz2"])
def test_what_is_unpacked_is_what_was_packed_and_is_counted(kind, monkeypatch):
    data = os.urandom(1000) * 1100
    packed = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "bz2": bz2.compress}[kind](data)
    unpacked = Unpacked("f")
    assert unpacked.unpack(kind, packed) == data
    assert unpacked.total == len(data)
    with pytest.raises((ValueError, zstandard.ZstdError, RuntimeError)):
        Unpacked("f").unpack(kind, packed[:-9])
    monkeypatch.setenv(UNPACKED_MB.variable, "1")
    with pytest.raises(TooLarge):
        Unpacked("f").unpack(kind, packed)


def npy(descr, shape):
    """Return the header of an array that says this."""
    header = (
        f"{{'descr': {descr!r}, 'fortran_order': False, 'shape': {shape!r}, }}".encode().ljust(117) + b"\n"
    )
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header


@every_case("shape", [(10**15,), (2**62, 4), (-5,), (10**9, 0, 0), (0, 10**12), (3.5,), (2**70,), (True,)])
@every_case("ending", ["npy", "npz"])
def test_an_array_that_says_more_than_there_is(tmp_path, ending, shape):
    path, content = tmp_path / f"a.{ending}", npy("<f8", shape) + bytes(80)
    if ending == "npz":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a.npy", content)
    else:
        path.write_bytes(content)
    with pytest.raises(DataDamaged, match=r"a\.np[yz]"):
        read_arrays(path)


OBJECTS = "Python objects in it are not loaded, because that can run any code"


@every_case(
    ("descr", "says"),
    [("|O", OBJECTS), ([("a", "|O")], OBJECTS), ("|V0", "shape"), ("<U0", "shape"), ("|S0", "shape")],
)
def test_an_array_of_what_is_no_number_is_refused(tmp_path, descr, says):
    path = tmp_path / "a.npy"
    path.write_bytes(npy(descr, (1000000000,)))
    with pytest.raises(DataDamaged, match=rf"a\.npy.*{says}"):
        npy_array(path)


def test_arrays_come_back_as_numpy_wrote_them(tmp_path):
    arrays = {
        "rows": np.arange(6.0).reshape(2, 3),
        "columns": np.asfortranarray(np.arange(24.0).reshape(2, 3, 4)),
        "big": np.arange(5, dtype=">i4"),
        "none": np.zeros((0, 4)),
        "one": np.array(2.5),
        "text": np.array("declared"),
        "fields": np.zeros(3, dtype=[("a", "<f8"), ("b", "<i4")]),
    }
    for save in (np.savez, np.savez_compressed):
        save(tmp_path / "a.npz", **arrays)
        for name, array in npz_arrays(tmp_path / "a.npz").items():
            np.testing.assert_array_equal(array, arrays[name], strict=True)
            np.save(tmp_path / "b.npy", arrays[name])
            np.testing.assert_array_equal(npy_array(tmp_path / "b.npy"), array)


@every_case("declared", [30 * MB, 1000])
def test_our_mcap(tmp_path, declared, monkeypatch):
    monkeypatch.setenv(UNPACKED_MB.variable, "20")
    path = tmp_path / "bomb.mcap"
    chunked_mcap(path, size=30 * MB, declared=declared)
    for salvage in (False, True):
        with pytest.raises(TooLarge, match=rf"bomb\.mcap.*20 MB.*{UNPACKED_MB.variable}"):
            read_recorded(path, salvage=salvage)


def test_many_chunks_count_together(tmp_path, monkeypatch):
    path = tmp_path / "g.mcap"
    write_recording(path, 10_000, ended())
    read_recorded(path)
    monkeypatch.setenv(UNPACKED_MB.variable, "1")  # 10 000 ticks of 155 bytes are 1.55 MB
    with pytest.raises(TooLarge, match=r"2 MB"):
        read_recorded(path)


@pytest.mark.slow
@every_case(
    ("record", "error"),
    [
        ("header", "DataDamaged"),
        ("chunk", "TooLarge"),
        ("attachment", "DataDamaged"),
        ("metadata", "DataDamaged"),
    ],
)
def test_lengths_behind_the_end_of_an_mcap_allocate_nothing(record, error, tmp_path):
    opcode = {"header": 1, "chunk": 6, "attachment": 9, "metadata": 12}[record]
    path = tmp_path / "g.mcap"
    write_recording(path, 20, ended())
    data = path.read_bytes()
    body = struct.pack("<QQIQ", 2**60, 2**60, 2**32 - 1, 2**60)
    path.write_bytes(data[:8] + struct.pack("<BQ", opcode, len(body)) + body + data[8:])
    told = read_with_little_memory(f"read_recorded({str(path)!r})", 60 * MB)
    assert told.startswith(error), told


def parquet_bomb(path):
    pyarrow = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    column = pyarrow.array(np.zeros(10 * MB))
    with pq.ParquetWriter(path, pyarrow.schema([("a", pyarrow.float64())])) as writer:
        for _ in range(9):
            writer.write_table(pyarrow.table({"a": column}))


def test_a_long_text_that_is_repeated_takes_its_place_once(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    import pyarrow.parquet as pq

    from graspsense.sources.formats.parquet_format import read_parquet

    path = tmp_path / "texts.parquet"
    rows = 3000
    indices = pyarrow.array(np.zeros(rows, np.int32))
    column = pyarrow.DictionaryArray.from_arrays(indices, pyarrow.array(["x" * MB]))
    pq.write_table(pyarrow.table({"t": column, "a": np.arange(float(rows))}), path, store_schema=False)
    (table,) = read_parquet(path)  # 3 GB if each row had its own
    assert len(table) == rows
    assert table.texts["t"][0] is table.texts["t"][-1]


def test_mat(tmp_path, monkeypatch):
    from scipy.io import savemat

    path = tmp_path / "a.mat"
    arrays = {"t": np.arange(MB / 5.0), "cells": np.array([[1, "a"]], dtype=object)}
    savemat(path, arrays, do_compression=True)
    assert read_arrays(path)[0].numbers["t"].shape == (MB // 5,)
    monkeypatch.setenv(UNPACKED_MB.variable, "1")
    with pytest.raises(TooLarge, match=r"a\.mat"):
        read_arrays(path)
    monkeypatch.setenv(UNPACKED_MB.variable, "100")
    # A variable of version 4 that says 10^9 rows.
    path.write_bytes(struct.pack("<IIIII", 0, 10**9, 1, 0, 2) + b"t\0" + bytes(80))
    with pytest.raises(DataDamaged, match=r"a\.mat"):
        read_arrays(path)


def message_of(store, size):
    """Return the name of a type of messages, and one of so many bytes of zeros."""
    name = "std_msgs/msg/Float64MultiArray"
    layout = store.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    return name, store.types[name](layout, np.zeros(size // 8))


def ros1_bomb(path):
    rosbag1 = pytest.importorskip("rosbags.rosbag1")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    name, message = message_of(store, BOMB)
    writer = rosbag1.Writer(path)
    writer.set_compression(rosbag1.Writer.CompressionFormat.LZ4)
    with writer:
        connection = writer.add_connection("/a", name, typestore=store)
        writer.write(connection, 1, store.serialize_ros1(message, name))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "write", "call"),
    [
        ("exported.npz", deflated_npz, "read_exported({})"),
        ("arrays.npz", deflated_npz, "read_arrays(Path({}))"),
        ("zstd.mcap", chunked_mcap, "read_bag(Path({}))"),
        ("lz4.mcap", partial(chunked_mcap, compression="lz4", declared=1000), "read_bag(Path({}))"),
        ("bomb.parquet", parquet_bomb, "read_parquet(Path({}))"),
        ("bomb.bag", ros1_bomb, "read_bag(Path({}))"),
    ],
)
def test_a_small_file_that_unpacks_to_a_lot_is_refused_by_name(tmp_path, name, write, call):
    path = tmp_path / name
    write(path)
    assert path.stat().st_size < 4 * MB
    told = read_with_little_memory(call.format(repr(str(path))))
    assert told.startswith("TooLarge"), told
    assert all(part in told for part in (str(path), UNPACKED_MB.variable, "512 MB")), told


def ros2_bag(path, compression=None):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    name, message = message_of(store, 3 * MB)
    kept_as = rosbag2.StoragePlugin.MCAP if compression == "STORAGE" else rosbag2.StoragePlugin.SQLITE3
    writer = rosbag2.Writer(path, version=9, storage_plugin=kept_as)
    if compression:
        mode = getattr(rosbag2.CompressionMode, compression)
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection("/a", name, typestore=store)
        for t in range(1, 4):
            writer.write(connection, t, store.serialize_cdr(message, name))


@every_case("compression", ["FILE", "MESSAGE", "STORAGE"])
def test_ros2_bags(tmp_path, compression, monkeypatch):
    ros2_bag(tmp_path / "bag", compression)
    monkeypatch.setenv(UNPACKED_MB.variable, "120")
    assert len(read_bag(tmp_path / "bag")[0]) == 3  # three messages of 3 MB
    monkeypatch.setenv(UNPACKED_MB.variable, "7")
    with pytest.raises(TooLarge, match=rf"bag.*7 MB.*{UNPACKED_MB.variable}"):
        read_bag(tmp_path / "bag")


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"


@every_case(
    "statement",
    [
        f"DROP TABLE schema; CREATE VIEW schema AS {ENDLESS} SELECT count(*) AS schema_version FROM n",
        f"DROP TABLE message_definitions; CREATE VIEW message_definitions AS {ENDLESS} SELECT i AS id, "
        "'a' AS topic_type, '' AS encoding, '' AS encoded_message_definition, '' AS type_description_hash FROM n",
        "CREATE TRIGGER t AFTER INSERT ON topics BEGIN SELECT 1; END",
        "CREATE TABLE g(a INTEGER, b AS (zeroblob(1000000000)))",
    ],
)
def test_a_ros2_bag_that_computes_is_refused(tmp_path, statement):
    ros2_bag(tmp_path / "bag")
    (path,) = (tmp_path / "bag").glob("*.db3")
    with closing(sqlite3.connect(path)) as connection:
        connection.executescript(statement)
    original = path.read_bytes()
    with pytest.raises(DataDamaged, match="is computed"):
        read_bag(tmp_path / "bag")
    assert path.read_bytes() == original


@every_case(
    ("definition", "more", "says"),
    [
        ("geometry_msgs/Vector3[900000000] x\n", "geometry_msgs/Vector3:float64 x", "900000000"),
        ("string[900000000] x\n", "", "900000000"),
        ("lab/Nothing[] x\n", "lab/Nothing:", "without fields"),
        ("lab/B x\n", "lab/B:lab/A x", "contains itself"),
    ],
)
def test_definitions_of_messages_that_cannot_be_built(definition, more, says, tmp_path):
    """An array of four thousand million messages without fields takes four bytes."""
    pytest.importorskip("rosbags")
    path = tmp_path / "a.mcap"
    name, _, fields = more.partition(":")
    text = definition + (f"{'=' * 80}\nMSG: {name}\n{fields}\n" if name else "")
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2")
        schema = writer.register_schema("lab/msg/A", "ros2msg", text.encode())
        channel = writer.register_channel("/a", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0" + struct.pack("<I", 2**32 - 1) + bytes(64), 1)
        writer.finish()
    with pytest.raises(DataDamaged, match=says):
        read_bag(path)
