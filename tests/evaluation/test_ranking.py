"""Classifiers and feature sets on the same folds: who is best, equivalent, undecided or worse."""

import numpy as np
import pytest
from attrs import evolve
from commands import answered, printed, refused
from test_conformal import bottles
from test_evaluate import learner

from graspsense.evaluation.intervals import difference
from graspsense.evaluation.ranking import CandidateResult, OutsideAnswers, rank, ranking_of
from graspsense.report.ranking_page import ranking_page
from graspsense.report.verdict import in_hundred


def crossed(**other):
    trials = bottles(30, spread=0.3)
    noise = evolve(trials.table, values=np.random.default_rng(1).normal(size=trials.table.values.shape))
    learners = {name: learner(name) for name in ("tree", "knn")}
    return rank(learners, {"force": trials, "noise": evolve(trials, table=noise)}, **other)


@pytest.mark.slow
def test_features_without_information_are_worse_and_the_same_trials_are_compared():
    ranking = crossed()

    assert ranking.protocol == "instance_held_out"
    assert ranking.candidates[0].standing == "best"
    assert ranking.candidates[0].features == "force"
    assert {candidate.standing for candidate in ranking.candidates if candidate.features == "noise"} == {
        "worse"
    }
    assert {candidate.rates["instance_held_out"].n for candidate in ranking.candidates} == {180}
    assert ranking.candidates[0].name in ranking.verdict
    assert ranking.chosen.candidates == 4
    assert ranking.chosen.rate <= ranking.candidates[0].rates["instance_held_out"].rate
    assert ranking.candidates[0].rates["instance_held_out"].interval == ranking.chosen.interval
    assert ranking.chosen.words in ranking.verdict
    for candidate in ranking.candidates:
        assert candidate.sets.covered.n == 180
        assert 0.8 < candidate.sets.covered.rate <= 1.0


@pytest.mark.slow
def test_the_best_of_several_in_noise_is_not_shown_to_be_better_than_guessing():
    learners = {name: learner(name) for name in ("tree", "knn")}
    trials = bottles(12, spread=0.1)
    noise = evolve(trials.table, values=np.random.default_rng(1).normal(size=trials.table.values.shape))
    guessing = "not shown to be better than always giving the most frequent label (50.0 %)"
    assert guessing in rank(learners, {"noise": evolve(trials, table=noise)}).verdict
    assert guessing not in rank(learners, {"force": trials}).verdict


def test_intervals_are_wider_for_more_comparisons():
    right, wrong = [True] * 90 + [False] * 10, [True] * 80 + [False] * 20
    single, ten = difference(right, wrong).interval, difference(right, wrong, comparisons=10).interval

    assert ten[0] < single[0] < single[1] < ten[1]


def compared(folder):
    """Write a table of bottles; return the command that compares on it."""
    trials = bottles(12)
    lines = ["label,bottle,force [N],noise"]
    for label, name, row in zip(trials.labels, trials.instances, trials.table.values.tolist(), strict=True):
        lines.append(",".join((label, name, *map(repr, row))))
    (folder / "t.csv").write_text("\n".join(lines))
    return "compare", str(folder / "t.csv"), "--label", "label", "--instance", "bottle"


@pytest.mark.slow
def test_the_command_names_the_best_and_refuses_feature_sets_of_a_csv(tmp_path):
    arguments = compared(tmp_path)

    shown = printed(*arguments, "--classifiers", "tree,knn")
    listed = answered(*arguments, "--classifiers", "tree,knn")

    assert "highest rate" in shown
    assert "RECORDING ORDER" in shown
    assert {candidate["classifier"] for candidate in listed["candidates"]} == {"tree", "knn"}
    assert listed["verdict"].startswith(listed["candidates"][0]["classifier"])
    for option, says in (
        ("--feature-sets", "not for a CSV"),
        ("--target-value", "compare is for classifiers"),
        ("--out", "curve: the name of the file must end in .html"),
    ):
        assert says in refused(*arguments, option, "curve")


