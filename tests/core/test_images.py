"""Images as numpy arrays, and cells of several components: declared, delivered, recorded, replayed and exported."""

from __future__ import annotations

import errno
import io
import os
import re
import sys
import weakref
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from lab_grasp import recorded_grasp
from mcap.reader import make_reader
from parts import NoKeys, channels, offering

from graspsense import load_pipeline
from graspsense.core.components.channels import as_json, cells_of, from_json, no_signals
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.pipeline import wiring
from graspsense.core.values.errors import WiringError
from graspsense.core.values.signals import Outcome
from graspsense.core.values.trace import KeptImages, TraceRecorder, trace_of
from graspsense.plugin_api import (
    EFFORT,
    HOLD,
    NO_PADS,
    STEADY,
    Channel,
    Command,
    Controller,
    ControllerEntry,
    FastChannel,
    Frame,
    Image,
    Reading,
    SensorBackend,
    SensorBackendEntry,
    TactileArray,
    signal_type,
)
from graspsense.recording.export_trace import write_csv, write_npz, write_parquet
from graspsense.recording.layout import Topic, shown_array
from graspsense.recording.reader import read_recorded
from graspsense.recording.replayable import content_sha256
from graspsense.sources.recordings.replay import read_named
from graspsense.testing.conformance import examine
from graspsense.testing.laws import GentleController, GentleParams, GentleState
from graspsense.testing.laws import step as gentle_step
from graspsense.testing.model_gripper import ModelGripper

HERE = sys.modules[__name__]
EYE = TactileArray("eye", "counts", 50.0, finger="left", rows=6, columns=8, components=3, dtype="uint8")
DEPTH = TactileArray("depth", "um", 50.0, rows=4, columns=5, dtype="uint16")
HEAT = TactileArray("heat", "K", 50.0, rows=3, columns=2, dtype="float32")
FORCES = TactileArray("forces", "N", 50.0, rows=2, columns=2, components=3)
IMAGES = (EYE, DEPTH, HEAT, FORCES)
FRAME = channels("gap", "velocity", "effort", "force_left", "force_right")
TICKS_OF_AN_IMAGE = 20
TOUCHING = Frame(0.0, 0.1, 0.05, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0)
NOTHING = Command(EFFORT, 0.0, inf, inf)
OF_16_BITS = TactileArray("depth", "um", rows=2, columns=3, dtype="uint16")


def numbers_of(array: TactileArray, counter: int):
    """The numbers of an image, which follow from its counter: no two images are equal. One cell is missing in HEAT."""
    numbers = ((np.arange(array.numbers) * 3 + counter * 7) % 251).astype(array.dtype)
    if array is HEAT:
        numbers[1] = nan
    return numbers


def images_at(t_s, counter):
    cells = (cells_of(array, numbers_of(array, counter)) for array in IMAGES)
    return signal_type(IMAGES)(*(Image(t_s, counter, image) for image in cells))


class Eyes(ModelGripper, SensorBackend[NoKeys]):
    """The model gripper with a camera, an image of 16 bits, one of floats with a missing cell, and force vectors."""

    channels = (*FRAME, *IMAGES)
    accepts = ("effort",)

    def __init__(self, config):
        super().__init__(frozenset(FRAME), 0.074, 1500.0)
        self.config = config

    def open(self, seed):
        self._tick, self._images = -1, no_signals(self.channels)
        return evolve(
            super().open(seed), name="eyes", simulated=False, opening=Command(EFFORT, -15.0, inf, inf)
        )

    def read(self, timeout_s):
        frame, _, _ = super().read(timeout_s)
        self._tick += 1
        if self._tick % TICKS_OF_AN_IMAGE == 0:
            counter = 1 + self._tick // TICKS_OF_AN_IMAGE
            self._images = images_at(frame.t_s, counter)
        return Reading(frame, NO_PADS, self._images)


WATCHING = ControllerEntry(
    name="watching",
    target=f"{__name__}:Watching",
    config=f"{__name__}:NoKeys",
    summary="compares each image with the first one",
    requires=(Channel("gap", "m"), Channel("velocity", "m/s"), EYE),
    commands=("effort",),
)
LAB_HAND = offering(
    SensorBackendEntry(name="eyes", target=f"{__name__}:Eyes", summary="a gripper with cameras"),
    WATCHING,
    # It needs another type of cells.
    evolve(WATCHING, name="deep", requires=(evolve(EYE, dtype="uint16"),)),
)


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """One grasp, which no test changes: the trial, the path of its recording, and the plugins."""
    options = ("gripper.type=eyes", "features.type=chitta", "run.hold_s=0.1")
    with recorded_grasp(HERE, LAB_HAND, tmp_path_factory.mktemp("seen"), *options) as (kept, path, plugins):
        yield kept.trial, path, plugins


