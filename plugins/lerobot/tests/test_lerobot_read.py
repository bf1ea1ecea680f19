"""LeRobot data sets of both versions become labelled trials, and what is wrong with them is told."""

import json
import shutil
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from cases import every_case
from click.testing import CliRunner
from commands import printed
from lerobot_sets import CELLS, FPS, NAMES, episode, write_set

from graspsense.cli.main import cli
from graspsense.core.values.errors import ConfigError, DataDamaged, GraspsenseError, TooLarge
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.store.store import Store
from graspsense.store.stored_grasps import stored_grasps
from graspsense_lerobot.names import meaning_of
from graspsense_lerobot.reader import recordings


def read(place):
    records = list(recordings(str(place)))
    assert {type(record) for record in records} == {LabelledRecording}
    return records


def column(recording, name):
    return np.array([getattr(reading.frame, name) for reading in recording.recording.readings])


@every_case("version", [2, 3])
def test_each_squeeze_of_an_episode_is_a_trial_with_its_task_as_label(tmp_path, version):
    squeezes = read(write_set(tmp_path / "set", version))
    cup, sponge = "pick_the_red_cup", "squeeze-_sponge"
    told = [(squeeze.label, int(squeeze.order)) for squeeze in squeezes]
    assert told == [(cup, 0), (sponge, 1), (sponge, 1), (cup, 2)]
    gap = column(squeezes[0], "gap_m")
    assert (gap.max(), gap.min()) == pytest.approx((100.0, 44.0), abs=0.02)
    # Four cells of 1, 2, 2 and 1 parts of the peak press along z; shear is not part of the force.
    peaks_n = [float(column(squeeze, "force_left_n").max()) for squeeze in squeezes]
    assert peaks_n == pytest.approx([24.0, 18.0, 19.5, 30.0], rel=1e-5)
    arrays = [channel for channel in squeezes[0].recording.channels if hasattr(channel, "components")]
    told = [(array.name, array.cells, array.components) for array in arrays]
    assert told == [("f0", 4, 3), ("f1", 4, 3)]
    cells = np.array([reading.signals.f0.cells for reading in squeezes[0].recording.readings])
    assert cells[:, 1, 2].max() == pytest.approx(8.0, rel=1e-5)
    assert cells[:, 1, 0].max() == pytest.approx(0.8, rel=1e-5)


def test_the_moments_of_closing_and_contact_are_told(tmp_path):
    squeeze = read(write_set(tmp_path / "set", 3, [episode()]))[0]
    line = next(line for line in squeeze.recording.notes if "contact" in line)
    numbers = [float(word) for word in line.replace(",", " ").split() if word.replace(".", "").isdigit()]
    # The gripper closes in a third of the episode of 3 s, and touches at 60 % of that.
    assert numbers[0] <= 0.1
    assert numbers[1] == pytest.approx(0.7, abs=0.1)


def test_the_import_keeps_trials_in_a_store(tmp_path):
    folder = write_set(tmp_path / "set", 3)
    printed("import", f"lerobot:{folder}?gap_m_per_unit=0.001", "--save", tmp_path / "s")
    with Store.read(tmp_path / "s") as store:
        trials = store.page(limit=10)
        assert len(trials) == 4
        assert {trial.label for trial in trials} == {"pick_the_red_cup", "squeeze-_sponge"}


@pytest.mark.slow
def test_check_says_what_was_understood(tmp_path):
    folder = write_set(tmp_path / "set", 2)
    told = printed("import", f"lerobot:{folder}", "--check", "--plot", tmp_path / "p.png")
    for word in ("gripper.pos", "gap_m_per_unit", "f0 [counts]", "episode_000000.mp4", "contact at"):
        assert word in told


def test_what_differs_in_its_numbers_alone_is_told_once(tmp_path):
    states = [np.repeat(episode(frames=frames), 2, axis=0) for frames in (40, 50, 60)]
    told = printed("import", f"lerobot:{write_set(tmp_path / 'set', 3, states)}", "--save", tmp_path / "s")
    (line,) = [line for line in told.splitlines() if "repeated=drop" in line]
    assert "3 of 3 grasps" in line


