"""Grasps in Rerun: what its own reader finds in a file, and what its viewer receives."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from importlib.util import find_spec

import click
import numpy as np
import pytest
from cases import every_case
from live_grasp import reading, shown

from graspsense import load_pipeline
from graspsense.cli.live import RERUN_VIEWER, _rerun_target
from graspsense.core.values.errors import ConfigError
from graspsense.live.feeds import LiveFeed
from graspsense.recording.layout import TICK_FIELDS

if find_spec("rerun") is None:
    pytest.skip("needs the extra rerun", allow_module_level=True)

pytestmark = pytest.mark.slow
PATIENCE_S = 60.0
RERUN = "graspsense.live.rerun_process"


def logged(path):
    """Return for each entity its times in nanoseconds and its values, by the reader of Rerun."""
    from rerun.chunk import RrdReader

    columns = {}
    for chunk in RrdReader(path).stream().to_chunks():
        batch = chunk.to_record_batch()
        if "t" not in batch.schema.names:
            continue
        kinds = (":scalars", ":text", ":data", ":buffer")
        name = next(column for column in batch.schema.names if column.endswith(kinds))
        values = [value[0] for value in batch.column(name).to_pylist()]
        times = batch.column("t").cast("int64").to_pylist()
        columns.setdefault(chunk.entity_path, []).extend(zip(times, values, strict=True))
    return {path: ([t for t, _ in rows], [v for _, v in rows]) for path, rows in columns.items()}


def check_complete(columns, n=20):
    sent = [reading(k) for k in range(n)]
    times = [k * 1_000_000 for k in range(n)]
    assert columns["/grasp/tick/gap_m"] == (times, [image.frame.gap_m for image in sent])
    assert columns["/grasp/scalars/temperature"] == (times, [300.0 + k for k in range(n)])
    skin_t, skin = columns["/grasp/signals/skin"]
    assert skin_t == times
    assert [image["shape"] for image in skin] == [[2, 3]] * n
    assert [image["buffer"] for image in skin] == [[float(k + i) for i in range(6)] for k in range(n)]
    sound_t, sound = columns["/grasp/signals/sound/x"]
    assert sound == [k + i / 4 for k in range(n) for i in range(3)]
    assert sound_t == [k * 1_000_000 - (2 - i) * 250_000 for k in range(n) for i in range(3)]
    assert columns["/grasp/events"][1][-1] == "outcome: steady"


def test_the_reader_of_rerun_finds_what_was_logged(tmp_path):
    path = tmp_path / "grasp.rrd"
    feed = LiveFeed(RERUN, [str(path)])
    shown(feed)
    assert feed.close() == ""
    check_complete(logged(path))


def test_the_reader_of_rerun_finds_the_whole_grasp(tmp_path):
    path = tmp_path / "grasp.rrd"
    feed = LiveFeed(RERUN, [str(path)])
    trial = load_pipeline("default").grasp(sinks=[feed])
    feed.finished(trial)
    assert feed.close() == ""
    columns, trace = logged(path), trial.trace
    assert {f"/grasp/tick/{name}" for name in TICK_FIELDS if name != "t_s"} <= columns.keys()
    for name in ("gap_m", "effort_n", "force_left_n", "force_right_n", "phase"):
        times, values = columns[f"/grasp/tick/{name}"]
        assert times == [round(t_s * 1e9) for t_s in trace.t_s]
        assert np.array_equal(values, getattr(trace, name), equal_nan=True)
    left = [image["buffer"] for image in columns["/grasp/pads/left"][1]]
    assert np.array_equal(left, trace.pad_left, equal_nan=True)
    assert columns["/grasp/events"][1][:-1] == [event.what for event in trial.events]
    text = columns["/grasp/prediction"][1][-1]
    assert text.startswith(trial.prediction.label)
    assert all(reason.words in text for reason in trial.prediction.because)


@pytest.fixture
def viewer(tmp_path):
    """A program of Rerun that receives as its viewer does, and writes what comes to a file."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", str(port)]
    command += ["--save", str(tmp_path / "received.rrd")]
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    ) as running:
        until = time.monotonic() + PATIENCE_S
        while True:
            try:
                socket.create_connection(("127.0.0.1", port)).close()
                break
            except OSError:
                assert running.poll() is None
                assert time.monotonic() < until
                time.sleep(0.05)
        yield running, f"rerun+http://127.0.0.1:{port}/proxy"
        with suppress(ProcessLookupError):  # it has ended
            os.killpg(running.pid, signal.SIGKILL)


@pytest.mark.filterwarnings("ignore:RRD file has no footer")
def test_a_viewer_that_runs_receives_the_grasp(viewer, tmp_path):
    running, address = viewer
    feed = LiveFeed(RERUN, [address])
    shown(feed)
    assert feed.close() == ""
    os.killpg(running.pid, signal.SIGINT)
    running.wait(PATIENCE_S)
    check_complete(logged(tmp_path / "received.rrd"))


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "stopped"])
def test_a_viewer_that_goes_away_loses_no_grasp(viewer, how):
    running, address = viewer
    feed = LiveFeed(RERUN, [address])
    os.killpg(running.pid, how)
    trial = load_pipeline("default").grasp(sinks=[feed])
    assert (trial.outcome.words, trial.reason) == ("steady", "")
    assert address in feed.close()


def test_without_a_viewer_the_command_says_so_before_the_grasp(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"rerun+http://127.0.0.1:{free.getsockname()[1]}/proxy"
        with pytest.raises(ConfigError, match="start the viewer"):
            LiveFeed(RERUN, [address])
    with pytest.raises(ConfigError, match="cannot log to"):
        LiveFeed(RERUN, [str(tmp_path / "missing" / "grasp.rrd")])


@every_case("target", ["", "grasp.txt", "http://127.0.0.1:9876", "rerun+http://127.0.0.1:x/proxy"])
def test_a_target_that_is_neither_a_file_nor_a_viewer_is_wrong_use(target):
    with pytest.raises(click.UsageError):
        _rerun_target(target)
    assert _rerun_target(RERUN_VIEWER) == RERUN_VIEWER
