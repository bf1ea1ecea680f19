"""Topics whose headers are from several clocks, that begin late or end early, or that fall silent."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import every_case

from graspsense.core.values.errors import DataDamaged
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.replayable import Recording
from graspsense.sources.formats.topic_clocks import Messages, common_clock
from graspsense.sources.importing.import_sources import recordings_to_import
from graspsense.sources.manifest.expression import ExpressionError, parse
from graspsense.sources.recordings.dataset_recordings import readable_or_not

S = 1_000_000_000
BEGAN_NS = 1_700_000_000 * S
T_S = np.arange(300) * 0.01
GAP_M = 0.08 - 0.01 * T_S
FORCE_N = np.maximum(T_S - 1.0, 0.0) * 3.0 + np.random.default_rng(0).normal(0.0, 0.01, len(T_S))
MANIFEST = """\
files = "jar"
label = "jar"
gap = "'/hand.position'"
force = "'/tip.data'[0]"
"""


def messages(t_s: Any, stamped_s: Any = None, delay_s: float = 0.002) -> Messages:
    """Messages that were recorded shortly after these times; without `stamped_s` their headers have these times."""
    joined = Messages()
    for time_s, stamp in zip(t_s, t_s if stamped_s is None else stamped_s, strict=True):
        joined.add(BEGAN_NS + round((time_s + delay_s) * S), BEGAN_NS + round(stamp * S), [time_s])
    return joined


HEALTHY = messages(T_S)
CLOCKS = {
    "behind": T_S - 20.0,
    "ahead": T_S + 20.0,
    "half a second": T_S + 0.5,
    "since boot": T_S - 1.69e9,
    "2 % fast": T_S * 1.02,
    "set back": np.where(T_S > 1.3, T_S - 0.5, T_S),
    "set back and forth": np.where((T_S > 1.0) & (T_S < 1.3), T_S - 0.2, T_S),
    "set forward": np.where(T_S > 1.3, T_S + 3600.0, T_S),
    "set back by 30 ms": np.where(T_S > 1.3, T_S - 0.03, T_S),
    "set forward by 60 ms": np.where(T_S > 1.05, T_S + 0.06, T_S),
    "set by 40 ms for a moment": np.where((T_S > 0.9) & (T_S < 1.2), T_S + 0.04, T_S),
    "1 % slow": T_S * 0.99,
    "coarse": np.floor(T_S / 0.05 + 1e-6) * 0.05,
    "standing still": 0.0 * T_S,
    "standing still from the contact on": np.minimum(T_S, 1.0),
    "standing still for a moment": np.where((T_S > 1.0) & (T_S < 1.2), 1.0, T_S),
}


@every_case("clock", CLOCKS)
@every_case("swapped", [False, True])
def test_headers_of_another_clock_are_not_used(clock: str, swapped: bool) -> None:
    topics = {"/hand": HEALTHY, "/tip": messages(T_S, CLOCKS[clock])}
    common = common_clock("bag", dict(reversed(topics.items())) if swapped else topics)
    assert np.array_equal(common.topics["/tip"].ns, common.topics["/hand"].ns)
    assert common.end_ns - common.begin_ns == pytest.approx(3.0 * S, rel=1e-6)
    assert len(common.notices) == 1
    assert "recorded" in common.notices[0]


def test_a_recorder_that_was_late_and_headers_that_stand_still_in_every_topic_change_nothing() -> None:
    """The latter as of a simulation whose clock is not published."""
    common = common_clock("bag", {"/hand": messages(T_S, 0.0 * T_S), "/tip": messages(T_S, 0.0 * T_S)})
    assert common.end_ns - common.begin_ns == pytest.approx(3.0 * S, rel=1e-6)
    topics = messages(T_S)
    held_up = BEGAN_NS + round(1.8 * S)
    topics.recorded_ns[100:170] = [max(ns, held_up + k) for k, ns in enumerate(topics.recorded_ns[100:170])]
    common = common_clock("bag", {"/hand": HEALTHY, "/tip": topics})
    assert common.notices == ()
    assert np.array_equal(common.topics["/tip"].ns, common.topics["/hand"].ns)


@every_case("ahead_s", [0.2, -0.2])
def test_a_slow_topic_is_not_told_from_a_clock_that_is_a_little_off(ahead_s: float) -> None:
    """With fingers at 30 mm/s, the gap of the contact is wrong by 6 mm if it is the clock."""
    common = common_clock("bag", {"/hand": HEALTHY, "/tip": messages(T_S, T_S + ahead_s)})
    assert common.topics["/tip"].ns[0] - common.topics["/hand"].ns[0] == pytest.approx(ahead_s * S)
    assert common.delays_ns["/tip"] - common.delays_ns["/hand"] == pytest.approx(-ahead_s * S)
    assert not any("header" in notice for notice in common.notices)


@every_case("delay_s", [0.0, 0.1, 3600.0])
def test_headers_of_one_clock_are_used_whatever_the_delay_of_the_recording(delay_s: float) -> None:
    """A bag that is played and recorded again has times of recording that are all late."""
    late = messages(T_S + 0.004, delay_s=delay_s)
    common = common_clock("bag", {"/hand": messages(T_S, delay_s=delay_s), "/tip": late})
    assert common.notes[-1] == "all have messages from 0.004 to 3.000 s"
    assert common.notices == ()
    assert common.begin_ns - common.topics["/hand"].ns[0] == pytest.approx(0.004 * S)
    assert any("/tip: 300 messages" in note and "longest hold 10 ms" in note for note in common.notes)


def test_a_header_without_a_time_has_that_of_its_recording_on_the_clock_of_its_topic() -> None:
    topics = messages(T_S, delay_s=3600.0)
    topics.stamped_ns[0] = topics.stamped_ns[150] = 0
    common = common_clock("bag", {"/hand": messages(T_S, delay_s=3600.0), "/tip": topics})
    assert np.array_equal(common.topics["/tip"].ns, common.topics["/hand"].ns)


def test_messages_that_are_stamped_when_they_come_in_bursts_are_told() -> None:
    """As of a serial port whose driver reads five lines at once: the first is 40 ms older than its time."""
    came_s = np.floor(T_S / 0.05 + 1e-6) * 0.05 + 0.05 + 1e-5 * (np.arange(len(T_S)) % 5)
    (told,) = common_clock("bag", {"/hand": HEALTHY, "/tip": messages(came_s)}).notices
    assert all(part in told for part in ("/tip has 5 messages", "every 50 ms"))


@pytest.mark.parametrize("seeds", [15, pytest.param(400, marks=pytest.mark.slow)])
def test_noise_of_time_and_lost_messages_are_no_fault(seeds: int) -> None:
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        topics = {}
        for topic in ("/hand", "/tip"):
            hz = float(rng.choice([25.0, 50.0, 100.0, 250.0, 1000.0]))
            t_s = np.arange(0.0, 3.0, 1.0 / hz)
            t_s = t_s[rng.random(len(t_s)) > rng.choice([0.0, 0.02])]
            stamped_s = t_s + np.abs(rng.normal(0.0, rng.choice([0.0, 2e-4, 1e-3]), len(t_s)))
            late_s = rng.exponential(rng.choice([1e-4, 1e-3, 1e-2]), len(t_s))
            topics[topic] = messages(np.maximum.accumulate(stamped_s + late_s), stamped_s)
        assert common_clock("bag", topics).notices == (), seed
        # The delays of a busy computer are no clock of their own, also where they change the order of messages.
        busy = (rng.uniform(1.0, 3.0) < T_S) & (rng.random(len(T_S)) > 0.1)
        late_s = rng.exponential(0.03, len(T_S)) + 0.2 * busy
        notices = common_clock("bag", {"/hand": HEALTHY, "/tip": messages(T_S + late_s, T_S)}).notices
        assert not any("clock" in notice for notice in notices), seed


def test_topics_that_never_overlap_are_refused_and_a_single_message_is_a_constant() -> None:
    with pytest.raises(DataDamaged, match=r"^bag: .*/hand: .*2\.990 s.*/tip: .*5\.000"):
        common_clock("bag", {"/hand": HEALTHY, "/tip": messages(T_S + 5.0)})
    common = common_clock("bag", {"/hand": HEALTHY, "/width": messages([1.5])})
    hand = common.topics["/hand"]
    assert (common.begin_ns, common.end_ns) == (hand.ns[0], hand.until_ns)
    assert not common.topics["/width"].latest(hand.ns)[1].any()


# The same through the readers, on bags of a hand with a fingertip.


@pytest.fixture
def written(tmp_path: Path) -> Any:
    pytest.importorskip("rosbags", reason="needs the extra ros")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    tip = "lab_msgs/msg/Tip"
    cells = "pr2_msgs/msg/PressureState"
    store.register(get_types_from_msg("std_msgs/Header header\nfloat64[2] data\n", tip))
    fields = "std_msgs/Header header\nint16[] l_finger_tip\nint16[] r_finger_tip\n"
    store.register(get_types_from_msg(fields, cells))
    (tmp_path / "m.toml").write_text(MANIFEST)

    def header(t_s: float) -> Any:
        ns = BEGAN_NS + round(t_s * S)
        return store.types["std_msgs/msg/Header"](
            store.types["builtin_interfaces/msg/Time"](ns // S, ns % S), ""
        )

    def write(kept: Any, stamped_s: Any = T_S, pr2: bool = False) -> LabelledRecording | UnreadableRecording:
        """Write the messages of the tip that are `kept`, with these times in their headers, and import the bag."""
        joint = "sensor_msgs/msg/JointState"
        topic = "/pressure/r_gripper_motor" if pr2 else "/tip"
        with Writer(tmp_path / "jar", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            hand = writer.add_connection("/joint_states" if pr2 else "/hand", joint, typestore=store)
            force = writer.add_connection(topic, cells if pr2 else tip, typestore=store)
            for k, (t_s, gap) in enumerate(zip(T_S, GAP_M, strict=True)):
                names, still = ["r_gripper_joint"], np.zeros(1)
                state = store.types[joint](header(t_s), names, np.array([gap]), still, still)
                stamp_ns = BEGAN_NS + round(t_s * S) + 10**6
                for late_ns in range(max(1, int(kept[k]))):
                    writer.write(hand, stamp_ns + late_ns, store.serialize_cdr(state, joint))
                load = np.full(22, 3000 + round(FORCE_N[k] * 100) + k % 3, dtype=np.int16)
                kind, felt = (cells, (load, load)) if pr2 else (tip, (np.array([FORCE_N[k], 0.0]),))
                message = store.types[kind](header(stamped_s[k]), *felt)
                for late_ns in range(int(kept[k])):
                    writer.write(force, stamp_ns + late_ns, store.serialize_cdr(message, kind))
        if pr2:
            (imported,), _ = recordings_to_import([f"rosbag:{tmp_path / 'jar'}"], {}, None)
            return imported.labelled
        (recording,) = readable_or_not("manifest", str(tmp_path / "m.toml"))
        return recording

    return write


ALL = np.ones(len(T_S), bool)


def frames(recording: Recording, name: str) -> Any:
    return np.array([getattr(reading.frame, name) for reading in recording.readings])


RISES = (T_S < 1.5) | (T_S > 2.0)


@pytest.mark.parametrize("pr2", [False, True], ids=["manifest", "pr2"])
@pytest.mark.parametrize(
    ("kept", "stamped_s", "samples", "notice"),
    [
        (T_S < 1.5, T_S, 151, "the other topics"),
        (2 * (T_S >= 0.03), T_S, 297, None),
        (ALL, T_S - 20.0, 300, "another clock"),
        (ALL, T_S - 0.03, 298, "30 ms older"),
        (ALL, T_S - 0.2, 281, "200 ms older"),
    ],
    ids=[
        "a topic that dies",
        "one that begins late, with messages twice",
        "another clock",
        "a clock off by little",
        "a clock off by more",
    ],
)
def test_a_bag_is_read_where_its_topics_overlap_on_one_clock(
    written: Any, pr2: bool, kept: Any, stamped_s: Any, samples: int, notice: str | None
) -> None:
    recording = written(kept, stamped_s, pr2=pr2)
    force = frames(recording.recording, "force_left_n")
    assert len(force) == pytest.approx(samples, abs=1)
    assert np.isfinite(force).all()
    assert any(notice in told for told in recording.notices) if notice else not recording.notices
    scale = 15 * 100 / 1600 if pr2 else 1.0
    assert force[-1] == pytest.approx(scale * FORCE_N[np.flatnonzero(kept)[-1]], abs=0.1)


def test_a_silence_is_told_and_bridged_only_where_the_value_held(written: Any, tmp_path: Path) -> None:
    recording = written(RISES)
    words = recording.line if isinstance(recording, UnreadableRecording) else " ".join(recording.notices)
    assert "/tip was silent" in words
    # As of a topic that is published where its value changes only.
    shutil.rmtree(tmp_path / "jar")
    held = written((T_S < 0.3) | (T_S > 0.8))
    assert len(held.recording.readings) == 300
    assert np.isfinite(frames(held.recording, "force_left_n")).all()
    # The pads of a PR2 give no number in a silence.
    shutil.rmtree(tmp_path / "jar")
    silent = written(RISES, pr2=True)
    force, t_s = (frames(silent.recording, name) for name in ("force_left_n", "t_s"))
    assert np.isnan(force[(t_s > 1.65) & (t_s < 1.95)]).all()
    assert np.isfinite(force[(t_s < 1.5) | (t_s > 2.05)]).all()


def test_messages_of_one_topic_are_divided_by_the_names_that_they_have(tmp_path: Path) -> None:
    """An arm and a hand publish their joints in one topic, as is usual in ROS; and a logger its values with names."""
    pytest.importorskip("rosbags", reason="needs the extra ros")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    from graspsense.sources.formats.ros_format import read_bag

    store = get_typestore(Stores.ROS2_HUMBLE)
    joint, named = "sensor_msgs/msg/JointState", "lab_msgs/msg/Named"
    store.register(get_types_from_msg("string name\nfloat64 value\n", named))
    header = store.types["std_msgs/msg/Header"](store.types["builtin_interfaces/msg/Time"](0, 0), "")
    folder, still = tmp_path / "squeeze.2026-11-29", np.zeros(1)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {"/joint_states": joint, "/values": named, "/weight": named}
        open_topics = {
            topic: writer.add_connection(topic, kind, typestore=store) for topic, kind in topics.items()
        }
        for k, t_s in enumerate(T_S):
            for topic, name, value in (
                ("/joint_states", "finger", GAP_M[k]), ("/joint_states", "elbow", 1.5),
                ("/values", "force", FORCE_N[k]), ("/values", "elsewhere", 7.0),
                ("/weight", "weight" if k else "", 2.0),  # the driver does not know its name at first
            ):  # fmt: skip
                kind = topics[topic]
                given = (header, [name], np.array([value]), still, still) if kind == joint else (name, value)
                data = store.serialize_cdr(store.types[kind](*given), kind)
                writer.write(open_topics[topic], BEGAN_NS + round(t_s * S), data)
    numbers = read_bag(folder)[0].numbers
    assert np.array_equal(numbers["/joint_states.finger.position"], GAP_M)
    assert np.array_equal(numbers["/joint_states.elbow.position"], np.full(300, 1.5))
    assert np.array_equal(numbers["/values.force.value"], FORCE_N)
    assert np.array_equal(numbers["/weight.value"], np.full(300, 2.0))
    # Named as a whole, the topic has no such column, and the refusal names its parts.
    shown = read_bag(folder, ["/joint_states.position", "/weight.value"])[0].numbers
    assert "/values.force.value" not in shown
    with pytest.raises(ExpressionError, match=r"in turn.*/joint_states\.finger\.position"):
        parse("'/joint_states.position'").columns(tuple(shown))
