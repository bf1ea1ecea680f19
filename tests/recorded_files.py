"""A small valid recording in every format that is read, by our own writers and those of the formats' libraries."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from kept import ended, keep, write_recording

from graspsense.recording.export_trace import write_csv, write_npz, write_parquet
from graspsense.recording.reader import read_recorded
from graspsense.store.store import Store

T_S = np.arange(40) * 0.01
GAP_M = 0.06 - 0.02 * np.minimum(T_S / 0.2, 1.0)
FORCE_N = np.maximum(0.05 - GAP_M, 0.0) * 500.0
COLUMNS = {"t": T_S, "gap": GAP_M, "F": FORCE_N, "cells": np.outer(FORCE_N, np.arange(1.0, 5.0))}
MANIFEST = """\
files = "{{label}}_{{order:d}}.{ending}"
time = "t [s]"
gap = "gap [m]"
force = "F [N]"
channels = {{ cells = "cells [counts]" }}
values = {{ most = "peak(F) [N]" }}
"""
TEXT_MANIFEST = MANIFEST.replace('"cells [counts]"', "\"'c_*' [counts]\"")
ROS_MANIFEST = """\
files = "{{label}}_{{order:d}}{ending}"
gap = "'/hand/width.data'"
left = "'/hand/forces.data'[0]"
right = "'/hand/forces.data'[1]"
"""


def npz(path: Path) -> None:
    np.savez_compressed(path, **COLUMNS)


def npy(path: Path) -> None:
    np.save(path, np.column_stack([T_S, GAP_M, FORCE_N]))


def mat(path: Path) -> None:
    scipy.io.savemat(path, COLUMNS, do_compression=True)


def plain_mat(path: Path) -> None:
    scipy.io.savemat(path, COLUMNS)


def parquet(path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    columns = {**COLUMNS, "cells": list(COLUMNS["cells"]), "note": ["squeezed"] * len(T_S)}
    pyarrow.parquet.write_table(pyarrow.table(columns), path)


def text(path: Path) -> None:
    names = ["t", "gap", "F", *(f"c_{k}" for k in range(4)), "note"]
    rows = np.column_stack([T_S, GAP_M, FORCE_N, COLUMNS["cells"]]).tolist()
    lines = [",".join(names), *(",".join([*map(repr, row), "squeezed"]) for row in rows)]
    path.write_text("\n".join(lines) + "\n")


def icub(path: Path) -> None:
    lines = ["-10000"]
    for force in FORCE_N[::4]:
        taxel = f"{240 - force:.0f}"
        lines += [" ".join([f"{20 + force:.3f}"] * 9), " ".join(["11"] * 5), *[" ".join([taxel] * 12)] * 5]
    path.write_text("\n".join(lines) + "\n")


def our_mcap(path: Path) -> None:
    write_recording(path, len(T_S), ended())


def exported(write: Callable[..., None]) -> Callable[[Path], None]:
    def written(path: Path) -> None:
        recording = path.with_name("exported.mcap")
        if not recording.exists():
            our_mcap(recording)
        write(path, read_recorded(recording))

    return written


exported_npz, exported_csv, exported_parquet = map(exported, (write_npz, write_csv, write_parquet))


def ros1_bag(path: Path) -> None:
    from rosbags.rosbag1 import Writer

    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    _write_hand(writer, ros1=True)


def ros2_bag(path: Path, **options: object) -> None:
    from rosbags.rosbag2 import Writer

    _write_hand(Writer(path, version=9, **options), ros1=False)


def ros2_mcap_bag(path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin

    ros2_bag(path, storage_plugin=StoragePlugin.MCAP)


def ros_mcap(path: Path) -> None:
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    name = "std_msgs/msg/Float64"
    several = "std_msgs/msg/Float64MultiArray"
    layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        channels = []
        for topic, kind in (("/hand/width", name), ("/hand/forces", several)):
            definition, _ = store.generate_msgdef(kind, ros_version=2)
            schema = writer.register_schema(kind, "ros2msg", definition.encode())
            channels.append(writer.register_channel(topic, "cdr", schema))
        for t_s, gap, force in zip(T_S, GAP_M, FORCE_N, strict=True):
            stamp_ns = 10**18 + round(t_s * 1e9)
            forces = store.types[several](layout, np.array([force, force]))
            writer.add_message(
                channels[0], stamp_ns, bytes(store.serialize_cdr(store.types[name](gap), name)), stamp_ns
            )
            writer.add_message(channels[1], stamp_ns, bytes(store.serialize_cdr(forces, several)), stamp_ns)
        writer.finish()


def _write_hand(writer: object, ros1: bool) -> None:
    forces = np.column_stack([FORCE_N, FORCE_N])
    write_topics(writer, {"/hand/width": (T_S, GAP_M), "/hand/forces": (T_S, forces)}, ros1=ros1)


def write_topics(writer: Any, topics: Mapping[str, tuple[Any, Any]], ros1: bool) -> None:
    """Write topics of numbers, or of rows of numbers, into a bag: the times (s) and the values of each."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    layout = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    encode = store.serialize_ros1 if ros1 else store.serialize_cdr
    messages = []
    with writer:
        for topic, (times_s, values) in topics.items():
            kind = "std_msgs/msg/Float64" if np.ndim(values) == 1 else "std_msgs/msg/Float64MultiArray"
            connection = writer.add_connection(topic, kind, typestore=store)
            for t_s, value in zip(times_s, values, strict=True):
                number = (value,) if np.ndim(values) == 1 else (layout, value)
                data = encode(store.types[kind](*number), kind)
                messages.append((10**18 + round(t_s * 1e9), connection, data))
        for stamp_ns, connection, data in sorted(messages, key=lambda message: message[0]):
            writer.write(connection, stamp_ns, data)


def pr2_bag(path: Path) -> None:
    """Write a ROS 1 bag of a PR2 gripper: motion at 100 Hz, and images that show the force."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    from graspsense.sources.recordings.rosbag import DEFINITIONS

    store = get_typestore(Stores.ROS1_NOETIC)
    for name, definition in DEFINITIONS.items():
        store.register(get_types_from_msg(definition, name))
    time, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    states, images = "pr2_controllers_msgs/msg/JointControllerState", "pr2_msgs/msg/PressureState"
    with Writer(path) as writer:
        state = writer.add_connection("/r_gripper_controller/state", states, typestore=store)
        image = writer.add_connection("/pressure/r_gripper_motor", images, typestore=store)
        for k, (t_s, gap, force) in enumerate(zip(T_S, GAP_M, FORCE_N, strict=True)):
            stamp_ns = 10**18 + round(t_s * 1e9)
            stamp = header(k, time(stamp_ns // 10**9, stamp_ns % 10**9), "")
            cells = np.full(22, 3000 + round(100 * force) + k, dtype=np.int16)
            moved = store.types[states](stamp, 0.0, gap, 0.0, 0.0, 0.01, -1.0, 0.0, 0.0, 0.0, 0.0)
            writer.write(state, stamp_ns, store.serialize_ros1(moved, states))
            writer.write(
                image, stamp_ns, store.serialize_ros1(store.types[images](stamp, cells, cells), images)
            )


def store(folder: Path) -> None:
    with Store.open(folder) as opened:
        for k in range(4):
            keep(
                opened,
                f"can:{'full' if k % 2 else 'empty'}",
                f"can#{k}",
                values=(0.06 + k / 1000, 5.0),
                ticks=20,
            )
