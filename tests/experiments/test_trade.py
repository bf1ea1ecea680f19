"""What recognition costs: the front, and paired tests."""

import pytest
from cases import every_case
from test_answer import condition

from graspsense.evaluation.over_seeds import verdict_on
from graspsense.experiments.executors.executor import Serial
from graspsense.experiments.experiment_file import read_experiment
from graspsense.experiments.page import findings_of
from graspsense.experiments.results import Results
from graspsense.experiments.run import run_experiment
from graspsense.experiments.summary import summarise
from graspsense.experiments.task_results import TrialValues
from graspsense.experiments.trade.costs import mean_seconds
from graspsense.experiments.trade.trade_point import advise, trade_points


def case(name, cost, *rates):
    """Return a case of this cost with these rates of its seeds."""
    return condition(name, *rates, target="state", cost=cost)


def test_a_cheap_case_is_recommended_only_if_it_is_shown_to_lose_little():
    best = case("strong", 3.0, 0.90, 0.91, 0.92, 0.91)
    near = case("weak", 2.0, 0.89, 0.90, 0.90, 0.90)
    far = case("feeble", 1.0, 0.40, 0.42, 0.41, 0.40)

    advice = advise(trade_points([far, near, best], True), "Force", "N")
    assert advice.recommended.name == "weak"
    assert "known object (can)" in advice.text

    advice = advise(trade_points([far, best], True), "Force", "N", "not for a robot")
    assert advice.recommended is advice.best
    assert "for a robot" in advice.text


def test_where_no_difference_is_shown_the_cheapest_is_taken_and_that_is_said():
    best = case("strong", 2.0, 0.70, 0.95, 0.80, 0.99)
    other = case("weak", 1.0, 0.95, 0.70, 0.90, 0.77)
    points = trade_points([other, best], True)
    advice = advise(points, "Force", "N")
    assert (advice.recommended.name, advice.shown) == ("weak", False)
    # Few seeds do not show that it loses nothing: what is shown is how much it loses at most.
    most = f"at most {100 * advice.loss.interval[1]:.1f}"
    assert "no difference" in advice.text
    assert most in advice.text
    assert most in advice.cells[-1]
    assert all(part in advice.text for part in ("100 grasps", "4 seeds"))
    assert advice.cells[2] == "weak, no difference shown"
    assert [point.on_front for point in points] == ["yes", "not decided"]


def test_a_case_that_is_the_cheapest_and_the_best_is_not_called_better():
    cheap, dear = case("weak", 1.0, 0.90, 0.91, 0.90, 0.92), case("strong", 2.0, 0.90, 0.90, 0.91, 0.91)
    advice = advise(trade_points([cheap, dear], True), "Force", "N")
    assert (advice.recommended.name, advice.loss) == ("weak", None)
    assert "take the cheapest" in advice.text
    assert "highest" not in advice.text


def test_a_case_that_lost_much_is_not_taken_because_few_seeds_show_nothing():
    best, poor = case("strong", 2.0, 0.90, 0.95), case("weak", 1.0, 0.50, 0.90)
    advice = advise(trade_points([poor, best], True), "Force", "N")
    assert (advice.recommended.name, advice.shown) == ("strong", False)
    assert "within 5 points, although 2 seeds" in advice.text
    assert advice.cells[2] == "strong"


def test_a_single_seed_recommends_nothing():
    advice = advise(trade_points([case("weak", 1.0, 0.8), case("strong", 2.0, 0.9)], True), "Force", "N")
    assert advice.recommended is None
    assert "cannot be told" in advice.text
    assert advice.cells[2] == "cannot be told"


@every_case(
    ("interval", "says"),
    [
        ((-0.01, 0.015), "agrees"),
        ((0.001, 0.015), "agrees"),
        ((0.01, 0.2), "differs"),
        ((-0.2, -0.03), "differs"),
        ((-0.1, 0.3), "cannot be told"),
        (None, "cannot be told"),
    ],
)
def test_an_interval_says_one_of_three_things(interval, says):
    assert verdict_on(interval) == says


