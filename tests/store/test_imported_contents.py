"""The same grasp is imported once, whatever its file is called."""

import pytest
from attrs import evolve
from kept import keep

from graspsense.core.values.errors import ConfigError
from graspsense.recording.replayable import content_sha256
from graspsense.store.changes import set_aside
from graspsense.store.imported_contents import ImportedContents
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
