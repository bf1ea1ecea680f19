"""A store written as a LeRobot data set v3.0: what others read of it, and that it is the same trials when read back."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from commands import graspsense, printed, refused
from lerobot_sets import NAMES, episode, write_set

from graspsense.store.store import Store
from graspsense_lerobot.reader import recordings

DATA, EPISODES = "data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"
SAMPLES = Path(__file__).parents[3] / "samples" / "trials"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return the data set of a store of imported trials, and the store."""
    folder = tmp_path_factory.mktemp("lerobot")
    place = f"lerobot:{write_set(folder / 'set', 3)}?gap_m_per_unit=0.001&force_n_per_unit=0.5"
    printed("import", place, "--save", folder / "s")
    printed("export", folder / "s", "--to", f"lerobot:{folder / 'out'}?fps=15")
    return folder / "out", folder / "s"


def table_of(path):
    return pq.read_table(path).to_pandas()


def frames(folder):
    return table_of(folder / DATA)


def json_of(path):
    return json.loads(path.read_text())


def info(folder):
    return json_of(folder / "meta/info.json")


def peak_n(recording):
    return max(reading.frame.force_left_n for reading in recording.recording.readings)


def test_the_description_agrees_with_the_frames(written):
    said, rows = info(written[0]), frames(written[0])
    assert said["codebase_version"] == "v3.0"
    assert (said["fps"], said["total_episodes"], said["total_frames"]) == (15, 4, len(rows))
    assert set(said["features"]) == set(rows.columns)
    for key, feature in said["features"].items():
        value = np.atleast_1d(rows[key].iloc[0])
        assert [*value.shape] == feature["shape"]
        if feature["names"]:
            assert len(feature["names"]) == len(value)
    assert not any("/" in key for key in said["features"])


def test_the_indices_are_those_that_lerobot_needs(written):
    rows = frames(written[0])
    assert rows["index"].tolist() == list(range(len(rows)))
    assert rows["timestamp"].dtype == np.float32
    episodes = table_of(written[0] / EPISODES)
    for row in episodes.itertuples():
        own = rows[rows["episode_index"] == row.episode_index]
        assert (row.dataset_from_index, row.dataset_to_index) == (own["index"].min(), own["index"].max() + 1)
        assert row.length == len(own)
        assert own["frame_index"].tolist() == list(range(len(own)))
        assert own["timestamp"].to_numpy() == pytest.approx(np.arange(len(own)) / 15)


def test_the_tasks_are_the_index_of_their_table(written):
    tasks = table_of(written[0] / "meta/tasks.parquet")
    assert tasks.loc["pick_the_red_cup"].task_index == 0
    assert [*tasks.columns] == ["task_index"]


def test_statistics_are_those_of_the_frames(written):
    stats = json_of(written[0] / "meta/stats.json")["observation.state"]
    state = np.stack(frames(written[0])["observation.state"])
    assert stats["max"] == pytest.approx(state.max(axis=0).tolist())
    assert stats["std"] == pytest.approx(state.std(axis=0).tolist(), rel=1e-4, abs=1e-6)
    assert stats["count"] == [len(state)]


def test_phase_event_and_prediction_have_a_meaning(written):
    means, rows = json_of(written[0] / "meta/graspsense.json"), frames(written[0])
    own = rows[rows["episode_index"] == 0]
    contact = next(number for number, name in means["graspsense.event"].items() if name == "contact")
    (touch,) = np.flatnonzero(own["graspsense.event"] == int(contact))
    phases = [means["graspsense.phase"][str(number)] for number in own["graspsense.phase"]]
    assert (phases[touch - 2], phases[touch + 1]) == ("approach", "squeeze")
    assert means["graspsense.prediction"][str(own["graspsense.prediction"].iloc[-1])]


def test_what_was_felt_and_the_features_are_columns_of_the_episodes(written):
    episodes = table_of(written[0] / EPISODES)
    assert episodes["graspsense/felt"].all()
    assert not episodes["graspsense/crushed"].any()
    with Store.read(written[1]) as store:
        features = store.trial(1).result.features
    for name, value in features.as_dict().items():
        kept = episodes[f"graspsense/feature/{name}"].iloc[0]
        assert np.isnan(kept) if value is None else kept == value


def test_the_raw_rate_is_kept_beside(written):
    raw = table_of(written[0] / "graspsense/raw/episode_000000.parquet")
    assert np.diff(raw["t_s"]) == pytest.approx(1 / 30, abs=1e-6)
    cells = table_of(written[0] / "graspsense/raw/episode_000000-f0.parquet")
    assert len(cells["f0"].iloc[0]) == 12


