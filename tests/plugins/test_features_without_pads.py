"""The features of grippers without pads."""

import numpy as np

from graspsense.plugins.features.without_pads import _without_start


def test_the_effort_that_starts_the_fingers_is_not_a_contact():
    gap_m = np.array([0.085, 0.085, 0.084, 0.080, 0.070, 0.0695])
    effort_n = np.array([0.0, 20.0, 7.0, 7.0, 15.0, 20.0])
    assert _without_start(gap_m, effort_n, 10.5).tolist() == [0.0, 0.0, 7.0, 7.0, 15.0, 20.0]
    touching = np.array([0.0, 20.0, 20.0, 20.0, 20.0, 20.0])
    assert _without_start(gap_m, touching, 10.5).tolist() == touching.tolist()
