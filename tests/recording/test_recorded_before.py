"""Stores, recordings and exports of the version before channels were declared still open, and give the same features.

`tests/data/layout2/make.sh` made them.
"""

import csv
import shutil

import numpy as np
import pytest
from repository import TESTS

from graspsense.core.components.registry import installed
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.settings.resolved import settings_from
from graspsense.recording.export_trace import write_npz
from graspsense.recording.reader import read_recorded
from graspsense.store.verify import verify_store

DATA = TESTS / "data" / "layout2"
NAMES = ["p_first [m]", "p_steady [m]", "f_steady [N]", "delta_t [s]", "dp_dt [m/s]", "df_dt [N/s]"]


@pytest.fixture
def store(tmp_path):
    shutil.copytree(DATA / "store", tmp_path / "store")
    return tmp_path / "store"


def exported():
    with (DATA / "features.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_an_old_store_is_whole_and_its_recordings_replay_to_the_same_features(store):
    findings = verify_store(store)
    assert (findings.trials, findings.recordings, findings.problems) == (2, 2, ())
    for row in exported():
        path = store / "recordings" / row["recording"]
        settings = dict(read_recorded(path).record().settings)
        settings["gripper"] = {"type": "replay", "recording": str(path)}
        trial = grasp_with(settings_from(settings, "the old trial"), installed())
        assert [repr(value) for value in trial.features.values] == [row[name] for name in NAMES]


def test_an_old_recording_exports_the_same_arrays(store, tmp_path):
    row = exported()[0]
    write_npz(tmp_path / "new.npz", read_recorded(store / "recordings" / row["recording"]))
    with np.load(DATA / "grasp.npz") as old, np.load(tmp_path / "new.npz") as new:
        # With these an import reads the file back as the recording.
        assert set(new.files) == {*old.files, "declared", "dt_s"}
        for name in old.files:
            np.testing.assert_array_equal(old[name], new[name])
