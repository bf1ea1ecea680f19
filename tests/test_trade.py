"""What recognition costs: the front, paired tests, and when to squeeze again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense.experiments.executors.serial import Serial
from graspsense.experiments.experiment import read_experiment
from graspsense.experiments.page import findings_of
from graspsense.experiments.results import Results
from graspsense.experiments.run import run_experiment
from graspsense.experiments.summary import summarise
from graspsense.experiments.trade.front import front
from graspsense.experiments.trade.next_squeeze import Decision, Forces, Promise, SqueezeAnswers, decide

CASES = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=12)


@given(CASES)
def test_nothing_beats_what_is_on_the_front_and_something_there_beats_the_rest(cases):
    costs, rates = [c for c, _ in cases], [r for _, r in cases]
    on = front(costs, rates)
    best = [one for one, kept in zip(cases, on, strict=True) if kept]
    assert best
    for (cost, rate), kept in zip(cases, on, strict=True):
        beaten = any(c <= cost and r >= rate and (c, r) != (cost, rate) for c, r in best)
        assert beaten is not kept


def test_a_high_value_may_be_the_cheap_one():
    assert front([1.0, 2.0], [0.5, 0.5], cheap_is_low=False) == [False, True]


KNOWS = np.array([[0.98, 0.02], [0.02, 0.98]])
GUESSES = np.full((2, 2), 0.5)


def squeezed(answer, seconds=1.0):
    return SqueezeAnswers(answer=np.array([answer]), seconds=np.array([seconds]))


def promise(confusion, seconds=1.0):
    return Promise(confusion=confusion, seconds=np.full(2, seconds))


def test_who_is_sure_at_the_contact_does_not_squeeze():
    known = (squeezed(1), promise(KNOWS))
    forces = Forces(answers={17.0: squeezed(0)}, promises={17.0: promise(KNOWS)})
    decision = decide(0, known, forces, sure=0.9, most=3, again_s=1.0)
    assert decision == Decision(answer=1, seconds=0.0, squeezes=0)


def test_who_is_not_takes_the_force_that_tells_most_per_second():
    nothing = (squeezed(0), promise(GUESSES))
    answers = {17.0: squeezed(0, 0.3), 20.0: squeezed(1, 0.4)}
    informative = Forces(answers=answers, promises={17.0: promise(GUESSES, 0.3), 20.0: promise(KNOWS, 0.4)})
    decision = decide(0, nothing, informative, sure=0.9, most=3, again_s=1.0)
    assert decision == Decision(answer=1, seconds=0.4, squeezes=1)
    # Both are equally informative; one takes less time.
    equal = Forces(answers=answers, promises={17.0: promise(KNOWS, 0.3), 20.0: promise(KNOWS, 0.4)})
    decision = decide(0, nothing, equal, sure=0.9, most=3, again_s=1.0)
    assert decision == Decision(answer=0, seconds=0.3, squeezes=1)


def test_a_second_squeeze_costs_its_opening_and_never_more_than_allowed():
    nothing = (squeezed(0), promise(GUESSES))
    forces = Forces(
        answers={17.0: squeezed(0, 0.3), 20.0: squeezed(1, 0.4)},
        promises={17.0: promise(KNOWS, 0.3), 20.0: promise(KNOWS, 0.4)},
    )
    decision = decide(0, nothing, forces, sure=0.999, most=3, again_s=1.0)
    assert (decision.seconds, decision.squeezes) == (pytest.approx(0.3 + 1.0 + 0.4), 2)
    assert decide(0, nothing, forces, sure=0.999, most=1, again_s=1.0).squeezes == 1


COMMON = """
title = "Small"
seeds = 2
[data]
objects = ["can:full_closed", "can:empty_open"]
instances = 5
trials = {trials}
[judge]
targets = ["state"]
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "more", "trials"),
    [
        ("early", "moments_s = [0.0, 1.0]", 2),
        ("squeezes", "most = 2", 2),
        ("physics", "error = 0.1", 2),
        ("next_squeeze", "forces_n = [17.0, 20.0]", 1),
        ("compare", "", 2),
    ],
)
def test_each_trade_runs_and_gives_advice(tmp_path, kind, more, trials):
    pytest.importorskip("graspsense_sim_gripper")
    pytest.importorskip("graspsense_c45")
    (tmp_path / "small.toml").write_text(f'kind = "{kind}"\n{COMMON.format(trials=trials)}{more}\n')
    planned = read_experiment(str(tmp_path / "small.toml"))
    results = Results(tmp_path / "out")
    account = run_experiment(planned, results, Serial)
    assert account.complete, account.failed
    found = findings_of(summarise(planned, results))
    assert found.answer
    assert found.tables[0].rows
    if kind == "early":
        at = {row[0]: float(row[2]) for row in found.tables[0].rows}
        assert at["0 s"] == 0.0 < at["1 s"] < 1.0  # at rest before a second is over
