"""What features need is compared with what each recording has, by every command that reads recordings."""

import re

import numpy as np
import pytest
from commands import graspsense, printed, refused

from graspsense.core.values.errors import WiringError
from graspsense.plugin_api import create
from graspsense.store.store import Store

OTHERS = ("evaluate", "compare")
CHOSEN = ("features.array=palm", "features.rows=2", "features.columns=3", "features.unit=N")


def manifest(folder, name, palm=True):
    """A manifest of six squeezes of two things, with a palm of 2 x 3 cells or without one."""
    (folder / name).mkdir()
    for k in range(6):
        t = np.arange(80) / 40.0
        gap = 60.0 - 30.0 * np.clip(t, 0.0, 1.0)
        force = (3.0 + 0.1 * k) * np.clip(t - 0.7, 0.0, 0.5) + 0.01 * np.sin(9.0 * t + k)
        cells = force[:, None] * np.roll([1.0, 2.0, 1.0, 0.0, 0.0, 0.0], 3 * (k % 2))
        np.savetxt(
            folder / name / f"{'ab'[k % 2]}_{k}.csv",
            np.column_stack([t, gap, force, cells]),
            delimiter=",",
            header="t,gap,force," + ",".join(f"c{i}" for i in range(6)),
            comments="",
        )
    lines = ['files = "{label}_*.csv"', 'time = "t"', 'gap = "gap [mm]"', 'force = "force"']
    lines += ["channels = { palm = \"'c?' [N]\" }"] if palm else []
    (folder / name / "set.toml").write_text("\n".join(lines) + "\n")
    return str(folder / name / "set.toml")


def options(*given):
    return [word for option in given for word in ("-o", option)]


def proposed(words):
    """The options in a message."""
    return re.search(r"palm: ((-o \S+\s*)+)", words)[1].split()


@pytest.mark.parametrize(
    "command", ["import", *(pytest.param(name, marks=pytest.mark.slow) for name in OTHERS)]
)
def test_an_array_that_the_features_do_not_name_is_told_with_the_options_that_choose_it(tmp_path, command):
    source = manifest(tmp_path, "set")
    arguments = {
        "import": ["import", source, "--save", tmp_path / "s"],
        "evaluate": ["evaluate", f"manifest:{source}", "--folds", 3],
        "compare": ["compare", f"manifest:{source}", "--folds", 3, "--classifiers", "c45,tree"],
    }[command]
    which = [] if command == "compare" else options("features.type=contact-image")
    sets = ["--feature-sets", "contact-image"] if command == "compare" else []
    failed = graspsense(*arguments, *which, *sets)

    assert failed.returncode
    assert "'pads'" in failed.stderr
    assert "palm" in failed.stderr
    printed(*arguments, *which, *sets, *proposed(failed.stderr))


@pytest.mark.slow
def test_recordings_that_have_the_array_are_imported_and_the_others_told(tmp_path):
    whole, without = manifest(tmp_path, "whole"), manifest(tmp_path, "without", palm=False)
    given = options("features.type=contact-image", *CHOSEN)
    done = graspsense("import", whole, without, "--save", tmp_path / "s", *given)

    assert done.returncode == 5, done
    with Store.read(tmp_path / "s") as store:
        assert len(store.page(limit=100)) == 6
    assert (done.stdout + done.stderr).count("'palm'") == 6


@pytest.mark.slow
def test_trials_of_a_store_that_lack_the_array_are_left_out_and_told(tmp_path):
    for name, palm in (("without", False), ("whole", True)):
        printed("import", manifest(tmp_path, name, palm=palm), "--save", tmp_path / "s")
    given = options("features.type=contact-image", *CHOSEN)
    for command, *more in (
        ("features", "--json"),
        ("evaluate", "--folds", 3, "--json"),
        ("train", "--out", tmp_path / "m.json"),
    ):
        done = graspsense(command, tmp_path / "s", *more, *given)

        assert done.returncode == 0, done
        if command != "train":
            assert "6 of 12 recordings" in done.stdout + done.stderr
            assert "palm" in done.stdout + done.stderr


def test_a_replay_says_which_channels_the_recording_has(tmp_path):
    source = manifest(tmp_path, "set")
    backend = create("sensor-backend", "replay", recording=f"manifest:{source}#1")

    names = [channel.name for channel in backend.channels]
    assert names == ["gap", "velocity", "force_left", "force_right", "palm"]
    replayed = graspsense("replay", f"manifest:{source}#1", *options("features.type=chitta-without-pads"))
    assert replayed.returncode == WiringError.exit_code
    assert "'effort'" in replayed.stderr


def test_other_features_than_those_of_the_model_are_imported_without_a_prediction(tmp_path):
    source = manifest(tmp_path, "set")
    done = graspsense("import", source, "--save", tmp_path / "s", *options("features.type=curve"))

    assert done.returncode == 0, done
    assert "no predictions" in done.stdout + done.stderr
    with_own = options("features.type=curve", "classifier.type=c45")
    assert "classifier" in refused("import", source, "--save", tmp_path / "t", *with_own)
