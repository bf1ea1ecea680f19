"""Tactile arrays, fast channels and further channels: through a grasp, its recording, replay and export."""

import csv
import sys
from math import inf, isnan

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import answered
from kept import begun
from lab_grasp import recorded_grasp
from parts import NoKeys, channels, offering

from graspsense import load_pipeline
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.trace import ImageTrace, SampleTrace
from graspsense.plugin_api import (
    EFFORT,
    NO_PADS,
    Channel,
    Command,
    FastChannel,
    Feature,
    Features,
    FeatureSet,
    FeatureSetEntry,
    Frame,
    Image,
    Pads,
    Reading,
    Samples,
    SensorBackend,
    SensorBackendEntry,
    TactileArray,
)
from graspsense.recording.export_trace import write_csv, write_npz, write_parquet
from graspsense.recording.layout import START
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorder import Recorder
from graspsense.sources.recordings.exported_grasp import read_exported
from graspsense.sources.recordings.replay import read_named
from graspsense.testing.model_gripper import ModelGripper

HERE = sys.modules[__name__]
PALM = TactileArray("palm", "N", 100.0, rows=2, columns=3)
ACCELERATION = FastChannel("acceleration", "m/s2", 3000.0, samples=3, axes=("x", "y"))
TEMPERATURE = Channel("motor_temperature", "K", 1000.0)
FRAME = channels("gap", "velocity", "effort", "force_left", "force_right")
LOST_AT = 700
"""The tick before which five samples of the acceleration are lost."""


class Palm(ModelGripper, SensorBackend[NoKeys]):
    """The model gripper with a palm of 2 x 3 cells, an accelerometer of three samples a tick, and a thermometer.

    Every number follows from the tick, so that a test knows what has to be in the recording.
    """

    channels = (*FRAME, PALM, ACCELERATION, TEMPERATURE)
    accepts = ("effort",)

    def __init__(self, config):
        super().__init__(frozenset(self.channels), 0.074, 1500.0)
        self.config = config

    def open(self, seed):
        self._tick, self._sampled = -1, 0
        return evolve(super().open(seed), name="palm", opening=Command(EFFORT, -15.0, inf, inf))

    def read(self, timeout_s):
        frame, pads, signals = super().read(timeout_s)
        self._tick += 1
        tick = self._tick
        image = signals.palm
        if image.counter:
            image = Image(image.t_s, image.counter, tuple(image.counter + 0.1 * i for i in range(6)))
        self._sampled += 3 + (5 if tick == LOST_AT else 0)
        # Every tenth tick has two new samples only.
        new = 2 if tick % 10 == 9 else 3
        self._sampled -= 3 - new
        rows = tuple((self._sampled - new + k, -1.0) if k < new else (float("nan"),) * 2 for k in range(3))
        samples = Samples(frame.t_s, self._sampled, new, rows)
        own = signals._replace(palm=image, acceleration=samples, motor_temperature=300.0 + tick)
        return Reading(frame, pads, own)


class Shaking(FeatureSet[NoKeys]):
    """Two features of the further channels, so that a replay is judged by what a user's features read."""

    def extract(self, trace):
        hottest = float(trace.signals["motor_temperature"].max())
        mean = float(trace.signals["acceleration"].values[:, 0].mean())
        return Features(names=("hottest", "mean"), values=(hottest, mean), units=("K", "m/s2"), reasons={})


LAB_HAND = offering(
    SensorBackendEntry(name="palm", target=f"{__name__}:Palm", summary="a gripper with a palm"),
    FeatureSetEntry(
        name="shaking",
        target=f"{__name__}:Shaking",
        config=f"{__name__}:NoKeys",
        summary="acceleration and temperature",
        requires=(ACCELERATION, Channel("motor_temperature", "K")),
        features=(Feature("hottest", "K", "of the motor"), Feature("mean", "m/s2", "mean acceleration")),
    ),
)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """One grasp, which no test changes: the trial, the path of its recording, and the plugins."""
    options = ("gripper.type=palm", "features.type=shaking")
    folder = tmp_path_factory.mktemp("recorded")
    with recorded_grasp(HERE, LAB_HAND, folder, *options) as (kept, path, plugins):
        yield kept.trial, path, plugins


def same(expected, now):
    """Return whether two signals are the same to the last bit."""
    if isinstance(expected, np.ndarray):
        return expected.tobytes() == now.tobytes()
    arrays = ("t_s", "cells") if isinstance(expected, ImageTrace) else ("t_s", "values")
    return all(same(getattr(expected, name), getattr(now, name)) for name in arrays)


def replayed(recording, plugins):
    options = ["gripper.type=replay", f"gripper.recording={recording}", "features.type=shaking"]
    settings = load_pipeline(options=[*options, "classifier.type=none"], plugins=plugins).settings
    return grasp_with(settings, plugins)


def test_the_trace_has_each_sample_and_image_once_and_counts_the_lost_ones(recorded):
    trial, path, _ = recorded
    palm, acceleration = trial.trace.signals["palm"], trial.trace.signals["acceleration"]
    assert (type(palm), type(acceleration)) == (ImageTrace, SampleTrace)
    assert (np.diff(palm.cells[:, 0]) == 1.0).all()
    steps = np.diff(acceleration.values[:, 0]).tolist()
    assert (set(steps), steps.count(6.0), acceleration.lost) == ({1.0, 6.0}, 1, 5)
    assert (np.diff(acceleration.t_s) > 0.0).all()

    read = read_recorded(path).trace()
    assert set(read.signals) == {"palm", "acceleration", "motor_temperature"}
    for name, signal in trial.trace.signals.items():
        assert same(signal, read.signals[name]), name
    assert read.signals["acceleration"].lost == 5


