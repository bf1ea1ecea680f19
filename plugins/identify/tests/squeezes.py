"""Recordings of squeezes whose forces are known."""

import numpy as np
from attrs import evolve

from graspsense.core.components.identification import RecordedSqueeze
from graspsense.core.values.trace import Trace
from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig
from graspsense_identify.prepare import prepared

WIDTH_M = 0.05
DEPTH_M = 0.008


def recorded(force_of=None, *, hold_s=1.0, speed_m_s=0.02, period_s=0.0):
    """Return a squeeze at constant speed with a hold, whose force is `force_of(closure)`."""
    load_s = DEPTH_M / speed_m_s
    t = np.arange(0.0, 0.3 + load_s + hold_s, 0.002)
    gap = WIDTH_M + 0.3 * speed_m_s - speed_m_s * np.minimum(t, 0.3 + load_s)
    force = (force_of or (lambda closure: 1000.0 * closure))(np.maximum(WIDTH_M - gap, 0.0))
    images = np.arange(0.001, t[-1], period_s) if period_s else np.empty(0)
    if period_s:
        force = force[np.searchsorted(t, images)][np.maximum(np.searchsorted(images, t, side="right") - 1, 0)]
    nothing, whole = np.full(len(t), np.nan), np.zeros(len(t), np.int64)
    unknown = dict.fromkeys(("velocity_m_s", "effort_n", "edge_left_n", "edge_right_n", "command"), nothing)
    cells = np.empty((len(images), 0))
    felt = {"force_left_n": force, "force_right_n": force, "pad_left": cells, "pad_right": cells}
    trace = Trace(t_s=t, gap_m=gap, pad_t_s=images, status=whole, phase=whole, **felt, **unknown)
    return RecordedSqueeze(name="one", sha256="0" * 64, trace=trace)


def grasped(scenes, gripper, *, hold_s=1.0):
    """Return a simulated grasp of each scene with these settings of the gripper; their seeds are 1, 2 and so on."""
    backend, seeds = create("sensor-backend", "sim", **gripper), range(1, 1 + len(scenes))
    run = RunConfig(hold_s=hold_s)
    grasps = backend.run_many(create("controller", "hybrid"), scenes, seeds, run=run, traces=True)
    return [
        RecordedSqueeze(name=str(seed), sha256="0" * 64, trace=grasp.trace, gripper=gripper)
        for seed, grasp in zip(seeds, grasps, strict=True)
    ]


def delayed(squeeze, late_s):
    """Return the recording of a sensor whose forces, and times of images, are late by a number of ticks."""
    trace = squeeze.trace
    ticks = round(late_s / float(np.median(np.diff(trace.t_s))))
    last = len(trace.t_s) - ticks

    def late(force):
        return np.concatenate([np.full(ticks, force[0]), force[:last]])

    forces = {"force_left_n": late(trace.force_left_n), "force_right_n": late(trace.force_right_n)}
    return evolve(squeeze, trace=evolve(trace, pad_t_s=trace.pad_t_s + late_s, **forces))


def ready(force_of=None, **settings):
    """Return the same squeeze as it is fitted, with the noise of no pad."""
    return prepared(recorded(force_of, **settings), 0.0)
