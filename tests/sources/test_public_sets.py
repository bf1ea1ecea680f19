"""Public sets in small: which lines of a suggested manifest are right, and what the shipped manifests read."""

import re
import tomllib

import numpy as np
import pytest
import scipy
from cases import every_case
from commands import answered, printed, refused
from repository import ROOT

from graspsense.core.values.signals import NO_GAP
from graspsense.core.values.trace import signals_of
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.reader import read_recorded
from graspsense.sources.manifest.reader import read_recordings
from graspsense.sources.recordings.dataset_recordings import readable_or_not
from graspsense.store.store import Store

MANIFESTS = ROOT / "docs" / "manifests"
N = 300
T_S = np.arange(N) * 0.01
GAP_M = np.where(T_S < 1.0, 0.06 - 0.01 * T_S, 0.05 - 0.002 * np.minimum(T_S - 1.0, 1.0))
FORCE_N = np.maximum(0.0, 0.05 - GAP_M) * 5000.0


def table(path, columns, index=False):
    """Write columns; with an index as `DataFrame.to_csv` does, whose column has no name."""
    path.parent.mkdir(parents=True, exist_ok=True)
    columns = {"": range(len(next(iter(columns.values()))))} | columns if index else columns
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n")


def recordings(folder, name):
    path = folder / "manifest.toml"
    path.write_text((MANIFESTS / f"{name}.toml").read_text())
    grasps = list(readable_or_not("manifest", str(path)))
    assert not [recording.error for recording in grasps if isinstance(recording, UnreadableRecording)]
    return grasps


def column(recording, name):
    return np.array([getattr(reading.frame, name) for reading in recording.recording.readings])


def forces(recording):
    return np.column_stack([column(recording, f"force_{side}_n") for side in ("left", "right")])


def test_the_page_of_public_data_sets_links_these_manifests_and_no_other():
    page = (ROOT / "docs" / "other_data.md").read_text()
    there = {path.name for path in MANIFESTS.glob("*.toml")}
    assert set(re.findall(r"\]\(manifests/([\w.]+)\)", page)) == there


# Sets whose manifests are suggested, and most of them shipped.


def fruit(folder):
    for k, kind in enumerate(("kiwi", "banana", "mango")):
        for part in ("training", "test"):
            for day in (20, 21, 23):
                stamp = f"202411{day}_15131{k}"
                place = folder / f"{kind}/{part}Set/{stamp}"
                columns = {"Time": T_S + 1.7e9, "Force": FORCE_N, "Pos": 60.0 - GAP_M * 1e3}
                table(place / f"ForceData_{stamp}.csv", columns)
                np.save(place / "break_force.npy", np.float64(2.6))


def jaco(folder):
    lines = ["A,Number of samples,3"]
    for order, label in enumerate((17, 3, 3)):
        began = 1592233887442126035 + order * 60_000_000_000
        lines.append(f"seq,{order},stamp start,{began},stamp end,{began + 490_000_000},label,{label}")
        lines.append("timestep,eucl force 1,eucl force 2,eucl force 3,finger1_pos,finger2_pos,finger3_pos")
        squeezed = zip((1.0 - 0.1 * order) * FORCE_N, 100.0 - GAP_M * 1e3, strict=True)
        lines += [f"{k},{f},{f / 2},{0.8 * f},{p - 3},{p},{p + 3}" for k, (f, p) in enumerate(squeezed, 1)]
    folder.mkdir(exist_ok=True)
    (folder / "000_real_life_data.csv").write_text("\n".join(lines) + "\n")


def pr2_biotac(folder):
    (folder / "data").mkdir(parents=True)
    for material, number in (("black_foam", 110), ("sponge", 4), ("glass_jar", 9)):
        for order in (2, 3, 10):
            variables = {
                "JPos": GAP_M[None], "JEff": -FORCE_N[None], "F0pdc": np.round(1000 + 10 * FORCE_N)[None],
                "F1pdc": np.round(1000 + 9 * FORCE_N)[None].astype(np.uint16),
                "F0Electrodes": np.arange(19 * N).reshape(19, N), "F1Electrodes": np.ones((19, N)),
            }  # fmt: skip
            scipy.io.savemat(folder / f"data/{material}_{number}_{order}_HOLD.mat", variables)