def test_what_was_written_reads_back_as_the_same_trials(written):
    squeezes = list(recordings(str(written[0])))
    cup, sponge = "pick_the_red_cup", "squeeze-_sponge"
    assert [recording.label for recording in squeezes] == [cup, sponge, sponge, cup]
    for recording, peak in zip(squeezes, [12.0, 9.0, 9.75, 15.0], strict=True):
        assert not recording.recording.units  # metres and newtons, as the metadata says
        assert peak_n(recording) == pytest.approx(peak, rel=1e-5)
        assert {channel.name for channel in recording.recording.channels} >= {"f0", "f1"}


@pytest.mark.slow
def test_simulated_trials_are_written(tmp_path):
    printed("export", SAMPLES, "--to", f"lerobot:{tmp_path / 'out'}")
    state = np.stack(frames(tmp_path / "out")["observation.state"])
    names = info(tmp_path / "out")["features"]["observation.state"]["names"]
    assert {"gripper.pos", "left.force", "right.force"} <= set(names)
    assert np.isfinite(state).all()
    read = recordings(str(tmp_path / "out"))
    most_n = max(reading.frame.effort_n for each in read for reading in each.recording.readings)
    assert most_n == pytest.approx(float(state[:, names.index("gripper.effort")].max()))
    assert "synthetic" in (tmp_path / "out/README.md").read_text()
    assert ":" in table_of(tmp_path / "out/meta/tasks.parquet").index[0]


def assert_refused(source, target, word):
    """Assert that the export of a store to this data set is wrong use, told with this word."""
    assert word in refused("export", source, "--to", f"lerobot:{target}")


def test_an_existing_folder_and_a_single_trial_are_no_data_set(written, tmp_path):
    assert_refused(written[1], written[0], "already exists")
    for trial in ("#1", "#2"):
        assert_refused(f"{written[1]}{trial}", tmp_path / "out", "folder of a store")


def test_nothing_is_left_of_an_export_that_fails(written, tmp_path):
    store = shutil.copytree(written[1], tmp_path / "s")
    next((store / "recordings").glob("*.mcap")).write_bytes(b"damaged")
    assert graspsense("export", store, "--to", f"lerobot:{tmp_path / 'out'}").returncode in (2, 5)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["s"]


def test_an_episode_of_an_array_feature_is_read(tmp_path):
    """`observation.tactile.left` as a whole: cells with three axes, or a grid."""
    folder = write_set(tmp_path / "set", 3, [episode()])
    path = folder / DATA
    table = pq.read_table(path)
    state = np.stack(table["observation.state"].to_pylist())
    cells = state[:, 3:15].reshape(-1, 4, 3).astype(np.float32)
    said = info(folder)
    said["features"]["observation.tactile.left"] = {"dtype": "float32", "shape": [4, 3], "names": None}
    said["features"]["observation.state"] |= {"shape": [3], "names": NAMES[:3]}
    (folder / "meta/info.json").write_text(json.dumps(said))
    table = table.set_column(0, "observation.state", pa.array(state[:, :3].tolist()))
    pq.write_table(table.append_column("observation.tactile.left", pa.array(cells.tolist())), path)
    (recording,) = recordings(str(folder))
    (array,) = [channel for channel in recording.recording.channels if channel.name == "tactile_left"]
    assert (array.cells, array.components) == (4, 3)
    assert peak_n(recording) == pytest.approx(24.0, rel=1e-5)


@pytest.fixture(scope="module", params=[2, 3])
def annotated(request, tmp_path_factory):
    """Return the version of a data set, and the folder of the data set, its store and its annotated copy."""
    folder = tmp_path_factory.mktemp("annotated")
    original = write_set(folder / "set", request.param)
    printed("import", f"lerobot:{original}?gap_m_per_unit=0.001", "--save", folder / "s")
    unchanged = contents(original)
    printed("export", folder / "s", "--to", f"lerobot:{folder / 'copy'}?annotate={original}")
    assert contents(original) == unchanged
    return request.param, folder


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def all_frames(folder):
    return pa.concat_tables(map(pq.read_table, sorted((folder / "data").rglob("*.parquet")))).to_pandas()


