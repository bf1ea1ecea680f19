"""Features of a whole store with other thresholds: from its recordings, without a change of the store."""

import json
import re
import shutil

import pytest
from cases import every_case
from commands import answered, printed, refused
from kept import frame, keep

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.sources.trial_table.features_csv import read_labelled
from graspsense.store.dataset import labelled_store, read_dataset
from graspsense.store.store import Store


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Six trials whose pads reach 0.01 N and 0.02 N more in each tick; the stored width is that of other settings."""
    folder = tmp_path_factory.mktemp("trials")
    with Store.open(folder) as store:
        for k in range(6):
            keep(store, ("can:full", "can:empty")[k % 2], f"can#{k}", grasp=k)
    return str(folder)


def gap_at(force_n):
    """Return the gap at which both pads have reached this force: the left one is the weaker."""
    return frame(next(k for k in range(120) if frame(k).force_left_n >= force_n)).gap_m


@every_case("table", ["controller", "features"])
def test_other_thresholds_give_other_features_of_the_same_trials(folder, table):
    stored = labelled_store(folder)
    again = labelled_store(folder, [f"{table}.contact_force_n=0.2"])

    assert (again.labels, again.instances, again.order) == (stored.labels, stored.instances, stored.order)
    assert stored.table.values[:, 0].tolist() == [0.066] * 6
    assert again.table.columns(["p_first"]).values[:, 0].tolist() == [gap_at(0.2)] * 6
    assert again.width.table.values[:, 0].tolist() == [gap_at(0.2)] * 6
    # What a model that is trained on them says of its training data.
    assert again.provenance["settings"]["features"]["contact_force_n"] == 0.2
    assert again.provenance["settings"]["gripper"]["type"] == "graspsense-sim-gripper/sim"
    told = "\n".join(again.notes)
    assert f"{table}.contact_force_n=0.2" in told
    assert "settings: 6 from steady" in told
    assert labelled_store(folder).table.values.tobytes() == stored.table.values.tobytes()


def test_another_feature_set_can_be_tried_on_a_store(folder):
    again = labelled_store(folder, ["features.type=curve"])
    assert "contact_gap" in again.table.names
    assert len(again.table.names) > 6
    assert again.provenance["components"]["features"].startswith("graspsense/curve")


def test_the_settings_of_an_experiment_are_used_for_a_store(folder):
    from graspsense.plugin_api import create

    left = read_dataset(folder, create("feature-set", "chitta", force="left", contact_force_n=0.5))
    assert left.table.columns(["p_first"]).values[0, 0] == gap_at(0.5)


@every_case(
    ("option", "says"),
    [
        ("gripper.object=can:full", r"\[features\], \[controller\], \[run\] only; its gripper"),
        ("features.contact_force=1", "'contact_force_n'"),
        ("features.contact_force_n=-1", "above 0"),
        ("features.type=curv", "curve"),
        ("nonsense", "other keys of"),
    ],
)
def test_what_cannot_be_changed_is_told(folder, option, says):
    with pytest.raises(ConfigError, match=says):
        labelled_store(folder, [option])


def test_a_lost_recording_is_told(folder, tmp_path):
    folder = str(shutil.copytree(folder, tmp_path / "copy"))
    with Store.read(folder) as store:
        store.recording_path(store.summary(3).recording).unlink()
    trials = labelled_store(folder, ["features.force=left"])
    assert len(trials) == 5
    (told,) = (note for note in trials.notes if "cannot be read" in note)
    assert re.search("1 of 6 .* the recording.*trial 3 .* is lost", told)
    with Store.read(folder) as store:
        for path in store.recordings.iterdir():
            path.unlink()
    with pytest.raises(DataDamaged, match=r" 6 .*copy#1"):
        labelled_store(folder, ["features.force=left"])


def test_the_command_compares_and_keeps(folder, tmp_path):
    kept = tmp_path / "again.csv"
    arguments = ("features", f"store:{folder}", "-o", "controller.contact_force_n=2", "--keep", kept)
    told = answered(*arguments)
    # The left pad reaches 1.19 N at most.
    (row,) = [row for row in told["features"] if row["name"] == "p_first"]
    assert (row["unit"], row["trials_before"], row["median_before"]) == ("m", 6, 0.066)
    assert (row["trials"], row["median"]) == (0, None)
    assert kept.read_text().startswith("label,instance,order,p_first [m]")
    assert "already exists" in refused(*arguments)
    other = ("-o", "controller.contact_force_n=0.2")
    assert "6 of 6" in printed("features", folder, "--overwrite", "--keep", kept, *other)
    assert "6 of 6" in printed("features", folder, *other)
    assert read_labelled(kept, "label").table.columns(["p_first"]).values[0, 0] == gap_at(0.2)
    assert "no store" in refused("features", tmp_path / "none", *other)


def test_train_uses_the_features_of_its_options(folder, tmp_path):
    out = tmp_path / "m.json"
    train = ("train", f"store:{folder}", "--out", out)
    options = ("-o", "features.contact_force_n=0.2", "-o", "classifier.min_leaf=1", "--classifier", "tree")
    printed(*train, *options)
    assert json.loads(out.read_text())["provenance"]["settings"]["features"]["contact_force_n"] == 0.2
    assert "[classifier], [features], [controller] and [run]" in refused(
        *train, "--overwrite", "-o", "gripper.object=can:full"
    )
