"""Stores, recordings and models that were truncated or changed at random places.

Whatever is read of them, it is what was written or an error of ours; nothing is run, and no file changes by being
read. Some dozens each; with GRASPSENSE_MUTATIONS as many as it says.
"""

import hashlib
import json
import os
import random
from contextlib import suppress

import numpy as np
import pytest
from kept import ended, keep, write_recording
from mutated_files import bounded, bytes_of, mcap_file, sqlite_file

from graspsense.core.components.registry import installed
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model_file import as_json, load_model
from graspsense.core.learn.training import train
from graspsense.core.values.errors import GraspsenseError
from graspsense.plugin_api import create
from graspsense.recording.reader import read_recorded
from graspsense.sources.trial_source import load_trials
from graspsense.store.dataset import labelled_store
from graspsense.store.recover import recover_file
from graspsense.store.store import Store
from graspsense.store.verify import verify_store

MUTATIONS = int(os.environ.get("GRASPSENSE_MUTATIONS", "0"))
NUMBER = MUTATIONS or 20


def digests(folder):
    files = (
        path for path in folder.rglob("*") if path.is_file() and not path.name.endswith(("-shm", "-wal"))
    )
    return {file: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


@pytest.mark.slow
def test_recordings(tmp_path):
    """What a strict reader gives is what was written, to the byte; salvage gives ticks that were written."""
    path = tmp_path / "g.mcap"
    write_recording(path, 200, ended())
    good = path.read_bytes()
    whole = read_recorded(path)
    written = {whole.ticks.tobytes()[k : k + 120] for k in range(0, 200 * 120, 120)}
    rng = random.Random(1)
    told = 0
    for _ in range(NUMBER):
        bad = bytes_of(good, rng)
        path.write_bytes(bad)
        try:
            recording = read_recorded(path)
            recording.record()
            assert recording.ticks.tobytes() == whole.ticks.tobytes()
            assert recording.pads.tobytes() == whole.pads.tobytes()
        except GraspsenseError:
            told += 1
        copy = tmp_path / "copy.mcap"
        with suppress(GraspsenseError):
            saved = read_recorded(path, salvage=True)
            assert {saved.ticks.tobytes()[k : k + 120] for k in range(0, len(saved) * 120, 120)} <= written
            recover_file(path, copy)
            read_recorded(copy)
        copy.unlink(missing_ok=True)
        assert path.read_bytes() == bad
    assert told > 0.8 * NUMBER


@pytest.mark.slow
def test_stores(tmp_path):
    """A store that opens is one in which `verify` finds what was changed, or nothing that matters was."""
    folder = tmp_path / "trials"
    with Store.open(folder) as store:
        for k in range(12):
            keep(
                store, f"can:{'full' if k % 2 else 'empty'}", f"can#{k % 3}", values=(0.06 + k, 5.0), ticks=2
            )
        good_rows = store.query("SELECT * FROM trial")
        good_details = store.query("SELECT * FROM detail")
    good, recordings = (folder / "store.sqlite").read_bytes(), sorted((folder / "recordings").iterdir())
    rng = random.Random(2)
    told = silent = 0
    for _ in range(NUMBER):
        for path in folder.glob("store.sqlite*"):
            path.unlink()
        (folder / "store.sqlite").write_bytes(good)
        kept = rng.choice(recordings)
        recording = kept.read_bytes()
        match rng.randrange(4):
            case 0:
                sqlite_file(folder / "store.sqlite", rng)
            case 1:
                mcap_file(kept, rng)
            case _:
                (folder / "store.sqlite").write_bytes(bytes_of(good, rng))
        digests_before = digests(folder)
        try:
            with bounded():
                problems = verify_store(folder).problems
                labelled_store(str(folder))
                load_trials(f"store:{folder}", options=["features.force=left"])
            with Store.read(folder) as store:
                for summary in store.page(set_aside=None):
                    with suppress(GraspsenseError):
                        store.trial(summary.id)
                rows = store.query("SELECT * FROM trial")
                same = rows == good_rows and store.query("SELECT * FROM detail") == good_details
            if problems:
                told += 1
            else:
                assert same or fewer(rows, good_rows)
                silent += 1
            said = str(folder)
        except GraspsenseError as error:
            said = str(error)
            told += 1
        assert str(folder) in said
        assert digests(folder) == digests_before
        kept.write_bytes(recording)
    assert told > silent


def fewer(rows, good):
    """Whether rows are gone or moved to another number, but none has other content: their recordings have no row."""
    return {row[1:] for row in rows} <= {row[1:] for row in good}


def test_models(tmp_path):
    table_of = np.random.default_rng(1).normal(size=(40, 2)) + np.repeat([[0.0], [3.0]], 20, axis=0)
    from graspsense.core.values.features import FeatureTable

    labelled = Labelled(
        source="made up",
        table=FeatureTable(names=("a", "b"), units=("m", "N"), values=table_of),
        labels=("x",) * 20 + ("y",) * 20,
    )
    plugins = installed()
    path = tmp_path / "m.json"
    for name in ("c45", "tree"):
        model = train(plugins.find("classifier", name), create("classifier", name).config, labelled, name="m")
        good = json.dumps(as_json(model)).encode()
        content = json.loads(good)
        rng = random.Random(3)
        told = 0
        for _ in range(NUMBER):
            bad = bytes_of(good, rng)
            path.write_bytes(bad)
            try:
                load_model(str(path), plugins)
            except GraspsenseError:
                told += 1
            else:
                assert json.loads(bad) == content
            assert path.read_bytes() == bad
        assert told > 0.9 * NUMBER


@pytest.mark.slow
def test_many_more(tmp_path, monkeypatch):
    monkeypatch.setitem(globals(), "NUMBER", MUTATIONS or 300)
    for test in (test_recordings, test_stores, test_models):
        (tmp_path / test.__name__).mkdir()
        test(tmp_path / test.__name__)
