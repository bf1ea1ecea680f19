"""ROS bags of a PR2 as recordings, on bags written here with the messages' own definitions."""

from __future__ import annotations

import math
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import every_case

from graspsense import load_pipeline
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.trace import signals_of
from graspsense.sources.recordings.rosbag import read_bag

if find_spec("rosbags") is None:
    pytest.skip("rosbags is the extra `ros`", allow_module_level=True)

PRESSURE_NOW = (
    "pr2_msgs/msg/PressureState",
    "std_msgs/Header header\nint16[] l_finger_tip\nint16[] r_finger_tip\n",
)
PRESSURE_2009 = (
    "ethercat_hardware/msg/PressureState", "std_msgs/Header header\nint16[] data0\nint16[] data1\n",
)  # fmt: skip
STATE_2009 = (
    "pr2_msgs/msg/GripperControllerState",
    "float64 joint_commanded_effort\nfloat64 joint_applied_effort\nstring joint_name\n"
    "float64 joint_position\nfloat64 joint_velocity\n",
)
CONTROLLER_STATE = (
    "pr2_controllers_msgs/msg/JointControllerState",
    "std_msgs/Header header\nfloat64 set_point\nfloat64 process_value\nfloat64 process_value_dot\nfloat64 error\n"
    "float64 time_step\nfloat64 command\nfloat64 p\nfloat64 i\nfloat64 d\nfloat64 i_clamp\n",
)
BEGAN_S = 1_252_000_000.0
"""Some time in September 2009."""

ZERO = 32_700
"""Unloaded counts near the sign bit, so that a load wraps the signed field."""


class Bag:
    """A bag being written, of either kind: `add(topic, (type, definition), t_s, **fields)`."""

    def __init__(self, path: Path, ros: int, definitions: bool = True) -> None:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_typestore

        self.ros, self.definitions = ros, definitions
        self.store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.ROS2_HUMBLE)
        self.writer: Any = (
            rosbag1.Writer(path) if ros == 1 else rosbag2.Writer(path, version=9 if definitions else 8)
        )
        self.writer.open()
        self.connections: dict[str, Any] = {}
        self.sequence = 0

    def add(self, topic: str, kind: tuple[str, str] | str, t_s: float, **fields: Any) -> None:
        from rosbags.typesys import get_types_from_msg

        name = kind if isinstance(kind, str) else kind[0]
        if not isinstance(kind, str) and name not in self.store.fielddefs:
            self.store.register(get_types_from_msg(kind[1], name))
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, name, typestore=self.store)
        message = self.store.types[name](**fields)
        encode = self.store.serialize_ros1 if self.ros == 1 else self.store.serialize_cdr
        self.writer.write(self.connections[topic], round(t_s * 1e9), encode(message, name))

    def header(self, t_s: float) -> Any:
        stamp = self.store.types["builtin_interfaces/msg/Time"](int(t_s), round((t_s - int(t_s)) * 1e9))
        kind = self.store.types["std_msgs/msg/Header"]
        self.sequence += 1
        return kind(self.sequence, stamp, "") if self.ros == 1 else kind(stamp, "")

    def close(self) -> None:
        self.writer.close()


def signed(cells: Any) -> Any:
    """16 bits unsigned in a signed field, as the PR2's driver published them."""
    return np.asarray(cells, dtype=np.int64).astype(np.uint16).view(np.int16)


@pytest.fixture(scope="module")
def grasp() -> Any:
    """A simulated grasp of a bottle: its trace is what the bags below hold."""
    options = ["classifier.type=none", "gripper.open_gap_m=0.07"]
    return load_pipeline(options=options).grasp(object="odwalla:full_closed", seed=1)


def pressure(bag: Bag, t_s: float, left: Any, right: Any, kind: tuple[str, str], side: str = "r") -> None:
    names = ("data0", "data1") if kind is PRESSURE_2009 else ("l_finger_tip", "r_finger_tip")
    fields = dict(zip(names, (signed(left), signed(right)), strict=True))
    bag.add(f"/pressure/{side}_gripper_motor", kind, t_s + 0.002, header=bag.header(t_s), **fields)


def controller_state(
    bag: Bag, t_s: float, gap_m: float = 0.05, velocity_m_s: float = 0.0, effort_n: float = 0.0
):
    """Add a state of the controller that was recorded at this time; ROS: a positive effort opens."""
    others = dict.fromkeys(("set_point", "error", "time_step", "p", "i", "d", "i_clamp"), 0.0)
    bag.add("/r_gripper_controller/state", CONTROLLER_STATE, t_s, header=bag.header(t_s), process_value=gap_m,
            process_value_dot=velocity_m_s, command=effort_n, **others)  # fmt: skip


