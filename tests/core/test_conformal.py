"""Prediction sets and reliability: coverage on trials of which the truth is known."""

from __future__ import annotations

import json

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import answered, printed
from test_evaluate import judged, labelled, learner

from graspsense.core.components.registry import installed
from graspsense.core.learn.answers import Answers
from graspsense.core.learn.certainty import Certainty, SupportClass, certainty_of
from graspsense.core.learn.conformal import sets_of, units_lacking, units_needed
from graspsense.core.learn.model_file import as_json, load_model, write_model
from graspsense.core.learn.training import train
from graspsense.core.values.errors import ComponentFailed
from graspsense.core.values.features import UNKNOWN
from graspsense.evaluation.doubt import calibrated
from graspsense.evaluation.json_codec import from_json, to_json
from graspsense.evaluation.results import Evaluation
from graspsense.report.evaluation_sections import doubt_section

NAMES = ("forest", "knn", "mlp", "svm", "tree", "c45")
SLOW = frozenset(("forest", "mlp"))


def bottles(instances=14, each=3, spread=0.9):
    """Full and empty bottles whose instances differ, with instances of each kind."""
    rng, names, force = np.random.default_rng(0), [], []
    for mean, kind in ((0.0, "full"), (2.0, "empty")):
        for i in range(instances):
            names += [f"{kind}#{i}"] * each
            force += (rng.normal(mean, spread) + rng.normal(0.0, 0.3, each)).tolist()
    labels = [name.partition("#")[0] for name in names]
    return labelled(labels, force, rng.normal(size=len(labels)), instances=tuple(names))


def model_of(trials, name):
    component = installed().find("classifier", name)
    model = train(component, component.config_class()(), trials, name="m")
    return calibrated(model, learner(name), trials, 0)


def answers_with(scores, columns, classes, support=None):
    """Answers with these scores as their probabilities, of models that learned from trials like these."""
    return Answers(
        classes=tuple(classes),
        probabilities=np.asarray(scores, float),
        scores=np.asarray(scores, float),
        columns=np.asarray(columns),
        support=np.full(len(columns), np.nan) if support is None else np.asarray(support, float),
        outside=np.zeros(len(columns)),
    )


def sure_of(rate, classes=1):
    """A certainty that is the same for all answers, with so many classes of support: 0, 1, and so on."""
    return Certainty(
        classes=tuple(
            SupportClass(least=float(k), probabilities=(0.0,), rates=(rate,), units=100.0)
            for k in range(classes)
        )
    )


def calibrated_by(truth, labels, instances=None, right=None, support_class=None):
    """The sets of held-out trials with these scores of their true labels; those that are not right are `other`."""
    n = len(truth)
    classes = (*sorted(set(labels)), "other")
    columns = np.array([classes.index(label) for label in labels])
    scores = np.zeros((n, len(classes)))
    scores[np.arange(n), columns] = truth
    predicted = np.where(np.zeros(n, bool) if right is None else right, columns, len(classes) - 1)
    answers = answers_with(scores, predicted, classes, support_class)
    certainty = sure_of(0.0, 1 if support_class is None else 2)
    return sets_of(answers, labels, instances, certainty, unit="trials" if instances is None else "instances")


def set_of(sets, scores, label, certainty=1.0, support_class=0):
    """The set of a trial with these scores, of which `label` is the prediction."""
    classes = tuple(scores)
    answers = answers_with([list(scores.values())], [classes.index(label)], classes, [support_class])
    (inside,) = sets.members(answers, sure_of(certainty, len(sets.of_support)))
    return {name for name, member in zip(classes, inside, strict=True) if member}


def threshold(sets):
    return sets.thresholds["a"].score


def certainty_from(probability, right, labels=None, effect=1.0, units=None):
    """The certainty of held-out answers with these probabilities, each of a trial by itself."""
    return certainty_of(asked(probability, labels), right, units or list(map(str, range(len(right)))), effect)