def test_a_copy_has_what_it_had_and_phase_event_and_prediction(annotated):
    _, folder = annotated
    copy = folder / "copy"
    old, new = all_frames(folder / "set"), all_frames(copy)
    added = ["graspsense.phase", "graspsense.event", "graspsense.prediction"]
    assert [*new.columns] == [*old.columns, *added]
    for key in old:
        assert np.array_equal(np.stack(old[key]), np.stack(new[key]))
    assert set(info(copy)["features"]) == set(new.columns) | {"observation.images.wrist"}
    means = json_of(copy / "meta/graspsense.json")
    own = new[new["episode_index"] == 1]  # with two squeezes, and so two contacts
    contacts = [means["graspsense.event"][str(number)] for number in own["graspsense.event"] if number]
    assert contacts.count("contact") == 2
    event_frames = np.flatnonzero(own["graspsense.event"])
    state = np.stack(own["observation.state"])
    assert (state[event_frames[0], 5::3] > 0.0).all()  # the cells press where contact is told
    assert (state[event_frames[0] - 3, 5::3] == 0.0).all()


def test_a_copy_says_what_each_trial_of_an_episode_was(annotated):
    version, folder = annotated
    copy = folder / "copy"
    if version == 2:
        rows = map(json.loads, (copy / "meta/episodes.jsonl").read_text().splitlines())
        keys = ("graspsense/label", "graspsense/felt")
        trials = [[tuple(trial[key] for key in keys) for trial in row["graspsense"]] for row in rows]
    else:
        table = table_of(copy / EPISODES)
        both = zip(table["graspsense/label"], table["graspsense/felt"], strict=True)
        trials = [list(zip(labels.tolist(), felt.tolist(), strict=True)) for labels, felt in both]
    cup, sponge = ("pick_the_red_cup", True), ("squeeze-_sponge", True)
    assert trials == [[cup], [sponge, sponge], [cup]]


def test_an_annotated_copy_reads_as_the_original(annotated):
    _, folder = annotated
    old, new = (
        [[reading.frame for reading in each.recording.readings] for each in recordings(str(folder / name))]
        for name in ("set", "copy")
    )
    assert old == new


@pytest.mark.slow
def test_an_annotation_takes_the_place_of_an_earlier_one(annotated, tmp_path):
    copy = annotated[1] / "copy"
    printed("import", f"lerobot:{copy}?gap_m_per_unit=0.001", "--save", tmp_path / "s2")
    printed("export", tmp_path / "s2", "--to", f"lerobot:{tmp_path / 'second'}?annotate={copy}")
    assert all_frames(tmp_path / "second").equals(all_frames(copy))
    assert info(tmp_path / "second") == info(copy)


def test_the_trials_of_another_data_set_annotate_nothing(annotated, tmp_path):
    version, folder = annotated
    other = write_set(tmp_path / "other", version, [episode(), episode(2, peak=3.5), episode() * 0.9])
    assert_refused(folder / "s", f"{tmp_path / 'wrong'}?annotate={other}", "data sets differ")
    assert_refused(SAMPLES, f"{tmp_path / 'wrong'}?annotate={other}", "imported")
    assert not (tmp_path / "wrong").exists()


def test_a_copy_within_the_original_is_refused(annotated):
    folder, original = annotated[1], annotated[1] / "set"
    unchanged = contents(original)
    assert_refused(folder / "s", f"{original / 'copy'}?annotate={original}", "not changed")
    assert contents(original) == unchanged


def test_a_damaged_file_is_copied_and_counted(tmp_path):
    original = write_set(tmp_path / "set", 2)
    damaged = original / "data/chunk-000/episode_000000.parquet"
    damaged.write_bytes(damaged.read_bytes()[:500])
    place = f"lerobot:{original}?gap_m_per_unit=0.001"
    assert graspsense("import", place, "--save", tmp_path / "s").returncode == 5
    done = graspsense("export", tmp_path / "s", "--to", f"lerobot:{tmp_path / 'copy'}?annotate={original}")
    assert done.returncode == 0
    assert "as they were: 1" in done.stdout + done.stderr
    assert (tmp_path / "copy/data/chunk-000/episode_000000.parquet").read_bytes() == damaged.read_bytes()


def test_frames_of_the_same_rate_are_written_once_each(written, tmp_path):
    printed("export", written[1], "--to", f"lerobot:{tmp_path / 'out'}")
    state = np.stack(frames(tmp_path / "out")["observation.state"])
    assert (np.diff(state, axis=0) != 0.0).any(axis=1).all()