def changed(rows, column, value):
    """Return an episode with another value in these rows of a column; a function makes it of the old one."""
    state = episode()
    state[rows, column] = value(state[rows, column]) if callable(value) else value
    return state


ALL, GAP, SECOND_FINGER = slice(None), 1, slice(15, None)


@every_case(
    ("written", "query", "notice", "mended"),
    [
        ({}, "gap_m_per_unit=0.0008&gap_zero=10", "gap_m_per_unit", 90),
        ({"fps": 60}, "fps=60", "fps", 90),
        ({"states": [np.repeat(episode(), 2, axis=0)]}, "repeated=drop", "repeated=drop", 90),
        ({"states": [changed(ALL, GAP, lambda gap: 100.0 - gap)]}, "", "gap_m_per_unit=-", None),
        ({"states": [changed(ALL, GAP, 40.0)]}, "", "gap=NAME", None),
        ({"states": [changed(10, GAP, np.nan)]}, "", "without a number", 89),
        ({"states": [changed(10, GAP, np.inf)]}, "", "without a number", 89),
        ({"states": [changed(ALL, SECOND_FINGER, np.nan)]}, "", "without a number", None),
        ({"names": [*NAMES[:3], "touch of thumb", *NAMES[4:]]}, "", "touch of thumb", None),
    ],
)
def test_what_is_doubtful_is_told_and_mended_by_the_option_that_is_named(
    tmp_path, written, query, notice, mended
):
    folder = write_set(tmp_path / "set", 3, **written)
    assert any(notice in told for told in read(folder)[0].notices)
    squeeze = read(f"{folder}?{query}" if query else folder)[0]
    assert not query or not any(notice in told for told in squeeze.notices)
    assert mended in (None, len(squeeze.recording.readings))


@pytest.mark.slow
def test_a_force_that_begins_half_a_second_after_the_fingers_came_to_rest_is_told(tmp_path):
    late = changed(ALL, slice(3, None), lambda cells: np.roll(cells, 15, axis=0))
    told = printed("import", f"lerobot:{write_set(tmp_path / 'set', 3, [late])}", "--check")
    assert "force come late" in " ".join(told.split())


def test_the_options_of_gap_and_time_are_used(tmp_path):
    folder = write_set(tmp_path / "set", 3)
    plain, mended = read(folder)[0], read(f"{folder}?gap_m_per_unit=0.0008&gap_zero=10&fps=60")[0]
    assert column(mended, "gap_m") == pytest.approx(0.0008 * (column(plain, "gap_m") - 10.0))
    assert np.diff(column(mended, "t_s")) == pytest.approx(1 / 60)
    (line,) = [line for line in read(folder)[3].recording.notes if "video" in line]
    assert "videos/observation.images.wrist/chunk-000/file-000.mp4" in line
    assert f"from {270 / FPS:.3f} s" in line
    assert "missing" in line


@every_case(
    ("written", "units", "force_n"),
    [
        ({}, {"gap": "%"}, 24.0),
        ({"states": [changed(ALL, GAP, lambda gap: 0.015 * gap)]}, {"gap": "rad"}, 24.0),
        ({"states": [changed(ALL, GAP, lambda gap: 0.01 * gap)]}, {"gap": "share"}, 24.0),
        ({"names": [NAMES[0], "gripper_width_mm", *NAMES[2:]]}, {}, 24.0),
        # A finger that is not connected leaves the force to the other.
        ({"states": [changed(ALL, SECOND_FINGER, np.nan)]}, {"gap": "%"}, 24.0),
        # Where nothing feels, the load of the motor is the force.
        ({"states": [episode()[:, :3]], "names": NAMES[:3]}, {"gap": "%", "force_left": "%"}, 50.0),
    ],
)
def test_units_and_the_force_are_those_of_the_numbers_and_their_names(tmp_path, written, units, force_n):
    squeeze = read(write_set(tmp_path / "set", 3, **written))[0]
    told = squeeze.recording.units
    named = {key: told.get(key) for key in ("gap", "force_left")}
    assert {key: unit for key, unit in named.items() if unit not in (None, "counts")} == units
    assert column(squeeze, "force_right_n").max() == pytest.approx(force_n, rel=1e-5)
    assert "gap" in told or column(squeeze, "gap_m").max() == pytest.approx(0.1, rel=1e-3)