def asked(probability, labels=None):
    """Answers with these probabilities, without a support."""
    labels = labels or ["can"] * len(probability)
    classes = sorted(set(labels))
    columns = [classes.index(label) for label in labels]
    scores = np.tile(np.asarray(probability, float)[:, np.newaxis], len(classes))
    return answers_with(scores, columns, classes)


def kept(model, folder):
    """The model as it comes back from a file in this folder."""
    write_model(folder / "m.json", model)
    return load_model(str(folder / "m.json"), installed())


def test_the_threshold_is_reached_by_90_percent_of_the_trials_that_are_not_recognised():
    truth = np.arange(1, 20) / 20.0

    # With the trial that is not known yet, 18 of 20.
    assert threshold(calibrated_by(truth, ["a"] * 19)) == truth[1]
    # The smallest number with a finite quantile.
    assert [units_needed(coverage) for coverage in (0.8, 0.9, 0.95, 0.99)] == [4, 9, 19, 99]


def test_eight_instances_are_too_few_and_nine_are_enough():
    few, enough = (calibrated_by(np.ones(72), ["a"] * 72, [str(i % n) for i in range(72)]) for n in (8, 9))

    assert few.thresholds == {}
    assert "8 calibration instances" in few.in_words
    assert enough.thresholds["a"].units == 9


@pytest.mark.parametrize(
    ("instances", "each"),
    [(9, 1), *(pytest.param(*shape, marks=pytest.mark.slow) for shape in ((15, 1), (16, 3)))],
)
def test_the_thresholds_of_few_instances_cover_what_is_asked_and_little_more(instances, each):
    # Scores of any distribution that is the same for all instances: here those of one instance resemble each other.
    rng = np.random.default_rng(instances)
    named = [f"#{i}" for i in range(instances) for _ in range(each)]
    covered = 0.0
    draws = 1000
    for _ in range(draws):
        own = 0.8 * rng.normal(size=(instances + 1, 1)) if each > 1 else 0.0
        scores = 1.0 / (1.0 + np.exp(-own - 0.6 * rng.normal(size=(instances + 1, each))))
        truth = scores[:-1].ravel()
        sets = calibrated_by(truth, ["a"] * len(truth), named)
        covered += float((scores[-1] >= threshold(sets)).mean())

    # Three standard errors below; above, the next whole instance: 15 of 16 for 14.4.
    assert 0.9 - 0.03 < covered / draws < 0.9 + 1.0 / (instances + 1) + 0.01


def test_a_label_that_is_recognised_more_often_than_asked_needs_no_other_member():
    truth = np.arange(1, 21) / 40.0

    often = calibrated_by(truth, ["a"] * 20, right=[True] * 19 + [False])
    seldom = calibrated_by(truth, ["a"] * 20, right=[False] * 10 + [True] * 10)
    assert set_of(often, {"b": 0.6, "a": 0.4}, "a") == {"a", "b"}  # `b` has no calibration
    assert threshold(often) > 1.0
    assert threshold(seldom) == truth[1]
    assert set_of(seldom, {"other": 0.8, "a": 0.2}, "other") == {"other", "a"}


def test_a_set_keeps_a_single_label_only_if_the_answer_is_certain_enough():
    sets = calibrated_by(np.full(40, 0.5), ["a"] * 20 + ["b"] * 20)

    assert set_of(sets, {"a": 0.9, "b": 0.1}, "a", certainty=0.95) == {"a"}
    assert set_of(sets, {"a": 0.9, "b": 0.1}, "a", certainty=0.85) == {"a", "b"}
    # A label whose score is its threshold is a member, whatever the rounding.
    for score in (0.5, np.nextafter(0.5, 0.0)):
        assert set_of(sets, {"a": 0.9, "b": score}, "a") == {"a", "b"}
    assert set_of(sets, {"a": 0.9, "b": 0.499}, "a") == {"a"}


