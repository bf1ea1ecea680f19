"""Export: what is written is read back by programs that know nothing of graspsense."""

import csv
import math
import shutil
import sys
import tomllib

import numpy as np
import pytest
import scipy
from attrs import evolve
from cases import every_case
from commands import graspsense, printed, refused
from kept import ended, frame, keep, pads, write_recording

from graspsense.core.settings.selected import select_component
from graspsense.core.values.errors import ConfigError, PluginUnavailable
from graspsense.core.values.features import Features
from graspsense.evaluation.evaluate import evaluate
from graspsense.evaluation.json_codec import to_json
from graspsense.recording.recording_info import RecordingInfo
from graspsense.sources.importing.import_sources import recordings_to_import
from graspsense.sources.trial_table.features_csv import read_labelled
from graspsense.store.changes import set_aside
from graspsense.store.dataset import labelled_store
from graspsense.store.export_table import ABOUT_BEFORE
from graspsense.store.store import Store


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored")
    with Store.open(folder) as store:
        keep(store, "can:full_open", "can#1", values=(0.066, 5.5))
        keep(store, "can:it's open", "can#2", values=(0.1 + 0.2, None))
        keep(store, None, values=(0.05, 1.0))
        set_aside(store, [keep(store)], "undone")
        keep(store, "can:full_open", "can#1", outcome="aborted", values=(None, None))
    return folder


@pytest.fixture
def folder(stored, tmp_path):
    return shutil.copytree(stored, tmp_path / "trials")


def export(source, target, code=0):
    """Export and demand how it ends; return what is said of it."""
    done = graspsense("export", source, "--to", target)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr


