"""The error of the fitted values that the finite number of nodes of a path causes, found by simulation.

A fit uses few nodes and means of measurements, whose forces follow from the curvature at a node. So it is biased by a
small, but common part in all squeezes, which no scatter shows. It is estimated as by a parametric bootstrap (Efron and
Tibshirani, An Introduction to the Bootstrap, 1993, chapter 10): the forces of the fitted values on a path with nodes at
all ticks and between them are fitted in place of the measured ones, and what comes back differs by the bias.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense_identify.fit import Fitted
from graspsense_identify.prepare import Squeeze
from graspsense_identify.spread import Uncertainty

Floats = NDArray[np.float64]

LARGEST_BIAS: Final = 0.01
"""A larger change of a logarithm is one along a flat valley of the squares, and no error of the path."""

NODES_PER_TICK: Final = 4
"""Of the fine path. A damper of 40 N s/m behind two fingertips of 30 kN/m each responds within 2.7 ms: with one node at
each tick of 1 ms, most of its error is left."""
SHORTEST: Final = 0.1
"""The shortest distance between two nodes of the fine path, over their usual distance."""


def without_path_error(fitted: Fitted, intervals: Uncertainty) -> tuple[Fitted, Uncertainty]:
    """Return the fit and its uncertainty without the error of the path."""
    factors = np.exp(-path_bias(fitted))
    values = tuple((np.array(fitted.values) * factors).tolist())
    return evolve(fitted, values=values), evolve(
        intervals,
        low=tuple((np.array(intervals.low) * factors).tolist()),
        high=tuple((np.array(intervals.high) * factors).tolist()),
        draws=intervals.draws * factors,
    )


def path_bias(fitted: Fitted) -> Floats:
    """Return by how much the logarithms of the values are too large; zeros if the recordings have no finer path."""
    none = np.zeros(len(fitted.values))
    finest = [on_fine_path(squeeze) for squeeze in fitted.squeezes]
    pairs = list(zip(fitted.squeezes, finest, strict=True))
    if any(len(fine.t_s) <= NODES_PER_TICK * len(squeeze.t_s) for squeeze, fine in pairs):
        return none
    forces = evolve(fitted, squeezes=finest).forces()
    simulated = [
        evolve(squeeze, force_n=_measured(squeeze, fine, force_n))
        for (squeeze, fine), force_n in zip(pairs, forces, strict=True)
    ]
    if not all(np.isfinite(squeeze.force_n).all() for squeeze in simulated):
        return none
    back = evolve(fitted, squeezes=simulated).refitted()
    bias: Floats = np.log(back.values) - np.log(fitted.values)
    return bias if float(np.max(np.abs(bias))) <= LARGEST_BIAS else none


def on_fine_path(squeeze: Squeeze) -> Squeeze:
    """Return the squeeze with `NODES_PER_TICK` nodes for each tick of the recording, each of which is a sample.

    The path reaches to the last measurement of the last mean.
    """
    ticks, gap = squeeze.course
    places = np.arange(NODES_PER_TICK * (len(ticks) - 1) + 1) / NODES_PER_TICK
    t_s = np.interp(places, np.arange(len(ticks)), ticks)
    end_s = squeeze.t_s[-1] + math.sqrt(3.0 * squeeze.averaged_s2[-1])
    part = (t_s > squeeze.t_s[0]) & (t_s < end_s)
    nodes = np.concatenate([squeeze.t_s[:1], t_s[part], [end_s]])
    # Over a step of 1e-15 s, the rate of compression would be arbitrary.
    nodes = nodes[
        np.diff(nodes, prepend=-np.inf) > SHORTEST / NODES_PER_TICK * float(np.median(np.diff(ticks)))
    ]
    return evolve(
        squeeze,
        t_s=nodes,
        gap_m=np.interp(nodes, ticks, gap),
        sample=np.arange(len(nodes)),
        force_n=np.zeros(len(nodes)),
        averaged_s2=np.zeros(len(nodes)),
    )


def _measured(squeeze: Squeeze, fine: Squeeze, force_n: Floats) -> Floats:
    """Return the force at the samples of a squeeze, from that at all nodes of a finer path: the mean over their times.

    Measurements at n evenly spaced times have a variance of (n^2 - 1) / 12 in units of their distance.
    """
    tick_s = float(np.median(np.diff(squeeze.course[0])))
    means = []
    for at_s, variance_s2 in zip(squeeze.t_s[squeeze.sample], squeeze.averaged_s2, strict=True):
        n = round(math.sqrt(1.0 + 12.0 * float(variance_s2) / tick_s**2))
        times = float(at_s) + tick_s * (np.arange(n) - 0.5 * (n - 1))
        means.append(float(np.mean(np.interp(times, fine.t_s, force_n))))
    return np.array(means)