def write(
    path: Path, grasp: Any, *, ros: int, source: str, kind: tuple[str, str], definitions: bool = True
) -> None:
    """Write the grasp at the PR2's rates: motion at 100 Hz, images as they came and each twice."""
    trace, bag = grasp.trace, Bag(path, ros, definitions)
    shift = ZERO - 3300
    for t, left, right in zip(trace.pad_t_s, trace.pad_left, trace.pad_right, strict=True):
        pressure(bag, BEGAN_S + t, left + shift, right + shift, kind)
        pressure(bag, BEGAN_S + t + 0.02, left + shift, right + shift, kind)
    for i in range(0, len(trace), 10):
        t_s, gap, velocity = BEGAN_S + trace.t_s[i], trace.gap_m[i], trace.velocity_m_s[i]
        effort = -trace.effort_n[i]  # ROS: positive opens
        if source == "/joint_states":
            kind_ = "sensor_msgs/msg/JointState"
            fields = {"name": ["head_pan_joint", "r_gripper_joint"], "position": np.array([9.0, gap]),
                      "velocity": np.array([9.0, velocity]), "effort": np.array([9.0, effort])}  # fmt: skip
            bag.add(source, kind_, t_s + 0.001, header=bag.header(t_s), **fields)
        elif source == "/r_gripper_controller/state":
            controller_state(bag, t_s, gap, velocity, effort)
        else:
            bag.add(source, STATE_2009, t_s, joint_commanded_effort=0.0, joint_applied_effort=effort,
                    joint_name="r_gripper_joint", joint_position=gap, joint_velocity=velocity)  # fmt: skip
    bag.close()


CASES = {
    "ros1": {"ros": 1, "source": "/joint_states", "kind": PRESSURE_NOW},
    "ros1-2009": {"ros": 1, "source": "/pr2_gripper_controller/state", "kind": PRESSURE_2009},
    "ros2-without-definitions": {
        "ros": 2,
        "source": "/r_gripper_controller/state",
        "kind": PRESSURE_NOW,
        "definitions": False,
    },
    "ros2-2009": {"ros": 2, "source": "/pr2_gripper_controller/state", "kind": PRESSURE_2009},
}


@pytest.mark.parametrize(("ros", "definitions"), [pytest.param(1, True, marks=pytest.mark.slow), (2, False)])
def test_the_accelerometer_of_a_bag_is_a_fast_channel_with_every_sample(ros, definitions, tmp_path):
    path = tmp_path / ("grasp.bag" if ros == 1 else "grasp")
    bag = Bag(path, ros, definitions)
    kind = "pr2_msgs/msg/AccelerometerState", "std_msgs/Header header\ngeometry_msgs/Vector3[] samples\n"
    sampled = 0
    for tick in range(100):
        t_s = BEGAN_S + 0.001 * tick
        if tick % 40 == 0:
            pressure(bag, t_s, np.full(22, ZERO), np.full(22, ZERO), PRESSURE_NOW)
        if tick % 10 == 0:
            controller_state(bag, t_s)
        vector = bag.store.types["geometry_msgs/msg/Vector3"]
        new = 2 if tick % 4 == 3 else 3
        samples = [vector(float(sampled + k), -1.0, 9.81) for k in range(new)]
        sampled += new
        bag.add("/accelerometer/r_gripper_motor", kind, t_s, header=bag.header(t_s), samples=samples)
    bag.close()

    recording = read_bag(str(path))
    (channel,) = recording.channels
    assert (channel.name, channel.unit, channel.axes) == ("acceleration", "m/s2", ("x", "y", "z"))
    assert channel.rate_hz == pytest.approx(2750.0, rel=0.02)
    signal = signals_of([reading.signals for reading in recording.readings])["acceleration"]
    # The first message came with the first position, and nine messages came after the last one. Of the ninety between,
    # 22 have two samples.
    assert signal.values[:, 0].tolist() == list(range(3, signal.values.shape[0] + 3))
    assert signal.values.shape[0] == 3 * 90 - 22
    assert signal.values[0].tolist() == [3.0, -1.0, 9.81]
    assert signal.lost == 0
    assert signal.t_s[-1] == pytest.approx(recording.readings[-1].frame.t_s, abs=1e-6)


