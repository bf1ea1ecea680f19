"""Choosing a classifier with its features: the right one where it is known, and a rate that is not raised by it."""

import numpy as np
import pytest
import scipy
from attrs import evolve
from cases import every_case
from parts import Nearest
from test_evaluate import learner

from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.training import train
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.choosing import choose
from graspsense.evaluation.doubt import calibrated, calibrated_with
from graspsense.plugin_api import ClassifierConfig


def trials(values, labels, instances=None):
    table = FeatureTable(
        names=tuple(f"f{k}" for k in range(values.shape[1])), units=("N",) * values.shape[1], values=values
    )
    return Labelled(source="made up", table=table, labels=tuple(labels), instances=instances)


def objects(label_count=3, instances=8, each=3, columns=3, seed=0):
    """Trials of several objects of each label; the features say nothing of it."""
    labels = [f"l{k % label_count}" for k in range(label_count * instances) for _ in range(each)]
    names = tuple(f"o{k}" for k in range(label_count * instances) for _ in range(each))
    rng = np.random.default_rng(seed)
    of_object = np.repeat(rng.normal(size=(label_count * instances, columns)), each, axis=0)
    return trials(of_object + 0.3 * rng.normal(size=(len(labels), columns)), labels, names)


def informed(noise):
    """The trials with one feature more, from which the label follows."""
    number = [[float(label[1:])] for label in noise.labels]
    return trials(np.hstack([noise.table.values, number]), noise.labels, noise.instances)


class Made:
    """Makes classifiers of this class."""

    def __init__(self, cls):
        self.cls = cls

    def create(self):
        return self.cls(ClassifierConfig())


LEARNERS = {name: learner(name) for name in ("tree", "knn")}
NEAREST = {"nearest": Made(Nearest)}


def test_the_features_that_tell_the_labels_are_chosen_in_each_fold():
    noise = objects()
    choice = choose(LEARNERS, {"noise": noise, "informed": informed(noise)})

    assert (choice.best.classifier, choice.best.features) == ("tree", "informed")
    assert choice.chosen_in == {"tree with informed": 5}
    assert choice.rate.rate == 1.0
    assert choice.ranking.protocol == "instance_held_out"
    assert {
        candidate.standing for candidate in choice.ranking.candidates if candidate.features == "noise"
    } == {"worse"}


def test_a_feature_that_names_the_object_does_not_pass_for_one_of_the_label():
    """Whole objects are held out of the choice: knowing an object again is of no use there."""
    noise = objects(each=6)
    known = evolve(noise, table=evolve(noise.table, values=1e-3 * noise.table.values))
    choice = choose({"knn": learner("knn")}, {"noise": known, "informed": informed(noise)})

    assert choice.best.features == "informed"


def test_each_trial_is_predicted_by_a_model_that_was_chosen_and_trained_without_it():
    seen = []

    class Watching(Nearest):
        def fit(self, table, labels, seed):
            seen.append({tuple(row) for row in table.values.tolist()})
            super().fit(table, labels, seed)

    noise = objects()
    choose({"watching": Made(Watching)}, {"noise": noise})
    rows = [tuple(row) for row in noise.table.values.tolist()]
    sizes = sorted(len(training_rows) for training_rows in seen)

    # Five models without one fold, and ten without two.
    assert len(seen) == 15
    assert sizes[:10] < sizes[10:]
    for row, instance in zip(rows, noise.instances, strict=True):
        apart = [training_rows for training_rows in seen if row not in training_rows]
        same = {r for r, other in zip(rows, noise.instances, strict=True) if other == instance}
        assert len(apart) == 1 + 4
        assert all(not same & training_rows for training_rows in apart)


@every_case(
    ("known", "least"),
    [
        (objects(label_count=2, instances=1, each=2), 5),
        (evolve(objects(label_count=2, instances=1, each=10), instances=tuple("ab" * 10)), 3),
    ],
)
def test_too_few_trials_or_objects_are_refused_with_the_number_that_is_needed(known, least):
    with pytest.raises(ConfigError, match=f"too few .* at least {least}$"):
        choose(NEAREST, {"noise": known})