def biotac_sp(folder):
    names = [f"{finger}_biotac_{k}" for finger in ("ff", "mf", "th") for k in range(1, 25)]
    cells = np.random.default_rng(0).integers(1000, 3000, (len(names), 9))
    cells[:48, 1], cells[48:, 1] = np.arange(48), np.arange(148, 172)
    for palm in ("down", "side", "45"):
        about = {"object": ["mug", "toy car", "jar"] * 3, "slipped": [0, 1, 1, 0, 0, 1, 0, 1, 1]}
        table(folder / f"bts3v2_palm_{palm}.csv", about | dict(zip(names, cells.tolist(), strict=True)))


def barrett_taps(folder):
    folder.mkdir()
    for material in ("felt", "wood"):
        taxels = np.tile(np.outer(10.0 * FORCE_N, np.full(24, 1 / 24)) + 7.0, (3, 1))
        taps = {"tap": np.repeat([1, 2, 3], N), "spread": np.tile(GAP_M, 3) * 1e3, "taxels": taxels}
        np.savez(folder / f"{material}.npz", **taps)


def glove(folder):
    for label, press in (("bottle", 300), ("rest", 0)):
        place = folder / "datasets/dataset" / label
        place.mkdir(parents=True)
        for k in range(3):
            rows = np.random.default_rng(k).integers(0, 999, (N, 33)).astype(float)
            rows[:, 0], rows[:, 1], rows[:, 10] = (
                4680 + 10 * np.arange(N),
                4.79 + 0.01 * np.arange(N),
                np.arange(N),
            )
            rows[:, 16:21] = 999.0
            rows[25:, 18] -= press
            lines = [f"{row[0]:.0f}, {', '.join(map(str, row[1:]))}" for row in rows.tolist()]
            (place / f"{k}.txt").write_text("\n".join(lines) + "\n")


def slides(folder):
    """A slide with electrodes and a fast vibration, and a comma at the end of each row."""
    names = [
        "timestamp",
        "tdc",
        "tac",
        "pdc",
        *(f"pac{k}" for k in range(1, 23)),
        *(f"ele{k}" for k in range(1, 20)),
    ]
    for material in (1, 2, 10):
        place = folder / f"raw_data/mat{material}"
        place.mkdir(parents=True)
        for number in range(1, 4):
            counted = ([90 + k % 90, *range(22 * k, 22 * k + 22), *range(19)] for k in range(N))
            rows = ([f"{1.6e9 + 0.01 * k:.9f}", 3, 100, *counts] for k, counts in enumerate(counted))
            lines = [",".join(names), *(",".join(map(str, row)) + "," for row in rows)]
            (place / f"mat{material}_{number}_bio.csv").write_text("\n".join(lines) + "\n")


def presses(folder):
    folder.mkdir()
    names = [f"Vertical_{i}_{j}_d{d}" for i in (1, 2) for j in (1, 2, 3) for d in (100, 120)]
    scipy.io.savemat(folder / "all.mat", {name: np.ones((N, 8, 3)) for name in names})


RIGHT = {
    glove: {"files": "datasets/dataset/{label}/{order:d}.txt", "time": "c1 [ms]"},
    slides: {
        "files": "raw_data/mat{object:d}/mat*_{order:d}_bio.csv",
        "label": "object{object}",
        "time": "timestamp [s]",
        "force": "pdc [counts]",
    },
    presses: {
        "files": "all.mat",
        "arrays": "Vertical_{object:d}_{number2:d}_d{number3:d}",
        "axes": "time, column, grasp",
        "label": "object{object}",
    },
    fruit: {
        "files": "{label}/{part}/{recorded}/ForceData_*.csv",
        "time": "Time [s]",
        "force": "Force [N]",
        "gap": "60 - Pos [mm]",
    },
    jaco: {
        "files": "000_real_life_data.csv",
        "order": "{seq}",
        "recorded": "{stamp_start}",
        "label": "object{label}",
        "left": "max('eucl force 1', 'eucl force 2') [N]",
        "right": "'eucl force 3' [N]",
        "gap": "100 - mean(finger1_pos, finger2_pos, finger3_pos) [mm]",
    },
    pr2_biotac: {
        "files": "data/{label}_{object:d}_{order:d}_HOLD.mat",
        "rate_hz": 100,
        "gap": "JPos [m]",
        "effort": "-JEff",
        "left": "F0pdc [counts]",
        "right": "F1pdc [counts]",
        "channels": {"f0electrodes": "F0Electrodes [counts]", "f1electrodes": "F1Electrodes [counts]"},
    },
    biotac_sp: {
        "split": "rows",
        "label": "slipped{slipped}",
        "instance": "{object}",
        "left": "mean('ff_biotac_*', 'mf_biotac_*') [counts]",
        "right": "mean('th_biotac_*') [counts]",
    },
    barrett_taps: {
        "files": "{label}.npz",
        "split": "tap",
        "order": "{tap}",
        "rate_hz": 100,
        "gap": "spread [mm]",
        "channels": {"taxels": "taxels [counts]"},
    },
}


