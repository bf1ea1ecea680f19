"""A scene of linear contact: its exact solution and its control law.

    M x'' = u - B x' - f,    m y'' = f - k y - c y',    f = kc max(0, x - y - x0)

M = 1 kg, B = 20 N s/m, m = 20 g, c = 5 N s/m, k = 2 kN/m, kc = 20 kN/m, x0 = 20 mm; 7 s under control at 1 kHz, u held
over each millisecond. For our simulator it is an ordinary scene (`light_surface`) in the shipped loop, on a straight
drive of constant mass with the ideal sensor, x being 70 mm less the gap; the control law is an ordinary controller.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from attrs import frozen
from scipy.linalg import expm

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
    """One run: gap closed x (m), force (N) and what was commanded, at each millisecond; processor seconds."""

    x: Any
    force: Any
    u: Any
    seconds: float = math.nan
    what: str = ""

    def error(self, reference: Run) -> tuple[float, float]:
        """Return the rms error of the force over the peak force, and that of the peak, both relative."""
        peak = float(np.max(reference.force))
        if not np.all(np.isfinite(self.force)):
            return math.inf, math.inf
        rms = float(np.sqrt(np.mean((self.force - reference.force) ** 2))) / peak
        return rms, abs(float(np.max(self.force)) - peak) / peak


# ------------------------------------------------------------------------------------------------ exact


def _rates(touching: bool) -> Any:
    """Return the matrix of (x, v, y, w, u, 1)."""
    kc = KC if touching else 0.0
    a = np.zeros((6, 6))
    a[0, 1] = a[2, 3] = 1.0
    a[1, [0, 1, 2, 4, 5]] = np.array([-kc, -B, kc, 1.0, kc * X0]) / M
    a[3, [0, 2, 3, 5]] = np.array([kc, -K - kc, -C, -kc * X0]) / LIGHT
    return a


PIECES = 200


def exact(u_of: Callable[[int, float, float, float], float], ticks: int = TICKS) -> Run:
    """Return the solution by matrix exponentials, looking at the contact 200 times a millisecond and bisecting.

    `u_of(tick, x, v, f)` gives what is commanded at the beginning of each tick.
    """
    rates = {touching: _rates(touching) for touching in (False, True)}
    steps = {touching: expm(a * TICK / PIECES) for touching, a in rates.items()}
    powers = {}
    for touching, piece in steps.items():
        power, rows = np.eye(6), []
        for _ in range(PIECES):
            power = piece @ power
            rows.append(power)
        powers[touching] = np.array(rows)
    state = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    xs, forces, us = np.zeros(ticks), np.zeros(ticks), np.zeros(ticks)
    touching = False
    for tick in range(ticks):
        force = KC * max(state[0] - state[2] - X0, 0.0)
        xs[tick], forces[tick] = state[0], force
        us[tick] = state[4] = u_of(tick, state[0], state[1], force)
        left = TICK
        while left > 0.0:
            path = powers[touching] @ state
            pressed = path[:, 0] - path[:, 2] > X0
            whole = min(int(left / TICK * PIECES + 1e-9), PIECES)
            turned = np.flatnonzero(pressed[:whole] != touching)
            if not len(turned):
                if whole:
                    state = path[whole - 1]
                remainder = left - whole * TICK / PIECES
                if remainder > 1e-15:
                    ahead = expm(rates[touching] * remainder) @ state
                    if (ahead[0] - ahead[2] > X0) != touching:
                        spent, state = _turn(rates[touching], state, touching, remainder)
                        left, touching = remainder - spent, not touching
                        continue
                    state = ahead
                break
            k = int(turned[0])
            last_state = path[k - 1] if k else state
            spent, state = _turn(rates[touching], last_state, touching, TICK / PIECES)
            left -= k * TICK / PIECES + spent
            touching = not touching
    return Run(x=xs, force=forces, u=us, what="exact")


def _turn(rates: Any, state: Any, touching: bool, span: float) -> tuple[float, Any]:
    """Return when within `span` the contact changes, and the state just after."""
    least, most = 0.0, span
    for _ in range(50):
        middle = 0.5 * (least + most)
        ahead = expm(rates * middle) @ state
        if (ahead[0] - ahead[2] > X0) == touching:
            least = middle
        else:
            most = middle
    return most, expm(rates * most) @ state


def exact_closed() -> Run:
    integral, since = 0.0, -1.0

    def u_of(tick: int, x: float, v: float, f: float) -> float:
        nonlocal integral, since
        u, integral, since = closed_law(tick * TICK, x, v, f, integral, since)
        return u

    return exact(u_of)


def exact_open(us: Any) -> Run:
    return exact(lambda tick, x, v, f: float(us[tick]))