def test_many_trials_of_one_instance_count_as_one():
    truth = np.array([0.05] * 100 + [0.5] * 20)
    instances = ["poor"] * 100 + [f"good{i}" for i in range(20)]

    assert threshold(calibrated_by(truth, ["a"] * 120, instances)) == 0.5  # reached by 20 of 21 instances
    assert threshold(calibrated_by(truth, ["a"] * 120)) == 0.05


def test_a_class_of_support_has_a_threshold_for_all_labels():
    # Answers of the class 0 are poor, those of the class 1 are not.
    truth = np.concatenate((np.linspace(0.1, 0.3, 39), np.linspace(0.6, 0.9, 661)))
    numbers = np.repeat([0, 1], (39, 661))
    sets = calibrated_by(truth, ["a", "b"] * 350, support_class=numbers)

    assert sets.of_support[0] == truth[3]  # with the one that is not known yet, 36 of 40
    assert threshold(sets) > 0.6
    scores = {"a": 0.8, "b": 0.2, "c": 0.0}
    assert set_of(sets, scores, "a", support_class=0) == {"a", "b", "c"}  # nothing is known of `c`
    assert set_of(sets, scores, "a", support_class=1) == {"a", "c"}


def test_what_a_label_lacks_for_sets_is_counted_in_instances_where_each_label_has_several():
    two = {("full", "full#1"): 20, ("full", "full#2"): 1, ("empty", "empty#1"): 5, ("empty", "empty#2"): 5}

    assert units_lacking(two) == ("instances", {"empty": 7, "full": 7})
    assert units_lacking({**two, ("jar", "jar#1"): 4}) == ("instances", {"empty": 7, "full": 7, "jar": 8})
    single = {("jar", "jar#1"): 4, ("can", "can#1"): 4}
    assert units_lacking({**two, **single}) == ("trials", {"can": 5, "empty": 0, "full": 0, "jar": 5})
    assert units_lacking({("full", None): 12}, 0.95) == ("trials", {"full": 7})


def test_a_label_with_few_instances_is_in_every_set_and_is_named():
    truth = np.concatenate((np.linspace(0.2, 0.9, 12), [0.5, 0.6, 0.7]))
    sets = calibrated_by(truth, ["often"] * 12 + ["seldom"] * 3, [str(i) for i in range(15)])

    assert sets.uncalibrated == ("seldom",)
    assert "seldom 6 more" in sets.in_words
    assert set_of(sets, {"often": 1.0, "seldom": 0.0}, "often") == {"often", "seldom"}


def test_predictions_say_which_labels_are_in_every_set():
    trials = bottles(20)
    few = [i for i, name in enumerate(trials.instances) if not name.startswith("empty#1")]
    model = model_of(trials.rows(np.array(few)), "knn")  # 9 instances of `empty` are left
    fewer = [i for i in few if trials.instances[i] != "empty#2"]
    lacking = model_of(trials.rows(np.array(fewer)), "knn")

    assert not any("in every set" in text for text in model.predict(trials.table.row(0)).warnings)
    for said in lacking.predictions(trials.table.rows(np.arange(0, len(trials), 7))):
        if said.label != UNKNOWN:
            assert "empty" in said.prediction_set
            assert any("in every set" in text and "empty" in text for text in said.warnings)


