"""The models that come with the simulator: what they say, and that their commands make them again."""

import json
import shlex
from importlib.resources import files
from pathlib import Path

import pytest
from cases import slow
from commands import answered, printed, python

pytest.importorskip("graspsense_c45", reason="the default model is a tree of graspsense-c45")

from graspsense import load_pipeline

MODELS = files("graspsense_sim_gripper").joinpath("models")
KEPT = json.loads(MODELS.joinpath("default.json").read_text(encoding="utf-8"))
BEST = json.loads(MODELS.joinpath("best.json").read_text(encoding="utf-8"))
BENCHMARK = Path(__file__).parents[3] / "benchmarks/certainty.py"


@pytest.fixture(scope="module")
def pipeline():
    return load_pipeline("default")


# Objects that it recognises in most trials; those of open bottles of water are confused with others.
RECOGNISED = ("odwalla:full_closed", "water:full_closed", "odwalla:full_open", "can:full_closed")


@pytest.mark.parametrize("name", [RECOGNISED[0], *map(slow, RECOGNISED[1:])])
def test_object_and_state_are_named_at_once_with_the_reason(pipeline, name):
    said = pipeline.grasp(object=name, seed=4).prediction

    assert (said.label, said.prediction_set[0], said.coverage) == (name, name, 0.9)
    assert said.probabilities[name] == max(said.probabilities.values())
    told = ("p_first ", "p_steady ", "f_steady ", "delta_t ")
    assert any(step.words.startswith(told) for step in said.because)
    assert "20 N, 10 mm/s" in said.model
    (warning,) = said.warnings
    assert "simulated" in warning


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("egg", "unlike everything"),
        slow("block", "is unlike everything trained on"),
        slow("toy", "is unlike everything trained on"),
        slow("none", "no feature is defined: no finger felt 0.625 N while the fingers closed"),
    ],
)
def test_what_it_never_saw_is_unknown(pipeline, name, why):
    said = pipeline.grasp(object=name, seed=0).prediction

    assert said.label == "unknown"
    assert why in said.because[0].words


def test_a_grasp_has_predictions_while_it_goes_on_and_the_answer_of_the_whole_grasp(pipeline):
    events = []
    trial = pipeline.grasp(object="odwalla:full_closed", seed=5, on_event=events.append)
    told = [event for event in events if event.source == "model"]

    assert [early.after_s for early in trial.checkpoints] == [
        checkpoint["after_contact_s"] for checkpoint in KEPT["checkpoints"]
    ]
    assert [event.what for event in told] == [early.words for early in trial.checkpoints]
    assert all("odwalla:full_closed" in early.prediction.prediction_set for early in trial.checkpoints)
    assert trial.prediction.model == trial.checkpoints[0].prediction.model.partition(", 0.")[0]


def test_its_sets_are_calibrated_for_each_label_and_at_the_checkpoints():
    assert KEPT["sets"]["unit"] == "instances"
    assert {threshold_set["units"] for threshold_set in KEPT["sets"]["thresholds"].values()} == {1000}
    for part in KEPT["checkpoints"]:
        assert part["sets"]["unit"] == "instances"
        assert part["trials"] > 100
        assert part["sets"]["thresholds"]


@pytest.mark.parametrize(("name", "kept"), [("default", KEPT), ("best", BEST)])
def test_it_was_made_with_the_settings_of_today(name, kept):
    values = load_pipeline(name).settings.values

    for table in ("gripper", "controller", "features"):
        assert kept["provenance"]["settings"][table] == json.loads(json.dumps(values[table]))


@pytest.mark.slow
def test_an_answer_from_five_training_trials_is_no_certain_one(pipeline):
    said = pipeline.grasp(object="naked:full_open", seed=7).prediction

    assert said.label == "naked:empty_open"  # wrong
    assert said.support == (5.0, 5.0)
    assert said.certainty < 0.6
    assert "naked:full_open" in said.prediction_set


@pytest.mark.slow
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_the_better_pipeline_names_what_the_default_one_confuses():
    said = load_pipeline("best").grasp(object="can:empty_open").prediction

    assert said.label == "can:empty_open"
    assert said.prediction_set == ("can:empty_open",)


@pytest.mark.slow
def test_the_default_pipeline_names_the_better_one():
    for name, says in (("default", True), ("best", False)):
        assert ("--pipeline best" in printed("run", "--pipeline", name)) is says


@pytest.mark.slow
@pytest.mark.parametrize(("force_n", "measured"), [(20, True), (15, False)])
def test_a_figure_is_printed_only_for_the_force_at_which_it_was_measured(force_n, measured):
    option = ("-o", f"controller.probing_force_n={force_n}")
    given = ("--objects", "can:full_open,can:empty_open", "--instances", "1", "--trials", "1")
    asked = (("run",), ("predict", "default", "simulated", *given))
    told = [answered(*arguments, *option) for arguments in asked]

    for said in (told[0]["prediction"], *told[1]["predictions"]):
        assert (said["certainty"] is not None) is measured
        assert (said["coverage"] is not None) is measured
        assert bool(said["prediction_set"]) is measured
        assert bool(said["no_certainty"]) is not measured


@pytest.mark.slow
@pytest.mark.parametrize("name", ["default", "best"])
def test_what_is_printed_holds_on_a_thousand_new_grasps(name):
    """Certainty by support and tenth, and sets by support, size and label: no row is off by more than chance."""
    done = python(BENCHMARK, name, "--seed", "7201")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "of one label" in done.stdout


@pytest.mark.slow
def test_its_command_makes_it_again(tmp_path):
    """All but its prediction sets and what is said at checkpoints: these need ten times as many grasps."""
    again = tmp_path / "default.json"
    words = shlex.split(KEPT["provenance"]["command"])
    words[words.index("--out") + 1] = str(again)
    for option in ("--checkpoints", "--calibration-instances"):
        begin = words.index(option)
        del words[begin : begin + 2]
    printed(*words[1:])
    made = json.loads(again.read_text(encoding="utf-8"))

    for key in ("classifier", "settings", "target", "features"):
        assert made[key] == KEPT[key]
    nodes, kept = made["model"]["nodes"], KEPT["model"]["nodes"]
    for column in ("feature", "category", "n_children", "class_weights"):
        assert nodes[column] == kept[column]
    for threshold, expected in zip(nodes["threshold"], kept["threshold"], strict=True):
        assert threshold == expected or threshold == pytest.approx(expected, rel=0.0, abs=1e-9)
    for label, ends in KEPT["unknown"]["ranges"].items():
        for end, expected in zip(made["unknown"]["ranges"][label], ends, strict=True):
            assert end == pytest.approx(expected, rel=0.0, abs=1e-9)
