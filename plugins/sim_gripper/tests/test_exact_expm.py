"""The matrix exponential and its integral, against SciPy."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from graspsense_sim_gripper.exact.expm import MAX_BISECTIONS, exponentials


@pytest.mark.parametrize("halvings", [0, 3, 20, MAX_BISECTIONS])
def test_the_maps_and_their_integrals_are_those_of_scipy(halvings):
    rates = np.array([[0.0, 1.0, 0.0], [-1e6, -250.0, 1e6], [0.0, 0.0, 0.0]])
    maps, integrals = exponentials(rates[None], 1e-3)
    h = math.ldexp(1e-3, -halvings)
    np.testing.assert_allclose(maps[0, halvings], expm(rates * h), rtol=1e-11, atol=1e-13)
    both = np.block([[rates, np.eye(3)], [np.zeros((3, 6))]])
    np.testing.assert_allclose(integrals[0, halvings], expm(both * h)[:3, 3:], rtol=1e-10, atol=1e-16)