@pytest.mark.slow
def test_the_rate_of_labels_without_information_is_that_of_guessing():
    """Twelve candidates on labels that were drawn at random; the best of them seems better than it is."""
    rng = np.random.default_rng(7)
    right = best = total = 0
    for repeat in range(6):
        labels = [f"l{k}" for k in rng.permutation(np.repeat(np.arange(2), 20))]
        sets = {f"set{k}": trials(rng.normal(size=(40, 2)), labels) for k in range(12)}
        choice = choose(NEAREST, sets, seed=repeat)
        right += choice.rate.correct
        best += choice.best.rates[choice.ranking.protocol].correct
        total += choice.rate.n
    low, high = scipy.stats.binom.interval(0.999, total, 0.5)

    assert right <= high
    assert right >= low - 0.05 * total  # labels that are held out are rarer in training: below one half
    assert best > high


@pytest.mark.slow
def test_the_certainty_of_a_chosen_model_is_not_raised_by_the_choice():
    """Among features that tell nothing, the chosen one had the most luck: its own held-out answers are too good."""
    rng = np.random.default_rng(7)
    own, procedure = [], []
    for repeat in range(4):
        labels = [f"l{k}" for k in rng.permutation(np.repeat(np.arange(2), 20))]
        sets = {f"set{k}": trials(rng.normal(size=(40, 1)), labels) for k in range(12)}
        learners = {"knn": learner("knn")}
        choice = choose(learners, sets, seed=repeat)
        chosen = sets[choice.best.features]
        model = train(learners["knn"].component, learners["knn"].config, chosen, name="m", seed=repeat)
        fresh = evolve(chosen.table, values=rng.normal(size=(200, 1)))
        for certainties, made in (
            (own, calibrated(model, learners["knn"], chosen, repeat)),
            (procedure, calibrated_with(model, choice.answers, chosen)),
        ):
            told = [prediction.certainty for prediction in made.predictions(fresh)]
            certainties += [certainty for certainty in told if certainty is not None]

    # Every answer to a fresh trial is right in one half of cases.
    assert np.mean(own) > np.mean(procedure) + 0.03
    assert np.mean(procedure) == pytest.approx(0.5, abs=0.07)


def raising(error):
    """Return what makes classifiers whose training ends with this error."""

    class Raising(Nearest):
        def fit(self, table, labels, seed):
            raise error

    return Made(Raising)


def test_a_classifier_that_fails_is_told_and_left_out():
    noise = objects()
    choice = choose({"broken": raising(RuntimeError("it broke")), **NEAREST}, {"informed": informed(noise)})

    assert {candidate.classifier for candidate in choice.ranking.candidates} == {"nearest"}
    assert any("broken" in note and "it broke" in note for note in choice.ranking.notes)
    with pytest.raises(ConfigError, match="it broke"):
        choose({"broken": raising(RuntimeError("it broke"))}, {"informed": informed(noise)})


def test_an_end_that_the_user_asks_for_is_no_failure_of_a_classifier():
    with pytest.raises(KeyboardInterrupt):
        choose({"slow": raising(KeyboardInterrupt()), **NEAREST}, {"noise": objects()})


def test_too_little_to_choose_by_is_refused():
    noise = objects()
    same = evolve(noise, labels=("a",) * len(noise))
    with pytest.raises(ConfigError, match="'a'"):
        choose(NEAREST, {"noise": same})
    with pytest.raises(ConfigError, match="4 trials"):
        choose(NEAREST, {"noise": noise.rows(np.array([0, 1, 4, 5]))})


def test_a_label_with_a_single_object_is_cross_validated_by_trials():
    choice = choose(NEAREST, {"informed": informed(objects(instances=1, each=6))})

    assert choice.ranking.protocol == "stratified_5_fold"
    assert any("single instance" in note for note in choice.ranking.notes)


def test_the_same_seed_gives_the_same_choice():
    noise = objects()
    sets = {"noise": noise, "other": objects(seed=3)}
    choices = [choose({"tree": learner("tree")}, sets, seed=4) for _ in range(2)]
    choice, repeated = [(made.rate, made.chosen_in, made.best.name) for made in choices]

    assert choice == repeated
