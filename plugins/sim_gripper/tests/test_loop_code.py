"""What a compiled loop does around the grasp itself, in the interpreter: the noise of its images is drawn in parts."""

import math
from types import SimpleNamespace

import numpy as np
from cases import every_case

from graspsense.simulator_api import bind
from graspsense_sim_gripper.plant.sensing import PadBuffers
from graspsense_sim_gripper.run.compiled.loop_code import (
    FIRST_IMAGES,
    IMAGES_AT_ONCE,
    NO_NOISE,
    CellNoise,
    stored_grasp,
)
from graspsense_sim_gripper.run.loop import Buffers

MOST = FIRST_IMAGES + 3 * IMAGES_AT_ONCE // 2


def state_after(images, *, ended):
    return SimpleNamespace(
        loop=SimpleNamespace(ticks=0, recorded=0, failed=0),
        sensor=SimpleNamespace(images=images),
        controller=SimpleNamespace(
            done=ended, guard=SimpleNamespace(stopped=0), law=SimpleNamespace(outcome=0)
        ),
    )


def run(wanted, *, begin=0, is_drawn=1):
    """Run a grasp that takes `wanted` images and has `begin` of them already; return how it ends, and its images."""
    drawn, seen = [], []
    images = np.full((MOST, 2, 1), 7.0)

    def grasp(params, state, buffers):
        given = buffers.pads.images
        seen.append((len(given), len(drawn)))
        if state.sensor.images == 0:
            # The loop reads it as the image before the first one.
            assert math.isnan(given[-1, 0, 0])
        taken = min(wanted, len(given))
        given[state.sensor.images : taken] = 1.0
        return state_after(taken, ended=1 if wanted < len(given) else 0)

    parts = {
        "grasp": grasp,
        "tuples_of": lambda *given: ((), state_after(begin, ended=0)),
        "store_numbers": lambda array, values: None,
        "draw_image_noise": lambda key, image, row: drawn.append(row),
    }
    noise = CellNoise(is_drawn, NO_NOISE.key)
    pads = PadBuffers(np.zeros(1), np.zeros(1), np.zeros((MOST, 2)), images)
    buffers = Buffers(pads, np.zeros(MOST), np.zeros((1, 1)), np.zeros(1))
    done = bind(stored_grasp, **parts)((), None, (), buffers, noise, None)
    return done, images, seen


@every_case(
    "wanted", [0, FIRST_IMAGES - 1, FIRST_IMAGES, FIRST_IMAGES + 1, FIRST_IMAGES + IMAGES_AT_ONCE, MOST - 1]
)
def test_noise_is_drawn_as_far_as_a_grasp_comes(wanted):
    done, images, seen = run(wanted)
    assert (done.images, done.ended) == (wanted, 1)
    assert (images[:wanted] == 1.0).all()
    sizes = [min(FIRST_IMAGES + k * IMAGES_AT_ONCE, MOST) for k in range(len(seen))]
    # Each part has its noise, and no part is begun that the grasp does not come to.
    assert seen == [(size, size) for size in sizes]
    assert len(sizes) == 1 or sizes[-2] <= wanted


def test_a_grasp_that_takes_all_images_goes_on_in_longer_buffers():
    done, images, seen = run(MOST + 5)
    assert (done.images, done.ended, seen[-1]) == (MOST, 0, (MOST, MOST))
    assert (images == 1.0).all()


def test_a_grasp_that_goes_on_keeps_its_images_and_draws_no_noise_again():
    images_before = MOST - 1
    done, images, seen = run(images_before, begin=images_before, is_drawn=0)
    assert done.ended == 1
    assert seen == [(MOST, 0)]
    # Not even the last one, which is NaN only before the first image.
    assert (images == 7.0).all()