@pytest.mark.parametrize(
    "make", [pytest.param(make, marks=() if make is jaco else pytest.mark.slow) for make in RIGHT]
)
def test_at_least_half_of_a_suggested_manifest_is_right_and_nothing_is_wrong_in_silence(make, tmp_path):
    folder = tmp_path / "set"
    make(folder)
    place = folder / "m.toml"
    out = printed("import", folder, "--suggest", place)
    text = place.read_text()
    assert text.strip() in out
    suggested = tomllib.loads(text)
    checked = {line.partition(" = ")[0] for line in text.splitlines() if "# check: " in line}
    right = [key for key, value in suggested.items() if RIGHT[make].get(key) == value]
    assert len(right) >= 0.5 * len(suggested), (right, text)
    assert set(suggested) - set(right) <= checked, text
    if not {"force", "left", "right"} & set(suggested) and make in (glove, presses):
        assert "# force" in text  # no column is called a force, so a person names it
        return
    recordings = list(read_recordings(str(place)))
    assert recordings
    assert not [recording.error for recording in recordings if hasattr(recording, "error")]


# What the manifests of docs/manifests read.

PRESSED = np.repeat([0.0, 300.0], [25, 275])
COUNTED = 90 + np.arange(N) % 90
F0, F1 = (np.round(1000 + counts * FORCE_N) for counts in (10, 9))
BEGAN = "2020-06-15T15:11:27.442126+00:00"


@pytest.mark.slow
@every_case(
    ("write", "number", "position", "facts", "left_n", "right_n"),
    [
        (jaco, 3, 0, ("object17", 0.0, "", BEGAN), FORCE_N, 0.8 * FORCE_N),
        # Not in the order of the texts: 10 is behind 2 and 3.
        (pr2_biotac, 9, 2, ("black_foam", 10.0, "", ""), F0, F1),
        (biotac_sp, 27, 1, ("slipped1", None, "toy_car", ""), [23.5], [159.5]),
        (barrett_taps, 6, 1, ("felt", 2.0, "", ""), FORCE_N, FORCE_N),
        (glove, 6, 0, ("bottle", 0.0, "", ""), PRESSED, PRESSED),
        (slides, 9, 3, ("mat2", 1.0, "", ""), COUNTED, COUNTED),
    ],
)  # fmt: skip
def test_a_shipped_manifest_reads_its_set(write, number, position, facts, left_n, right_n, tmp_path):
    write(tmp_path / "set")
    grasps = recordings(
        tmp_path / "set", {glove: "dataglove", slides: "biotac_slide"}.get(write, write.__name__)
    )
    grasp = grasps[position]
    assert len(grasps) == number
    assert (grasp.label, grasp.order, grasp.instance, grasp.recorded_at) == facts
    assert forces(grasp) == pytest.approx(np.column_stack([left_n, right_n]), abs=1e-9)
    if write not in (glove, slides, biotac_sp):
        assert column(grasp, "gap_m") == pytest.approx(GAP_M)
    assert UNITS.get(write, {}).items() <= grasp.recording.units.items()
    signals = signals_of([reading.signals for reading in grasp.recording.readings])
    for name, cells in CELLS.get(write, {}).items():
        values = getattr(signals[name], "cells", getattr(signals[name], "values", signals[name]))
        assert np.ravel(values)[: len(cells)].tolist() == pytest.approx(list(cells))


COUNTS = {"force_left": "counts", "force_right": "counts"}
UNITS = {
    pr2_biotac: COUNTS,
    biotac_sp: COUNTS | {"t": "sample", "gap": NO_GAP},
    glove: COUNTS | {"gap": NO_GAP},
    slides: COUNTS | {"gap": NO_GAP},
}
CELLS = {
    jaco: {"position1": [37.0, 37.1], "finger2": 0.5 * FORCE_N},
    pr2_biotac: {"left_electrodes": np.arange(19.0) * N},
    biotac_sp: {"thumb": range(148, 172)},
    barrett_taps: {"fingertip": [0.0] * 24},
    glove: {"little": range(N)},
    slides: {"vibration": range(660), "electrodes": range(19)},
}


