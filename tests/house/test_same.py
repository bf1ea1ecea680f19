"""What `benchmarks/same.py` calls the same: every bit, with NaN equal to NaN."""

import math

import numpy as np
import pytest
from same import catalogue, difference, differences

ONE = np.array([1.0, math.nan, -0.0])


@pytest.mark.parametrize(
    "after", [[np.nextafter(1.0, 2.0), math.nan, -0.0], [1.0, 0.0, -0.0], [1.0, math.nan, 0.0]]
)
def test_the_last_bit_a_lost_nan_and_the_sign_of_zero_are_differences(after):
    assert difference("a", ONE, np.array(after)) is not None


def test_recordings_are_compared_by_name(tmp_path):
    np.savez(tmp_path / "before.npz", **{"hybrid|gap": ONE, "hybrid|outcome": np.array([1])})
    np.savez(tmp_path / "after.npz", **{"hybrid|gap": ONE, "hybrid|outcome": np.array([2])})

    count, unlike = differences(tmp_path / "before.npz", tmp_path / "after.npz")

    assert count == 2
    assert [difference.name for difference in unlike] == ["hybrid/outcome"]


def test_every_object_of_the_catalogue_is_compared_in_every_state():
    names = catalogue()

    assert {"odwalla:full_closed", "odwalla_worn:empty_open", "egg", "block"} <= set(names)
    assert "odwalla" not in names
