"""What evaluate measures, on trials of which the truth is known."""

import json
import re
import warnings

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from repository import ROOT

from graspsense.core.components.registry import installed
from graspsense.core.learn.labelled import ControlFeatures, Labelled
from graspsense.core.settings.selected import SelectedComponent
from graspsense.core.values.errors import ComponentFailed, ConfigError
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.crossval import thinned
from graspsense.evaluation.evaluate import evaluate
from graspsense.evaluation.json_codec import from_json, to_json
from graspsense.evaluation.results import Evaluation, confusion
from graspsense.report.verdict import verdict


def learner(name="tree"):
    component = installed().find("classifier", name)
    return SelectedComponent(component, component.config_class()())


def table(*columns, names=None):
    values = np.column_stack(columns)
    names = names or tuple(f"x{k}" for k in range(values.shape[1]))
    return FeatureTable(names=names, units=("",) * len(names), values=values)


def labelled(labels, *columns, **more):
    return Labelled(source="a test", table=table(*columns), labels=tuple(labels), **more)


def judged(trials, name="tree", **more):
    """Evaluate with four folds instead of ten, one permutation of the labels instead of 19, and no learning curve.

    Each permutation and each point of the curve is a cross-validation of its own.
    """
    few = {"classifier": name, "folds": 4, "permutations": 1, "learning_curve": False}
    return evaluate(learner(name), trials, **{**few, **more})


STATES = ["can:full", "can:empty", "jar:full", "jar:empty"]


def four_states(n=30, seed=0):
    """Width tells can from jar, force tells full from empty."""
    rng = np.random.default_rng(seed)
    labels = [STATES[i % 4] for i in range(4 * n)]
    width = np.array([60.0 if label.startswith("can") else 50.0 for label in labels]) + rng.normal(size=4 * n)
    force = np.array([9.0 if label.endswith("full") else 3.0 for label in labels]) + rng.normal(size=4 * n)
    return labels, width, force


def test_what_can_be_told_apart_is_and_noise_is_not():
    labels, width, force = four_states()
    rng = np.random.default_rng(1)

    good = judged(labelled(labels, width, force))
    noise = judged(labelled(labels, rng.normal(size=120), rng.normal(size=120)))

    assert good.headline.rate > 0.95
    assert noise.headline.interval[0] < 0.25 < noise.headline.interval[1]
    assert good.controls["majority_class"].rate.rate == 0.25
    assert good.headline.n == good.confusion.n == 120
    assert good.headline.correct == good.confusion.correct


@pytest.mark.slow
def test_class_and_state_given_the_class():
    labels, width, force = four_states()
    by_width = labelled(labels, width)

    assert judged(by_width, target="class").headline.rate > 0.95
    state = judged(by_width, target="state", folds=10)
    assert state.headline.interval[0] < 0.5 < state.headline.interval[1]
    assert judged(labelled(labels, force), target="state").headline.rate > 0.95
    # Only states of one's own class can be answered.
    for i, label in enumerate(state.confusion.labels):
        for j, other in enumerate(state.confusion.labels):
            assert label[:3] == other[:3] or state.confusion.counts[i][j] == 0
    assert state.controls["majority_class"].rate.rate == 0.5
    assert set(state.by_class) == {"can", "jar"}


def test_a_class_of_one_state_is_left_out_of_the_states():
    labels, width, force = four_states()
    labels = ["egg:whole" if label == "jar:full" else label for label in labels]
    labels = ["egg:whole" if label == "jar:empty" else label for label in labels]
    evaluation = judged(labelled(labels, width, force), target="state")

    assert evaluation.headline.n == 60
    assert any("egg" in note for note in evaluation.notes)
    with pytest.raises(ConfigError, match="has no state"):
        judged(labelled(["a", "b"] * 20, width[:40]), target="state")


