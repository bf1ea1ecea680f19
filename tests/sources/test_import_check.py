"""`import --check` on files without a manifest, and `--suggest`, which writes one from the files of a folder."""

import shutil
import tomllib

import numpy as np
import pytest
import scipy
from commands import graspsense
from recorded_files import write_topics
from repository import ROOT

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


def rests_of(folder, *points):
    """Return what a check tells of the rests of a squeeze whose gap (mm) goes through these points (s, mm)."""
    t_s = np.arange(800) * 0.01
    gap_mm = np.interp(t_s, *zip(*points, strict=True))
    table(folder / "jar_1.csv", {"t": t_s, "pos": gap_mm, "F": np.maximum(2.0 * (50.0 - gap_mm), 0.0)})
    (folder / "m.toml").write_text(PLAIN)
    told = checked(folder / "m.toml")
    assert told["outcomes"] == {"steady": 1}
    return told["rests"]


@pytest.mark.slow
def test_a_rest_after_which_the_squeeze_goes_on_is_told(tmp_path):
    """The fingers stick for 0.6 s, at a sixth of the force that the squeeze comes to."""
    stuck = rests_of(tmp_path / "stuck", (0, 80), (1, 50), (1.4, 49.2), (2, 49.2), (4, 45), (8, 45))
    assert stuck.startswith("1 of 1 grasp tried")
    assert "controller.rest_window_s" in stuck
    assert rests_of(tmp_path / "resting", (0, 80), (1, 50), (4, 45), (8, 45)) == ""


# Sets in the shape of the public ones, without their manifests: what is suggested, and which lines are right.


def squeeze():
    gap = np.where(T_S < 1.0, 0.06 - 0.01 * T_S, 0.05 - 0.002 * np.minimum(T_S - 1.0, 1.0))
    return gap, np.maximum(0.0, 0.05 - gap) * 5000.0


def fruit(folder):
    gap, force = squeeze()
    for k, kind in enumerate(("kiwi", "banana", "mango")):
        for part in ("training", "test"):
            for day in (20, 21, 23):
                stamp = f"202411{day}_15131{k}"
                place = folder / f"{kind}/{part}Set/{stamp}"
                table(
                    place / f"ForceData_{stamp}.csv",
                    {"Time": T_S + 1.7e9, "Force": force, "Pos": 60.0 - gap * 1e3},
                )
                np.save(place / "break_force.npy", np.float64(2.6))


def jaco(folder):
    gap, force = squeeze()
    lines = ["A,Number of samples,3"]
    for order, label in enumerate((17, 3, 3)):
        began = 1592233887442126035 + order * 60_000_000_000
        lines.append(f"seq,{order},stamp start,{began},stamp end,{began + 490_000_000},label,{label}")
        lines.append("timestep,eucl force 1,eucl force 2,eucl force 3,finger1_pos,finger2_pos,finger3_pos")
        lines += [
            f"{k + 1},{f},{f / 2},{f},{p - 3},{p},{p + 3}"
            for k, (f, p) in enumerate(zip(force, 100.0 - gap * 1e3, strict=True))
        ]
    folder.mkdir()
    (folder / "000_real_life_data.csv").write_text("\n".join(lines) + "\n")


def pr2_biotac(folder):
    gap, force = squeeze()
    (folder / "data").mkdir(parents=True)
    for material, number in (("black_foam", 110), ("sponge", 4), ("glass_jar", 9)):
        for order in (1, 2, 3):
            variables = {
                "JPos": gap[None], "JEff": -force[None], "F0pdc": np.round(1000 + 10 * force)[None],
                "F1pdc": np.round(1000 + 9 * force)[None], "F0Electrodes": np.arange(19 * N).reshape(19, N),
            }  # fmt: skip
            scipy.io.savemat(folder / f"data/{material}_{number}_{order}_HOLD.mat", variables)


def biotac_sp(folder):
    names = [f"{finger}_biotac_{k}" for finger in ("ff", "mf", "th") for k in range(1, 25)]
    cells = np.random.default_rng(0).integers(1000, 3000, (len(names), 9)).tolist()
    for palm in ("down", "side", "45"):
        about = {"object": ["toy car", "mug", "jar"] * 3, "slipped": [0, 1, 1, 0, 0, 1, 0, 1, 1]}
        table(folder / f"bts3v2_palm_{palm}.csv", about | dict(zip(names, cells, strict=True)))


