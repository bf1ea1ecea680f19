"""A scene of linear contact and its control law.

    M x'' = u - B x' - f,    m y'' = f - k y - c y',    f = kc max(0, x - y - x0)

M = 1 kg, B = 20 N s/m, m = 20 g, c = 5 N s/m, k = 2 kN/m, kc = 20 kN/m, x0 = 20 mm; 7 s under control at 1 kHz, u held
over each millisecond. For our simulator it is an ordinary scene (`light_surface`) in the shipped loop, on a straight
drive of constant mass with the ideal sensor, x being 70 mm less the gap; the control law is an ordinary controller.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from attrs import frozen

from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    RUNNING,
    STEADY,
    Command,
    Controller,
)
from graspsense_sim_gripper.config import SimConfig

M, B, LIGHT, C, K, KC, X0 = 1.0, 20.0, 0.02, 5.0, 2e3, 2e4, 0.02
TICK, TICKS = 1e-3, 7000
OPEN_M = 0.07
CONFIG = SimConfig(
    object="light_surface",
    spread=False,
    sensor="ideal",
    transmission="straight",
    moving_mass_kg=M,
    coulomb_n=0.0,
    breakaway_n=0.0,
    load_friction_coefficient=0.0,
    damping_n_s_m=B,
    open_gap_m=OPEN_M,
    pad_stiffness_n_m=math.inf,
)


class LawState(NamedTuple):
    phase: int
    outcome: int
    begun_s: float
    integral_n: float
    switched_s: float


class LawParams(NamedTuple):
    seconds: float


def closed_law(
    t: float, x: float, v: float, f: float, integral: float, since: float
) -> tuple[float, float, float]:
    """Return u, the integral and the instant of the switch: a speed of 30 mm/s until 1 N, then a force."""
    if since < 0.0 and f <= 1.0:
        off = 0.03 - v
        integral += 400.0 * off * TICK
        u = 60.0 * off + integral
    else:
        if since < 0.0:
            since = t
        wanted = min(1.0 + 10.0 * (t - since), 15.0)
        if t > 5.0:
            wanted = max(15.0 - 10.0 * (t - 5.0), 5.0)
        u = wanted + (wanted - f) - 40.0 * v
    return min(max(u, -100.0), 100.0), integral, since


def step(params: LawParams, state: LawState, reading: Any) -> tuple[Command, LawState]:
    """The same law as a controller's step."""
    frame = reading.frame
    begun = state.begun_s
    if begun < 0.0:
        begun = frame.t_s
    t = frame.t_s - begun
    u, integral, since = closed_law(
        t, OPEN_M - frame.gap_m, -frame.velocity_m_s, frame.force_left_n, state.integral_n, state.switched_s
    )
    outcome = STEADY if t >= params.seconds - 0.5 * TICK else RUNNING
    return Command(EFFORT, u, math.inf, math.inf), LawState(APPROACH, outcome, begun, integral, since)


class Law(Controller[None]):
    step = staticmethod(step)

    def params(self) -> LawParams:
        return LawParams(TICK * TICKS)

    def init(self) -> LawState:
        return LawState(APPROACH, RUNNING, -1.0, 0.0, -1.0)


@frozen(kw_only=True, eq=False)
class Run:
    """One run: gap closed x (m), force (N) and what was commanded, at each millisecond."""

    x: Any
    force: Any
    u: Any

    def error(self, reference: Run) -> tuple[float, float]:
        """Return the rms error of the force over the peak force, and that of the peak, both relative."""
        peak = float(np.max(reference.force))
        if not np.all(np.isfinite(self.force)):
            return math.inf, math.inf
        rms = float(np.sqrt(np.mean((self.force - reference.force) ** 2))) / peak
        return rms, abs(float(np.max(self.force)) - peak) / peak