@pytest.mark.slow
@every_case("instances", [3, 9])
def test_each_label_is_covered_however_few_instances_it_has(instances):
    """Four labels, of which one has few instances; the sets are judged by trials of new instances of each label."""
    covered, draws = np.zeros(4), 40
    for seed in range(draws):
        rng = np.random.default_rng((instances, seed))

        def drawn(counts, rng=rng):
            kinds = np.repeat(np.arange(4), counts)
            force = 1.2 * kinds + rng.normal(size=len(kinds))
            return labelled([f"k{k}" for k in kinds], force, instances=tuple(map(str, range(len(kinds)))))

        model = model_of(drawn((30, instances, 30, 30)), "knn")
        new = drawn((25,) * 4)
        inside = [
            said.label == UNKNOWN or label in said.prediction_set
            for said, label in zip(model.predictions(new.table), new.labels, strict=True)
        ]
        covered += np.array(inside).reshape(4, 25).mean(axis=1) / draws

    # A model of all trials answers, and the sets are calibrated by models of nine tenths of them: 90 % less three
    # standard errors of 40 calibrations with 30 instances.
    assert (covered > 0.9 - 3.0 * np.sqrt(0.09 / 30 / draws + 0.09 / 25 / draws)).all()


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in NAMES],
)
@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")  # mlp, on 42 trials
def test_every_classifier_has_sets_that_loading_keeps_exactly(name, tmp_path):
    trials = bottles()
    model = model_of(trials, name)
    loaded = kept(model, tmp_path)

    assert (loaded.sets, as_json(loaded)) == (model.sets, as_json(model))
    assert {threshold.units for threshold in model.sets.thresholds.values()} == {14}
    for i in range(0, len(trials), 5):
        said, again = model.predict(trials.table.row(i)), loaded.predict(trials.table.row(i))
        assert (said.probabilities, said.prediction_set) == (again.probabilities, again.prediction_set)
        assert said.label in said.prediction_set
        assert not said.calibrated or said.certainty == said.probabilities[said.label]
        assert said.coverage == 0.9
        assert said.set_in_words.endswith(" (right in 90 % of grasps for the same sessions)")
    model.classifier.to_json = lambda: {"means": np.zeros(2)}
    with pytest.raises(ComponentFailed, match=rf"/{name} .*to_json"):
        write_model(tmp_path / "m.json", model)


def test_an_unknown_trial_and_a_model_without_calibration_have_no_set(tmp_path):
    trials = bottles()
    model = model_of(trials, "tree")
    far = evolve(trials.table, values=trials.table.values + 1000.0)
    assert model.predict(far.row(0)).label == UNKNOWN
    assert model.predict(far.row(0)).set_in_words == ""
    assert model.sets.trials == len(trials)
    assert 0 <= model.sets.unknown < len(trials) / 5

    old = kept(evolve(model, sets=None), tmp_path)
    assert json.loads((tmp_path / "m.json").read_text())["sets"] is None
    assert old.predict(trials.table.row(0)).coverage is None


@every_case("name", ["tree", "knn"])
def test_a_trial_without_a_feature_that_all_training_trials_had_has_no_certainty(name, tmp_path):
    """Without the force, the labels are guessed: half of the answers are right, whatever was measured with it."""
    trials = bottles(spread=0.1)
    model = kept(model_of(trials, name), tmp_path)
    without = evolve(trials.table, values=trials.table.values * [np.nan, 1.0])
    lacking = model.predict(without.row(0))
    assert model.predict(trials.table.row(0)).prediction_set == ("full",)
    assert lacking.label in trials.classes
    assert (lacking.certainty, lacking.prediction_set) == (None, ())
    assert lacking.no_certainty.endswith(" x0")
    assert [each.no_certainty for each in model.predictions(without)] == [lacking.no_certainty] * len(trials)

    some = evolve(trials.table, values=np.vstack([without.values[:1], trials.table.values[1:]]))
    assert model_of(evolve(trials, table=some), name).predict(without.row(1)).certainty is not None


def test_evaluate_measures_coverage_size_and_reliability_with_instances_held_out():
    evaluation = judged(bottles(40, spread=0.5), "knn", controls=False)

    assert from_json(to_json(evaluation), Evaluation) == evaluation
    assert evaluation.sets.unit == "instances"
    assert evaluation.sets.covered.rate >= max(0.85, evaluation.headline.rate)
    assert 1.0 < evaluation.sets.mean_size < 2.0
    assert sum(point.rate.n for point in evaluation.reliability.curve) == 240
    assert 0.0 < evaluation.reliability.brier < 0.5
    assert evaluation.reliability.calibration_error < 0.15


