"""The rows of a grasp in the terminal."""

from math import nan

import pytest

from graspsense.cli.live_rows import LiveRows
from graspsense.core.values.signals import EFFORT, NO_PADS, Command, Frame, Phase, Reading


@pytest.mark.parametrize("gap_m", [0.08, nan])
def test_a_gripper_without_pads_or_gap_is_shown_as_often_as_another(gap_m, capsys):
    rows = LiveRows()
    for k in range(300):
        frame = Frame(0.01 * k, 0.01, gap_m, 0.0, 0.0, nan, nan, nan, nan, 0)
        rows.take(Reading(frame, NO_PADS), int(Phase.APPROACH), Command(EFFORT, 0.0, 1.0, 1.0))

    lines = capsys.readouterr().err.splitlines()
    assert 5 <= len(lines) <= 8
    assert "nan" not in "".join(lines)
