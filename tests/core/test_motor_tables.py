"""The force of a gripper from the load of its motor: tables by a load cell, for both directions."""

import json
from math import inf

import numpy as np
import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.grasp.calibration import LEAST_READINGS, load_within, motor_at, motor_table
from graspsense.core.grasp.calibration_files import Calibration, read_calibration, write_calibration
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.gripper_api import stored_motor_tables

FRICTION_N, NEWTONS = 2.0, 20.0


def readings(seed, count):
    """A geared motor: on the way up friction is lost, on the way down it helps to hold."""
    draws = np.random.default_rng(seed)
    force_n = draws.uniform(0.0, 10.0, count)
    friction_n = FRICTION_N * draws.choice([1.0, -1.0], count)
    return [(max(f + g, 0.0) / NEWTONS, f) for f, g in zip(force_n, friction_n, strict=True)]


@pytest.mark.slow
def test_nine_of_ten_further_readings_are_within_the_error():
    inside = []
    for seed in range(20):
        table = motor_table(readings(seed, 60))
        for motor, load_n in readings(1000 + seed, 50):
            estimate_n, error_n = load_within(table, motor)
            inside.append(abs(estimate_n - load_n) <= error_n)
    # By chance 0.9 +- 0.02, since the readings of a table are its own.
    assert 0.87 < np.mean(inside) < 0.96


def test_friction_is_in_the_error_and_no_force_is_promised_beyond_the_table():
    table = motor_table(readings(1, 200))
    assert FRICTION_N * 0.8 < table.error_n < FRICTION_N * 2.0
    assert load_within(table, table.table.pad_n[-1] * 1.01)[1] == inf
    without = motor_table([(0.05 * i, float(i)) for i in range(12)])
    assert load_within(without, 0.25) == (pytest.approx(5.0), pytest.approx(0.0, abs=1e-9))


@given(st.integers(0, 10_000), st.floats(0.0, 15.0))
def test_the_load_that_is_asked_for_presses_with_at_most_the_force(seed, force_n):
    table = motor_table(readings(seed, 20))
    motor = motor_at(table, force_n)
    assert load_within(table, motor)[0] <= force_n + 1e-9
    assert motor <= table.table.pad_n[-1]


def test_too_few_readings_are_told():
    with pytest.raises(ConfigError, match=str(LEAST_READINGS)):
        motor_table(readings(1, LEAST_READINGS - 1))


def stored(tmp_path, data):
    path = tmp_path / "load-cell.json"
    made = Calibration(kind="load-cell", serial="a-6", device={}, made="2026-01-01T00:00:00+00:00", data=data)
    return write_calibration(path, made)


def test_tables_are_kept_as_they_were(tmp_path):
    closing, opening = motor_table(readings(1, 20)), motor_table(readings(2, 20))
    data = {
        name: {"motor": list(table.table.pad_n), "load_n": list(table.table.load_n), "error_n": table.error_n}
        for name, table in (("closing", closing), ("opening", opening))
    }
    assert stored_motor_tables(stored(tmp_path, data)) == (closing, opening)


@every_case(
    "changed", [{"error_n": -1.0}, {"error_n": None}, {"motor": [0.0, 1.0, 1.0]}, {"load_n": [0.0, 2.0, 1.0]}]
)
def test_damaged_tables_are_told(tmp_path, changed):
    good = {"motor": [0.0, 0.5, 1.0], "load_n": [0.0, 1.0, 2.0], "error_n": 0.5}
    with pytest.raises(DataDamaged):
        stored(tmp_path, {"closing": {**good, **changed}, "opening": good})
    path = tmp_path / "load-cell.json"
    assert json.loads(path.read_text())["kind"] == "load-cell"
    with pytest.raises(DataDamaged):
        read_calibration(path)
