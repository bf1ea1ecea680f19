"""Hands with any number of fingers: the rule by which they touch, a whole grasp, its record, its pictures."""

import sys
from math import inf, isnan, nan, sqrt

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense
from hypothesis import given
from hypothesis import strategies as st
from lab_grasp import recorded_grasp
from parts import NoKeys, channels, offering

from graspsense import load_pipeline
from graspsense.core.components.channels import as_json, from_json
from graspsense.core.control.contact import both_touch
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.fingers import fingers_of
from graspsense.gripper_api import FingerForce, opposed_forces
from graspsense.plugin_api import (
    EFFORT,
    NO_PADS,
    Command,
    Reading,
    SensorBackend,
    SensorBackendEntry,
    signal_type,
)
from graspsense.recording.export_trace import WRITERS
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.reader import read_recorded
from graspsense.report.further_channels import channel_figures
from graspsense.report.trace_plot import draw_trace
from graspsense.sources.columns.grasp_columns import GraspColumns, checked_recording
from graspsense.sources.recordings.dataset_recordings import readable_or_not
from graspsense.sources.recordings.exported_grasp import read_exported
from graspsense.testing.model_gripper import ModelGripper

HERE = sys.modules[__name__]
FRAME = channels("gap", "velocity", "effort", "force_left", "force_right")
FORCES = st.lists(st.floats(0.0, 50.0), min_size=5, max_size=5)
HALF = sqrt(0.75)
JAWS = (
    FingerForce("force_thumb", "N", 250.0, side="left", closing=(1.0, 0.0, 0.0)),
    FingerForce("force_index", "N", 250.0, side="right", closing=(-0.5, HALF, 0.0)),
    FingerForce("force_ring", "N", 250.0, side="right", closing=(-0.5, -HALF, 0.0)),
)
"""Three fingers that close at 120 degrees to each other."""


FINGERS = ("thumb", "index", "middle", "ring", "little")


def five(touch, **sides):
    return tuple(
        FingerForce(f"force_{name}", "N", side=sides.get(name, "right"), touch=touch) for name in FINGERS
    )


class ThreeJaws(ModelGripper, SensorBackend[NoKeys]):
    """The model gripper, of which two fingers at 120 degrees share what its right pad feels."""

    accepts = ("effort",)
    channels = (*FRAME, *JAWS)

    def __init__(self, config):
        super().__init__(frozenset(FRAME), 0.06, 1500.0)
        self.config, self._forces = config, opposed_forces(JAWS)

    def open(self, seed):
        return evolve(super().open(seed), simulated=False, opening=Command(EFFORT, -15.0, inf, inf))

    def read(self, timeout_s):
        frame, _, _ = super().read(timeout_s)
        # At 60 degrees to the axis of the thumb, two fingers bear together twice what one on the axis would.
        felt = (frame.force_left_n, 1.2 * frame.force_right_n, 0.8 * frame.force_right_n)
        left, right = self._forces(felt)
        frame = frame._replace(force_left_n=left, force_right_n=right)
        return Reading(frame, NO_PADS, signal_type(self.channels)(*felt))


LAB_HAND = offering(SensorBackendEntry(name="jaws", target=f"{__name__}:ThreeJaws", summary="three fingers"))


@pytest.fixture(scope="module")
def grasped(tmp_path_factory):
    """One grasp with three fingers: the trial, the path of its recording, and the plugins."""
    options = ("gripper.type=jaws", "run.hold_s=0.05")
    folder = tmp_path_factory.mktemp("recorded")
    with recorded_grasp(HERE, LAB_HAND, folder, *options) as (kept, path, plugins):
        yield kept.trial, path, plugins


# ------------------------------------------------------------------------------------------------- the rule


@given(FORCES, st.floats(0.1, 10.0))
def test_fingers_touch_where_a_side_every_finger_or_the_thumb_and_another_one_bears_the_contact_force(
    forces, contact_n
):
    thumb, others = forces[0], forces[1:]
    each, opposed = opposed_forces(five("each"))(forces), opposed_forces(five("any", thumb="left"))(forces)

    assert opposed_forces(five("sides", thumb="left"))(forces) == (thumb, pytest.approx(sum(others)))
    assert both_touch(*each, contact_n) == (min(forces) >= contact_n)
    assert both_touch(*opposed, contact_n) == (min(thumb, max(others)) >= contact_n)