def test_a_rate_that_is_the_instance_is_found_out():
    """Each of 20 things has a width of its own, which says nothing of its label; noise is small beside it."""
    rng = np.random.default_rng(0)
    things = np.repeat(np.arange(20), 6)
    labels = [("full", "empty")[thing % 2] for thing in things]
    width = rng.normal(size=20)[things] + 1e-3 * rng.normal(size=120)
    evaluation = judged(labelled(labels, width, instances=tuple(f"thing{k}" for k in things)), "knn")

    assert evaluation.protocol == "instance_held_out"
    assert evaluation.protocols["stratified_4_fold"].rate.rate > 0.95
    assert evaluation.headline.rate < 0.75
    held = evaluation.controls["instance_held_out"]
    assert held.rate == evaluation.headline
    assert held.difference.interval[0] > 0.1
    assert any("the same objects" in warning for warning in evaluation.warnings)


def test_no_leak_is_found_in_noise():
    """Whole instances held out are recognised less often than single trials, by the folds alone."""
    things = np.repeat(np.arange(12), 5)
    for seed in (7, 9):
        noise = np.random.default_rng(seed).normal(size=(2, 60))
        trials = labelled(
            [("can", "jar", "tin")[thing % 3] for thing in things],
            *noise,
            instances=tuple(f"thing{thing}" for thing in things),
        )
        evaluation = judged(trials, "knn", folds=12, permutations=0)

        assert not any("stratified rate" in warning for warning in evaluation.warnings)


