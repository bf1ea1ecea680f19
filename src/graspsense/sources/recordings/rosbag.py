"""Recordings of a PR2 gripper from ROS 1 and ROS 2 bags.

These topics of the left (`l`) or right (`r`) gripper are read:

| topic | type | used for |
|---|---|---|
| `/pressure/{l,r}_gripper_motor` | pr2_msgs/PressureState (2009: ethercat_hardware/PressureState) | cell images |
| `/joint_states` | sensor_msgs/JointState | gap, its rate, effort |
| `/{l,r}_gripper_controller/state` | pr2_controllers_msgs/JointControllerState | if there are no joint states |
| `/pr2_gripper_controller/state` | pr2_msgs/GripperControllerState (2009) | if there is neither |
| `/accelerometer/{l,r}_gripper_motor` | pr2_msgs/AccelerometerState | the fast channel `acceleration`, if present |

The driver stores the unsigned 16-bit cells in signed fields, so values above 32767 appear as negative numbers. The
fields of the two tips are l_finger_tip and r_finger_tip, or data0 and data1 in 2009. A message without a header, or
with a stamp of zero, has the time at which it was recorded (pr2_ethercat_drivers, pr2_common, and personalrobots-pkg of
September 2009). The accelerometer of the palm takes about 3000 samples a second, in m/s2; a message has those since the
one before, about three, and its time is that of the last (wiki.ros.org/ethercat_hardware/Tutorials/
GripperAccelerometer). In ROS a positive effort opens the gripper; here it squeezes.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import evolve

from graspsense.core.grasp.calibration import Cells, edge_force, masked, pad_force, tare, zero_of
from graspsense.core.values.channel import Channel, FastChannel
from graspsense.core.values.errors import ConfigError, DataDamaged, TareRefused
from graspsense.core.values.signals import Frame, Pads, Reading
from graspsense.recording.readable import readable
from graspsense.recording.replayable import Recording
from graspsense.recording.unpacked import Unpacked
from graspsense.sources.columns.fast_samples import most_in_a_tick, sample_blocks, signals_in_ticks
from graspsense.sources.columns.force_and_gap import doubtful_delay
from graspsense.sources.formats.ros_bags import opened_bag, stamp_ns
from graspsense.sources.formats.table import Numbers
from graspsense.sources.formats.topic_clocks import Messages, Nanoseconds, TopicTimes, common_clock

SIDES: Final = {"l": "left", "r": "right"}
TIP_FIELDS: Final = (("l_finger_tip", "r_finger_tip"), ("data0", "data1"))
"""Names of the fields of the two tips, since 2010 and in 2009."""
TARE_IMAGES: Final = 6
CELLS: Final = 22
"""Number of cells of a fingertip of the PR2."""
FIRST_PAD_CELL: Final = 7
"""The first cell on its gripping face."""
PAD_COUNTS_PER_N: Final = 1600.0
"""Counts of the sum of the fifteen cells of the gripping face under one newton (fingertip_pressure, scripts/
fingertip_geometry.py). The driver of the gripper has the same scales: `tests/sources/test_pr2_numbers.py`."""
EDGE_COUNTS_PER_N: Final = (600.0, 400.0, 600.0, 600.0, 600.0, 600.0, 400.0)
"""Counts of each of the cells 0 to 6 under one newton: back, side, corner, tip, tip, corner, side; source as above."""
PRESSURE: Final = "/pressure/{}_gripper_motor"
JOINT_STATES: Final = "/joint_states"
CONTROLLER_STATE: Final = "/{}_gripper_controller/state"
ACCELERATION: Final = "/accelerometer/{}_gripper_motor"
MOST_SAMPLES: Final = 1000
"""Limit on the samples of the accelerometer that one tick delivers; others follow in the next ticks."""
STATE_2009: Final = "/pr2_gripper_controller/state"

DEFINITIONS: Final[Mapping[str, str]] = {
    "pr2_msgs/msg/PressureState": "std_msgs/Header header\nint16[] l_finger_tip\nint16[] r_finger_tip\n",
    "pr2_msgs/msg/AccelerometerState": "std_msgs/Header header\ngeometry_msgs/Vector3[] samples\n",
    "pr2_controllers_msgs/msg/JointControllerState": (
        "std_msgs/Header header\nfloat64 set_point\nfloat64 process_value\nfloat64 process_value_dot\nfloat64 error\n"
        "float64 time_step\nfloat64 command\nfloat64 p\nfloat64 i\nfloat64 d\nfloat64 i_clamp\n"
    ),
}
"""Definitions of the messages of the PR2, for bags that contain no definitions of their own."""

_MESSAGE_BYTES: Final = 512
"""Bytes of a message in memory, about."""
_NAN: Final = float("nan")


def read_bag(name: str) -> Recording:
    """Return the recording in a bag: `FILE`, or `FILE#l` and `FILE#r` if it contains both grippers.

    The zero of the pads is the mean of the first images. Raises ConfigError if the file does not exist or the gripper
    must be named, DataDamaged if the file is not a bag or has no complete grasp, PluginUnavailable without the library
    rosbags.
    """
    file, _, side = name.partition("#")
    path = Path(file)
    if not path.exists():
        raise ConfigError(f"there is no bag {file!r}: name a .bag file, or the folder of a ROS 2 bag")
    if side not in ("", *SIDES):
        raise ConfigError(f"{name!r}: write l or r after #, for the left or the right gripper")
    kept = Unpacked(path)
    with opened_bag(path, DEFINITIONS) as bag, readable(path):
        messages = _Messages(path, _side(path, side, bag.topics), bag.topics)
        for topic, recorded_ns, message in bag.messages(messages.values.__contains__):
            kept.add(_MESSAGE_BYTES)
            messages.add(topic, recorded_ns, message)
    return _recording(path, messages)


class _Messages:
    """What is read of the messages of a gripper in a bag, by their topics, and when they came."""

    def __init__(self, path: Path, side: str, topics: Collection[str]) -> None:
        self.gripper, self.joint = f"{SIDES[side]} gripper", f"{side}_gripper_joint"
        self.pressure, self.acceleration = PRESSURE.format(side), ACCELERATION.format(side)
        self.source = _source(path, side, topics)
        self.values: dict[str, list[Any]] = {
            topic: [] for topic in (self.pressure, self.source, self.acceleration)
        }
        self.times = {topic: Messages() for topic in self.values}
        self.path = path

    def add(self, topic: str, recorded_ns: int, message: Any) -> None:
        """Add a message, unless it is of other joints."""
        if topic == self.acceleration:
            value: Any = [(sample.x, sample.y, sample.z) for sample in message.samples]
        else:
            value = _tips(self.path, message) if topic == self.pressure else _motion(message, self.joint)
        if value is not None and self.times[topic].add(recorded_ns, stamp_ns(message), value):
            self.values[topic].append(value)


def _recording(path: Path, messages: _Messages) -> Recording:
    """Return the recording that these messages are. Raises DataDamaged."""
    pressure, source, gripper = messages.pressure, messages.source, messages.gripper
    motions, tips, samples = (messages.values[topic] for topic in (source, pressure, messages.acceleration))
    if len(motions) < 2 or not tips:
        raise DataDamaged(
            f"{path} contains {len(motions)} positions of the {gripper} on {source} and {len(tips)} cell images on "
            f"{pressure}: a grasp needs both"
        )
    topics = {topic: stamps for topic, stamps in messages.times.items() if stamps.recorded_ns}
    clock = common_clock(path.name, topics, (pressure, source))
    moved = clock.topics[source]
    common = (moved.ns >= clock.begin_ns) & (moved.ns <= clock.end_ns)
    ns = moved.ns[common]
    duration_s = float(ns[-1] - ns[0]) * 1e-9 if len(ns) else 0.0
    if duration_s <= 0.0:
        raise DataDamaged(f"{path}: all positions on {source} have the same time")
    notes = [f"recorded on a PR2, {gripper}: gap from {source}, cells from {pressure}", *clock.notes]
    columns = np.array([motions[k] for k in moved.order[common]], dtype=np.float64).T
    readings = _readings(
        ns, columns, _images(tips, clock.topics[pressure], int(ns[0])), clock.topics[pressure], notes
    )
    channels: tuple[Channel, ...] = ()
    if any(samples):
        sampled = clock.topics[messages.acceleration]
        timed = [(t_ns, samples[k]) for t_ns, k in zip(sampled.ns.tolist(), sampled.order, strict=True)]
        channels, readings = _with_acceleration(readings, int(ns[0]), timed)
    recording = Recording(
        name=f"{path.name}, {gripper}",
        readings=readings,
        channels=channels,
        rate_hz=(len(ns) - 1) / duration_s,
        notes=tuple(notes),
        notices=clock.notices,
    )
    if not {pressure, source} <= clock.delays_ns.keys():
        return recording
    t_s, gap, left, right = recording.columns("t_s", "gap_m", "force_left_n", "force_right_n")
    later_s = (clock.delays_ns[pressure] - clock.delays_ns[source]) * 1e-9
    apart = doubtful_delay(t_s, gap, 0.5 * (left + right), later_s)
    return evolve(recording, notices=(*recording.notices, *filter(None, [apart])))


def _side(path: Path, side: str, topics: Collection[str]) -> str:
    there = [candidate for candidate in SIDES if PRESSURE.format(candidate) in topics]
    if side in there:
        return side
    if not there:
        wanted = " or ".join(PRESSURE.format(candidate) for candidate in SIDES)
        raise DataDamaged(
            f"{path} has no fingertips: no topic {wanted}. It has: {', '.join(sorted(topics)) or 'none'}"
        )
    if side:
        raise ConfigError(f"{path} has no {SIDES[side]} gripper: no topic {PRESSURE.format(side)}")
    if len(there) > 1:
        raise ConfigError(
            f"{path} contains both grippers: write {path}#l for the left or {path}#r for the right one"
        )
    return there[0]


def _source(path: Path, side: str, topics: Collection[str]) -> str:
    wanted = (JOINT_STATES, CONTROLLER_STATE.format(side), STATE_2009)
    for topic in wanted:
        if topic in topics:
            return topic
    raise DataDamaged(f"{path} has no gap of the gripper: no topic {', '.join(wanted)}")


def _tips(path: Path, message: Any) -> tuple[Cells, Cells]:
    """Return the cells of the two tips in a message."""
    for fields in TIP_FIELDS:
        if all(hasattr(message, name) for name in fields):
            left, right = (
                tuple(float(int(cell) & 0xFFFF) for cell in getattr(message, name)) for name in fields
            )
            if len(left) != CELLS or len(right) != CELLS:
                raise DataDamaged(
                    f"{path}: a pressure message has {len(left)} and {len(right)} cells, not {CELLS}"
                )
            return left, right
    names = ", ".join(" and ".join(pair) for pair in TIP_FIELDS)
    raise DataDamaged(f"{path}: a pressure message has neither of the pairs of fields {names}")


def _motion(message: Any, joint: str) -> tuple[float, float, float] | None:
    """Return gap (m), its rate (m/s) and effort (N) of this joint in a message; None if it is of other joints."""
    if hasattr(message, "process_value"):
        return message.process_value, message.process_value_dot, -message.command
    if hasattr(message, "joint_position"):
        if message.joint_name not in ("", joint):
            return None
        return message.joint_position, message.joint_velocity, -message.joint_applied_effort
    if joint not in message.name:
        return None
    i = list(message.name).index(joint)
    velocity, effort = ([*column, *[_NAN] * (i + 1)][i] for column in (message.velocity, message.effort))
    return float(message.position[i]), float(velocity), -float(effort)


def _images(tips: Sequence[tuple[Cells, Cells]], times: TopicTimes, began_ns: int) -> list[Pads]:
    """Return the last image at each message, which can repeat the one before: it has no clock of the board."""
    images: list[Pads] = []
    for ns, k in zip(times.ns.tolist(), times.order, strict=True):
        last = images[-1] if images else Pads(0.0, 0, (), ())
        same = tips[k] == (last.left, last.right)
        images.append(last if same else Pads((ns - began_ns) * 1e-9, last.counter + 1, *tips[k]))
    return images


def _readings(
    ns: Nanoseconds, columns: Numbers, images: Sequence[Pads], times: TopicTimes, notes: list[str]
) -> tuple[Reading, ...]:
    """Return a reading for each motion, with the last image; its forces are missing where that is too old."""
    unloaded = list(dict.fromkeys(images))[:TARE_IMAGES]
    try:
        zero = tare(unloaded, PAD_COUNTS_PER_N, FIRST_PAD_CELL)
    except TareRefused as refused:
        zero = zero_of([pad.left for pad in unloaded]), zero_of([pad.right for pad in unloaded])
        notes.append(
            f"the zero of the pads is uncertain, because the first {len(unloaded)} images cannot be used "
            f"for it: {refused}"
        )
    gap, velocity, effort = columns
    steps = np.diff(ns, prepend=ns[:1]) * 1e-9
    with np.errstate(all="ignore"):
        change = np.diff(gap, prepend=gap[:1]) / steps
    velocity = np.where(np.isnan(velocity) & (steps > 0.0), change, velocity)
    last, old = times.latest(ns)
    readings = []
    for i, (k, is_old) in enumerate(zip(last.tolist(), old.tolist(), strict=True)):
        pads = images[k]
        left, edge_left = (_NAN, _NAN) if is_old else _forces(pads.left, zero[0])
        right, edge_right = (_NAN, _NAN) if is_old else _forces(pads.right, zero[1])
        frame = Frame(
            t_s=(int(ns[i]) - int(ns[0])) * 1e-9,
            dt_s=steps[i].item(),
            gap_m=gap[i].item(),
            velocity_m_s=velocity[i].item(),
            effort_n=effort[i].item(),
            force_left_n=left,
            force_right_n=right,
            edge_left_n=edge_left,
            edge_right_n=edge_right,
        )
        readings.append(Reading(frame, pads))
    return tuple(readings)


def _with_acceleration(
    readings: Sequence[Reading],
    began_ns: int,
    messages: Sequence[tuple[int, list[tuple[float, float, float]]]],
) -> tuple[tuple[Channel, ...], tuple[Reading, ...]]:
    """Return the channel of the accelerometer, and the readings with its samples.

    The samples of a message are taken as equally spaced since the one before. Those before the first reading are left
    out.
    """
    sampled_s: list[float] = []
    values: list[tuple[float, float, float]] = []
    for (before_ns, _), (t_ns, rows) in pairwise(messages):
        if before_ns >= began_ns:
            step_ns = (t_ns - before_ns) / max(len(rows), 1)
            sampled_s += [(before_ns - began_ns + step_ns * k) * 1e-9 for k in range(1, len(rows) + 1)]
            values += rows
    times = np.array([reading.frame.t_s for reading in readings])
    most = most_in_a_tick(times, sampled_s)
    if most == 0:
        return (), tuple(readings)
    rate_hz = (len(sampled_s) - 1) / (sampled_s[-1] - sampled_s[0]) if sampled_s[-1] > sampled_s[0] else 0.0
    channel = FastChannel(
        "acceleration", "m/s2", rate_hz, samples=min(most, MOST_SAMPLES), axes=("x", "y", "z"), clock="sensor"
    )
    blocks = sample_blocks(times, np.array(sampled_s), np.array(values), channel)
    signals = signals_in_ticks((channel,), [blocks], len(readings))
    return (channel,), tuple(
        reading._replace(signals=own) for reading, own in zip(readings, signals, strict=True)
    )


def _forces(cells: Cells, zero: Cells) -> tuple[float, float]:
    """Return the pad force and the edge force of a tip; NaN if no cell has a value."""
    kept, bad = masked(cells, zero)
    if bad == CELLS:
        return _NAN, _NAN
    return pad_force(kept, zero, PAD_COUNTS_PER_N, FIRST_PAD_CELL), edge_force(kept, zero, EDGE_COUNTS_PER_N)
