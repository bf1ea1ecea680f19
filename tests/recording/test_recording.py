"""Recordings, read without us: by the `mcap` package with the ROS 2 decoder that knows nothing of graspsense."""

import hashlib
import json
import math
import os
import signal
import time
from collections import namedtuple
from contextlib import contextmanager
from itertools import pairwise

import pytest
from cases import every_case
from commands import python
from kept import begun, command, ended, frame, pads, write_recording
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from graspsense import load_pipeline
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.signals import Image, Reading, Samples
from graspsense.recording.layout import START
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorder import Recorder
from graspsense.recording.writer import RecordingWriter

OPTIONS = ["classifier.type=none", "gripper.object=can:full_open"]


def decoded(path):
    """Return topic to its messages in order, as somebody else's reader gives them."""
    messages = {}
    with path.open("rb") as file:
        for _, channel, message, value in make_reader(
            file, validate_crcs=True, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages(log_time_order=False):
            messages.setdefault(channel.topic, []).append((message, value))
    return messages


def same(a, b):
    return a == b or (math.isnan(a) and math.isnan(b))


def test_a_grasp_is_recorded_tick_by_tick_as_another_reader_sees_it(tmp_path):
    recorder = Recorder(tmp_path / "g.mcap")
    trial = load_pipeline("default", options=OPTIONS).grasp(sinks=[recorder])
    recorded = recorder.finish()
    messages = decoded(tmp_path / "g.mcap")
    ticks = [value for _, value in messages["/grasp/tick"]]
    assert len(ticks) == len(trial.trace) == recorded.ticks
    for name in (
        "t_s",
        "gap_m",
        "velocity_m_s",
        "effort_n",
        "force_left_n",
        "force_right_n",
        "phase",
        "command",
    ):
        column = getattr(trial.trace, name).tolist()
        assert all(same(getattr(tick, name), value) for tick, value in zip(ticks, column, strict=True)), name
    images = [value for _, value in messages["/grasp/pads"]]
    assert [image.t_s for image in images] == trial.trace.pad_t_s.tolist()
    assert [image.right_21 for image in images] == trial.trace.pad_right[:, 21].tolist()
    assert recorded.sha256 == hashlib.sha256((tmp_path / "g.mcap").read_bytes()).hexdigest()
    assert (recorded.dropped, recorded.size) == (0, (tmp_path / "g.mcap").stat().st_size)


def test_times_are_the_gripper_s_on_the_wall_clock_and_a_chunk_closes_every_50_ms(tmp_path):
    began_ns = time.time_ns()
    write_recording(tmp_path / "g.mcap", ticks=400)
    messages = [message for message, _ in decoded(tmp_path / "g.mcap")["/grasp/tick"]]
    assert began_ns - 1e9 < messages[0].log_time < time.time_ns()
    steps = {b.log_time - a.log_time for a, b in pairwise(messages)}
    assert max(abs(step - 1_000_000) for step in steps) <= 2
    with (tmp_path / "g.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    spans = [index.message_end_time - index.message_start_time for index in summary.chunk_indexes]
    assert len(spans) >= 8
    assert max(spans) <= 51_000_000
    assert summary.statistics.message_count == 400 + 10


def test_our_reader_gives_each_tick_with_the_image_it_had(tmp_path):
    write_recording(tmp_path / "g.mcap", ticks=120, record=ended())
    readings = read_recorded(tmp_path / "g.mcap").readings()
    assert repr([reading.frame for reading in readings]) == repr([frame(k) for k in range(120)])
    assert [reading.pads for reading in readings] == [pads(k) for k in range(120)]


def test_a_recording_has_another_name_while_it_is_written_and_is_never_written_over_another(tmp_path):
    file = write_recording(tmp_path / "g.mcap", finish=False)
    assert [path.name for path in tmp_path.iterdir()] == ["g.mcap.part"]
    with pytest.raises(ConfigError, match=r"g\.mcap\.part.*graspsense recover"):
        read_recorded(tmp_path / "g.mcap")
    file.finish()
    assert [path.name for path in tmp_path.iterdir()] == ["g.mcap"]
    content = (tmp_path / "g.mcap").read_bytes()
    with pytest.raises(FileExistsError):
        RecordingWriter(tmp_path / "g.mcap")
    recorder = Recorder(tmp_path / "g.mcap")
    recorder.take(Reading(frame(0), pads(0)), 3, command(0))
    with pytest.raises(SaveFailed, match=r"g\.mcap "):
        recorder.finish()
    assert (tmp_path / "g.mcap").read_bytes() == content


@contextmanager
def stopped(recorder):
    """Stop the process of the writer meanwhile, so that the pipe fills."""
    recorder.metadata(START, begun().section(START))
    os.kill(recorder._process.pid, signal.SIGSTOP)
    try:
        yield
    finally:
        os.kill(recorder._process.pid, signal.SIGCONT)


def test_a_writer_that_does_not_follow_holds_nobody_up_and_loses_nothing(tmp_path):
    """Every message is kept and written once it goes on."""
    recorder = Recorder(tmp_path / "g.mcap")
    with stopped(recorder):
        for k in range(9_000):
            recorder.take(Reading(frame(k), pads(k)), 3, command(k))
    recorded = recorder.finish()
    assert recorded.ticks == 9_000
    assert recorded.deferred > 1000
    assert recorded.dropped == 0
    grasp = read_recorded(tmp_path / "g.mcap")
    assert grasp.ticks["t_s"].tolist() == [frame(k).t_s for k in range(9_000)]


def test_messages_of_a_tick_that_the_pipe_takes_in_part_only_are_whole(tmp_path):
    """Samples and an image of 2000 cells are 16 kB a tick, four times what a pipe takes at once or not at all."""
    signals = namedtuple("Signals", ("acceleration", "palm"))
    recorder, ticks = Recorder(tmp_path / "g.mcap"), 120
    with stopped(recorder):
        for k in range(ticks):
            samples = Samples(
                k * 1e-3, 3 * k + 3, 2, ((k + 0.1, -1.0), (k + 0.2, -1.0), (math.nan, math.nan))
            )
            palm = Image(k * 1e-3, k + 1, tuple(k + 0.5 * i for i in range(2000)))
            recorder.take(Reading(frame(k), pads(k), signals(samples, palm)), 3, command(k))
    recorded = recorder.finish()
    assert (recorded.ticks, recorded.dropped) == (ticks, 0)
    assert recorded.deferred > 0
    grasp = read_recorded(tmp_path / "g.mcap")
    assert grasp.ticks["t_s"].tolist() == [frame(k).t_s for k in range(ticks)]
    read = [reading.signals for reading in grasp.readings()]
    assert [tick.palm.cells[1999] for tick in read] == [k + 999.5 for k in range(ticks)]
    assert [tick.acceleration.values[1][0] for tick in read] == [k + 0.2 for k in range(ticks)]


def test_a_writer_that_has_died_loses_nothing_of_the_grasp(tmp_path):
    recorder = Recorder(tmp_path / "g.mcap")
    recorder.wait_ready()
    recorder._process.kill()
    recorder._process.wait()
    recorder.metadata(START, begun().section(START))
    began_ns = time.time_ns()
    trial = load_pipeline("default", options=OPTIONS).grasp(sinks=[recorder])
    assert trial.outcome.words == "steady"
    recorder.finish()
    grasp = read_recorded(tmp_path / "g.mcap")
    assert grasp.ticks["gap_m"].tolist() == trial.trace.gap_m.tolist()
    assert len(grasp.pads) == len(trial.trace.pad_t_s)
    assert began_ns <= grasp.base_ns + grasp.ticks["t_s"][0] * 1e9 < time.time_ns()
    assert [path.name for path in tmp_path.iterdir()] == ["g.mcap"]


def test_a_grasp_that_ends_without_a_word_leaves_what_was_felt(tmp_path):
    felt, nothing = Recorder(tmp_path / "felt.mcap"), Recorder(tmp_path / "nothing.mcap")
    for k in range(10):
        felt.take(Reading(frame(k), pads(k)), 3, command(k))
    felt.leave()
    nothing.leave()
    assert [path.name for path in tmp_path.iterdir()] == ["felt.mcap.part"]
    assert len(read_recorded(tmp_path / "felt.mcap.part", salvage=True)) == 10


@every_case(
    ("spoil", "says"),
    [
        (lambda data: b"", "EndOfFile"),
        (lambda data: b"t,gap\n0,1\n", "not a valid MCAP file|unpack"),
        (lambda data: data[:-200], "damaged"),
        (lambda data: data[: len(data) // 2], "damaged"),
        (lambda data: data + b"more", "after its end"),
        (lambda data: data[:1500] + bytes(8) + data[1508:], "damaged"),
    ],
)
def test_a_damaged_recording_is_told_and_not_used(tmp_path, spoil, says):
    path = tmp_path / "g.mcap"
    write_recording(path, ticks=300, record=ended())
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(DataDamaged, match=says) as told:
        read_recorded(path)
    assert str(path) in str(told.value)


def test_a_newer_layout_and_somebody_else_s_mcap_are_no_recordings_of_ours(tmp_path):
    write_recording(tmp_path / "newer.mcap", version="3")
    with pytest.raises(DataDamaged, match=r"newer\.mcap .*'3'.* 2$"):
        read_recorded(tmp_path / "newer.mcap")
    from mcap.writer import Writer

    with (tmp_path / "g.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/imu", "json", 0)
        writer.add_message(channel, 0, json.dumps({"x": 1}).encode(), 0)
        writer.finish()
    with pytest.raises(DataDamaged, match=r"g\.mcap .*graspsense recover"):
        read_recorded(tmp_path / "g.mcap")


def test_the_writer_s_process_is_light_and_starts_in_any_folder(tmp_path):
    """A file mcap.py where the user stands is not imported; numpy is not needed to write."""
    (tmp_path / "mcap.py").write_text("raise SystemExit('imported the wrong one')")
    program = (
        "import sys; sys.argv = ['x']; import graspsense.recording.writer_process; "
        "print([m for m in ('numpy', 'scipy', 'sklearn', 'sqlite3') if m in sys.modules])"
    )
    done = python("-P", "-c", program, cwd=tmp_path)
    assert (done.stdout, done.stderr) == ("[]\n", "")