def test_noise_gives_sets_of_both_labels_and_too_few_instances_have_no_coverage():
    trials = bottles(20)
    noise = evolve(trials.table, values=np.random.default_rng(3).normal(size=trials.table.values.shape))
    evaluation = judged(evolve(trials, table=noise), "svm", controls=False)
    assert evaluation.sets.mean_size > 1.7
    assert evaluation.sets.covered.rate > 0.85

    few = judged(bottles(4), "tree", controls=False)
    assert few.sets.covered is None
    assert "90 % needs 9" in few.sets.reason
    sections = [doubt_section(judged.sets, judged.reliability).body for judged in (evaluation, few)]
    assert [evaluation.sets.covered.words in body for body in sections] == [True, False]
    assert ["6 calibration instances" in body for body in sections] == [False, True]


def test_states_within_classes_are_covered_too():
    labels = [f"{cls}:{state}" for cls in ("can", "jar") for state in ("full", "empty") for _ in range(30)]
    rng = np.random.default_rng(0)
    force = [(3.0 if label.endswith("full") else 0.0) + rng.normal() for label in labels]
    evaluation = judged(labelled(labels, force), "knn", target="state", controls=False)

    assert evaluation.sets.unit == "trials"
    assert evaluation.sets.covered.rate > 0.85
    assert evaluation.sets.mean_size <= 2.0  # only states of the class of a trial are possible


def test_equal_probabilities_are_told_apart_by_the_closeness_of_the_training_trials():
    trials = bottles(20, spread=0.2)
    model = model_of(trials, "tree")
    closeness = model.novelty.closeness(trials.table, ("full", "empty"))
    own = np.where(np.array(trials.labels) == "full", closeness[:, 0], closeness[:, 1])
    other = np.where(np.array(trials.labels) == "full", closeness[:, 1], closeness[:, 0])

    assert (own > other).mean() > 0.95
    # The two at the ends of a range are equally far from its middle.
    assert len(np.unique(own)) >= len(own) - 4


@pytest.mark.slow
def test_the_commands_tell_the_sets_and_the_reliability(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "300")
    trials, model = bottles(12, spread=2.5), tmp_path / "m.json"
    rows = zip(trials.labels, trials.instances, *trials.table.values.T.tolist(), strict=True)
    lines = ["label,bottle,force [N],noise", *(",".join(map(str, row)) for row in rows)]
    (tmp_path / "t.csv").write_text("\n".join(lines))
    given = (tmp_path / "t.csv", "--label", "label", "--instance", "bottle")
    learned = (*given, "--classifier", "knn")

    trained = printed("train", *learned, "--out", model)
    asked = answered("predict", model, *given)
    measured = printed("evaluate", *learned)

    assert "90 % for 2 of 2 labels (12 instances" in trained
    assert "of the held-out trials" in trained
    assert "90 % SET" in printed("predict", model, *given)
    assert "label; 90 % asked for, by instances" in measured
    assert "Brier score" in measured
    assert "expected calibration error" in measured
    for prediction in asked["predictions"]:
        if prediction["label"] != UNKNOWN:
            assert prediction["label"] in prediction["prediction_set"]
            assert prediction["coverage"] == 0.9


# Right answers of probabilities that tell nothing, and of exact ones.
@pytest.mark.slow
@every_case("n", [20, 60, 200])
@every_case("rate_of", [lambda probability: np.full_like(probability, 0.6), lambda probability: probability])
def test_the_interval_of_a_certainty_holds_for_new_answers_and_its_highest_is_not_too_sure(rate_of, n):
    rng, held, highest = np.random.default_rng(1), [], []
    fresh = np.linspace(0.4, 1.0, 200)
    for _ in range(100):
        probability = rng.uniform(0.4, 1.0, n)
        right = rng.uniform(size=n) < rate_of(probability)
        certainty = certainty_from(probability, right.tolist())
        highest += certainty.rate(asked([1.0])).tolist()
        intervals = certainty.bounds(asked(fresh))[:, [0, 2]]
        for low, high in np.unique(intervals, axis=0):
            rests_on_as_much = intervals[:, 0] == low
            held += [low <= rate_of(fresh[rests_on_as_much]).mean() <= high] * int(rests_on_as_much.sum())
    # 95 % are asked for.
    assert np.mean(held) > 0.92
    assert np.mean(highest) < rate_of(np.ones(1))[0] + 0.03