@pytest.mark.slow
def test_a_replay_gives_the_same_signals_and_features(recorded):
    trial, path, plugins = recorded
    again = replayed(path, plugins)
    assert again.features.values == trial.features.values
    assert not any(isnan(value) for value in again.features.values)
    for name, signal in trial.trace.signals.items():
        assert same(signal, again.trace.signals[name]), name


@pytest.mark.slow
def test_an_exported_grasp_comes_back_with_the_same_features_arrays_and_samples(recorded, tmp_path):
    trial, path, plugins = recorded
    write_npz(tmp_path / "grasp.npz", read_recorded(path))
    again = replayed(f"npz:{tmp_path / 'grasp.npz'}", plugins)
    assert again.features.values == trial.features.values
    assert same(trial.trace.gap_m, again.trace.gap_m)
    original, now = trial.trace.signals, again.trace.signals
    assert same(original["palm"], now["palm"])
    assert same(original["motor_temperature"], now["motor_temperature"])
    # The file does not say which samples were lost, so only their number and the spacing beside them differ.
    assert same(original["acceleration"].values, now["acceleration"].values)
    assert now["acceleration"].t_s == pytest.approx(original["acceleration"].t_s, abs=1e-3)
    assert now["acceleration"].lost == 0


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "write"), [("csv", write_csv), ("parquet", write_parquet)])
def test_columns_of_an_exported_grasp_come_back_as_its_arrays_do(recorded, tmp_path, ending, write):
    grasp, file = read_recorded(recorded[1]), tmp_path / f"grasp.{ending}"
    write_npz(tmp_path / "grasp.npz", grasp)
    write(file, grasp)
    exported = read_exported(str(tmp_path / "grasp.npz"))
    now = read_named(ending, str(file))
    # Texts, in which NaN equals NaN and every number has all its digits.
    for name in ("readings", "rate_hz", "units", "commands", "channels", "has_release"):
        assert repr(getattr(now, name)) == repr(getattr(exported, name)), name

    (tmp_path / f"grasp-palm.{ending}").unlink()
    with pytest.raises(ConfigError, match=f"grasp-palm.{ending} cannot be read"):
        read_exported(str(file))
    (tmp_path / f"grasp.{ending}.json").unlink()
    with pytest.raises(ConfigError, match=rf"grasp\.{ending}\.json is missing"):
        read_exported(str(file))


def test_an_npz_file_that_is_not_an_export_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"none\.npz"):
        read_exported(str(tmp_path / "none.npz"))
    np.savez(tmp_path / "other.npz", t=np.arange(3.0))
    with pytest.raises(DataDamaged, match=r"docs/import\.md"):
        read_exported(str(tmp_path / "other.npz"))
    (tmp_path / "text.npz").write_text("t,gap")
    with pytest.raises(DataDamaged, match=r"text\.npz"):
        read_exported(str(tmp_path / "text.npz"))


def test_an_export_has_the_signals_as_arrays_and_as_csv_a_line_for_each_sample(recorded, tmp_path):
    trial, path, _ = recorded
    palm, acceleration = trial.trace.signals["palm"], trial.trace.signals["acceleration"]
    told = answered("export", path, "--to", tmp_path / "grasp.npz")
    assert told["images"] == len(palm.t_s) > 20
    with np.load(tmp_path / "grasp.npz") as exported:
        assert np.array_equal(exported["signal_palm"], palm.cells)
        assert np.array_equal(exported["signal_acceleration_t_s"], acceleration.t_s)
        assert np.array_equal(exported["signal_acceleration"], acceleration.values)
        assert np.array_equal(exported["signal_motor_temperature"], trial.trace.signals["motor_temperature"])

    write_csv(tmp_path / "grasp.csv", read_recorded(path))
    head, *rows = csv.reader((tmp_path / "grasp-acceleration.csv").read_text().splitlines())
    assert head == ["t_s", "x", "y"]
    expected = np.column_stack((acceleration.t_s, acceleration.values))
    assert [list(map(float, row)) for row in rows] == expected.tolist()
    images = csv.DictReader((tmp_path / "grasp-palm.csv").read_text().splitlines())
    assert [float(row["cells_05"]) for row in images] == palm.cells[:, 5].tolist()


@pytest.mark.slow
@every_case("cells", [0, 40_000, None])  # more than a message once held
def test_fingertips_of_any_size_or_without_images_are_recorded_and_read(tmp_path, cells):
    recorder = Recorder(tmp_path / "g.mcap")
    recorder.metadata(START, begun().section(START))
    sizes = [] if cells is None else [cells] * 3
    images = [Pads(0.1 * k, k + 1, (1.0 + k,) * size, (2.0 + k,) * size) for k, size in enumerate(sizes)]
    for k, pads in enumerate(images or [NO_PADS]):
        frame = Frame(0.1 * k, 0.1, 0.05, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0)
        recorder.take(Reading(frame, pads), 3, Command(EFFORT, 0.0, inf, inf))
    recorder.finish()
    read = read_recorded(tmp_path / "g.mcap")
    assert [reading.pads for reading in read.readings()] == (images or [NO_PADS])
    assert len(read.pads) == read.images == len(images)
