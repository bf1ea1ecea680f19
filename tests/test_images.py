"""Images as numpy arrays, and cells of several components: declared, delivered, recorded, replayed and exported."""

from __future__ import annotations

import sys
from math import inf, nan

import numpy as np
import pytest
from attrs import evolve, frozen

from graspsense import load_pipeline
from graspsense.core.components.channels import cells_of, no_signals
from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.values.trace import TraceRecorder
from graspsense.plugin_api import (
    EFFORT,
    NAMES_INPUT,
    NO_PADS,
    Channel,
    Command,
    DeviceInfo,
    Image,
    ObjectKind,
    Reading,
    SensorBackend,
    SensorBackendEntry,
    TactileArray,
    hookimpl,
    setting,
    signal_type,
)
from graspsense.recording.export_trace import write_csv, write_npz, write_parquet
from graspsense.recording.reader import read_recorded
from graspsense.sources.replay import read_named
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store
from graspsense.testing.conformance import examine
from graspsense.testing.model_gripper import ModelGripper

HERE = sys.modules[__name__]
EYE = TactileArray("eye", "counts", 50.0, finger="left", rows=6, columns=8, components=3, dtype="uint8")
DEPTH = TactileArray("depth", "um", 50.0, rows=4, columns=5, dtype="uint16")
HEAT = TactileArray("heat", "K", 50.0, rows=3, columns=2, dtype="float32")
FORCES = TactileArray("forces", "N", 50.0, rows=2, columns=2, components=3)
IMAGES = (EYE, DEPTH, HEAT, FORCES)
FRAME = tuple(
    Channel(name, unit, 1000.0)
    for name, unit in (
        *(("gap", "m"), ("velocity", "m/s"), ("effort", "N")),
        *(("force_left", "N"), ("force_right", "N")),
    )
)
TICKS_OF_AN_IMAGE = 20


def numbers_of(array: TactileArray, counter: int):
    """The numbers of an image, which follow from its counter: no two images are equal."""
    numbers = (np.arange(array.numbers) * 3 + counter * 7) % 251
    return numbers.astype(array.dtype)


@frozen(kw_only=True)
class Held:
    object: str = setting(default="cup:full", effect=NAMES_INPUT, meaning="What it holds.")


class Eyes(SensorBackend[Held]):
    """The model gripper with a camera, an image of 16 bits, one of floats with a missing cell, and force vectors."""

    channels = (*FRAME, *IMAGES)
    accepts = ("effort",)

    def open(self, seed):
        self._fingers = ModelGripper(frozenset(FRAME), 0.05, 1500.0)
        self._fingers.open(seed)
        self._tick, self._signals = -1, no_signals(self.channels)
        return DeviceInfo(
            name="eyes",
            clock="virtual",
            simulated=True,
            rate_hz=1000.0,
            effort_limit_n=100.0,
            speed_limit_m_s=0.2,
            opening=Command(EFFORT, -15.0, inf, inf),
            relaxed=Command(EFFORT, 0.0, inf, inf),
        )

    def objects(self):
        return (ObjectKind(name="cup", states=("full",)),)

    def with_object(self, name):
        return type(self)(evolve(self.config, object=name))

    def image(self, array, t_s, counter):
        numbers = numbers_of(array, counter)
        if array is HEAT:
            numbers[1] = nan
        return Image(t_s, counter, cells_of(array, numbers))

    def read(self, timeout_s):
        frame, _, _ = self._fingers.read(timeout_s)
        self._tick += 1
        if self._tick % TICKS_OF_AN_IMAGE == 0:
            counter = 1 + self._tick // TICKS_OF_AN_IMAGE
            images = (self.image(array, frame.t_s, counter) for array in IMAGES)
            self._signals = signal_type(self.channels)(*images)
        return Reading(frame, NO_PADS, self._signals)

    def apply(self, command):
        self._fingers.apply(command)

    def tare(self, images):
        pass

    def close(self):
        pass


@hookimpl
def graspsense_sensor_backends():
    return [
        SensorBackendEntry(
            name="eyes",
            target=f"{__name__}:Eyes",
            config=f"{__name__}:Held",
            summary="a gripper with cameras",
        )
    ]