def demand_same(signals, trace):
    for array in IMAGES:
        recorded, now = signals[array.name], trace.signals[array.name]
        assert now.cells.dtype == recorded.cells.dtype == array.dtype
        assert now.cells.shape == (len(recorded.t_s), *array.shape)
        assert now.cells.tobytes() == recorded.cells.tobytes()
        assert now.t_s.tobytes() == recorded.t_s.tobytes()


def replayed(recording):
    recorder = TraceRecorder()
    for reading in recording.readings:
        recorder.add(reading, 2, NOTHING)
    return recorder.trace()


def test_the_trace_has_each_image_once_with_its_type_and_shape(seen):
    trial, _, _ = seen
    signals = trial.trace.signals
    counters = (1 + np.rint(signals["eye"].t_s * 1000.0 / TICKS_OF_AN_IMAGE).astype(int)).tolist()
    assert counters == list(range(counters[0], counters[-1] + 1))
    assert len(counters) > 20
    for array in IMAGES:
        expected = [numbers_of(array, k).reshape(array.shape) for k in counters]
        assert signals[array.name].cells.dtype == array.dtype
        assert np.array_equal(signals[array.name].cells, expected, equal_nan=True)
    assert signals["eye"].until(signals["eye"].t_s[5]).cells.shape == (6, 6, 8, 3)


@pytest.mark.slow
@every_case(
    ("source", "write"),
    [("mcap", None), ("npz", write_npz), ("csv", write_csv), ("parquet", write_parquet)],
)
def test_images_come_back_from_a_recording_and_an_export_as_they_were(seen, tmp_path, source, write):
    trial, path, _ = seen
    grasp = read_recorded(path)
    assert grasp.channels[-len(IMAGES) :] == IMAGES
    demand_same(trial.trace.signals, grasp.trace())
    if write is not None:
        path = tmp_path / f"grasp.{source}"
        write(path, grasp)
    demand_same(trial.trace.signals, replayed(read_named(source, str(path))))
    if source == "csv":
        with np.load(tmp_path / "grasp-eye.csv.npz") as arrays:
            assert np.array_equal(arrays["cells"], trial.trace.signals["eye"].cells)


@pytest.mark.slow
@pytest.mark.parametrize("part", ["eyes", "watching"])
def test_a_gripper_with_cameras_and_a_law_with_a_reference_image_conform(seen, part):
    _, _, plugins = seen
    results = examine(f"lab-hand/{part}", plugins=plugins).report().results
    assert [(result.check, result.text) for result in results if result.state == "failed"] == []
    passed = {result.check for result in results if result.state == "passed"}
    assert part != "eyes" or "images-stay-as-they-were-delivered" in passed


@every_case(
    "fields",
    ["uint8[4] t_s", "float64 t_s\nuint8 x", "float64 t_s\nuint8[3] x\nint64 y", "float64 t_s\nint8[3] x"],
)
def test_a_topic_of_other_fields_is_refused(fields):
    with pytest.raises(ValueError, match="/grasp/signals/eye has"):
        Topic("/grasp/signals/eye", "graspsense_msgs/msg/Array3", fields + "\n")
    cells = "float64 t_s\nint64 counter\nuint8[18] cells\n"
    with pytest.raises(ValueError, match="components"):
        shown_array(Topic("/grasp/signals/eye", "graspsense_msgs/msg/Uint8Array1x2x9", cells))


def grasped(image, monkeypatch, array):
    """Return the grasp of a gripper that delivers these cells as every image of the camera."""
    signals = signal_type((array,))(Image(0.0, 1, image))

    def read(self, timeout_s):
        return Reading(ModelGripper.read(self, timeout_s).frame, NO_PADS, signals)

    monkeypatch.setattr(Eyes, "channels", (*FRAME, array))
    monkeypatch.setattr(Eyes, "read", read)
    return run_grasp(Eyes(NoKeys()), GentleController(EFFORT), RunConfig())


def fixed(array):
    array.setflags(write=False)
    return array


BLACK = np.zeros((6, 8, 3), np.uint8)
NOT_AS_DECLARED = {
    "8 x 6 x 3 instead of the shape 6 x 8 x 3": fixed(np.zeros((8, 6, 3), np.uint8)),
    "6 x 8 instead of": fixed(np.zeros((6, 8), np.uint8)),
    "int16 instead of uint8": fixed(np.zeros((6, 8, 3), np.int16)),
    "float64 instead of uint8": BLACK.tolist(),
    "not contiguous": fixed(fixed(np.zeros((6, 16, 3), np.uint8))[:, ::2]),
}
# The last two are read-only views of arrays that are not.
CHANGEABLE = (BLACK, fixed(BLACK[::1, ::-1][:, ::-1]), fixed(BLACK[:]))