def test_a_finger_without_a_number_is_no_contact_of_its_side_or_of_every_finger():
    forces = (5.0, nan, 5.0, 5.0, 5.0)

    assert isnan(opposed_forces(five("sides", thumb="left"))(forces)[1])
    assert isnan(opposed_forces(five("each"))(forces)[0])
    assert opposed_forces(five("any", thumb="left"))(forces) == (5.0, 5.0)


@every_case(
    ("fingers", "says"),
    [
        (five("sides"), "two sides"),
        (five("any"), "opposed"),
        (five("each")[:1], "two or more"),
        ((*five("each"), FingerForce("force_sixth", "N", touch="any")), "one rule"),
    ],
)
def test_fingers_that_cannot_touch_are_refused(fingers, says):
    with pytest.raises(ValueError, match=says):
        opposed_forces(fingers)


def test_the_forces_of_a_side_count_along_its_direction_so_that_three_jaws_balance():
    left, right = opposed_forces(JAWS)((8.0, 8.0, 8.0))

    assert right == pytest.approx(left)
    assert [from_json(as_json(jaw)) for jaw in JAWS] == list(JAWS)


@every_case("name", ["thumb", "force_left", "force_"])
def test_the_name_of_a_finger_is_not_that_of_another_channel(name):
    with pytest.raises(ValueError, match="finger"):
        FingerForce(name, "N")


# ------------------------------------------------------------------------------------------------- a grasp


def demand_rule(device):
    """The note of the device must say of which fingers the forces are."""
    (note,) = [text for text in device.notes if "fingers" in text]
    assert "of thumb" in note
    assert "index and ring" in note


def test_every_finger_is_in_trace_recording_and_replay(grasped):
    trial, path, plugins = grasped
    recorded = read_recorded(path)
    options = ["gripper.type=replay", f"gripper.recording={path}", "classifier.type=none"]
    replayed = grasp_with(load_pipeline(options=options, plugins=plugins).settings, plugins)

    assert trial.outcome.words == "steady"
    assert not isnan(trial.features.as_dict()["f_steady"])
    assert fingers_of(recorded.channels) == JAWS
    demand_rule(trial.device)
    demand_rule(replayed.device)
    for jaw in JAWS:
        signal = trial.trace.signals[jaw.name]
        assert signal.max() > 1.0
        assert np.array_equal(signal, recorded.trace().signals[jaw.name])
        assert np.array_equal(signal, replayed.trace.signals[jaw.name])


@pytest.mark.parametrize("suffix", [pytest.param(".csv", marks=pytest.mark.slow), ".npz"])
def test_an_export_declares_the_fingers_and_has_their_forces(grasped, tmp_path, suffix):
    _, path, _ = grasped
    file = tmp_path / f"grasp{suffix}"
    WRITERS[suffix](file, read_recorded(path))

    back = read_exported(str(file))

    assert fingers_of(back.channels) == JAWS
    most = max(reading.signals.force_index for reading in back.readings)
    assert most == read_recorded(path).trace().signals["force_index"].max()


@pytest.mark.slow
def test_the_pages_and_the_picture_draw_the_force_of_each_finger(grasped):
    from matplotlib.figure import Figure

    trial, _, _ = grasped
    force, gap = Figure().subplots(2)
    draw_trace(trial.trace, force, gap, fingers_of(trial.device.channels))

    (fingers,) = channel_figures(trial.trace, trial.device.channels)
    assert all(name in fingers for name in ("Forces of the fingers", "thumb", "index", "ring"))
    assert {"thumb", "index", "ring"} <= {line.get_label() for line in force.lines}


# ------------------------------------------------------------------------------------------------- recordings


LOADS_N = dict(zip(FINGERS, (10.0, 4.0, 3.0, 2.0, 0.0), strict=True))
"""What each finger bears at rest; the little finger touches nothing."""
NAMED = (
    'fingers = { thumb = "F1 [N]", index = "F2 [N]", middle = "F3 [N]", ring = "F4 [N]", little = "F5 [N]" }'
)


