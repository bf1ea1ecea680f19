"""`import --check` on files without a manifest, and `--suggest`, which writes one from the files of a folder."""

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from cases import every_case
from commands import graspsense, printed
from recorded_files import write_topics
from repository import ROOT

from graspsense import load_trials
from graspsense.core.values.errors import DataDamaged
from graspsense.sources.columns.channel_facts import channel_facts
from graspsense.sources.manifest.reader import read_recordings

SAMPLES = ROOT / "samples"
N = 300
T_S = np.arange(N) * 0.01
GAP_MM = np.where(T_S < 1.0, 60.0 - 10.0 * T_S, 50.0)
FORCE_N = np.where((T_S > 1.0) & (T_S < 1.5) | (T_S > 2.0) & (T_S < 2.5), 8.0, 0.1 * (T_S % 0.02 > 0.01))

TABLE = {"t (ms)": T_S * 1e3, "pos (mm)": GAP_MM, "F (N)": FORCE_N, "still": np.ones(N)}


def table(path, columns):
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*columns.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n")


def checked(place):
    """Return what a check of this file says as JSON, and draw into a picture beside it."""
    done = graspsense("import", place, "--check", "--json", "--plot", place.with_name("x.png"))
    assert done.returncode == 0, done.stderr
    return done.json


PLAIN = 'files = "{label}_{order:d}.csv"\ntime = "t"\ngap = "pos [mm]"\nforce = "F"\n'


def test_the_facts_of_a_channel_are_those_of_its_samples():
    t_s = np.array([0.0, 0.1, 0.2, 0.7, 0.8])
    facts = channel_facts("x", "N", np.array([1.0, 1.5, 1.5, 1.5, np.nan]), t_s, end_s=2.0)
    assert (facts.samples, facts.missing, facts.low, facts.high) == (5, 1, 1.0, 1.5)
    assert (facts.resolution, facts.rate_hz) == (0.5, pytest.approx(10.0))
    assert (facts.longest_gap_s, facts.age_s) == (pytest.approx(0.5), pytest.approx(1.2))