@every_case(
    ("array", "image", "word"),
    [
        *((EYE, image, word) for word, image in NOT_AS_DECLARED.items()),
        *((EYE, image, "can still be changed") for image in CHANGEABLE),
        (FORCES, ((1.0, 2.0),) * 4, "4 x 2 instead"),
    ],
)
def test_an_image_that_is_not_as_declared_ends_the_grasp_and_is_told(array, image, word, monkeypatch):
    ended = grasped(image, monkeypatch, array)
    assert ended.outcome is Outcome.ABORTED
    assert repr(array.name) in ended.reason
    assert word in ended.reason


def test_an_array_says_its_type_and_components_or_is_refused():
    for side, shape, says in (
        (2, {"dtype": "int64"}, "dtype"),
        (2, {"components": 4}, "components"),
        (1024, {"components": 2, "dtype": "uint8"}, "GRASPSENSE_MAX_CHANNEL_NUMBERS"),
    ):
        with pytest.raises(ValueError, match=says):
            TactileArray("eye", "counts", rows=side, columns=side, **shape)
    with pytest.raises(ValueError, match="GRASPSENSE_MAX_CHANNEL_NUMBERS"):
        FastChannel("sound", "Pa", 1e9, samples=2**19, axes=("x", "y", "z"))
    with pytest.raises(ValueError, match="camera_left"):
        TactileArray("pads", "counts", rows=240, columns=320, components=3, dtype="uint8")
    for array in IMAGES:
        assert from_json(as_json(array)) == array
    spread = TactileArray("skin", "N", positions_m=((0.0, 0.0),) * 5, components=2, dtype="float32")
    assert spread.shape == (5, 2)


def test_an_array_is_copied_if_it_can_be_changed():
    pixels = np.arange(144, dtype=np.uint8)
    kept = cells_of(EYE, pixels)
    assert not np.shares_memory(kept, pixels)
    assert not kept.flags.writeable
    assert np.shares_memory(cells_of(EYE, kept), kept)


def test_before_the_first_image_there_are_numbers_of_the_same_type():
    eye, _, heat, forces = no_signals(IMAGES)
    assert (eye.counter, eye.cells.dtype, eye.cells.max()) == (0, "uint8", 0)
    assert np.isnan(heat.cells).all()
    assert np.isnan(forces.cells).all()
    assert not eye.cells.flags.writeable


def test_the_hash_of_a_grasp_tells_images_apart_that_differ_in_one_cell(seen):
    _, path, _ = seen
    recording = read_recorded(path).recording()
    big = TactileArray("eye", "counts", rows=100, columns=100, dtype="uint8")

    def seeing(pixel):
        cells = np.zeros((100, 100), np.uint8)
        cells[50, 50] = pixel
        reading = Reading(TOUCHING, NO_PADS, signal_type((big,))(Image(0.0, 1, fixed(cells))))
        return content_sha256(evolve(recording, readings=(reading,), channels=(big,)))

    assert seeing(1) == seeing(1) != seeing(2)


def images_of(number):
    return (Image(0.1 * k, k + 1, fixed(np.full((2, 3), k, np.uint16))) for k in range(number))


def test_images_for_which_the_disk_has_no_room_stay_in_memory(monkeypatch):
    write, written = os.pwrite, []

    def pwrite(fd, data, offset):
        if len(written) == 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(offset)
        return write(fd, data, offset)

    monkeypatch.setattr(os, "pwrite", pwrite)
    kept = KeptImages(np.zeros((2, 3), np.uint16))
    for image in images_of(6):
        kept.add(image)
        kept.add(image)  # the same image, in the next tick
    for number in range(7):
        shown = kept.first_images(number)
        assert (shown.shape, shown.dtype) == ((number, 2, 3), "uint16")
        assert shown[:, 0, 0].tolist() == list(range(number))


def test_the_trace_of_a_running_grasp_grows_and_holds_no_image_in_memory():
    recorder, make, held, traces = TraceRecorder(), signal_type((OF_16_BITS,)), [], []
    for image in (*no_signals((OF_16_BITS,)), *images_of(50)):
        held.append(weakref.ref(image.cells))
        recorder.add(Reading(TOUCHING, NO_PADS, make(image)), 2, NOTHING)
        traces.append(recorder.trace().signals["depth"].cells)
    del image
    assert [reference() for reference in held[1:]] == [None] * 50
    assert traces[-1][:, 0, 0].tolist() == list(range(50))
    assert [cells.tobytes() for cells in traces] == [traces[-1][:k].tobytes() for k in range(51)]
    # The same from readings at hand, without a file.
    signals = [make(image) for image in (*no_signals((OF_16_BITS,)), *images_of(5))]
    again = trace_of([TOUCHING] * 6, [2] * 6, [0.0] * 6, [], signals=signals)
    assert again.signals["depth"].cells.tobytes() == traces[5].tobytes()