def test_features_from_before_the_contact_are_a_control_and_not_compared():
    from graspsense.core.learn.labelled import ControlFeatures

    trials = bottles(12)
    width = ControlFeatures(table=trials.table, what="the same numbers")
    ranking = rank({"tree": learner("tree")}, {"force": evolve(trials, before_contact=width)})

    assert [candidate.standing for candidate in ranking.candidates] == ["best", "control"]
    assert ranking.candidates[1].loss is None
    assert "tree recognises" in ranking.verdict


def test_answers_from_outside_are_compared_like_any_other():
    trials = bottles(30, spread=0.3)
    perfect = OutsideAnswers(predicted={"instance_held_out": trials.labels}, training_s=1.0)
    ranking = rank({"knn": learner("knn")}, {"force": trials}, outside={("oracle", "all"): perfect})

    assert [candidate.name for candidate in ranking.candidates] == ["oracle with all", "knn with force"]
    assert ranking.candidates[0].rates["instance_held_out"].rate == 1.0
    assert ranking.candidates[0].sets is None
    assert ranking.candidates[1].loss.value > 0.0


def test_an_unknown_name_is_refused_by_the_option_that_was_typed_before_any_grasp():
    for option, name, role in (
        ("--feature-sets", "nope", "feature set"),
        ("--classifiers", "svn", "classifier"),
    ):
        err = refused("compare", "simulated", option, name)
        assert f"{option} {name}: no {role} named" in err
        assert "grasping" not in err


@pytest.mark.slow
def test_the_page_has_verdict_rates_losses_sets_and_the_command(tmp_path):
    page = tmp_path / "page.html"
    shown = printed(*compared(tmp_path), "--classifiers", "tree,knn", "--out", str(page))

    text = page.read_text(encoding="utf-8")
    assert str(page) in "".join(shown.split())
    assert "recognises most: " in text
    for heading in ("Recognition rates</h2>", "Provenance</h2>", "loss, in points</th>", "sets cover</th>"):
        assert heading in text
    assert "--classifiers tree,knn" in text
    assert "http" not in text.replace("http-equiv", "").replace("http://www.w3.org/2000/svg", "")


def test_the_headline_of_the_page_has_the_rate_without_the_luck_of_the_choice():
    """Thirty-two candidates that guess one of two labels: the best of them seems far better than that."""
    trials = bottles(12)
    rng = np.random.default_rng(0)
    measured = {
        ("guess", f"set{k}"): CandidateResult(
            right={"folds": (rng.random(len(trials)) < 0.5).tolist()}, training_s=1.0
        )
        for k in range(32)
    }
    ranking = ranking_of(measured, "folds", trials, (), 10)
    best = ranking.candidates[0].rates["folds"].rate

    assert best > ranking.chosen.rate + 0.05
    headline = ranking_page(ranking, "graspsense compare").headline
    assert in_hundred(ranking.chosen.rate) in headline
    assert in_hundred(best) not in headline


@pytest.mark.parametrize("sign", [1, pytest.param(-1, marks=pytest.mark.slow)])
def test_a_default_that_is_worse_is_told_with_what_to_do(sign, tmp_path):
    """The label is that of the product of two features: a tree that looks at one of them at a time sees nothing."""
    rng = np.random.default_rng(0)
    x = rng.uniform(-1.0, 1.0, size=(120, 2))
    product = x[:, 0] * x[:, 1] if sign > 0 else x[:, 0]
    lines = ["what,a [N],b [N]"]
    lines += [
        f"{'high' if factor > 0.0 else 'low'},{a:.4f},{b:.4f}"
        for factor, (a, b) in zip(product.tolist(), x.tolist(), strict=True)
    ]
    path = tmp_path / "t.csv"
    path.write_text("\n".join(lines) + "\n")
    said = printed("compare", path, "--label", "what", "--classifiers", "c45,svm")
    assert ("--choose" in said) == (sign > 0)
