"""`graspsense train --choose`, as a user types it, on a store of recordings of another program."""

import numpy as np
import pytest
from commands import answered, printed, refused

pytestmark = pytest.mark.slow
MANIFEST = """\
folder = "grasps"
files = "{class}_{instance:d}_{order:d}.csv"
label = "{class}"
instance = "{class}#{instance}"
time = "t [s]"
gap = "gap [mm]"
left = "left [N]"
right = "right [N]"
"""


def squeeze(relaxes, rng):
    """Return the lines of a squeeze to 10 N that is held for 1 s; the force of foam falls by a third meanwhile."""
    t = np.arange(0.0, 2.0, 0.02)
    x = np.interp(t, [0.3, 0.8, 2.0], [0.0, 4.0, 4.8])  # it creeps, so that no rest ends a replay
    force = 2.5 * np.minimum(x, 4.0) * (
        1.0 - relaxes * np.clip((t - 0.8) / 1.0, 0.0, 1.0)
    ) + 0.02 * rng.normal(size=len(t))
    gap = 40.0 - 10.0 * np.minimum(t, 0.3) - x + rng.normal() * 0.5
    rows = zip(t.tolist(), gap.tolist(), force.tolist(), strict=True)
    return "\n".join(["t,gap,left,right", *(f"{a:.3f},{b:.4f},{c:.4f},{c:.4f}" for a, b, c in rows)])


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """Eight objects of two labels, each squeezed twice; only the course of the hold tells the labels apart."""
    rng, folder = np.random.default_rng(0), tmp_path_factory.mktemp("squeezes")
    (folder / "grasps").mkdir()
    for kind, relaxes in (("foam", 0.33), ("wood", 0.0)):
        for instance in range(4):
            for order in range(2):
                file = folder / "grasps" / f"{kind}_{instance}_{order}.csv"
                file.write_text(squeeze(relaxes, rng) + "\n")
    (folder / "m.toml").write_text(MANIFEST)
    printed("import", folder / "m.toml", "--save", folder / "store")
    return folder / "store"


def choice_of(trials, folder, *given):
    """Train the best candidate on the trials, and return what is said of the choice."""
    return answered("train", trials, "--choose", *given, "--out", folder / "own.json")["choice"]


def runs(store, pipeline):
    recording = ("--gripper", "replay", "-o", f"gripper.recording=store:{store}#1")
    out = printed("run", "--pipeline", pipeline, *recording)
    assert "prediction  foam" in out
    # Other settings than those of the training would be told.
    assert "warning" not in out


@pytest.mark.parametrize(
    ("given", "least"),
    [
        pytest.param(("-o", "features.type=curve"), 6, id="every classifier"),
        pytest.param(("--classifier", "extra-trees", "-o", "classifier.trees=10"), 4, id="every feature set"),
        pytest.param((), 24, marks=pytest.mark.long, id="all"),
    ],
)
def test_among_all_candidates_one_that_knows_the_hold_is_chosen(store, tmp_path, given, least):
    choice = choice_of(store, tmp_path, *given)

    assert choice["rate"]["rate"] >= 0.9
    assert choice["rate"]["instances"] == 8
    candidates = {(named["classifier"], named["features"]) for named in choice["ranking"]["candidates"]}
    assert ("extra-trees", "curve" if given[:1] == ("-o",) else "union") in candidates
    assert len(candidates) >= least
    runs(store, tmp_path / "own.toml")


def test_the_text_names_the_pipeline_and_the_procedure(store, tmp_path):
    fixed = ("--classifier", "extra-trees", "-o", "classifier.trees=10", "-o", "features.type=union")
    out = printed("train", store, "--choose", *fixed, "--out", tmp_path / "own.json")

    assert f"--pipeline {tmp_path / 'own.toml'}" in out
    assert "instance_held_out" in " ".join(out.split())
    runs(store, tmp_path / "own.toml")


def test_components_that_are_given_stay_run_on_a_recording_and_are_not_replaced(store, tmp_path):
    given = ("-o", "features.type=curve", "--classifier", "knn")
    (candidate,) = choice_of(store, tmp_path, *given)["ranking"]["candidates"]

    assert (candidate["classifier"], candidate["features"]) == ("knn", "curve")
    runs(store, tmp_path / "own.toml")
    (tmp_path / "own.json").unlink()
    assert "own.toml" in refused("train", store, "--choose", *given, "--out", tmp_path / "own.json")


def test_a_file_of_another_kind_beside_the_model_is_never_replaced(store, tmp_path):
    (tmp_path / "m.toml").write_text(MANIFEST)
    assert "manifest" in refused("train", store, "--choose", "--overwrite", "--out", tmp_path / "m.json")
    assert (tmp_path / "m.toml").read_text() == MANIFEST


def test_a_table_has_its_features_and_gets_no_pipeline(tmp_path):
    rng = np.random.default_rng(0)
    lines = ["what,thing,f [N]"]
    lines += [f"l{k % 2},l{k % 2}#{k % 12},{k % 2 + 0.1 * rng.normal():.4f}" for k in range(48)]
    (tmp_path / "t.csv").write_text("\n".join(lines) + "\n")
    columns = ("--label", "what", "--instance", "thing")
    choice = choice_of(tmp_path / "t.csv", tmp_path, *columns, "--classifier", "c45")
    assert choice["rate"]["correct"] >= 46
    assert not (tmp_path / "own.toml").exists()


def test_trials_from_which_nothing_can_be_chosen(store, tmp_path):
    out = ("--out", tmp_path / "own.json")
    assert "'foam'" in refused("train", store, "--choose", "--only", "foam", *out)
    # No pad reaches this force.
    given = ("-o", "features.type=curve", "-o", "features.contact_force_n=15", "--classifier", "knn")
    assert "no feature" in refused("train", store, "--choose", *given, *out)
    assert not list(tmp_path.glob("own*"))


@pytest.mark.parametrize("option", [("--checkpoints", "0.1"), ("--target-value", "fill")])
def test_options_that_do_not_go_with_it(store, tmp_path, option):
    assert "--choose" in refused("train", store, "--choose", *option, "--out", tmp_path / "own.json")
    assert not (tmp_path / "own.json").exists()


def test_recordings_without_contact_are_told_apart_by_the_features_that_need_none(store, tmp_path):
    given = ("-o", "features.contact_force_n=15", "--classifier", "extra-trees", "-o", "classifier.trees=10")
    choice = choice_of(store, tmp_path, *given)

    assert {candidate["features"] for candidate in choice["ranking"]["candidates"]} == {"quant"}
    assert choice["rate"]["rate"] >= 0.9
    assert sum(choice["right"]) == choice["rate"]["correct"]
    assert any("curve" in note and "0 of 16" in note for note in choice["ranking"]["notes"])


def test_sets_of_many_features_are_left_to_classifiers_that_take_them_quickly(store, tmp_path):
    ranking = choice_of(store, tmp_path, "--classifier", "knn")["ranking"]

    assert not {"quant", "union of all"} & {candidate["features"] for candidate in ranking["candidates"]}
    assert any("quant" in note and "knn" in note for note in ranking["notes"])
    runs(store, tmp_path / "own.toml")
