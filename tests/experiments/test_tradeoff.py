"""What a simulator's accuracy costs: the table, and what the command refuses."""

import math

import pytest
from attrs import evolve
from commands import answered, refused

from graspsense.evaluation.intervals import Difference
from graspsense.experiments import simulation
from graspsense.experiments.simulation import PEAK, TRACE, SimulationTrade, VariantPoint, simulation_table
from graspsense.experiments.simulation_recognition import conclusion

QUANTITIES = ("p_first", "delta_t", PEAK, TRACE)


def point(method, step, seconds, error, role="curve", failure=""):
    errors = {} if math.isnan(error) else dict.fromkeys(QUANTITIES, error)
    return VariantPoint(
        method=method,
        fidelity="full",
        step=step,
        role=role,
        seconds=seconds,
        setup_s=12.5,
        errors=errors,
        failure=failure,
    )


TRADE = SimulationTrade(
    gripper="lab/sim",
    scenes=("block",),
    seeds=(1,),
    quantities=QUANTITIES,
    points=(
        point("halved", "to the end", 2.0, 0.0, role="reference"),
        point("even", "1 ms", 1e-3, 1e-2),
        point("even", "0.5 ms", 2e-3, 1e-3),
        point("even", "5 ms", 1e-4, math.inf, failure="no number in the force trace"),
        point("broken", "1 ms", math.nan, math.nan, failure="ZeroDivisionError: x"),
    ),
    made={"date": "2026-11-21", "numpy": "2.4"},
)


def test_a_row_says_time_set_up_errors_and_what_failed():
    table = simulation_table(TRADE)
    header, rows = table.header, table.rows
    assert header[3:6] == ("time [ms]", "set-up [s]", "p_first [%]")
    assert len(rows) == len(TRADE.points)
    assert all(len(row) == len(header) for row in rows)
    by_step = {(row[0], row[2]): row for row in rows}
    assert by_step["even", "1 ms"][3:7] == ("1", "12.5", "1.0e+00", "1.0e+00")
    assert by_step["even", "5 ms"][-1] == "no number in the force trace"
    assert by_step["broken", "1 ms"][3:7] == ("-", "12.5", "-", "-")


def test_a_gripper_with_nothing_to_trade_is_refused(tmp_path):
    file = tmp_path / "squeeze.csv"
    file.write_text("t,gap\n0,0\n")
    options = ["--gripper", "replay", "-o", f"gripper.recording=csv:{file}"]
    assert "no accuracy" in refused("tradeoff", "simulation", *options)


@pytest.fixture(autouse=True)
def _each_variant_is_timed_once(monkeypatch):
    monkeypatch.setattr(simulation, "LEAST_S", 0.0)
    monkeypatch.setattr(simulation, "LEAST_RUNS", 1)


@pytest.mark.slow
def test_the_simulator_gets_better_with_finer_steps():
    few = ("--scene", "can:empty_open", "--seeds", "1", "--instances", "2")
    answer = answered("tradeoff", "simulation", *few)
    points = answer["points"]
    assert [p["role"] for p in points].count("reference") == 1
    assert {p["failure"] for p in points} == {""}
    assert answer["quantities"][-2:] == [PEAK, TRACE]
    assert all(p["seconds"] > 0.0 for p in points)
    curve = [p for p in points if p["method"] == "even steps" and p["role"] == "curve"]
    assert [p["step"] for p in curve] == ["1 ms", "0.5 ms", "0.2 ms", "0.1 ms"]
    errors = [p["errors"][TRACE] for p in curve]
    assert 0.01 > errors[0] > 2.0 * errors[1] > 2.0 * errors[2] > 0.0
    # Near what the reference itself is exact to.
    assert errors[3] < 0.2 * errors[0]
    recognised = [p for p in points if p["recognised"] is not None]
    steps = ["until all stands still", "0.5", "0.1", "0.01", "0.001", "0.0001"]
    assert [p["step"] for p in recognised] == steps
    assert {p["recognised"]["n"] for p in recognised} == {30}
    assert all(p["behind"] for p in recognised[1:])


def with_rates(interval, slowest_s=1.2e-3):
    behind = Difference(0.05, interval)
    points = (
        point("halved", "to the end", 2.0, 0.0, role="reference"),
        evolve(point("errors", "0.5", 1e-3, 0.0), behind=behind),
        evolve(point("errors", "0.001", slowest_s, 0.0), behind=behind),
    )
    return conclusion(evolve(TRADE, points=points))


def test_the_conclusion_says_whether_a_lower_accuracy_saves_time_or_costs_recognition():
    nothing = with_rates((-0.01, 0.11))
    assert "1 to 1.2 ms" in nothing
    assert "hardly a trade-off" in nothing
    assert "hardly" not in with_rates((-0.01, 0.11), slowest_s=1e-2)
    assert "shown at 0.5, 0.001" in with_rates((0.01, 0.09))
    assert "shown at 0.5, 0.001" in with_rates((-0.09, -0.01))


@pytest.mark.slow
def test_without_a_classifier_errors_and_times_are_measured():
    few = ("--scene", "block", "--seeds", "1", "-o", "classifier.type=none")
    points = answered("tradeoff", "simulation", *few)["points"]
    assert all(p["errors"] and p["recognised"] is None for p in points)
