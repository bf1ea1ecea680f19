"""The same grasp is imported once, whatever its file is called and whatever ended an import before."""

import os

import pytest
from attrs import evolve
from commands import graspsense
from kept import keep
from repository import ROOT

from graspsense.core.files.whole_file import SaveFailed, locked
from graspsense.core.values.errors import ConfigError
from graspsense.recording.replayable import content_sha256
from graspsense.store.changes import set_aside
from graspsense.store.imported_contents import ImportedContents, imported_alone
from graspsense.store.store import Store
from graspsense.store.stored_grasps import stored_recording


def test_a_content_that_the_store_has_is_refused_until_its_trial_is_set_aside(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        keep(store, origin="collect")
        number = keep(store, origin="import")
        recording = stored_recording(f"{store.folder}#{number}")
        sha256 = content_sha256(evolve(recording, name="another file"))

        with pytest.raises(ConfigError, match=r"again\.csv .*trial 2 .* trials aside"):
            ImportedContents(store).refuse(sha256, "again.csv")
        # Another grasp is not refused, and neither is this one where only its own trial is set aside.
        ImportedContents(store).refuse("0" * 64, "other.csv")
        set_aside(store, [number], "wrong columns")
        ImportedContents(store).refuse(sha256, "again.csv")


def test_an_import_that_could_not_add_its_last_trial_is_gone_on_with(tmp_path, monkeypatch):
    command = ("import", ROOT / "samples" / "manifest.toml", "--save", tmp_path / "s")
    with monkeypatch.context() as full:
        full.setattr(Store, "_add", lambda *_: (_ for _ in ()).throw(SaveFailed("it is full")))
        assert graspsense(*command)[0] == 2
    graspsense(*command)
    with Store.read(tmp_path / "s") as store:
        assert [trial.complete for trial in store.page()] == [True, True]


def test_one_import_at_a_time_writes_to_a_store(tmp_path):
    with Store.open(tmp_path) as store:
        other = os.open(store.recordings, os.O_RDONLY)
        assert locked(other)
        waited = []
        with imported_alone(store, lambda: waited.append(os.close(other))):
            assert waited