def test_objects_that_differ_more_than_held_out_trials_did_have_no_certainty_and_others_keep_it(tmp_path):
    rng = np.random.default_rng(3)
    kinds = np.repeat(np.arange(3), 40)
    means = np.diag([0.0, 4.0, 4.0, 4.0])
    trials = labelled([f"thing {k}" for k in kinds], *(means[kinds] + rng.normal(size=(120, 4))).T)
    model = model_of(trials, "svm")
    other, same = (
        labelled(["?"] * 300, *(means[which] + rng.normal(size=(300, 4))).T)
        for which in (np.full(300, 3), rng.integers(0, 3, 300))
    )
    for known in (model, kept(model, tmp_path)):
        told_of_other, told_of_same = (
            [prediction.certainty is not None for prediction in known.predictions(asked_about.table)]
            for asked_about in (other, same)
        )
        assert np.mean(told_of_other) < 0.4
        assert np.mean(told_of_same) > 0.95
    untold = next(
        answer
        for answer in model.predictions(other.table)
        if answer.certainty is None and answer.label != UNKNOWN
    )
    assert "f" in untold.no_certainty
    assert not untold.prediction_set


def test_a_certainty_from_few_trials_is_printed_with_its_interval_and_kept(tmp_path):
    model = model_of(bottles(10), "tree")
    for known in (model, kept(model, tmp_path)):
        (prediction, *_) = known.predictions(bottles(10).table)
        low, high = prediction.certainty_interval
        assert low < prediction.certainty < high
        figure = f"({100 * low:.0f} to {100 * high:.0f} %)"
        assert figure in prediction.certainty_figure
        assert figure in prediction.certainty_in_words
        assert prediction.as_json()["certainty_interval"] == [low, high]
    sure = evolve(prediction, certainty_interval=(prediction.certainty - 0.01, prediction.certainty + 0.01))
    assert "(" not in sure.certainty_figure


def test_the_interval_of_a_certainty_holds_it_where_answers_are_right_less_often_than_by_chance():
    trials = bottles(10)
    seldom = SupportClass(least=0.0, probabilities=(0.0,), rates=(0.1,), units=20.0, intervals=((0.02, 0.3),))
    model = evolve(model_of(trials, "tree"), certainty=Certainty(classes=(seldom,)))
    for prediction in model.predictions(trials.table):
        assert prediction.certainty == 0.5
        assert prediction.certainty_interval == (0.02, 0.5)


def squeezed_in(sessions, each, rng, means):
    """Squeezes of three things whose forces have a gain of their own in each session, by 10 % (standard deviation)."""
    labels, forces, names = [], [], []
    for session in range(sessions):
        gain = 1.0 + 0.1 * rng.normal()
        for k, mean in enumerate(means):
            labels += [f"thing {k}"] * each
            names += [f"session {session}"] * each
            forces.append(gain * mean * (1.0 + 0.08 * rng.normal(size=(each, 3))))
    return labels, np.concatenate(forces).T, tuple(names)


