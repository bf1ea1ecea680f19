from __future__ import annotations

import numpy as np

from graspsense_sim_gripper.compiled.noise import compiled_noise, draw_by_numpy


def test_compiled_noise_is_that_of_numpy_to_the_bit_and_leaves_the_generator_in_one_state():
    # Some three in ten thousand numbers are of the tails, which have a formula of their own: here some 600.
    draw, drawn, expected = compiled_noise(), np.zeros((50_000, 44)), np.zeros((50_000, 44))
    rng, other = np.random.default_rng(5), np.random.default_rng(5)

    draw(rng, drawn)
    draw_by_numpy(other, expected)

    assert np.array_equal(drawn.view(np.int64), expected.view(np.int64))
    assert rng.random() == other.random()
