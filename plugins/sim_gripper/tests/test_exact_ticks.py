"""Ticks of an exactly discretised plant that are run at once, against the same ticks one by one: equal to the bit."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from attrs import evolve
from linear_scenes import FREE, FRICTION, QUICK, RIGID, SCENES

from graspsense.core.runner import RunConfig
from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    HOLD,
    RUNNING,
    SQUEEZE,
    STEADY,
    Command,
    Controller,
    bind,
    tick,
)
from graspsense_sim_gripper.batch import run_many
from graspsense_sim_gripper.batch.job import Job, Storage, _run
from graspsense_sim_gripper.binding import bind_reachable
from graspsense_sim_gripper.build import unverified_setup
from graspsense_sim_gripper.compiled.compose import composed_move, grasp_loop
from graspsense_sim_gripper.compiled.padding import composition_of
from graspsense_sim_gripper.loop import grasp

SECONDS = 1.6


class LawState(NamedTuple):
    phase: int
    outcome: int
    begun_s: float


class LawParams(NamedTuple):
    seconds: float


def step(params, state, reading):
    """Close, press with a force that swings, let go, and press again; what the sensors show is fed back."""
    frame = reading.frame
    begun = frame.t_s if state.begun_s < 0.0 else state.begun_s
    share = (frame.t_s - begun) / params.seconds
    effort = 25.0 + 40.0 * frame.velocity_m_s + 0.02 * frame.force_left_n
    if share > 0.75:
        effort += 5.0
    elif share > 0.6:
        effort = -12.0 + 40.0 * frame.velocity_m_s
    elif share > 0.35:
        effort += 12.0 * math.sin(50.0 * frame.t_s)
    phase = HOLD if share > 0.9 else SQUEEZE if share > 0.35 else APPROACH
    return Command(EFFORT, effort, math.inf, math.inf), LawState(
        phase, STEADY if share > 0.95 else RUNNING, begun
    )


class Pressing(Controller[None]):
    step = staticmethod(step)

    def params(self):
        return LawParams(SECONDS)

    def init(self):
        return LawState(APPROACH, RUNNING, -1.0)


def grasps(config, spec):
    """Return the end and the buffers of a grasp whose ticks are run at once, and of one with its ticks one by one.

    The third value is the number of ticks that neither of the runs has taken.
    """
    run = RunConfig(hold_s=0.05)
    job = Job(config=config, controller=Pressing(None), run=run, extract=None, traces=True)
    setup = unverified_setup(config, spec, 3)
    composition = composition_of(config, setup, pad=False)
    assert composition.shape is not None
    move, singly = composed_move(composition), []

    def counted(*given):
        singly.append(1)
        return move(*given)

    at_once = bind(grasp_loop(composition, step), move=counted)
    one_by_one = bind_reachable(grasp, {"move": move, "control": bind(tick, step=step)})
    results = [_run(job, setup, loop, Storage()) for loop in (at_once, one_by_one)]
    return *((end.state(), buffers) for end, buffers in results), len(singly)


@pytest.mark.parametrize("sensor", ["ideal", "pads"])
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in {*QUICK, "lag", "damped pads"} else pytest.mark.slow)
        for name in SCENES
    ],
)
def test_ticks_run_at_once_are_ticks_one_by_one(name, sensor):
    change, spec = SCENES[name]
    config = evolve(FRICTION, sensor=sensor, **change)
    (end, buffers), (end1, buffers1), singly = grasps(config, spec)
    assert end == end1
    n, k = end.loop.recorded, end.sensor.images
    for given, expected in (
        *((row[:n], row1[:n]) for row, row1 in zip(buffers.columns, buffers1.columns, strict=True)),
        (buffers.phases[:n], buffers1.phases[:n]),
        (buffers.image_times[:k], buffers1.image_times[:k]),
        (buffers.pads.images[:k], buffers1.pads.images[:k]),
    ):
        np.testing.assert_array_equal(given, expected)
    assert {APPROACH, SQUEEZE, HOLD} <= set(buffers.phases[:n])
    # Off the centre line every tick takes time steps.
    if name not in ("off centre", "table"):
        assert singly < 0.5 * end.loop.ticks


@pytest.mark.parametrize("change", [FREE, {}])
def test_a_run_ends_where_the_object_separates_and_where_the_fingers_stop(change):
    config = evolve(FRICTION, **change, **RIGID)
    (end, buffers), (end1, _), singly = grasps(config, SCENES["rigid"][1])
    assert end == end1
    force = np.array(buffers.columns[4][: end.loop.recorded])
    velocity = np.array(buffers.columns[2][: end.loop.recorded])
    assert ((force[1:] > 0.0) != (force[:-1] > 0.0)).sum() >= 3
    if change == {}:
        assert (velocity == 0.0).sum() > 20
    assert 0 < singly < 0.5 * end.loop.ticks


@pytest.mark.slow
@pytest.mark.parametrize("sensor", ["ideal", "pads"])
def test_a_compiled_grasp_runs_the_same_ticks(sensor):
    config = evolve(FRICTION, sensor=sensor, object="peers_surface", open_gap_m=0.07)
    plain, fast = (
        run_many(config, Pressing(None), [config.object], [1], compiled=compiled)[0]
        for compiled in (False, True)
    )
    assert plain.state == fast.state
    for name in ("t_s", "gap_m", "velocity_m_s", "force_left_n", "command", "phase", "pad_left"):
        np.testing.assert_array_equal(getattr(plain.trace, name), getattr(fast.trace, name))