def barrett_taps(folder):
    gap, force = squeeze()
    folder.mkdir()
    for material in ("felt", "wood"):
        taxels = np.tile(np.outer(10.0 * force, np.full(24, 1 / 24)), (3, 1))
        np.savez(
            folder / f"{material}.npz",
            tap=np.repeat([1, 2, 3], N),
            spread=np.tile(gap, 3) * 1e3,
            taxels=taxels,
        )


def glove(folder):
    for label in ("bottle", "pen"):
        (folder / label).mkdir(parents=True)
        for k in range(3):
            rows = [
                [4680 + 10 * i, 4.79 + 0.01 * i, *np.random.default_rng(i).integers(0, 999, 9)]
                for i in range(N)
            ]
            (folder / label / f"{k}.txt").write_text(
                "\n".join(", ".join(map(str, row)) for row in rows) + "\n"
            )


def slides(folder):
    for material in (1, 2, 10):
        for k in range(1, 4):
            columns = {"timestamp": T_S + 1.6e9, "pdc": np.arange(N) % 90, "ele1": np.arange(N) % 7}
            table(folder / f"mat{material}" / f"mat{material}_{k}_bio.csv", columns)


def presses(folder):
    folder.mkdir()
    names = [f"Vertical_{i}_{j}_d{d}" for i in (1, 2) for j in (1, 2, 3) for d in (100, 120)]
    scipy.io.savemat(folder / "all.mat", {name: np.ones((N, 8, 3)) for name in names})


RIGHT = {
    glove: {"files": "{label}/{order:d}.txt", "time": "c1 [ms]"},
    slides: {
        "files": "mat{object:d}/mat*_{order:d}_bio.csv",
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
        "channels": {"f0electrodes": "F0Electrodes [counts]"},
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
    "make", [pytest.param(make, marks=() if make in (jaco, fruit) else pytest.mark.slow) for make in RIGHT]
)
def test_at_least_half_of_a_suggested_manifest_is_right_and_nothing_is_wrong_in_silence(make, tmp_path):
    folder = tmp_path / "set"
    make(folder)
    place = folder / "m.toml"
    code, out, err = graspsense("import", folder, "--suggest", place)
    assert code == 0, err
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
    code, _, err = graspsense("import", tmp_path, "--suggest", tmp_path / "m.toml")
    assert code == 0, err
    suggested = tomllib.loads((tmp_path / "m.toml").read_text())
    assert {"force", "left", "right"} & suggested.keys() == keys


def test_what_the_file_states_is_not_questioned(tmp_path):
    for name in ("jar_1", "jar_2", "can_1"):
        table(
            tmp_path / f"{name}.csv",
            {"t (ms)": T_S * 1e3, "gap (mm)": GAP_MM, "left (N)": FORCE_N, "right (N)": FORCE_N},
        )
    (tmp_path / "README.txt").write_text("a text")
    place = tmp_path / "described.toml"
    code, _, err = graspsense("import", tmp_path, "--suggest", place)
    assert code == 0, err
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
    assert graspsense("import", tmp_path / "jar_1.csv", "--suggest", tmp_path / "n.toml")[0] == 2
    (tmp_path / "empty").mkdir()
    assert graspsense("import", tmp_path / "empty", "--suggest", tmp_path / "n.toml")[0] == 2
    assert not (tmp_path / "n.toml").exists()


@pytest.mark.slow
def test_check_draws_a_grasp_whose_object_is_not_known(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra plot")
    shutil.copytree(SAMPLES / "trials", tmp_path / "trials")
    code, _, err = graspsense("export", f"{tmp_path / 'trials'}#1", "--to", tmp_path / "x.npz")
    assert code == 0, err
    code, _, err = graspsense("import", f"npz:{tmp_path / 'x.npz'}", "--check", "--plot", tmp_path / "x.png")
    assert code == 0, err
    assert (tmp_path / "x.png").stat().st_size > 5000