@every_case("case", CASES)
def test_bag_is_the_grasp_that_was_written(case: str, grasp: Any, tmp_path: Path) -> None:
    path = tmp_path / ("grasp.bag" if "ros1" in case else "grasp")
    write(path, grasp, **CASES[case])  # type: ignore[arg-type]
    recording = read_bag(str(path))
    trace = grasp.trace
    frames = [reading.frame for reading in recording.readings]
    assert recording.rate_hz == pytest.approx(100.0, rel=0.01)
    np.testing.assert_allclose([f.t_s for f in frames], trace.t_s[::10] - trace.t_s[0], atol=1e-6)
    np.testing.assert_allclose([f.gap_m for f in frames], trace.gap_m[::10])
    np.testing.assert_allclose([f.velocity_m_s for f in frames], trace.velocity_m_s[::10])
    np.testing.assert_allclose([f.effort_n for f in frames], trace.effort_n[::10])
    pads = recording.readings[-1].pads
    images = int(np.sum(trace.pad_t_s <= trace.t_s[::10][-1]))
    assert pads.counter == images, "an image that is repeated counts once"
    np.testing.assert_array_equal(pads.left, trace.pad_left[images - 1] + ZERO - 3300)
    # Zero and images differ from the run's by the noise of 15 counts a cell: sqrt(15) * 15 / 1600 N and a few.
    peak = max(f.force_left_n for f in frames)
    assert peak == pytest.approx(float(np.max(trace.force_left_n)), abs=0.15)
    assert max(max(reading.pads.left) for reading in recording.readings) > 2**15, (
        "the load crosses the sign bit"
    )


def motion(bag: Bag, t_s: float, gap_m: float = 0.05, side: str = "r") -> None:
    bag.add("/pr2_gripper_controller/state", STATE_2009, t_s, joint_commanded_effort=0.0, joint_applied_effort=0.0,
            joint_name=f"{side}_gripper_joint", joint_position=gap_m, joint_velocity=0.0)  # fmt: skip


def test_fingertip_that_reads_zero_throughout_is_absent(tmp_path: Path) -> None:
    bag = Bag(tmp_path / "a.bag", 1)
    for i in range(8):
        cells = [3000 + i] * 22
        pressure(bag, BEGAN_S + 0.041 * i, [0] * 22, cells, PRESSURE_NOW)
        motion(bag, BEGAN_S + 0.041 * i)
    bag.close()
    recording = read_bag(str(tmp_path / "a.bag"))
    assert all(math.isnan(reading.frame.force_left_n) for reading in recording.readings)
    assert not any(math.isnan(reading.frame.force_right_n) for reading in recording.readings)
    assert any("left fingertip" in note for note in recording.notes)


def test_bag_of_both_grippers_must_be_told_which(tmp_path: Path) -> None:
    bag = Bag(tmp_path / "a.bag", 1)
    for i in range(8):
        for side, level in (("l", 3000), ("r", 3500)):
            pressure(bag, BEGAN_S + 0.041 * i, [level + i] * 22, [level] * 22, PRESSURE_NOW, side)
            motion(bag, BEGAN_S + 0.041 * i, 0.05 if side == "l" else 0.07, side)
    bag.close()
    path = str(tmp_path / "a.bag")
    with pytest.raises(ConfigError, match=r"a\.bag#l .*a\.bag#r"):
        read_bag(path)
    assert {reading.frame.gap_m for reading in read_bag(path + "#l").readings} == {0.05}
    assert read_bag(path + "#r").readings[-1].pads.left[0] == 3507
    with pytest.raises(ConfigError, match=r"a\.bag#x"):
        read_bag(path + "#x")


def test_what_is_no_bag_is_told_apart(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no bag"):
        read_bag(str(tmp_path / "missing.bag"))
    (tmp_path / "text.bag").write_text("this is no bag\n")
    (tmp_path / "empty").mkdir()
    for name in ("text.bag", "empty"):
        with pytest.raises(DataDamaged, match=re.escape(str(tmp_path / name))):
            read_bag(str(tmp_path / name))
    bag = Bag(tmp_path / "a.bag", 1)
    motion(bag, BEGAN_S)
    bag.close()
    with pytest.raises(
        DataDamaged, match=r"a\.bag .*/pressure/l_gripper_motor.*/pr2_gripper_controller/state"
    ):
        read_bag(str(tmp_path / "a.bag"))


def test_bag_that_is_cut_short_or_changed_raises_nothing_but_our_own(grasp: Any, tmp_path: Path) -> None:
    whole = tmp_path / "whole.bag"
    write(whole, grasp, ros=1, source="/joint_states", kind=PRESSURE_NOW)
    data = whole.read_bytes()
    chance = np.random.default_rng(5)
    damaged = 0
    for i in range(12):
        broken = bytearray(data[: int(chance.integers(len(data)))] if i % 2 else data)
        if not i % 2:
            for integer in chance.integers(len(broken), size=40):
                broken[integer] = int(chance.integers(256))
        path = tmp_path / f"{i}.bag"
        path.write_bytes(bytes(broken))
        try:
            read_bag(str(path))
        except (DataDamaged, ConfigError):
            damaged += 1
    assert damaged >= 6, "at least those that are cut short"