def test_missing_frames_are_told_and_divide_the_episode(tmp_path):
    folder = write_set(tmp_path / "set", 3, [episode(2)], total_frames=172)
    table = pq.read_table(folder / DATA)
    kept = [k for k in range(len(table)) if not 88 <= k < 96]
    pq.write_table(table.take(kept), folder / DATA)
    _episodes(length=[len(kept)])(folder)
    assert any("gaps=cut" in notice for notice in read(folder)[0].notices)
    assert [len(squeeze.recording.readings) for squeeze in read(f"{folder}?gaps=cut")] == [88, 84]


def test_a_load_in_newtons_is_the_effort_too(tmp_path):
    folder = write_set(tmp_path / "set", 3, [episode()[:, :3]], NAMES[:3])
    squeeze = read(f"{folder}?gap_m_per_unit=0.001&force_n_per_unit=0.2")[0]
    assert column(squeeze, "effort_n").max() == pytest.approx(10.0)
    options = ("-o", "features.type=chitta-without-pads", "-o", "features.contact_effort_n=1")
    place = f"lerobot:{folder}?gap_m_per_unit=0.001&force_n_per_unit=0.2"
    printed("import", place, "--save", tmp_path / "s", *options)
    assert stored_grasps(str(tmp_path / "s"))[0].features["p_first"] > 0.0


STYLES = ("{side}_taxel_{cell}_f{axis}", "Finger{finger}.P{cell}.F{upper}", "f{finger}.p{cell:02d}.{axis}")
STYLES += ("f{finger}.f{axis}.p{cell:02d}", "thumb{finger}.cell_{cell}.force_{axis}")
STYLES += ("tactile.finger{finger}.{cell}.{axis}", "finger_{finger}.row_{row}.col_{column}.{axis}")


@every_case("style", STYLES)
def test_cells_are_known_in_other_styles_of_names(style):
    names = [
        style.format(
            finger=finger, side=side, cell=cell, row=cell // 2, column=cell % 2, axis=axis, upper=axis.upper()
        )
        for finger, side in enumerate(("left", "right"))
        for cell in range(4)
        for axis in "xyz"
    ]
    arrays = meaning_of(["gripper.pos", *names]).arrays
    assert [(array.rows * array.columns, array.axes) for array in arrays] == [(4, "xyz"), (4, "xyz")]
    assert arrays[1].normal == tuple(names[14::3])


def test_numbered_joints_are_no_cells_and_cells_that_are_not_all_there_no_array():
    taxels = [f"thumb.r{row}c{column}" for row in range(3) for column in range(5)]
    meaning = meaning_of([*taxels, "gripper_width"])
    (array,) = meaning.arrays
    assert (array.name, array.rows, array.columns, array.axes) == ("thumb", 3, 5, "z")
    assert meaning.gap == ("gripper_width",)
    names = [f"left_joint_{k}" for k in range(7)] + [f"finger_{k}" for k in range(5)]
    assert meaning_of(names).arrays == ()
    assert [array.name for array in meaning_of(CELLS[:-1]).arrays] == ["f0"]


@every_case("names", [{"motors": NAMES[:9], "cells": NAMES[9:]}, [NAMES], {"axes": [NAMES]}])
def test_names_in_lists_of_lists_are_those_of_the_numbers(tmp_path, names):
    folder = write_set(tmp_path / "set", 3)
    features = json.loads((folder / META).read_text())["features"]
    features["observation.state"]["names"] = names
    damage_info(folder, features=features)
    assert [channel.name for channel in read(folder)[0].recording.channels] == ["gripper_load", "f0", "f1"]