GRASPSENSE_API = (2, 0)


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """One grasp, which no test changes: the trial, the path of its recording, and the plugins."""
    folder = tmp_path_factory.mktemp("seen") / "trials"
    options = ["gripper.type=eyes", "features.type=chitta", "classifier.type=none", "run.hold_s=0.1"]
    with (
        pytest.MonkeyPatch.context() as patch,
        IsolatedPlugins() as plugins,
        Store.open(folder) as store,
    ):
        patch.setitem(sys.modules, __name__, HERE)
        plugins.add(HERE, "lab-hand")
        settings = load_pipeline(options=options, plugins=plugins).settings
        trial = record_grasp(store, settings, plugins, labels={}, origin="run").trial
        (path,) = (folder / "recordings").glob("*.mcap")
        yield trial, path, plugins


def demand_same(signals, trace):
    for array in IMAGES:
        before, now = signals[array.name], trace.signals[array.name]
        assert now.cells.dtype == before.cells.dtype == array.dtype
        assert now.cells.shape == (len(before.t_s), *array.shape)
        assert now.cells.tobytes() == before.cells.tobytes()
        assert now.t_s.tobytes() == before.t_s.tobytes()


def replayed(recording):
    recorder = TraceRecorder()
    for reading in recording.readings:
        recorder.add(reading, 2, Command(EFFORT, 0.0, inf, inf))
    return recorder.trace()


def test_the_trace_has_each_image_once_with_its_type_and_shape(seen):
    trial, _, _ = seen
    signals = trial.trace.signals
    counters = 1 + np.rint(signals["eye"].t_s * 1000.0 / TICKS_OF_AN_IMAGE).astype(int)
    assert counters.tolist() == list(range(counters[0], counters[0] + len(counters)))
    assert len(counters) > 20
    for array in IMAGES:
        expected = [numbers_of(array, k).reshape(array.shape) for k in counters.tolist()]
        if array is HEAT:
            for numbers in expected:
                numbers[0, 1] = nan
        assert signals[array.name].cells.dtype == array.dtype
        assert np.array_equal(signals[array.name].cells, expected, equal_nan=True)
    assert signals["eye"].until(signals["eye"].t_s[5]).cells.shape == (6, 6, 8, 3)


def test_images_come_back_from_the_recording_and_a_replay_as_they_were(seen):
    trial, path, _ = seen
    grasp = read_recorded(path)
    assert [one for one in grasp.channels if one.name not in {c.name for c in FRAME}] == list(IMAGES)
    demand_same(trial.trace.signals, grasp.trace())
    demand_same(trial.trace.signals, replayed(read_named("mcap", str(path))))


@pytest.mark.parametrize(
    ("ending", "write"), [("npz", write_npz), ("csv", write_csv), ("parquet", write_parquet)]
)
def test_images_come_back_from_an_export_as_they_were(seen, tmp_path, ending, write):
    trial, path, _ = seen
    write(tmp_path / f"grasp.{ending}", read_recorded(path))
    demand_same(trial.trace.signals, replayed(read_named(ending, str(tmp_path / f"grasp.{ending}"))))


def test_an_export_as_columns_has_the_images_of_a_camera_in_a_file_of_arrays(seen, tmp_path):
    trial, path, _ = seen
    write_csv(tmp_path / "grasp.csv", read_recorded(path))
    with np.load(tmp_path / "grasp-eye.npz") as found:
        assert np.array_equal(found["cells"], trial.trace.signals["eye"].cells)
        assert set(np.diff(found["counter"])) == {1}
        assert found["t_s"].tobytes() == trial.trace.signals["eye"].t_s.tobytes()


@pytest.mark.slow
def test_a_gripper_with_cameras_conforms(seen):
    _, _, plugins = seen
    report = examine("lab-hand/eyes", plugins=plugins).report()
    assert [(one.check, one.text) for one in report.results if one.state == "failed"] == []
    assert "images_stay_as_they_were_delivered" in {
        one.check for one in report.results if one.state == "passed"
    }
