"""train, predict and evaluate, as a user types them."""

import json
import re

import numpy as np
import pytest
from cases import every_case
from commands import answered, graspsense, printed, refused


@pytest.fixture
def csv(tmp_path):
    rng = np.random.default_rng(0)
    lines = ["what,thing,p_first [m],f_steady [N]"]
    for i in range(120):
        kind, state = ("can", "jar")[i % 2], ("full", "empty")[(i // 2) % 2]
        width = {"can": 0.066, "jar": 0.055}[kind] + 0.001 * rng.normal()
        force = {"full": 9.0, "empty": 4.0}[state] + rng.normal()
        lines.append(f"{kind}:{state},{kind}{i % 6},{width:.5f},{force:.3f}")
    path = tmp_path / "mine.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.slow
def test_an_honest_rate_and_a_picture_of_ones_own_csv_in_one_command(csv, tmp_path):
    pytest.importorskip("matplotlib", reason="needs matplotlib, the extra `plot`")
    picture = tmp_path / "confusion.png"
    code, out, err = graspsense("evaluate", csv, "--label", "what", "--instance", "thing", "--png", picture)

    assert code == 0
    assert f"drawn in {picture}" in err
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert "\nrate        9" in out
    assert re.match("c45 recognises .* 9", out)
    for line in [
        "instance_held_out",
        "stratified_10_fold",
        "before_contact",
        "width_only",
        "recording_order",
    ]:
        assert f"\n{line}" in out
    assert "confusion (rows" in out
    assert "learning curve" in out
    assert "contact (--before COLUMNS)" in out


@pytest.mark.slow
def test_its_json(csv):
    out = printed(
        "evaluate", csv, "--label", "what", "--json", "--classifier", "knn", "-o", "classifier.neighbours=3"
    )
    answer = json.loads(out)

    assert answer["classifier"].startswith("graspsense/knn ")
    assert answer["settings"] == {"neighbours": 3}
    assert answer["protocol"] == "stratified_10_fold"
    assert answer["headline"]["n"] == 120
    assert answer["confusion"]["labels"] == ["can:empty", "can:full", "jar:empty", "jar:full"]
    assert answer["controls"]["width_only"]["rate"]["rate"] < 0.8 < answer["headline"]["rate"]


@pytest.mark.slow
def test_states_of_one_class(csv):
    _, out, _ = graspsense("evaluate", csv, "--label", "what", "--json", "--target", "state", "--only", "can")

    assert json.loads(out)["confusion"]["labels"] == ["can:empty", "can:full"]


def test_the_name_of_a_model_need_not_be_text(csv, tmp_path):
    model = tmp_path / "\udcff.json"
    printed("train", csv, "--label", "what", "--instance", "thing", "--classifier", "knn", "--out", model)
    assert "\\udcff.json" in json.loads(model.read_text())["provenance"]["command"]


def test_train_then_predict(csv, tmp_path):
    model = tmp_path / "mine.json"
    out = printed("train", csv, "--label", "what", "--instance", "thing", "--out", model)
    assert "labels      can:empty, can:full, jar:empty, jar:full" in out
    assert "\ndrift " in printed("train", csv, "--label", "what", "--out", tmp_path / "by_trials.json")
    assert "\ndrift " not in out  # of six things no certainty is measured
    assert f"how good    graspsense evaluate {csv} --label what --instance thing" in out
    assert json.loads(model.read_text())["provenance"]["command"] == (
        f"graspsense train {csv} --out {model} --label what --instance thing"
    )

    new = tmp_path / "new.csv"
    new.write_text("f_steady,p_first,comment\n9.1,0.0661,a\n4.2,0.0549,b\n9.0,0.0300,c\n,0.066,d\n")
    out = printed("predict", model, new, "--json")
    answer = json.loads(out)
    predicted = [prediction["label"] for prediction in answer["predictions"]]
    assert predicted[:3] == ["can:full", "jar:empty", "unknown"]
    assert answer["unknown"] == 1
    assert answer["rate"] is None
    (assumed,) = (note for note in answer["notes"] if "states no unit" in note)
    assert assumed.endswith((" as p_first in m, f_steady in N", " as f_steady in N, p_first in m"))
    reasons = answer["predictions"][3]["because"]
    assert any("f_steady is missing" in reason["words"] for reason in reasons)

    assert "as wrong" in printed("predict", model, csv, "--label", "what")


def test_a_rate_of_trials_that_were_learned_from_has_no_interval_and_says_so(csv, tmp_path):
    model, others = tmp_path / "mine.json", tmp_path / "others.csv"
    header, *lines = csv.read_text().splitlines()
    # As a spreadsheet saves them: columns in another order, and a value of 66.0 mm without its zero.
    turned = [",".join([line.split(",")[k] for k in (3, 2, 1, 0)]) for line in [header, *lines]]
    others.write_text("\n".join(turned).replace("00,", ",") + "\n")
    graspsense("train", csv, "--label", "what", "--instance", "thing", "--out", model)

    answer = answered("predict", model, others, "--label", "what")
    assert answer["rate"]["rate"] > 0.9
    assert answer["rate"]["interval"] is None
    assert any("120 of 120 trials" in warning for warning in answer["warnings"])


@pytest.mark.slow
def test_a_rate_of_predictions_counts_the_objects_of_the_trials(csv, tmp_path):
    model, others = tmp_path / "mine.json", tmp_path / "others.csv"
    header, *lines = csv.read_text().splitlines()
    others.write_text(
        "\n".join([header, *(f"{line}1" for line in lines)]) + "\n"
    )  # one digit more: other trials
    graspsense("train", csv, "--label", "what", "--instance", "thing", "--out", model)

    arguments = ("predict", model, others, "--label", "what", "--json")
    alone, of_objects = (
        json.loads(printed(*arguments, *more))["rate"] for more in ((), ("--instance", "thing"))
    )
    assert of_objects["instances"] == 6  # in place of 120 independent trials
    assert of_objects["interval"][0] < alone["interval"][0]

    # The same grasps, of things that are named by the day: all of one day.
    today = [line.replace(line.split(",")[1], f"{line.split(':')[0]}#today", 1) for line in lines]
    others.write_text("\n".join([header, *(f"{line}1" for line in today)]) + "\n")
    rate = json.loads(printed(*arguments, "--instance", "thing"))["rate"]
    assert (rate["instances"], rate["interval"]) == (1, None)


@pytest.mark.slow
def test_a_certainty_by_trials_is_said_to_be_that_of_the_same_objects(tmp_path):
    # Every object has a width of its own, which its label does not determine: a new one is recognised by chance.
    rng = np.random.default_rng(2)
    widths = rng.normal(60.0, 5.0, 40)
    rows = [
        (("can", "jar")[k % 2], f"thing {k}", f"{widths[k] + 0.05 * rng.normal():.4f}")
        for k in range(40)
        for _ in range(4)
    ]
    known, new = [rows[k] for k in rng.permutation(80)], rows[80:]
    said = []
    for columns in ((0, 2), (0, 1, 2)):
        for name, some in (("known.csv", known), ("new.csv", new)):
            lines = [("what", "thing", "p_first [mm]"), *some]
            (tmp_path / name).write_text("".join(",".join(row[k] for k in columns) + "\n" for row in lines))
        model = tmp_path / "m.json"
        graspsense("train", tmp_path / "known.csv", "--label", "what", "--out", model, "--overwrite")
        said.append(answered("predict", model, tmp_path / "new.csv", "--label", "what"))
    by_trials, by_objects = said
    assert by_trials["rate"]["rate"] < 0.75
    for predicted, of_same_objects in ((by_trials, True), (by_objects, False)):
        assert any("same objects" in warning for warning in predicted["warnings"]) is of_same_objects
        assert {"objects" in row["holds_for"] for row in predicted["predictions"]} == {of_same_objects}


@pytest.mark.slow
def test_a_model_of_states_or_classes(csv, tmp_path):
    model = tmp_path / "states.json"
    assert "--only: can, jar" in refused("train", csv, "--label", "what", "--out", model, "--target", "state")
    states = ("--target", "state", "--only", "jar")
    printed("train", csv, "--label", "what", "--out", model, *states)
    assert json.loads(model.read_text())["target"] == "state"
    again = ("train", csv, "--label", "what", "--out", model, "--target", "class", "--json")
    assert graspsense(*again, "--overwrite")[0] == 0
    answer = answered("predict", model, csv, "--label", "what")
    assert answer["rate"]["rate"] > 0.9


@pytest.mark.slow
def test_features_are_kept(csv, tmp_path):
    kept = tmp_path / "kept.csv"
    own = ("--label", "what", "--instance", "thing", "--keep", kept)
    columns = ("--label", "label", "--instance", "instance", "--order", "order")
    result, again = (
        json.loads(printed("evaluate", source, *options, "--json", "--classifier", "tree"))
        for source, options in ((csv, own), (kept, columns))
    )

    assert again["confusion"] == result["confusion"]
    assert again["controls"]["recording_order"] == result["controls"]["recording_order"]


@every_case(
    ("arguments", "said"),
    [
        (["evaluate", "nothing"], "manifest:FILE.toml"),
        (["evaluate", "none.csv", "--label", "x"], "none.csv "),
        (["evaluate", "nosuch:x"], "'nosuch'. Known: icub"),
        (["evaluate", "icub:"], "names no folder"),
        (["evaluate", "icub:nowhere"], " nowhere"),
        (["evaluate", "icub:x", "--label", "y"], "--label "),
        (["evaluate", "x.csv", "--instances", "3"], "--instances "),
        (["evaluate", "x.csv", "--states-per-instance", "one"], "--states-per-instance "),
        (
            ["evaluate", "simulated", "--instances", "2", "--states-per-instance", "one"],
            "at least 4 instances",
        ),
        (["evaluate", "x.csv", "--label", "y", "--classifier", "treee"], "'treee'. Known: "),
        (["evaluate", "x.csv", "--label", "y", "-o", "controller.ramp_s=1"], "[classifier]"),
        (["evaluate", "x.csv", "--label", "y", "-o", "classifier.trees=3"], "'trees'"),
        (["evaluate", "simulated", "--instances", "0"], "1 to 1000"),
        (["evaluate", "simulated", "--trials", "0"], "0 trials"),
        (["evaluate", "simulated", "--objects", "canoe"], "'canoe'. Known: "),
        (["evaluate", "simulated", "--objects", "can,can:full_open"], "named twice"),
        (["evaluate", "simulated", "--objects", "can:full_open#3"], "without an instance"),
        (["train", "x.csv", "--label", "y", "--out", "model.pkl"], " .json"),
        (["train", "x.csv", "--label", "y", "--out", "gone/model.json"], " gone"),
        (["evaluate", "x.csv", "--label", "y", "--keep", "."], ". is a folder"),
        (["predict", "nosuch", "x.csv"], "'nosuch'. Known: "),
    ],
)
def test_mistakes(monkeypatch, tmp_path, arguments, said):
    monkeypatch.chdir(tmp_path)
    assert said in refused(*arguments)


def test_other_columns_than_the_model_takes(csv, tmp_path):
    model = tmp_path / "mine.json"
    graspsense("train", csv, "--label", "what", "--features", "p_first,f_steady", "--out", model)
    other = tmp_path / "other.csv"
    other.write_text("p_first [mm],f_steady [N]\n66,9\n")
    assert "takes p_first in m" in refused("predict", model, other)


@pytest.mark.slow
def test_simulated_trials_small_and_whole():
    few = ("--objects", "can", "--instances", "2", "--trials", "2", "--folds", "2")
    answer = answered("evaluate", "simulated", *few)

    assert answer["headline"]["n"] == 12
    assert answer["protocol"] == "instance_held_out"
    assert answer["controls"]["before_contact"]["rate"]["n"] == 12
    assert any("simulated" in note for note in answer["notes"])
    assert any("of its states" in note for note in answer["notes"])


@pytest.mark.slow
def test_simulated_trials_with_each_instance_in_one_state_only(tmp_path):
    few = ("--objects", "can:full_open,can:empty_open", "--instances", "4", "--trials", "1", "--folds", "2")
    more = ("--states-per-instance", "one", "--keep", tmp_path / "t.csv", "--json")
    out = printed("evaluate", "simulated", *few, *more)

    assert any("its states only" in note for note in json.loads(out)["notes"])
    rows = [line.split(",") for line in (tmp_path / "t.csv").read_text().splitlines()[1:]]
    assert len(rows) == len({row[1] for row in rows}) == 4


@pytest.fixture
def opened(monkeypatch):
    """The list of real grippers that were opened: none may be by what is called simulated."""
    from graspsense.core.components.registry import installed

    opened = []
    backend = installed().find("sensor-backend", "pr2").component_class()
    monkeypatch.setattr(backend, "open", lambda self, seed: opened.append(self.config))
    return opened


@pytest.mark.parametrize("command", ["train", "evaluate"])
def test_simulated_trials_never_open_a_real_gripper(tmp_path, opened, command):
    out = ("--out", tmp_path / "m.json") if command == "train" else ()
    assert "graspsense-pr2-gripper/pr2" in refused(
        command, "simulated", "--gripper", "pr2", "--instances", "1", "--trials", "1", *out
    )
    assert opened == []


@pytest.mark.slow
def test_a_feature_set_that_raises_on_simulated_grasps_is_named(monkeypatch):
    from graspsense.plugins.features.chitta import ChittaFeatures

    monkeypatch.setattr(ChittaFeatures, "extract", lambda self, trace: 1 / 0)
    objects = "can:full_open,can:empty_open"
    code, _, err = graspsense(
        *("evaluate", "simulated", "--objects", objects, "--instances", "1", "--trials", "2", "--folds", "2")
    )

    assert code == 70
    assert re.search("graspsense/chitta .*ZeroDivisionError", err)
    assert "internal error" not in err


@pytest.mark.parametrize("option", ["--out", "--keep"])
@pytest.mark.parametrize("disk", ["ro", "full"])
def test_train_finds_out_before_the_grasps_that_it_cannot_write(mounted, tmp_path, option, disk):
    place = mounted("size=64k")
    if disk == "ro":
        mounted("ro", remount=True)
    else:
        with pytest.raises(OSError, match="No space"):
            (place / "filler").write_bytes(b"x" * 1_000_000)
    files = {"--out": tmp_path / "m.json", "--keep": tmp_path / "k.csv"}
    files[option] = place / files[option].name

    err = refused(
        "train", "simulated", "--instances", "1000000", *(word for pair in files.items() for word in pair)
    )
    assert f"{files[option]} cannot be written" in err
    assert "grasping" not in err
    assert not files["--out"].exists()