@pytest.mark.slow
@every_case(
    ("sessions", "each", "held_out", "too_sure"),
    [(1, 40, False, True), (10, 6, False, False), (10, 6, True, False)],
)
def test_a_certainty_knows_the_drift_between_the_sessions_of_its_trials_and_no_other(
    sessions, each, held_out, too_sure
):
    differences = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        means = 5.0 * np.exp(0.13 * rng.normal(size=(3, 3)))
        labels, forces, names = squeezed_in(sessions, each, rng, means)
        trials = labelled(labels, *forces, instances=names if held_out else None)
        model = model_of(evolve(trials, sessions=held_out), "svm")
        labels, forces, _ = squeezed_in(30, 3, rng, means)
        made = model.predictions(labelled(labels, *forces).table)
        said = [prediction for prediction in made if prediction.certainty is not None]
        right = [prediction.label == label for prediction, label in zip(made, labels, strict=True)]
        differences.append(np.mean([prediction.certainty for prediction in said]) - np.mean(right))
        assert any("drifted" in warning for warning in made[0].warnings) != held_out
    # Of forces that do not drift, certainty and rate differ by 3 points at most.
    assert np.mean(differences) > 0.06 if too_sure else np.mean(differences) < 0.03


@pytest.mark.slow
def test_the_coverage_of_sets_is_that_of_all_sizes_together():
    covered: dict[int, list[bool]] = {}
    for seed in range(15):
        rng = np.random.default_rng(seed)
        means = 0.6 * rng.normal(size=(3, 3))

        def hard(each, rng=rng, means=means):
            numbers = np.repeat(np.arange(3), each)
            return labelled(
                [f"thing {k}" for k in numbers], *(means[numbers] + rng.normal(size=(3 * each, 3))).T
            )

        model, new = model_of(hard(30), "svm"), hard(100)
        for prediction, label in zip(model.predictions(new.table), new.labels, strict=True):
            if prediction.prediction_set:
                size = len(prediction.prediction_set)
                covered.setdefault(size, []).append(label in prediction.prediction_set)
    # Sets of every label always hold. So with 90 % of all sets, those of two hold less often.
    assert all(covered[3])
    assert 0.88 < np.mean([*covered.get(1, ()), *covered[2], *covered[3]]) < 0.96
    assert 0.8 < np.mean(covered[2]) < 0.9


def test_the_certainty_of_a_rare_label_is_not_that_of_the_frequent_one():
    """Where a cup is as probable as a can but rare, it is right in 12 of 20 answers, the can in 95 of 100."""
    labels = ["can"] * 100 + ["cup"] * 20 + ["jar"] * 4
    right = [k < 95 for k in range(100)] + [k < 12 for k in range(20)] + [True] * 4
    certainty = certainty_from([0.9] * len(labels), right, labels)
    answers = asked([0.9] * 4, ["can", "cup", "jar", "pan"])

    can, cup, jar, pan = certainty.rate(answers)
    assert 0.88 < can < 0.96
    assert cup == pytest.approx(0.6, abs=0.01)
    assert np.isnan([jar, pan]).all(), "four answers do not tell, nor does none"
    (low, _, high), (lowest, _, highest) = certainty.bounds(answers)[:2]
    assert low < can < high
    assert lowest < 0.45 < 0.75 < highest, "the interval is that of 20 answers"


def test_rare_labels_whose_few_answers_were_all_right_are_hardly_surer_than_others():
    """Each of three rare labels is right in 60 % of 10 answers, which share their luck in pairs."""
    rng, said, rare = np.random.default_rng(0), [], [f"rare {k}" for k in range(3)]
    labels = ["can"] * 80 + [label for label in rare for _ in range(10)]
    for _ in range(200):
        right = [*(rng.uniform(size=80) < 0.9), *np.repeat(rng.uniform(size=15) < 0.6, 2)]
        certainty = certainty_from([0.9] * len(labels), right, labels, effect=2.0)
        said += certainty.rate(asked([0.9] * 3, rare)).tolist()
    assert np.mean(said) == pytest.approx(0.6, abs=0.05)
    assert np.quantile(said, 0.95) < 0.79, "without what is known of all rare labels it would be 0.84"