class Reference(NamedTuple):
    phase: int
    outcome: int
    gentle: GentleState
    counter: int
    image: Any


def step_with_reference(params, state, reading):
    """Closes gently until an image differs much from the first one."""
    command, gentle = gentle_step(params, state.gentle, reading)
    image = reading.signals.eye
    reference = image.cells if state.counter == 0 and image.counter else state.image
    new = image.counter > state.counter
    changed = new and float(abs(image.cells.astype(float) - reference).mean()) > 40.0
    phase, outcome = (HOLD, STEADY) if changed else (gentle.phase, gentle.outcome)
    return command, Reference(phase, outcome, gentle, max(state.counter, image.counter), reference)


class Watching(Controller[NoKeys]):
    """A law that compares each image with the first one."""

    step = staticmethod(step_with_reference)

    def params(self):
        return GentleParams(EFFORT)

    def init(self):
        gentle = GentleController(EFFORT).init()
        return Reference(gentle.phase, gentle.outcome, gentle, 0, no_signals((EYE,)).eye.cells)


def test_a_law_for_cells_of_another_type_does_not_fit(seen):
    _, _, plugins = seen
    options = ["gripper.type=eyes", "controller.type=deep", "features.type=chitta", "classifier.type=none"]
    with pytest.raises(WiringError, match=r"6 x 8 x 3 uint16, but .*6 x 8 x 3 uint8"):
        wiring.check(load_pipeline(options=options, plugins=plugins).settings)


def test_a_law_keeps_a_reference_image():
    ended = run_grasp(Eyes(NoKeys()), Watching(NoKeys()), RunConfig())
    assert ended.outcome is Outcome.STEADY
    eye = ended.trace.signals["eye"]
    changes = abs(eye.cells.astype(float) - eye.cells[0].astype(float)).mean(axis=(1, 2, 3))
    held_s = ended.trace.t_s[np.flatnonzero(ended.trace.phase == 4)[0]]
    seen_until_then = changes[: np.searchsorted(eye.t_s, held_s, "right")]
    assert seen_until_then[-1] > 40.0 > seen_until_then[:-1].max()


def test_pictures_for_foxglove_have_the_colours_of_the_camera(seen):
    from graspsense.recording.foxglove import with_pictures

    trial, path, _ = seen
    made = make_reader(io.BytesIO(with_pictures(read_recorded(path))))
    messages = [m.data for _, c, m in made.iter_messages(topics=["/grasp/pictures/eye"])]
    cells = trial.trace.signals["eye"].cells
    assert len(messages) == len(cells)
    large = cells.repeat(16, axis=1).repeat(16, axis=2)
    assert all(data.endswith(image.tobytes()) for data, image in zip(messages, large, strict=True))
    assert b"rgb8" in messages[0]


@pytest.mark.slow
def test_a_camera_is_a_small_picture_in_the_report():
    import base64
    import zlib

    from graspsense.report.tactile import tactile_figures
    from graspsense.testing.samples import squeeze, with_signals

    arrays = (
        TactileArray("eye", "counts", 30.0, rows=240, columns=320, components=3, dtype="uint8"),
        TactileArray("floats", "counts", 30.0, rows=120, columns=160),
        TactileArray("shear", "N", 30.0, rows=60, columns=80, components=3),
        TactileArray("line", "K", 30.0, rows=1, columns=2000, dtype="float32"),
    )
    trace = with_signals(squeeze(), arrays)
    cells = np.zeros((len(trace.signals["eye"].t_s), 240, 320, 3), np.uint8)
    cells[:, :120] = (200, 100, 50)
    trace = evolve(trace, signals={**trace.signals, "eye": evolve(trace.signals["eye"], cells=cells)})
    _, *figures = tactile_figures(trace, arrays)
    assert [figure.count("<image") for figure in figures] == [3, 3, 3, 3]
    assert sum(map(len, figures)) < 200_000
    data = base64.b64decode(re.search(r'base64,([^"]+)"', figures[0]).group(1))
    width, height = int.from_bytes(data[16:20]), int.from_bytes(data[20:24])
    assert (width, height) == (106, 80)
    body = zlib.decompress(data[data.index(b"IDAT") + 4 : data.index(b"IEND") - 8])
    rows = np.frombuffer(body, np.uint8).reshape(height, 1 + 3 * width)[:, 1:].reshape(height, width, 3)
    assert (rows[:40] == (200, 100, 50)).all()
    assert (rows[41:] == 0).all()
