"""The closed form of the PR2's linkage, against its published table and its own inverse."""

import pytest
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense_pr2_gripper.linkage import ENCODER_TICKS, LINKAGES

# Gap (mm), motor revolutions, mm/revolution, um/encoder tick for the delivered gripper: computed from the published
# constants (pr2.urdf.xacro) with the published formula, in its own form (acos and sin of the finger angle).
TABLE = [
    (0, 0.0, 0.4637, 0.386),
    (30, 68.3, 0.4194, 0.349),
    (50, 117.3, 0.3975, 0.331),
    (65, 155.8, 0.3819, 0.318),
    (86, 212.5, 0.3586, 0.299),
]


@every_case(("gap_mm", "revolutions", "rate", "tick_um"), TABLE)
def test_the_delivered_gripper_matches_its_table(gap_mm, revolutions, rate, tick_um):
    link = LINKAGES["pr2"]
    turns = revolutions_at(link, gap_mm / 1e3)
    assert turns == pytest.approx(revolutions, abs=0.06)
    gap, slope = gap_and_rate(link, turns)
    assert gap == pytest.approx(gap_mm / 1e3, abs=1e-9)
    assert slope * 1e3 == pytest.approx(rate, abs=6e-5)
    assert slope * 1e6 / ENCODER_TICKS == pytest.approx(tick_um, abs=6e-4)


@every_case(
    ("name", "gap_mm", "rate"),
    [("pr2_2009", 0, 0.263), ("pr2_2009", 50, 0.241), ("pr2_paper", 0, 0.425), ("pr2_paper", 50, 0.390)],
)
def test_the_sets_of_the_papers_time_have_their_own_ratios(name, gap_mm, rate):
    link = LINKAGES[name]
    _, slope = gap_and_rate(link, revolutions_at(link, gap_mm / 1e3))
    assert slope * 1e3 == pytest.approx(rate, abs=6e-4)


@given(st.sampled_from(sorted(LINKAGES)), st.floats(0.0, 0.09))
def test_gap_to_revolutions_and_back(name, gap_m):
    link = LINKAGES[name]
    gap, rate = gap_and_rate(link, revolutions_at(link, gap_m))
    assert gap == pytest.approx(gap_m, abs=1e-12)
    assert rate > 0.0


@given(st.sampled_from(sorted(LINKAGES)), st.floats(5.0, 200.0))
def test_the_rate_is_the_slope_of_the_gap(name, revolutions):
    link, h = LINKAGES[name], 1e-3
    slope = (gap_and_rate(link, revolutions + h)[0] - gap_and_rate(link, revolutions - h)[0]) / (2 * h)
    assert gap_and_rate(link, revolutions)[1] == pytest.approx(slope, rel=1e-6)