def test_of_two_arms_the_load_is_that_of_the_chosen_gripper(tmp_path):
    whole = episode()[:, :3]
    still = np.column_stack([whole[:, 0], np.full(len(whole), 100.0), np.zeros(len(whole))])
    names = [f"{arm}_{name}" for arm in ("left", "right") for name in NAMES[:3]]
    folder = write_set(tmp_path / "set", 3, [np.hstack([still, whole])], names)
    (refused,) = recordings(str(folder))
    assert isinstance(refused, UnreadableRecording)
    assert "right_gripper.pos" in str(refused.error)
    squeeze = read(f"{folder}?gap=right_gripper.pos")[0]
    assert column(squeeze, "force_left_n").max() == pytest.approx(50.0)
    assert [channel.name for channel in squeeze.recording.channels] == ["right_gripper_load"]


@every_case("damage", [Path.unlink, lambda path: path.write_bytes(path.read_bytes()[:500])])
def test_an_episode_whose_file_cannot_be_read_leaves_the_others(tmp_path, damage):
    folder = write_set(tmp_path / "set", 2)
    damage(folder / "data/chunk-000/episode_000000.parquet")
    kinds = [type(recording) for recording in recordings(str(folder))]
    assert kinds == [UnreadableRecording, LabelledRecording, LabelledRecording, LabelledRecording]


@every_case("times", [[5, 4], [np.nan, np.nan]])
def test_times_that_do_not_increase_name_the_option_that_mends_them(tmp_path, times):
    folder = write_set(tmp_path / "set", 3, [episode()])
    stamps = pq.read_table(folder / DATA)["timestamp"].to_numpy().copy()
    stamps[4:6] = times
    set_frames(folder, "timestamp", stamps)
    (refused,) = recordings(str(folder))
    assert "fps=30" in str(refused.error)
    assert len(read(f"{folder}?fps=30")[0].recording.readings) == 90


def damage_info(folder, **changed):
    path = folder / "meta/info.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changed}))


def _remove(name):
    return lambda folder: (folder / name).unlink()


def _cut(name):
    return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:200])


def _other_schema(folder):
    pq.write_table(pa.table({"a": [1, 2]}), folder / DATA)


def _clone(folder):
    (folder / DATA).write_text("version https://git-lfs.github.com/spec/v1\nsize 9\n")


def _tasks(folder):
    pq.write_table(pa.table({"task_index": [5], "__index_level_0__": ["x"]}), folder / "meta/tasks.parquet")


def set_frames(folder, name, values):
    frames = pq.read_table(folder / DATA)
    place = frames.schema.get_field_index(name)
    pq.write_table(frames.set_column(place, name, pa.array(values)), folder / DATA)


def _ragged(folder):
    states = pq.read_table(folder / DATA)["observation.state"].to_pylist()
    set_frames(folder, "observation.state", [state[: 1 + k % 2] for k, state in enumerate(states)])


def _episodes(**changed):
    def damage(folder):
        path = folder / "meta/episodes/chunk-000/file-000.parquet"
        pq.write_table(pa.table({**pq.read_table(path).to_pydict(), **changed}), path)

    return damage


def _info(**changed):
    return lambda folder: damage_info(folder, **changed)


DATA, META = "data/chunk-000/file-000.parquet", "meta/info.json"


