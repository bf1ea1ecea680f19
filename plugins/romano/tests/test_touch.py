"""The scenes of the experiments, and the trade of a threshold."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense import load_pipeline
from graspsense_mujoco_gripper.scene import read_scene
from graspsense_romano.findings import SHOCK_THRESHOLDS_M_S2, _ranges, _trade, area
from graspsense_romano.touch import LIFT_S, TouchRow, TouchSettings, measured


@given(st.floats(0.01, 0.5), st.floats(0.0, 0.04))
def test_the_arm_goes_down_at_its_speed_and_meets_the_table_when_it_is_said(tmp_path_factory, speed, rise):
    settings = TouchSettings(lower_m_s=speed, table_rise_m=rise)
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(settings.toml())
    arm = np.array(read_scene(str(path)).scene.arm)
    assert arm[:, 1].max() == pytest.approx(settings.lift_m)
    assert arm[-1, 1] == pytest.approx(0.0, abs=1e-6)
    speeds = np.abs(np.diff(arm[:, 1]) / np.diff(arm[:, 0]))
    assert speeds[arm[:-1, 0] >= settings.disturbed_s].max() <= speed + 0.01
    if rise > 0.011 and settings.lift_m / speed > 0.4:  # while the arm has its full speed
        assert np.interp(settings.down_s, *arm.T) == pytest.approx(rise, abs=1e-3 + 0.1 * speed)
    assert arm[0].tolist() == [LIFT_S, 0.0]


def test_a_table_that_would_reach_the_thing_is_refused():
    with pytest.raises(ValueError, match="table_rise_m"):
        TouchSettings(lower_m_s=0.05, table_rise_m=0.06)


def test_a_trade_counts_what_is_above_each_threshold():
    (table,) = _trade("place", "title", SHOCK_THRESHOLDS_M_S2, [1.5, 4.0, 9.0], [0.5, 2.5])
    told = {row[0]: (row[1][:6], row[2][:6]) for row in table.rows}
    assert told["1"] == ("3 of 3", "1 of 2")
    assert told["3.25"] == ("2 of 3", "0 of 2")
    assert told["5 (published, fast)"] == ("1 of 3", "0 of 2")


NUMBERS = st.lists(st.integers(0, 9), min_size=1, max_size=20)


@given(NUMBERS, NUMBERS)
def test_the_area_under_a_curve_is_the_statistic_of_mann_and_whitney(positive, negative):
    """How often a positive value is above a negative one; equal ones count half."""
    share, least, most = area(positive, negative)
    above = [(p > n) + 0.5 * (p == n) for p in positive for n in negative]
    assert share == pytest.approx(sum(above) / len(above))
    assert 0.0 <= least <= share + 1e-4
    assert share - 1e-4 <= most <= 1.0


def test_the_interval_of_an_area_holds_the_true_area_in_most_samples():
    generator, held = np.random.default_rng(1), 0
    for _ in range(300):
        _, least, most = area(generator.normal(1.0, 1.0, 15), generator.normal(0.0, 1.0, 15))
        held += least <= 0.7602 <= most  # the normal distribution at 1 / sqrt(2)
    assert 0.90 < held / 300 < 0.99


def test_few_values_that_are_told_apart_leave_room_for_doubt():
    assert area([2.0] * 3, [1.0] * 3)[:2] == pytest.approx((1.0, 0.56), abs=0.1)
    assert area([2.0] * 3, [1.0] * 3)[1] < area([2.0] * 30, [1.0] * 30)[1] < 1.0


def test_a_range_says_what_became_of_each_thing():
    rows = [
        TouchRow(outcome="slipped", law="grab", mass_kg=5.0, friction=0.05, needed_n=490.0, limited=True),
        TouchRow(outcome="steady", law="grab", mass_kg=5.0, friction=2.0, needed_n=12.3, greatest_n=13.0),
        TouchRow(outcome="steady", law="grab", mass_kg=0.001, friction=2.0, needed_n=0.0025, greatest_n=1.2),
    ]
    (table,) = _ranges(rows)
    assert table.header[1:] == ("friction 0.05", "friction 2")
    assert table.rows[0][1] == ""
    for row, column, words in (
        (0, 2, ["held, 1.2 N"]),
        (1, 1, ["slipped", "at the limit"]),
        (1, 2, ["held, 13.0 N"]),
    ):
        assert all(word in table.rows[row][column] for word in words)


def grasped(tmp_path, settings, *options):
    path = tmp_path / "scene.toml"
    path.write_text(settings.toml())
    return load_pipeline("hold", options=[f"gripper.object={path}", *options]).grasp()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mass_kg", "friction"),
    [(0.001, 0.05), pytest.param(0.001, 2.0, marks=pytest.mark.long), (5.0, 0.05), (5.0, 2.0)],
)
def test_the_corners_of_weight_and_friction_are_held_or_lost_with_a_reason(tmp_path, mass_kg, friction):
    """With 20 N on each finger: 5 kg need 12.3 N at a friction of 2, and 490 N at 0.05."""
    settings = TouchSettings(mass_kg=mass_kg, friction=friction, lift_s=2.5)
    options = ("controller.type=force-servo", "controller.force_n=20", "run.hold_s=4.5")
    trial = grasped(tmp_path, settings, *options)
    assert np.isfinite(trial.trace.force_left_n).all()
    if mass_kg * 9.81 / (2.0 * friction) > 20.0:
        assert trial.outcome.name == "SLIPPED"
        assert "too heavy" in trial.reason
    else:
        assert trial.outcome.name == "STEADY"
        # The wrist of 6300 N/m yields.
        assert trial.report["highest_m"] == pytest.approx(0.05 - mass_kg * 9.81 / 6300.0, abs=0.005)


@pytest.mark.slow
def test_a_finger_that_is_bumped_tells_a_side_impact(tmp_path):
    settings = TouchSettings(bump_at="finger", bump_kg=0.4, bump_m_s=0.15, bump_touch_s=0.2)
    trial = grasped(tmp_path, settings, "run.hold_s=4")
    quantities = measured(trial.trace, settings)
    assert quantities["edge_at_n"] > 0.2 > quantities["edge_before_n"]
    told = [event.t_s for event in trial.trace.events if event.what == "side impact"]
    contact = next(event.t_s for event in trial.trace.events if event.what == "both in contact")
    assert told
    assert min(told) - contact == pytest.approx(settings.bumped_s + 0.04 / 0.15, abs=0.1)
