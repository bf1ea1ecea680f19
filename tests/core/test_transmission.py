"""The linkage without fingers: the map of a straight drive and its inverse."""

import pytest

from graspsense.core.drivers.transmission import gap_and_rate, revolutions_at, straight_linkage


@pytest.mark.parametrize("gap_m", [0.0, 0.03, 0.09])
def test_a_straight_drive_moves_the_gap_in_proportion(gap_m):
    link = straight_linkage(4e-4)
    revolutions = revolutions_at(link, gap_m)

    assert revolutions == pytest.approx(gap_m / 4e-4)
    assert gap_and_rate(link, revolutions) == (pytest.approx(gap_m), 4e-4)
