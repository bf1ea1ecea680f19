"""The scenes of the experiments, and the trade of a threshold."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from graspsense_mujoco_gripper.scene import read_scene
from graspsense_romano.findings import SHOCK_THRESHOLDS_M_S2, _trade
from graspsense_romano.touch import DISTURBED_S, LIFT_S, TouchSettings


@given(st.floats(0.01, 0.5), st.floats(0.0, 0.04))
def test_the_arm_goes_down_at_its_speed_and_meets_the_table_when_it_is_said(tmp_path_factory, speed, rise):
    settings = TouchSettings(lower_m_s=speed, table_rise_m=rise)
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(settings.toml())
    arm = np.array(read_scene(str(path)).scene.arm)
    assert arm[:, 1].max() == pytest.approx(settings.lift_m)
    assert arm[-1, 1] == pytest.approx(0.0, abs=1e-6)
    speeds = np.abs(np.diff(arm[:, 1]) / np.diff(arm[:, 0]))
    assert speeds[arm[:-1, 0] >= DISTURBED_S].max() <= speed + 0.01
    if rise > 0.011 and settings.lift_m / speed > 0.4:  # while the arm has its full speed
        assert np.interp(settings.down_s, *arm.T) == pytest.approx(rise, abs=1e-3 + 0.1 * speed)
    assert arm[0].tolist() == [LIFT_S[0], 0.0]


def test_a_table_that_would_reach_the_thing_is_refused():
    with pytest.raises(ValueError, match="table_rise_m"):
        TouchSettings(lower_m_s=0.05, table_rise_m=0.06)


def test_a_trade_counts_what_is_above_each_threshold():
    table = _trade("place", "title", "", SHOCK_THRESHOLDS_M_S2, [1.5, 4.0, 9.0], [0.5, 2.5])
    told = {row[0]: (row[1][:6], row[2][:6]) for row in table.rows}
    assert told["1"] == ("3 of 3", "1 of 2")
    assert told["3.25"] == ("2 of 3", "0 of 2")
    assert told["5 (published, fast)"] == ("1 of 3", "0 of 2")