def test_check_on_a_table_tells_each_channel_and_draws_its_squeezes(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra plot")
    table(tmp_path / "jar.csv", TABLE)
    (load,) = checked(tmp_path / "jar.csv")
    by_name = {channel["name"]: channel for channel in load["channels"]}
    assert by_name["pos (mm)"]["unit"] == "mm"
    assert by_name["F (N)"]["rate_hz"] == pytest.approx(100.0)
    assert by_name["still"]["resolution"] is None
    assert by_name["still"]["age_s"] == pytest.approx(T_S[-1])
    assert len(load["squeezes"]) == 2
    assert load["squeezes"][0] == pytest.approx([1.01, 1.49])
    assert (tmp_path / "x.png").stat().st_size > 5000


@every_case("name", ["jar.asc", "jar.log", "jar"])
def test_a_text_is_read_and_suggested_whatever_its_ending(name, tmp_path):
    table(tmp_path / name, {"t (ms)": T_S * 1e3, "pos (mm)": GAP_MM, "F (\u00b5N)": FORCE_N * 1e6})
    with (tmp_path / name).open("a") as file:  # a second grasp, from whose beginning on the time begins anew
        file.writelines((tmp_path / name).read_text().splitlines(keepends=True)[1:])
    graspsense("import", tmp_path / name, "--suggest", tmp_path / "m.toml")
    recording, _ = read_recordings(str(tmp_path / "m.toml"))
    assert recording.recording.readings[120].frame.force_left_n == pytest.approx(8.0)


def test_a_file_without_a_column_of_numbers_is_refused(tmp_path):
    (tmp_path / "t.csv").write_text("part,remark\nlid,soft\ncap,hard\n")
    done = graspsense("import", tmp_path / "t.csv", "--check")
    assert done.returncode == DataDamaged.exit_code
    assert "'part'" in done.stderr


def test_goals_errors_counts_and_places_of_a_tool_are_neither_gap_nor_force(tmp_path):
    sine = 30.0 * np.sin(T_S)
    columns = {
        "n_contacts": FORCE_N > 1.0,
        "gap_error": sine,
        "x_position": sine,
        "y_position": sine,
        "force_cmd": FORCE_N,
    }
    table(tmp_path / "jar.csv", {"t": T_S, "stamp": T_S, **columns, "position": GAP_MM, "f": FORCE_N})
    graspsense("import", tmp_path / "jar.csv", "--suggest", tmp_path / "m.toml")
    lines = (tmp_path / "m.toml").read_text().splitlines()
    values = {key: value for key, _, value in (line.partition(" = ") for line in lines)}
    assert values["gap"].startswith('"position [mm]"')
    assert values["force"].startswith('"f [')
    assert "stamp" in values["time"].partition("check:")[2]


def test_the_components_of_a_force_are_suggested_as_its_length(tmp_path):
    forces = {
        f"{side}_f{axis}": share * FORCE_N
        for side in ("left", "right")
        for axis, share in (("x", 0.6), ("y", 0.0), ("z", -0.8))
    }
    table(tmp_path / "jar.csv", {"t (s)": T_S, "pos (mm)": GAP_MM, **forces})
    graspsense("import", tmp_path / "jar.csv", "--suggest", tmp_path / "m.toml")
    (recording,) = read_recordings(str(tmp_path / "m.toml"))
    assert recording.recording.readings[120].frame.force_left_n == pytest.approx(8.0)


@pytest.mark.slow
def test_check_on_a_bag_shows_a_topic_that_died(tmp_path):
    pytest.importorskip("rosbags", reason="needs the extra ros")
    from rosbags.rosbag1 import Writer

    alive = np.flatnonzero(T_S < 1.2)[::2]
    topics = {"/hand/gap": (T_S, GAP_MM), "/hand/force": (T_S[alive], FORCE_N[alive])}
    write_topics(Writer(tmp_path / "jar.bag"), topics, ros1=True)
    by_name = {channel["name"]: channel for channel in checked(tmp_path / "jar.bag")[0]["channels"]}
    assert by_name["/hand/gap.data"]["rate_hz"] == pytest.approx(100.0)
    assert by_name["/hand/force.data"]["rate_hz"] == pytest.approx(50.0)
    assert by_name["/hand/force.data"]["age_s"] > 1.5


def rests_of(folder, *points, step_mm=0.0):
    """Return what a check tells of the rests of a squeeze whose gap (mm) goes through these points (s, mm)."""
    t_s = np.arange(800) * 0.01
    gap_mm = np.interp(t_s, *zip(*points, strict=True))
    gap_mm = np.round(gap_mm / step_mm) * step_mm if step_mm else gap_mm
    table(folder / "jar_1.csv", {"t": t_s, "pos": gap_mm, "F": np.maximum(2.0 * (50.0 - gap_mm), 0.0)})
    (folder / "m.toml").write_text(PLAIN)
    told = checked(folder / "m.toml")
    assert told["outcomes"] == {"steady": 1}
    return told["rests"]


@pytest.mark.slow
def test_a_rest_after_which_the_squeeze_goes_on_is_told(tmp_path):
    """The fingers stick for 0.6 s, at a sixth of the force that the squeeze comes to."""
    stuck = rests_of(tmp_path / "stuck", (0, 80), (1, 50), (1.4, 49.2), (2, 49.2), (4, 45), (8, 45))
    assert stuck.startswith("1 of 1 grasp:")
    assert "controller.rest_window_s" in stuck
    place = f"manifest:{tmp_path / 'stuck' / 'm.toml'}"
    assert any("features.rest_window_s" in note for note in load_trials(place).notes)
    assert "controller.rest_window_s" in graspsense("replay", f"{place}#1").stderr
    assert rests_of(tmp_path / "resting", (0, 80), (1, 50), (4, 45), (8, 45)) == ""


@pytest.mark.slow
def test_fingers_that_slow_down_within_a_step_of_their_encoder_leave_delta_t_open(tmp_path):
    """They stop at once, or come to rest within a second at the last tenth of a millimetre."""
    slows = ((0, 80), (1, 50), (1.5, 49), (2, 48.7), (3, 48.55), (8, 48.55))
    assert "delta_t" in rests_of(tmp_path / "slows", *slows, step_mm=0.1)
    assert rests_of(tmp_path / "fine", *slows, step_mm=0.01) == ""
    assert rests_of(tmp_path / "stops", (0, 80), (1, 50), (1.5, 47), (8, 47), step_mm=0.1) == ""


@pytest.mark.parametrize(
    ("numbers", "keys"),
    [
        pytest.param(FORCE_N, {"left", "right"}, id="zero until the fingers touch"),
        pytest.param(60.0 - GAP_MM, set(), id="moving before that, as positions do"),
    ],
)
def test_columns_named_after_both_fingers_are_forces_if_their_numbers_look_like_one(tmp_path, numbers, keys):
    for name in ("jar_1", "jar_2"):
        columns = {"t (ms)": T_S * 1e3, "gap (mm)": GAP_MM, "left finger": numbers, "right finger": numbers}
        table(tmp_path / f"{name}.csv", columns)
    printed("import", tmp_path, "--suggest", tmp_path / "m.toml")
    suggested = tomllib.loads((tmp_path / "m.toml").read_text())
    assert {"force", "left", "right"} & suggested.keys() == keys


CELLS = {
    "a grid for each side": ("L{0}{1}", "R{0}{1}", ["L??"], ["R*"]),
    "a grid in the words of another": ("left_r{0}c{1}", "right_r{0}c{1}", ["left_r*c*"], ["right_r*c*"]),
    "numbers behind a finger": ("finger0_t{0}{1}", "finger1_t{0}{1}", ["finger0_t*"], ["finger1_t*"]),
    "numbers in front": ("{0}{1}_left", "{0}{1}_right", ["*_left"], ["*_right"]),
    "one sensor": ("x{0}y{1}", "", ["x*y*"], []),
    "names that begin as others do": ("t{0}{1}", "", ["t??"], []),
    "signs of patterns": ("p[{0}][{1}]", "", ["'p[0][0]', 'p[0][1]'"], []),
}


@pytest.mark.slow
@every_case("names", CELLS)
def test_the_cells_of_sensors_are_forces_whatever_their_names(names: str, tmp_path: Path) -> None:
    """Not those that move before the fingers touch, such as the joints of an arm."""
    left, right, *patterns = CELLS[names]
    gap = np.clip(60.0 - 20.0 * T_S, 50.0, None)
    force = np.interp(T_S, [0.5, 1.0, 2.5, 2.6], [0.0, 8.0, 8.0, 0.0])
    cells = np.random.default_rng(0).uniform(0.2, 1.0, 16)
    for name in ("jar_1", "jar_2"):
        columns = {"time": T_S, "Lift": T_S % 0.5, "gap (mm)": gap}
        for k, weight in enumerate(cells.tolist()):
            columns |= {side.format(k // 4, k % 4): weight * force for side in (left, right) if side}
            columns |= {f"q{k}": weight * T_S}
        table(tmp_path / f"{name}.csv", columns)
    printed("import", tmp_path, "--suggest", tmp_path / "m.toml")
    suggested = tomllib.loads((tmp_path / "m.toml").read_text())
    keys = ("left", "right") if right else ("force",)
    assert [pattern in suggested[key] for key, (pattern, *_) in zip(keys, patterns, strict=False)] == [
        True
    ] * len(keys)
    for grasp in read_recordings(str(tmp_path / "m.toml")):
        (felt,) = grasp.recording.columns("force_left_n")
        assert np.corrcoef(felt, force)[0, 1] > 0.99


@every_case(
    ("head", "recorded", "label"),
    [
        ("# date: 2026-05-03 14:22:01\n# object: jar\n", "{date}", "jar"),
        ("# Date: 3.5.2026\n# Time: 14:22:01\n", "{date} {time}", "object"),
        ('"Started"\t"2026-05-03T14:22:01"\n\n', "{started}", "object"),
        ("# rate: 100 Hz\n# operator = Ada\n", None, "object"),
    ],
)
def test_what_lines_before_a_table_say_can_be_used_and_is_suggested(
    head: str, recorded: str | None, label: str, tmp_path: Path
) -> None:
    for k in (1, 2):
        place = tmp_path / f"r_{k}.csv"
        table(place, TABLE)
        place.write_text(head + (place.read_text().replace(",", "\t") if "\t" in head else place.read_text()))
    printed("import", tmp_path, "--suggest", tmp_path / "m.toml")
    assert tomllib.loads((tmp_path / "m.toml").read_text()).get("recorded") == recorded
    for grasp in read_recordings(str(tmp_path / "m.toml")):
        assert (grasp.label, grasp.recorded_at[:19]) == (label, "2026-05-03T14:22:01" if recorded else "")


def test_what_the_file_states_is_not_questioned(tmp_path):
    for name in ("jar_1", "jar_2", "can_1"):
        table(
            tmp_path / f"{name}.csv",
            {"t (ms)": T_S * 1e3, "gap (mm)": GAP_MM, "left (N)": FORCE_N, "right (N)": FORCE_N},
        )
    (tmp_path / "README.txt").write_text("a text")
    place = tmp_path / "described.toml"
    printed("import", tmp_path, "--suggest", place)
    lines = [line for line in place.read_text().splitlines() if not line.startswith("#")]
    assert [line for line in lines if "check" in line] == [lines[0]]  # the names of files state nothing
    assert lines[1:] == [
        "time = \"'t (ms)' [ms]\"",
        "gap = \"'gap (mm)' [mm]\"",
        "left = \"'left (N)' [N]\"",
        "right = \"'right (N)' [N]\"",
    ]


def test_a_manifest_is_not_written_over_another_one(tmp_path):
    table(tmp_path / "jar_1.csv", {"t": T_S, "pos": GAP_MM, "F": FORCE_N})
    (tmp_path / "m.toml").write_text("mine")
    assert graspsense("import", tmp_path, "--suggest", tmp_path / "m.toml")[0] == 2
    assert (tmp_path / "m.toml").read_text() == "mine"
    assert graspsense("import", tmp_path / "jar", "--suggest", tmp_path / "n.toml")[0] == 2
    (tmp_path / "empty").mkdir()
    assert graspsense("import", tmp_path / "empty", "--suggest", tmp_path / "n.toml")[0] == 2
    assert not (tmp_path / "n.toml").exists()


@pytest.mark.slow
def test_check_draws_a_grasp_whose_object_is_not_known(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra plot")
    shutil.copytree(SAMPLES / "trials", tmp_path / "trials")
    printed("export", f"{tmp_path / 'trials'}#1", "--to", tmp_path / "x.npz")
    printed("import", f"npz:{tmp_path / 'x.npz'}", "--check", "--plot", tmp_path / "x.png")
    assert (tmp_path / "x.png").stat().st_size > 5000
