"""The extremes that the simulator has to bear: a row of benchmarks/extremes.py a test."""

import math

import extremes
import pytest

from graspsense.plugin_api import ConfigError
from graspsense_sim_gripper.config import SimConfig


@pytest.mark.parametrize(
    "short",
    [
        pytest.param(True, id="short", marks=pytest.mark.slow),
        pytest.param(False, id="whole", marks=pytest.mark.long),
    ],
)
@pytest.mark.parametrize("case", extremes.CASES, ids=lambda case: case.__name__)
def test_what_must_hold_holds(case, short):
    rows = list(case(short=short))
    assert rows
    assert [row for row in rows if not row["holds"]] == []
    assert all(row.get("finite", True) for row in rows)


def test_what_no_gripper_and_no_object_has_is_refused_by_name():
    wrong = {"rotor_kg_m2": 1e-30, "noise_counts": math.inf, "damping_n_s_m": math.inf, "accuracy": 0.0}
    for name, value in wrong.items():
        with pytest.raises((ConfigError, ValueError, TypeError), match=name):
            SimConfig(**{name: value})
    with pytest.raises(ConfigError, match="width_m"):
        extremes.ready(extremes.BASE, extremes.object_of(width_m=0.2, file="wide.toml"))