def five_fingers(folder, manifest_lines, offset_n=0.0):
    """Write a text file of a squeeze with five fingers, and a manifest of it; return the recordings."""
    t_s = np.arange(300) / 100.0
    gap_mm = np.maximum(60.0 - 10.0 * t_s, 40.0)
    pressed = np.clip(0.1 * (50.0 - gap_mm), 0.0, 1.0)
    columns = [t_s, gap_mm, *(offset_n + load * pressed for load in LOADS_N.values())]
    head = "t,gap,F1,F2,F3,F4,F5"
    np.savetxt(folder / "cup-1.csv", np.stack(columns, 1), "%.4f", ",", header=head, comments="")
    text = ['files = "{label}-{order:d}.csv"', 'time = "t [s]"', 'gap = "gap [mm]"', *manifest_lines]
    (folder / "manifest.toml").write_text("\n".join(text) + "\n")
    recordings = list(readable_or_not("manifest", str(folder / "manifest.toml")))
    for recording in recordings:
        if isinstance(recording, UnreadableRecording):
            raise recording.error
    return recordings


@every_case(
    ("touch", "left_n", "right_n"),
    [("thumb", 10.0, 9.0), ("thumb, index", 14.0, 5.0), ("each", 0.0, 10.0), ("any", 10.0, 4.0)],
)
def test_a_recording_of_five_fingers_has_the_forces_of_its_rule(tmp_path, touch, left_n, right_n):
    (finger_grasp,) = five_fingers(tmp_path, [NAMED, f'touch = "{touch}"'])
    frame = finger_grasp.recording.readings[-1].frame

    assert sorted((frame.force_left_n, frame.force_right_n)) == pytest.approx(sorted((left_n, right_n)))


def test_each_finger_of_a_recording_has_its_own_zero(tmp_path):
    (finger_grasp,) = five_fingers(tmp_path, [NAMED, 'touch = "thumb"', 'zero = "10 samples"'], offset_n=0.7)

    last = finger_grasp.recording.readings[-1]
    assert list(last.signals) == pytest.approx(list(LOADS_N.values()))
    assert last.frame.force_right_n == pytest.approx(9.0)


def test_a_resampled_recording_keeps_the_rule(tmp_path):
    (finger_grasp,) = five_fingers(tmp_path, [NAMED, 'touch = "each"', "resample_hz = 37.0"])

    for reading in finger_grasp.recording.readings:
        assert reading.frame.force_left_n == min(reading.signals)
        assert reading.frame.force_right_n == max(reading.signals)


def test_an_imported_trial_of_five_fingers_says_of_which_fingers_its_features_are(tmp_path):
    five_fingers(tmp_path, [NAMED, 'touch = "thumb"'])
    given = (tmp_path / "manifest.toml", "--save", tmp_path / "store", "-o", "classifier.type=none")

    assert graspsense("import", *given).returncode == 0
    (path,) = (tmp_path / "store" / "recordings").glob("*.mcap")
    recorded = read_recorded(path)
    assert [finger.finger for finger in fingers_of(recorded.channels)] == list(FINGERS)
    assert "of thumb" in " ".join(recorded.device.notes)
    assert recorded.record().result.features.values


@every_case(
    ("lines", "says"),
    [
        ([NAMED], 'touch = "thumb"'),
        ([NAMED, 'touch = "pinky"'], "pinky"),
        ([NAMED, 'touch = "each"', 'left = "F1 [N]"'], "leave out"),
        (['left = "F1 [N]"', 'touch = "each"'], "rule of fingers"),
        (['fingers = { thumb = "F1 [N]" }'], "one finger"),
        (['fingers = { Thumb = "F1 [N]", index = "F2 [N]" }'], "small letters"),
        (['fingers = { thumb = "F1 [N]", index = "F2 [counts]" }'], "one unit"),
        (['fingers = { thumb = "F1 [N]", index = "F9 [N]" }'], "fingers.index"),
    ],
)
def test_a_manifest_with_fingers_that_cannot_be_is_refused(tmp_path, lines, says):
    with pytest.raises(ConfigError, match=says):
        five_fingers(tmp_path, lines)


def test_columns_of_a_reader_have_every_finger_that_they_declare():
    columns = GraspColumns(
        source="a hand",
        t_s=np.arange(20) / 100.0,
        gap_m=np.full(20, 0.05),
        left_n=np.ones(20),
        right_n=np.ones(20),
        scalars={"force_thumb": np.ones(20)},
        fingers=five("sides", thumb="left")[:2],
    )

    with pytest.raises(DataDamaged, match="force_index"):
        checked_recording(columns)