def test_a_rate_that_is_the_moment_of_the_recording_is_found_out():
    """A value that drifts, each label recorded now and then: neighbours in time are alike."""
    rng = np.random.default_rng(0)
    order = np.arange(120)
    labels = [("full", "empty")[(i // 12) % 2] for i in order]
    drift = 0.1 * order + 1e-3 * rng.normal(size=120)
    evaluation = judged(labelled(labels, drift, order=tuple(order.tolist())), "knn", folds=10)

    assert evaluation.headline.rate > 0.85
    assert evaluation.controls["recording_order"].rate.rate < 0.7
    assert evaluation.controls["recording_order"].difference.interval[0] > 0.2
    assert any("time of recording" in warning for warning in evaluation.warnings)


def test_drift_can_tell_labels_that_were_recorded_one_after_the_other_and_it_is_said():
    """A zero that drifts by its noise in 6 trials tells 30 cans from the 30 jars after them, in every block of both."""
    rng = np.random.default_rng(0)
    drift = np.arange(60) / 6.0 + rng.normal(size=60)
    labels, turns = ["can"] * 30 + ["jar"] * 30, ["can", "jar"] * 30
    in_blocks, in_turn = (
        judged(labelled(given, drift, order=tuple(range(60))), controls=True) for given in (labels, turns)
    )
    assert in_blocks.headline.rate > 0.8
    assert not in_blocks.warnings
    assert any("one stretch" in note for note in in_blocks.notes)
    assert in_turn.headline.rate < 0.7
    assert not any("one stretch" in note for note in in_turn.notes)


def test_instances_that_are_no_other_objects_are_noted():
    noise = np.random.default_rng(0).normal(size=24)
    labels = ["can", "jar"] * 12
    spelled = [f"{'Bb'[k // 2 % 2]}ottle {'ab'[k % 2]}{k // 8}" for k in range(24)]
    proper = [f"bottle {'ab'[k % 2]}{k // 8}" for k in range(24)]
    numbers = [f"t{k}" for k in range(24)]
    said = {"spelling": spelled, "instance of its own": numbers}
    for text, instances in said.items():
        assert any(text in note for note in judged(labelled(labels, noise, instances=tuple(instances))).notes)
        assert not any(
            text in note for note in judged(labelled(labels, noise, instances=tuple(proper))).notes
        )


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("before_contact", "from before contact"),
        pytest.param("first_line", "from the first line of the recording", marks=pytest.mark.slow),
    ],
)
@every_case("leak", [True, False])
def test_what_is_known_before_the_contact_is_a_warning_only_where_it_tells(name, says, leak):
    labels, width, force = four_states()
    posture = width if leak else np.random.default_rng(2).normal(size=120)
    control = ControlFeatures(table=table(posture, names=("posture",)), what="posture before the grasp")
    evaluation = judged(labelled(labels, width, force, **{name: control}), folds=10)

    assert any(says in warning for warning in evaluation.warnings) is leak
    assert evaluation.controls[name].what == "posture before the grasp"
    assert (evaluation.controls[name].rate.rate > 0.4) is leak
    assert ("The first line" in verdict(evaluation)) is (leak and name == "first_line")


def control_of(values, missing=""):
    known = table(values, names=("gap_at_start",))
    reasons = {k: {"gap_at_start": missing} for k in np.flatnonzero(np.isnan(values)).tolist() if missing}
    return ControlFeatures(table=evolve(known, reasons=reasons), what="the gap at the start")


@every_case(
    ("having", "missing", "reason"),
    [
        (0, "a pad felt a force", "0 of 60 trials have such features: a pad felt a force"),
        (1, "", "1 of 60 trials have such features; these are too few to learn from"),
    ],
)
def test_a_control_that_few_trials_have_is_not_measured_instead_of_passing(having, missing, reason):
    """Trials that begin in contact: their control from before contact would be chance, which proves nothing."""
    labels, width, force = four_states(15)
    control = control_of(np.where(np.arange(60) < having, 0.08, np.nan), missing=missing)
    evaluation = judged(labelled(labels, width, force, before_contact=control))

    measured = evaluation.controls["before_contact"]
    assert (measured.rate, measured.reason) == (None, reason)
    assert f"was not measured: {reason}" in verdict(evaluation)


def test_a_control_is_measured_on_the_trials_that_have_its_features():
    """Half of the trials begin in contact. In the others the gap at the start is the label."""
    labels, width, force = four_states()
    leaking = np.where(np.arange(120) < 60, np.nan, np.array([STATES.index(label) for label in labels]))
    control = control_of(leaking, missing="a pad felt a force")
    evaluation = judged(labelled(labels, width, force, before_contact=control)).controls["before_contact"]

    assert (evaluation.rate.correct, evaluation.rate.n) == (60, 60)
    assert re.search("60 of 120 .*: a pad felt a force", evaluation.what)
    # The headline of the same sixty trials, of which it misses some.
    assert -0.5 < evaluation.difference.value < 0.0


@pytest.mark.parametrize("squeeze_adds", [True, False])
def test_a_width_that_is_as_good_as_all_features_is_a_warning(squeeze_adds):
    rng = np.random.default_rng(4)
    labels = ["can", "jar"] * 60
    width = np.array([60.0, 55.0] * 60) + 3.0 * rng.normal(size=120)
    force = np.array([9.0, 3.0 if squeeze_adds else 9.0] * 60) + rng.normal(size=120)
    control = ControlFeatures(table=table(width, names=("p_first",)), what="p_first alone")
    evaluation = judged(labelled(labels, width, force, width=control))
    assert any("width alone" in warning for warning in evaluation.warnings) is not squeeze_adds


def test_what_cannot_be_measured_is_null_with_a_reason():
    evaluation = to_json(judged(labelled(*four_states(), no_instances="one thing a class")))

    assert evaluation["protocol"] == "stratified_4_fold"
    assert "first_line" not in evaluation["controls"]
    assert evaluation["controls"]["instance_held_out"]["rate"] is None
    assert evaluation["controls"]["instance_held_out"]["reason"] == "one thing a class"
    for name in ("before_contact", "width_only", "recording_order"):
        assert evaluation["controls"][name]["rate"] is None
        assert evaluation["controls"][name]["reason"]


def test_one_instance_of_a_label_cannot_be_held_out():
    labels, width, force = four_states()
    things = tuple("only can" if label.startswith("can") else f"jar{i % 5}" for i, label in enumerate(labels))
    held = judged(labelled(labels, width, force, instances=things)).controls["instance_held_out"]

    assert held.rate is None
    assert held.reason.endswith(": can:empty, can:full")


def test_too_few_instances_for_an_interval_are_a_note_with_their_number():
    notes = judged(labelled(*four_states(), instances=("can#1",) * 120)).notes
    assert any(note.startswith("1 instance:") for note in notes), notes


def names_in(value):
    """Return every key of JSON values, at any depth."""
    if isinstance(value, list):
        return set().union(*map(names_in, value))
    return set(value).union(*map(names_in, value.values())) if isinstance(value, dict) else set()


def test_the_json_is_whole_and_stable():
    trials = labelled(*four_states(), order=tuple(range(120)))
    text, again = (
        json.dumps(to_json(judged(trials, seed=2, learning_curve=True)), allow_nan=False) for _ in range(2)
    )
    evaluation = json.loads(text)

    assert text == again
    assert evaluation.keys() >= {"protocol", "headline", "confusion", "controls", "learning_curve"}
    assert evaluation["headline"].keys() == {"correct", "n", "rate", "interval", "no_interval", "instances"}
    controls = "before_contact width_only instance_held_out recording_order majority_class"
    assert list(evaluation["controls"])[:5] == controls.split()
    counts, headline = evaluation["confusion"]["counts"], evaluation["headline"]
    assert sum(map(sum, counts)) == headline["n"] == 120
    assert sum(counts[k][k] for k in range(4)) == headline["correct"] == round(headline["rate"] * 120)
    page = (ROOT / "docs" / "evaluation.md").read_text()
    sample = re.search(r"^## JSON\n.*?```text\n(.*?)```", page, re.DOTALL | re.MULTILINE)[1]
    assert set(re.findall(r'"(\w+)":', sample)) <= names_in(evaluation) | {"stratified_10_fold"}
    # A row is the truth: every label was there thirty times.
    assert [sum(row) for row in counts] == [30] * 4


def test_the_learning_curve_ends_at_the_headline_and_grows():
    evaluation = judged(labelled(*four_states(n=20)), learning_curve=True)
    curve = evaluation.learning_curve

    assert curve[-1].rate == evaluation.headline
    assert [round(point.trained_on) for point in curve] == [8, 12, 24, 40, 60]
    # Of few trials a tenth and a fifth come to the same ones: that is one point.
    few = judged(labelled(*four_states(n=4)), folds=4, learning_curve=True).learning_curve
    assert [point.trained_on for point in few] == sorted({point.trained_on for point in few})
    assert len(few) < len(curve)


@pytest.mark.parametrize("n", [3, 2])
def test_few_trials_are_said_or_refused(n):
    labels, width, force = four_states()
    trials = labelled(labels, width, force)
    few = trials.rows(np.array([i for i in range(120) if i < 4 * n or labels[i] != "can:full"]))

    assert any("(4): can:full" in note for note in judged(few).notes)
    with pytest.raises(ConfigError, match="10 folds"):
        judged(trials.rows(np.arange(8)), folds=10)


def test_a_label_of_one_trial_can_never_be_right_and_one_label_is_nothing():
    labels, width, force = four_states()
    alone = judged(labelled(["egg", *labels[1:]], width, force))

    assert any(note.endswith(": egg") for note in alone.notes)
    assert alone.by_class["egg"].correct == 0
    with pytest.raises(ConfigError, match=r"'can'(.|\n)*10 of 130"):
        judged(labelled(["can"] * 120, width, notes=("10 of 130 files are left out",)))


class Choosy:
    """A learner whose classifier refuses fewer than some number of trials, as the contract of `fit` allows."""

    def __init__(self, least):
        self.least = least

    def create(self):
        classifier = learner().create()
        learn = classifier.fit

        def fit(table, labels, seed):
            if len(labels) < self.least:
                raise ValueError(f"{self.least} trials are needed")
            learn(table, labels, seed)

        classifier.fit = fit
        return classifier


def test_a_fit_that_refuses_few_trials_costs_its_figure_only():
    trials = labelled(*four_states())

    evaluation = evaluate(Choosy(60), trials, classifier="choosy", folds=4, permutations=1)

    assert evaluation.headline.rate > 0.95
    assert [point.trained_on >= 60 for point in evaluation.learning_curve] == [True, True]
    assert any("at 10 %" in note and "60 trials" in note for note in evaluation.notes)
    with pytest.raises(ConfigError, match=r"90 .* 4 .*1000 trials"):
        evaluate(Choosy(1000), trials, classifier="choosy", folds=4)


class Vague:
    """A learner whose classifier gives no probabilities."""

    def create(self):
        classifier = learner().create()
        classifier.probabilities = lambda table: np.full((len(table), 4), np.nan)
        return classifier


def test_a_classifier_without_probabilities_is_named_and_not_scored():
    with pytest.raises(ComponentFailed, match=r"tree.Cart "):
        evaluate(Vague(), labelled(*four_states()), classifier="vague", folds=4)


def test_unlike_trials_are_counted():
    labels, width, force = four_states()
    odd = evolve(labelled(labels, width, force))
    odd.table.values[7] = 1e4

    assert judged(odd).unknown.correct >= 1
    assert judged(labelled(labels, width, np.zeros(120))).unknown.correct <= 3


def test_a_smaller_share_lies_within_a_larger_one_and_keeps_every_label():
    labels = ["a"] * 50 + ["b"] * 3
    rows = np.arange(53)
    small, large = (set(thinned(rows, labels, share, 0).tolist()) for share in (0.1, 0.4))

    assert small <= large
    assert {labels[i] for i in small} == {"a", "b"}
    assert (len(small), len(large)) == (6, 21)


def test_a_confusion_has_every_label_of_either_side():
    matrix = confusion(["a", "b", "b"], ["a", "c", "b"])

    assert matrix.labels == ("a", "b", "c")
    assert matrix.counts == ((1, 0, 0), (0, 1, 1), (0, 0, 0))
    assert (matrix.correct, matrix.n) == (2, 3)


def test_an_evaluation_is_read_back_from_its_json():
    rng = np.random.default_rng(4)
    labels = [f"can:{'full' if k % 2 else 'empty'}" for k in range(40)]
    made = judged(labelled(labels, rng.normal(size=40), rng.normal(size=40)), learning_curve=True)
    assert from_json(json.loads(json.dumps(to_json(made))), Evaluation) == made


class Unconverged(SelectedComponent):
    """A classifier whose every fit warns, as one of scikit-learn does that reaches its limit of iterations."""

    def create(self):
        classifier = super().create()
        fit = classifier.fit

        def warning_fit(*arguments):
            from sklearn.exceptions import ConvergenceWarning

            text = "lbfgs failed to converge after 500 iteration(s) (status=1):\nIncrease the number of iterations."
            warnings.warn(text, ConvergenceWarning, stacklevel=2)
            fit(*arguments)

        classifier.fit = warning_fit
        return classifier


def test_warnings_of_scikit_learn_are_one_line_each_with_a_count(recwarn):
    learner_of_test = learner("knn")
    warning = Unconverged(learner_of_test.component, learner_of_test.config)
    few = {"classifier": "knn", "folds": 4, "permutations": 1, "learning_curve": False}
    evaluation = evaluate(warning, labelled(*four_states(10)), **few)
    # Four folds of the headline and four of the shuffled labels.
    (note,) = [text for text in evaluation.notes if "iterations ended" in text]
    assert "8 times" in note
    assert "lbfgs" not in note
    assert not [text for text in recwarn if "onverge" in str(text.message)]


@pytest.mark.slow
def test_shuffled_labels_are_recognised_as_often_as_by_guessing():
    """In folds of the real labels, a label that a fold has often is rare in its training trials: 42 % of noise."""
    noise = np.random.default_rng(2).normal(size=(2, 24))
    evaluation = judged(labelled(["can", "jar"] * 12, *noise), "knn", permutations=40)
    assert evaluation.controls["shuffled_labels"].rate.rate > 0.45