def test_the_front_takes_intervals_into_account_and_a_high_value_may_be_the_cheap_one():
    high, low = case("a", 1.0, 0.9, 0.91, 0.9), case("b", 2.0, 0.5, 0.52, 0.5)
    assert [point.on_front for point in trade_points([high, low], True)] == ["yes", "no"]
    assert [point.on_front for point in trade_points([high, low], False)] == ["yes", "yes"]
    same = trade_points([case("b", 1.0, 0.5, 0.52, 0.5), high], True)  # they cost the same
    assert {point.name: point.on_front for point in same} == {"a": "yes", "b": "no"}


COMMON = """
title = "Small"
seeds = 2
[data]
objects = ["can:full_closed", "can:empty_open"]
instances = 3
trials = 2
[judge]
targets = ["state"]
"""


def summary_of(folder, kind, more):
    """Run a small experiment of this kind, and return the summary of its results."""
    pytest.importorskip("graspsense_sim_gripper")
    pytest.importorskip("graspsense_c45")
    (folder / "small.toml").write_text(f'kind = "{kind}"\n{COMMON}{more}\n')
    planned = read_experiment(str(folder / "small.toml"))
    results = Results(folder / "out")
    account = run_experiment(planned, results, Serial)
    assert account.complete, account.failed
    return summarise(planned, results)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "more"), [("early", "moments_s = [0.0, 1.0]"), ("squeezes", "most = 2")])
def test_each_trade_runs_and_gives_advice(tmp_path, kind, more):
    """That of the physics is run whole by `test_a_trade_off_is_the_one_of_today`."""
    summary = summary_of(tmp_path, kind, more)
    findings = findings_of(summary)
    assert findings.answer
    if "squeeze" in kind:  # the answers are those of too few bottles for an interval
        rates = [seed.rate for condition in summary.conditions for seed in condition.by_seed.values()]
        assert all(rate.instances and rate.interval is None for rate in rates)
    assert findings.tables[0].rows
    if kind == "early":
        steps_of = {row[0]: float(row[2]) for row in findings.tables[0].rows}
        assert steps_of["0 s"] == 0.0 < steps_of["1 s"] < 1.0  # at rest before a second is over


def test_a_grasp_lasts_until_the_rest_window_has_shown_the_rest():
    trials = TrialValues(
        features=(("p_first", "m"), ("delta_t", "s")),
        labels=("can:full", "can:full"),
        instances=None,
        values=((0.066, 0.3), (0.066, None)),
    )
    settings = {
        "gripper": {"open_gap_m": 0.086},
        "controller": {"closing_speed_m_s": 0.01, "rest_window_s": 0.2},
    }
    assert mean_seconds(settings, trials) == pytest.approx(2.0 + 0.3 + 0.2)


def test_the_joint_trade_varies_speed_force_rest_and_squeezes_on_bottles_held_out():
    planned = read_experiment("trade_joint")
    assert planned.experiment.kind == "squeezes"  # whole instances are held out
    assert set(planned.experiment.sweep) == {
        "controller.closing_speed_m_s",
        "controller.probing_force_n",
        "controller.rest_window_s",
    }
    assert planned.cases[0].judge.most > 1


@pytest.mark.slow
def test_controls_stand_beside_the_rates_of_a_trade(tmp_path):
    judge = "controls = true\ngrasps = 0\nfolds = 2\nprotocol = 'stratified'\n"
    sweep = '[sweep]\n"controller.closing_speed_m_s" = [0.02, 0.04]'
    findings = findings_of(summary_of(tmp_path, "trade", judge + sweep))
    (controls,) = (table for table in findings.tables if table.id == "controls")
    assert len(controls.rows) == 2
    assert controls.header[-5:] == (
        "most frequent label",
        "shuffled labels",
        "before contact",
        "width alone",
        "new bottles",
    )
    for row in controls.rows:
        assert all("%" in row[3 + k] for k in (0, 1, 4)), row  # the rate, the most frequent label, the width