@every_case(
    ("damage", "kind", "word"),
    [
        (shutil.rmtree, ConfigError, "no folder"),
        (_clone, DataDamaged, "git lfs pull"),
        (_tasks, DataDamaged, "task_index 0"),
        (_remove(META), ConfigError, "info.json"),
        (_remove("meta/tasks.parquet"), DataDamaged, "tasks.parquet"),
        (_remove("meta/episodes/chunk-000/file-000.parquet"), DataDamaged, "meta/episodes"),
        (_remove(DATA), DataDamaged, "file-000.parquet is missing"),
        (_cut(META), DataDamaged, "JSON"),
        (_cut(DATA), DataDamaged, "file-000.parquet"),
        (_other_schema, DataDamaged, "timestamp"),
        (_ragged, DataDamaged, "observation.state"),
        (_episodes(length=[89, 181, 90]), DataDamaged, "90 frames"),
        (_episodes(**{"data/file_index": [-1, 0, 0]}), DataDamaged, "file_index"),
        (_episodes(episode_index=[0, 1, 9]), DataDamaged, "1 to 9"),
        (_info(total_episodes=4), DataDamaged, "4 episodes"),
        (_info(total_frames=7), DataDamaged, "7 frames"),
        (_info(codebase_version="v1.6"), DataDamaged, "v1.6"),
        (_info(fps=0), DataDamaged, "fps"),
        (_info(fps="30"), DataDamaged, "fps"),
        (_info(features={}), DataDamaged, "features"),
        (_info(features={"observation.state": {"dtype": "float32"}}), DataDamaged, "shape"),
        (_info(data_path="../../{chunk_index}/x.parquet"), DataDamaged, "data_path"),
        (_info(data_path="/etc/passwd"), DataDamaged, "data_path"),
        (_info(data_path="data/{chunk_index.__class__}"), DataDamaged, "data_path"),
        (_info(data_path="data/{chunk_index:0999999999d}"), DataDamaged, "data_path"),
        (_info(data_path="data/{name}.parquet"), DataDamaged, "name"),
    ],
)  # fmt: skip
def test_a_damaged_data_set_is_an_error_that_says_what_is_wrong(tmp_path, damage, kind, word):
    folder = write_set(tmp_path / "set", 3)
    damage(folder)
    with pytest.raises(kind) as caught:
        _refusal(folder)
    assert word in str(caught.value)


def _refusal(folder):
    """Raise the error of a data set, or of its first episode that cannot be read."""
    records = recordings(str(folder))
    raise next(record.error for record in records if isinstance(record, UnreadableRecording))


@pytest.mark.slow
def test_more_numbers_than_the_memory_should_hold_are_not_read(tmp_path):
    folder = write_set(tmp_path / "set", 3)
    n = 20_000_000
    values = pa.DictionaryArray.from_arrays(pa.array(np.zeros(n, np.int8)), pa.array([1.0]))
    table = pa.table(dict.fromkeys(("timestamp", "frame_index", "episode_index", "index"), values))
    pq.write_table(table, folder / DATA)
    with pytest.raises(TooLarge):
        _refusal(folder)


@every_case(
    ("query", "names"),
    [
        *((query, NAMES) for query in ("fps=0", "fps=x", "speed=3", "repeated=often", "gap=none")),
        ("gap_m_per_unit=nan", NAMES),
        # What moves is not what is felt.
        ("force=gripper.pos", NAMES),
        # Nothing feels, and no option says what does.
        ("", NAMES[:2]),
    ],
)
def test_a_wrong_option_is_wrong_use(tmp_path, query, names):
    folder = write_set(tmp_path / "set", 3, [episode()[:, : len(names)]], names)
    with pytest.raises(GraspsenseError) as caught:
        list(recordings(f"{folder}?{query}"))
    assert caught.value.exit_code == 2


@every_case("value", [np.nan, np.inf, -np.inf, 1e30])
@every_case("name", NAMES[1:4])
def test_a_column_of_impossible_numbers_is_told_without_a_warning_of_numpy(tmp_path, value, name):
    state = episode()
    state[:, NAMES.index(name)] = value
    folder = write_set(tmp_path / "set", 3, [state, episode()])
    try:
        records = list(recordings(f"{folder}?gap_m_per_unit=0.001&force_n_per_unit=1"))
    except GraspsenseError:
        return
    assert isinstance(records[-1], LabelledRecording)
    assert all(isinstance(recording, LabelledRecording | UnreadableRecording) for recording in records)


@every_case("seed", range(12))
def test_damaged_bytes_are_an_error_of_ours(tmp_path, seed):
    folder = write_set(tmp_path / "set", 3, [episode()])
    random = np.random.default_rng(seed)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    path = files[seed % len(files)]
    data = bytearray(path.read_bytes())
    for place in random.integers(0, len(data), 5):
        data[place] = random.integers(256)
    path.write_bytes(bytes(data))
    done = CliRunner().invoke(cli, ["import", f"lerobot:{folder}", "--save", str(tmp_path / "s")])
    assert done.exception is None or isinstance(done.exception, GraspsenseError | SystemExit)
