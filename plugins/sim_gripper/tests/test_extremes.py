"""The extremes that the simulator has to bear: a row of benchmarks/extremes.py a test."""

import importlib.util
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[3] / "benchmarks" / "extremes.py"


def module():
    spec = importlib.util.spec_from_file_location("extremes", BENCHMARK)
    benchmark = importlib.util.module_from_spec(spec)
    sys.modules["extremes"] = benchmark
    spec.loader.exec_module(benchmark)
    return benchmark


extremes = module()
SLOW = {"stiffness_and_mass", "head_space", "vents", "relaxation", "thin_object", "ticks"}
SLOW |= {"stuck", "hertz_energy", "sliding_again", "cyclic", "whole_grasps", "masses", "batches"}


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=pytest.mark.slow if case.__name__ in SLOW else ()) for case in extremes.CASES],
    ids=lambda case: case.__name__,
)
def test_what_must_hold_holds(case):
    rows = list(case(short=True))
    assert rows
    assert [row for row in rows if not row["holds"]] == []
    assert all(row.get("finite", True) for row in rows)


@pytest.mark.long
def test_every_row_holds():
    rows = [row for case in extremes.CASES for row in case(short=False)]
    assert [row for row in rows if not row["holds"]] == []
