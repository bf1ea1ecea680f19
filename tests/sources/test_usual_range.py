"""The range of a force or a gap does not follow its glitches."""

from cases import every_case
from numpy import append, arange

from graspsense.sources.columns.usual_range import usual_range


@every_case("glitch", [1e6, -1e6])
@every_case("count", [4, 40, 99])
def test_a_single_glitch_does_not_move_the_range(count, glitch):
    low, high = usual_range(append(arange(float(count)), glitch))
    assert 0.0 <= low <= high <= count - 1.0
