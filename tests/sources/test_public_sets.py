"""Layouts of public sets whose arrays or gaps are unlike those of a gripper, with the manifests of docs/manifests."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from repository import ROOT

from graspsense.core.values.signals import NO_GAP
from graspsense.core.values.trace import signals_of
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.sources.recordings.dataset_recordings import readable_or_not

MANIFESTS = ROOT / "docs" / "manifests"


def recordings(folder, name):
    path = folder / "manifest.toml"
    path.write_text((MANIFESTS / f"{name}.toml").read_text())
    grasps = list(readable_or_not("manifest", str(path)))
    assert not [recording.error for recording in grasps if isinstance(recording, UnreadableRecording)]
    return grasps


def forces(recording):
    return np.array([(r.frame.force_left_n, r.frame.force_right_n) for r in recording.recording.readings])


def test_presses_in_named_arrays_of_three_dimensions_beside_arrays_of_other_shapes(tmp_path):
    """Each array holds three presses along its last axis; arrays of other motions and a legend are in the same file."""
    depth = np.arange(41) // 2
    taxels = np.arange(1, 8)[:, np.newaxis] * depth
    presses = np.array([np.vstack([depth, 1000 + k * taxels]).T for k in (1, 2, 3)])
    arrays = {f"Vertical_{i}_{j}": np.moveaxis(presses * 1, 0, -1) for i in (1, 2) for j in (1, 2)}
    turns = {f"Rotate_1_1_d{d}_r100": np.ones((61, 8, 3)) for d in (100, 120)}
    (tmp_path / "data").mkdir()
    scipy.io.savemat(
        tmp_path / "data" / "properties_exp.mat", {"nodules": np.ones((4, 4, 4)), **turns, **arrays}
    )

    grasps = recordings(tmp_path, "palpation")

    assert sorted((recording.label, recording.order) for recording in grasps) == [
        (f"place{i}{j}", k) for i in (1, 2) for j in (1, 2) for k in (0.0, 1.0, 2.0)
    ]
    press = next(recording for recording in grasps if (recording.label, recording.order) == ("place21", 1.0))
    gaps = [reading.frame.gap_m for reading in press.recording.readings]
    assert gaps == pytest.approx(0.02 - 0.001 * depth)
    # The mean of 1 to 7 is 4; the zero is the first sample.
    assert forces(press)[:, 0] == pytest.approx(2 * 4.0 * depth)
    assert press.recording.units["force_left"] == "counts"


def test_a_glove_without_a_gap_and_without_names_of_columns(tmp_path):
    for label, press in (("bottle", 300.0), ("rest", 0.0)):
        rows = np.zeros((50, 33))
        rows[:, 0] = 4680 + 10 * np.arange(50)
        rows[:, 1] = 4.79 + 0.01 * np.arange(50)
        rows[:, 16:21] = 999.0
        rows[25:, 18] -= press
        rows[:, 10] = np.arange(50)
        (tmp_path / "datasets/dataset" / label).mkdir(parents=True)
        lines = [f"{row[0]:.0f}, {', '.join(map(str, row[1:]))}" for row in rows]
        (tmp_path / "datasets/dataset" / label / "7.txt").write_text("\n".join(lines) + "\n")

    bottle, other_bottles = recordings(tmp_path, "dataglove")

    assert (bottle.label, bottle.order, other_bottles.label) == ("bottle", 7.0, "rest")
    assert bottle.recording.units["gap"] == NO_GAP
    assert forces(bottle).tolist() == [[0.0, 0.0]] * 25 + [[300.0, 300.0]] * 25
    assert not forces(other_bottles).any()
    little = signals_of([reading.signals for reading in bottle.recording.readings])["little"]
    assert np.ravel(little).tolist() == list(range(50))


def test_a_slide_with_electrodes_and_a_fast_vibration_and_a_comma_at_the_end_of_each_row(tmp_path):
    names = ["timestamp", "tdc", "tac", "pdc", *(f"pac{k}" for k in range(1, 23))]
    names += [f"ele{k}" for k in range(1, 20)]
    rows = [
        [f"{1581073084.69 + 0.01 * k:.9f}", 3, 100, 90 + k, *range(22 * k, 22 * k + 22), *range(19)]
        for k in range(30)
    ]
    (tmp_path / "raw_data/mat4").mkdir(parents=True)
    lines = [",".join(names), *(",".join(map(str, row)) + "," for row in rows)]
    (tmp_path / "raw_data/mat4/mat4_12_bio.csv").write_text("\n".join(lines) + "\n")

    (recording,) = recordings(tmp_path, "biotac_slide")

    assert (recording.label, recording.order) == ("mat4", 12.0)
    assert forces(recording)[:, 0].tolist() == [90.0 + k for k in range(30)]
    signals = signals_of([reading.signals for reading in recording.recording.readings])
    assert signals["vibration"].values[:, 0].tolist() == list(range(660))
    assert signals["electrodes"].cells.tolist() == [list(range(19))] * 30


def test_slips_in_a_file_beside_those_of_two_fingers(tmp_path):
    folder = tmp_path / "data_set" / "data_sample_2022-02-21-09-58-49"
    folder.mkdir(parents=True)
    names = [f"txl{k}_{axis}" for k in range(1, 17) for axis in "xyz"]
    for finger in (1, 2):
        rows = 38000.0 + np.outer(np.arange(90) >= 50, np.full(48, 10.0 * finger))
        lines = [",".join(names), *(",".join(map(str, row)) for row in rows)]
        (folder / f"xela_sensor{finger}.csv").write_text("\n".join(lines) + "\n")
    slips = [f"{float(60 <= k < 70)},0.0" for k in range(90)]
    (folder / "slip_label.csv").write_text("\n".join(["slip,fail", *slips]) + "\n")

    (recording,) = recordings(tmp_path, "uskin_slip")

    # 16 cells of each finger rise by 10 or 20 counts.
    assert forces(recording)[-1].tolist() == [160.0, 320.0]
    (slip,) = recording.recording.events["slip"]
    assert (slip.t_s, slip.until_s) == pytest.approx((60 / 59.8, 69 / 59.8))
    assert (recording.label, recording.instance) == ("box", "2022-02-21-09-58-49")


def test_shocks_of_a_fingertip_with_lists_in_its_cells(tmp_path):
    folder = tmp_path / "Soup Can" / "soup_can_A-3-4-11"
    folder.mkdir(parents=True)
    rows = [",features,labels"]
    for k in range(20):
        # Acceleration and turn of the left fingertip, then of the right one; five samples of each in a row.
        sample = [0.0, 3.0, 4.0 + k, *[0.0] * 9]
        label = [k > 4, k > 9, False, False] if k < 15 else [None] * 4
        rows.append(f'{k},"{sample * 5}","{label}"')
    (folder / "features_and_labels.csv").write_text("\n".join(rows) + "\n")
    times = [",time", *(f"{k},{0.7 + 0.2 * k}" for k in range(20))]
    (folder / "times.csv").write_text("\n".join(times) + "\n")

    (recording,) = recordings(tmp_path, "fingertip_imu")

    samples = signals_of([reading.signals for reading in recording.recording.readings])["acceleration"]
    assert samples.values[:5, 0].tolist() == [5.0] * 5
    assert samples.values[-1, 0] == pytest.approx(np.hypot(3.0, 23.0))
    for name, span in (("acceleration", (2.7, 3.5)), ("acceleration not known", (3.7, 4.5))):
        (event,) = recording.recording.events[name]
        assert (event.t_s, event.until_s) == pytest.approx(span)
