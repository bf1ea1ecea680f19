"""Numbers as people read them: none is shown as zero that is not."""

import pytest
from cases import every_case

from graspsense.core.values.units import display_unit, in_column, in_words


@every_case(
    ("value", "unit", "words"),
    [
        (2.5e-4, "m2", "250 mm2"),
        (2.5e-4, "m^2", "250 mm^2"),
        (5e-4, "m3", "500 cm3"),
        (0.05786, "m", "57.86 mm"),
        (-0.0102, "m/s", "-10.2 mm/s"),
        (7.3, "N", "7.3 N"),
        (1.452, "1", "1.452"),
        (9.81, "m/s2", "9.81 m/s2"),
    ],
)
def test_values_are_in_units_of_a_grasp(value, unit, words):
    assert in_words(value, unit) == words


@every_case("value", [1e-12, -4e-5, 6e-4, 0.0012, 0.0578, 12.3, 99_999.0, 1e9])
@every_case("unit", ["m2", "m3", "s", "1/Pa", "kg"])
def test_a_column_shows_no_number_as_zero(value, unit):
    _, factor = display_unit(unit)
    shown = in_column(value * factor)
    assert float(shown) == pytest.approx(value * factor, rel=0.2)
    assert len(shown) >= 9