def rows_of(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_table_is_read_by_programs_that_do_not_know_us(folder, tmp_path):
    for ending in ("csv", "npz"):
        export(folder, tmp_path / f"t.{ending}")
    rows = rows_of(tmp_path / "t.csv")
    assert [row["trial"] for row in rows] == ["1", "2", "3", "5"]
    assert float(rows[1]["p_first [m]"]) == 0.1 + 0.2
    assert (rows[1]["f_steady [N]"], rows[2]["label"], rows[3]["outcome"]) == ("", "", "aborted")
    with np.load(tmp_path / "t.npz", allow_pickle=False) as arrays:
        assert arrays["features"].tolist() == ["p_first", "f_steady"]
        assert arrays["units"].tolist() == ["m", "N"]
        assert arrays["values"][0].tolist() == [0.066, 5.5]
        assert arrays["label"].tolist() == ["can:full_open", "can:it's open", "", "can:full_open"]
    with Store.open(folder) as store:
        set_aside(store, [3], "no label")
    export(folder, tmp_path / "t.arff")
    data, about = scipy.io.arff.loadarff(tmp_path / "t.arff")
    assert about.names() == ["p_first", "f_steady", "label"]
    assert data["p_first"][:2].tolist() == [0.066, 0.1 + 0.2]
    assert math.isnan(data["f_steady"][1])
    assert data["label"][0] == b"can:full_open"


def test_parquet_is_read_by_pyarrow(folder, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")
    export(folder, tmp_path / "t.parquet")
    table = parquet.read_table(tmp_path / "t.parquet")
    assert table["f_steady"].to_pylist() == [5.5, None, 1.0, None]
    assert table.schema.field("p_first").metadata == {b"unit": b"m"}
    export(f"{folder}#1", tmp_path / "one.parquet")
    assert parquet.read_table(tmp_path / "one.parquet")["gap_m"].to_pylist()[5] == frame(5).gap_m
    assert parquet.read_table(tmp_path / "one-pads.parquet").num_rows == 3


@every_case("ending", ["csv", "npz", "parquet"])
def test_the_table_of_a_store_is_no_grasp_to_import(stored, tmp_path, ending):
    if ending == "parquet":
        pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")
    table = tmp_path / f"t.{ending}"
    export(stored, table)
    assert f"graspsense export DIR#12 --to FILE.{ending}" in refused(
        "import", table, "--save", tmp_path / "other"
    )
    learned = graspsense("train", table, "--label", "label", "--out", tmp_path / "model.json")
    assert (learned.returncode, "store:DIR" in learned.stderr) == (
        (0, False) if ending == "csv" else (2, True)
    )


def test_labelled_trials_of_a_store_are_a_data_set(folder):
    trials = labelled_store(str(folder))
    assert trials.table.names == ("p_first", "f_steady")
    assert (trials.labels, trials.instances) == (("can:full_open", "can:it's open"), ("can#1", "can#2"))
    assert trials.order == (0, 1)
    assert trials.first_line is None  # that is of imports alone
    assert str(trials.table.values.tolist()) == str([[0.066, 5.5], [0.1 + 0.2, math.nan]])
    assert trials.before_contact.table.values.tolist() == [[0.08], [0.08]]
    assert trials.width.table.names == ("p_first",)
    assert trials.provenance["simulated"]
    assert any("simulated" in note for note in trials.notes)
    assert trials.provenance["settings"]["controller"]["probing_force_n"] == 20.0


def test_one_grasp_tick_by_tick(folder, tmp_path):
    for ending in ("csv", "npz", "mcap", "toml"):
        assert ("the settings of" if ending == "toml" else "120 ticks, ") in printed(
            "export", f"{folder}#1", "--to", tmp_path / f"one.{ending}"
        )
    rows = rows_of(tmp_path / "one.csv")
    assert [float(row["gap_m"]) for row in rows] == [frame(k).gap_m for k in range(120)]
    assert {row["edge_left_n"] for row in rows} == {""}
    assert float(rows_of(tmp_path / "one-pads.csv")[0]["right_00"]) == pads(0).right[0]
    with np.load(tmp_path / "one.npz", allow_pickle=False) as arrays:
        assert arrays["pad_left"].shape == (3, 22)
    (recording,) = [
        path
        for path in (folder / "recordings").iterdir()
        if path.read_bytes() == (tmp_path / "one.mcap").read_bytes()
    ]
    assert recording.is_file()
    assert tomllib.loads((tmp_path / "one.toml").read_text())["controller"]["probing_force_n"] == 20.0
    # A recording without a store, as well.
    export(recording, tmp_path / "again.npz")


def test_nothing_is_ever_overwritten_and_what_cannot_be_written_is_told(folder, tmp_path):
    (tmp_path / "mine.csv").write_text("mine")
    assert "already exists" in export(folder, tmp_path / "mine.csv", code=2)
    assert (tmp_path / "mine.csv").read_text() == "mine"
    for source, target in (("", "t.xlsx"), ("", "t.mcap"), ("#1", "t.arff"), ("#9", "t.csv")):
        told = export(f"{folder}{source}", tmp_path / target, code=2)
        assert "be written as" in told or "trial 9" in told
        assert not (tmp_path / target).exists()


def test_without_pyarrow_parquet_says_what_to_install(folder, tmp_path, monkeypatch):
    from graspsense.store.export_table import trial_table, write_parquet

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(PluginUnavailable, match=r"graspsense\[parquet\]"):
        write_parquet(tmp_path / "t.parquet", trial_table(folder))


def test_a_store_without_labels_says_how_to_get_some(tmp_path):
    with Store.open(tmp_path / "t") as store:
        keep(store, None)
    with pytest.raises(ConfigError, match="graspsense collect"):
        labelled_store(str(tmp_path / "t"))


def a_store_of_everything(folder):
    """Trials of both origins, with times, numbers to predict, one incomplete, one aborted, one with other features."""
    other = Features(names=("p_other",), values=(0.05,), units=("m",))
    with Store.open(folder) as store:
        trial_id = ended(label="can:full")
        alone = evolve(trial_id, result=evolve(trial_id.result, features=other))
        path = store.new_recording(trial_id.made_at)
        write_recording(path, 5, alone)
        store.add(alone, RecordingInfo.hashed(path, 5, 1))
        for k in range(24):
            label, origin = ("can:full", "can:empty")[k % 2], ("import", "collect")[k % 3 == 0]
            keep(store, label, f"can#{k // 2}", values=(0.05 + 0.001 * k, (k * 7) % 5 + k % 2), origin=origin, ticks=9,
                 labels={"recorded_at": f"2020-01-{1 + (k * 5) % 24:02d}", "fill [ml]": str(100 + k)})  # fmt: skip
        keep(store, "can:full", "can#1", outcome="aborted", ticks=9)
        keep(store, "can:full", "can#1", ticks=9, complete=False)


def test_evaluate_gives_the_same_figures_for_a_store_and_its_export(tmp_path):
    folder = tmp_path / "trials"
    a_store_of_everything(folder)
    export(folder, tmp_path / "t.csv")
    component = select_component("classifier", "c45")
    stored, from_export = (
        to_json(evaluate(component, trials, classifier="c45", folds=3, permutations=1, learning_curve=False))
        for trials in (labelled_store(str(folder)), read_labelled(tmp_path / "t.csv", "label"))
    )
    for own in ("source", "notes"):
        stored.pop(own), from_export.pop(own)
    assert stored["headline"]["n"] == 24
    assert {"before_contact", "first_line", "recording_order"} <= stored["controls"].keys()
    assert all(stored["controls"][name]["rate"] for name in ("first_line", "recording_order", "width_only"))
    assert from_export == stored


def test_an_export_of_an_earlier_version_still_opens(folder, tmp_path):
    export(folder, tmp_path / "t.csv")
    rows = rows_of(tmp_path / "t.csv")
    names = [*ABOUT_BEFORE, "p_first [m]", "f_steady [N]"]
    with (tmp_path / "old.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, names, extrasaction="ignore")
        writer.writeheader()
        writer.writerows(rows)
    trials = read_labelled(tmp_path / "old.csv", "label")
    assert trials.table.names == ("p_first", "f_steady")
    assert (trials.labels, trials.order) == (("can:full_open", "can:it's open"), (0, 1))
    assert trials.before_contact is None


@pytest.mark.parametrize("ending", ["npz", "PARQUET"])
def test_an_exported_grasp_is_imported_without_a_kind_before_its_name(folder, tmp_path, ending):
    if ending.lower() == "parquet":
        pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")
    export(f"{folder}#1", tmp_path / f"one.{ending.lower()}")
    for file in list(tmp_path.glob(f"one*.{ending.lower()}*")):
        file.rename(file.with_name(file.name.replace(ending.lower(), ending)))
    (imported,), refused = recordings_to_import([str(tmp_path / f"one.{ending}")], {}, None)
    assert not refused
    assert imported.name == f"{ending.lower()}:{tmp_path / f'one.{ending}'}"
    recording = imported.labelled.recording
    assert [reading.frame.gap_m for reading in recording.readings] == [frame(k).gap_m for k in range(120)]