def test_fruit_squeezed_until_it_breaks(tmp_path):
    gap, force = GAP_M, FORCE_N.copy()
    force[180:] *= 0.2
    position = 60.0 - gap * 1e3
    folder = tmp_path / "kiwi/trainingSet/20241124_151319"
    time = np.repeat(T_S[::2], 2) + 1732432394.9
    time[1:][np.diff(time) == 0.0] += np.where(np.arange(150) < 140, 0.01, 0.0)
    table(
        folder / "ForceData_20241124_151319.csv", {"Time": time, "Force": force, "Pos": position}, index=True
    )
    np.save(folder / "break_force.npy", np.float64(2.62))
    (tmp_path / "banana/trainingSet").mkdir(parents=True)
    np.save(tmp_path / "banana/trainingSet/data_7.npy", np.column_stack([position * 95.4929, force]))

    banana, kiwi = recordings(tmp_path, "fruit")

    assert (banana.label, banana.instance) == ("banana", "7")
    assert (kiwi.label, kiwi.instance) == ("kiwi", "20241124_151319")
    assert (kiwi.values, banana.values) == ({"break_force [N]": 2.62}, {})
    for fruit in (banana, kiwi):
        assert column(fruit, "gap_m") == pytest.approx(gap[:180], abs=1e-12)
        assert len(fruit.recording.readings) == 180  # up to the largest force before the rupture
    dropped = "10 samples with the time of the one before were dropped"
    assert any(dropped in note for note in kiwi.recording.notes)
    assert banana.recording.rate_hz == pytest.approx(100.0)


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


# The commands.


@pytest.mark.slow
def test_a_whole_set_is_imported_evaluated_and_replayed(tmp_path):
    jaco(tmp_path)
    described, store = tmp_path / "m.toml", tmp_path / "store"
    described.write_text((MANIFESTS / "jaco.toml").read_text())

    trials = answered("import", described, "--save", store, "-o", "classifier.type=none")["trials"]
    assert [trial["trial"] for trial in trials] == [1, 2, 3]
    with Store.read(store) as opened:
        labels = [dict(opened.trial(1).record.labels)]
        recording = read_recorded(opened.trial(1).recording)
        assert opened.trial(1).record.provenance["source"] == "000_real_life_data.csv, line 3"
    assert labels[0] == {"label": "object17", "recorded_at": "2020-06-15T15:11:27.442126+00:00", "order": "0"}
    assert recording.readings()[-1].signals.finger2 == pytest.approx(0.5 * FORCE_N[-1])
    assert [channel.name for channel in recording.channels][:3] == ["finger1", "finger2", "finger3"]
    plain = ("--pipeline", "default", "-o", "classifier.type=none")
    features, same = (
        answered("replay", source, *more)["features"]
        for source, more in ((f"{store}#1", ()), (f"manifest:{described}#1", plain))
    )
    assert features == same
    assert "trial 1" in refused("import", described, "--save", store, "-o", "classifier.type=none")


@pytest.mark.slow
def test_check_says_what_it_understood_and_draws_a_grasp_without_storing(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib", reason="needs the extra plot")
    jaco(tmp_path)
    monkeypatch.chdir(tmp_path)
    described = tmp_path / "m.toml"
    described.write_text((MANIFESTS / "jaco.toml").read_text())

    out = printed("import", described, "--check", "-o", "classifier.type=none")
    assert "object17  1       unknown  300      100       48 to 60  0 to 10  0 to 8" in out
    assert "channels    finger1 [N], finger2 [N], finger3 [N], position1 [mm]" in out
    assert "recorded    2020-06-15T15:11:27.442126+00:00 to 2020-06-15T15:13:27.442126+00:00" in out
    assert (tmp_path / "import-check.png").read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "store").exists()
    assert re.search("--save DIR.*--check", refused("import", described), re.DOTALL)


@pytest.mark.slow
def test_one_recording_of_a_set_is_imported_by_its_number(tmp_path):
    jaco(tmp_path)
    described = tmp_path / "manifest.toml"
    described.write_text((MANIFESTS / "jaco.toml").read_text())
    printed("import", f"manifest:{described}#2", "--save", tmp_path / "second", "-o", "classifier.type=none")
    with Store.read(tmp_path / "second") as store:
        assert store.trial(1).record.labels["label"] == "object3"
    assert "fewer than 9 recordings" in refused("replay", f"manifest:{described}#9")