def test_answers_of_a_cross_validation_count_for_less():
    for effect, units in ((1.0, 20), (2.0, 10)):
        certainty = certainty_from([1.0] * 20, [True] * 20, effect=effect)
        # All are right, of two labels: the square of the distance from guessing, 1/2, is so many variances.
        variances = units * (units + 2) ** 2 / 4.0 / (units + 1)
        right = units * (1.0 - 0.5 / (variances + 1.0))
        assert certainty.rate(asked([1.0])) == pytest.approx([(right + 1.0) / (units + 2.0)])


def test_guesses_among_several_labels_are_hardly_surer_than_guesses():
    rng, labels, said = np.random.default_rng(0), [f"thing {k}" for k in range(5)] * 8, []
    for _ in range(300):
        certainty = certainty_from(
            rng.uniform(size=40), (rng.uniform(size=40) < 0.2).tolist(), labels, effect=2.0
        )
        said += certainty.rate(asked([0.5] * 5, labels[:5])).tolist()
    # Drawn towards a half, they would say 23 %.
    assert 0.2 <= np.mean(said) < 0.22


def test_answers_for_one_object_count_for_more_than_one_where_the_objects_hardly_differ():
    """Of 160 answers, 144 are right: in each of 20 objects alike, or none in two of them."""
    spread = [k % 10 != 0 for k in range(160)]
    together = [k // 8 not in (0, 10) for k in range(160)]
    objects = [str(k // 8) for k in range(160)]
    said = []
    for right, units in ((spread, objects), (together, objects), ([k > 1 for k in range(20)], None)):
        certainty = certainty_from(np.ones(len(right)), right, effect=2.0, units=units)
        said += certainty.rate(asked([1.0])).tolist()
    assert said[0] == pytest.approx(0.88, abs=0.02)
    assert said[1] == pytest.approx(said[2])
    assert said[1] < said[0] - 0.03


@pytest.mark.slow
def test_a_label_with_a_single_object_has_no_certainty_and_others_are_not_too_sure_beside_it():
    """Objects of a label differ: those of three labels are known by 10 others, of the fourth one only one is."""
    said, told = [], 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        means = rng.normal(size=(4, 4))
        kinds = np.array([*np.repeat([1, 2, 3], 10), 0])
        own = np.repeat(means[kinds] + 0.7 * rng.normal(size=(31, 4)), 3, axis=0)
        names = [f"{k}#{i}" for i, k in enumerate(kinds) for _ in range(3)]
        values = own + 0.3 * rng.normal(size=own.shape)
        model = model_of(labelled([name[0] for name in names], *values.T, instances=tuple(names)), "svm")
        new = rng.choice(kinds, 200)
        asked_about = labelled(["?"] * 200, *(means[new] + 0.76 * rng.normal(size=(200, 4))).T)
        for answer, kind in zip(model.predictions(asked_about.table), new, strict=True):
            told += answer.label == "0" and answer.certainty is not None
            if answer.certainty is not None:
                said.append(answer.certainty - (answer.label == str(kind)))
    assert told == 0
    # With single trials held out it would be 6 points.
    assert np.mean(said) < 0.03


def test_an_answer_that_is_seldom_given_has_no_certainty_and_no_set_of_its_own(tmp_path):
    rng = np.random.default_rng(0)
    force = np.concatenate([rng.normal(0.0, 1.0, 60), rng.normal(12.0, 1.0, 3)])
    trials = labelled(["full"] * 60 + ["empty"] * 3, force, rng.normal(size=63))
    model = kept(model_of(trials, "tree"), tmp_path)
    full, empty = model.predictions(trials.table.rows(np.array([0, 62])))

    assert (full.label, empty.label) == ("full", "empty")
    assert full.certainty is not None
    assert (empty.certainty, empty.certainty_interval) == (None, None)
    assert "5 held-out trials" in empty.no_certainty
    assert len(empty.prediction_set) == 2
    assert model.predict(trials.table.row(62)).certainty is None
