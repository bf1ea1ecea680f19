"""Six scenes that other integrators are compared on, written down once more, apart from the simulator's own code.

    M x'' = u - B x' - N - R,    x: by how much the gap has closed (m); u: effort (N); N: force on the pad; R: friction

Each scene is a system of ordinary differential equations with events, as a user would write it for an integrator:
`rates(s, u, mode, ds)` with the state `s`, the discrete modes and the derivative; `guards(s, u, mode, g)`, each of
which is positive once its event is due; `jump(k, s, u, mode)`, which applies event k; `output(s, mode)`, which gives x,
x' and the force. All are compiled by numba. The controller is `closed_law` at 1 kHz for 7 s, closed in every engine.
For our simulator it is an ordinary controller (`Law`), and the scene is a config and, but for the first, an object file
in `peer_objects/`. The first is the shipped object `light_surface` on a straight drive of constant mass:

    M x'' = u - B x' - f,    m y'' = f - k y - c y',    f = kc max(0, x - y - x0)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import evolve, frozen
from numba import njit

from graspsense.gripper_api import gap_and_rate, revolutions_at
from graspsense.plugin_api import APPROACH, EFFORT, RUNNING, STEADY, Command, Controller
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.drive_models import LINKAGES

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


OBJECTS: Final = Path(__file__).parent / "peer_objects"
MODES: Final = 2
law = njit(closed_law)


@frozen(kw_only=True, eq=False)
class PeerScene:
    """One scene: our config of it, and its equations."""

    name: str
    says: str
    """What it tries, in a phrase."""
    config: SimConfig
    start: Any
    """The state at the beginning."""
    rates: Callable[..., None]
    guards: Callable[..., None]
    jump: Callable[..., None]
    output: Callable[..., tuple[float, float, float]]
    n_guards: int
    positions: tuple[bool, ...]
    """Whether each state is a position, whose rate is another state."""
    inertia: float
    """Of the first coordinate, as MuJoCo's joint has it."""
    scale: Any
    """Typical size of each state, for absolute tolerances."""


def scene_config(name: str, **changes: Any) -> SimConfig:
    """Return our config with the object of this file."""
    return evolve(CONFIG, object=str(OBJECTS / f"{name}.toml"), **changes)


# ----------------------------------------------------------------------------------------- linear contact


@njit
def _surface_force(s: Any) -> float:
    return KC * max(s[0] - s[2] - X0, 0.0)


@njit
def _surface_rates(s: Any, u: float, mode: Any, ds: Any) -> None:
    force = _surface_force(s)
    ds[0], ds[1] = s[1], (u - B * s[1] - force) / M
    ds[2], ds[3] = s[3], (force - K * s[2] - C * s[3]) / LIGHT


@njit
def _surface_guards(s: Any, u: float, mode: Any, g: Any) -> None:
    # The law has a kink where the contact begins and where it ends.
    pressed = s[0] - s[2] - X0
    g[0] = pressed if mode[0] == 0 else -pressed


@njit
def _toggle(k: int, s: Any, u: float, mode: Any) -> None:
    mode[0] = 1 - mode[0]


@njit
def _surface_output(s: Any, mode: Any) -> tuple[float, float, float]:
    return s[0], s[1], _surface_force(s)


# ----------------------------------------------------------------------------------- gas behind a vent

GAS_K, GAS_MAXWELL, GAS_TAU = 1500.0, 1500.0, 0.15
GAS_AREA, GAS_VOLUME, GAS_PRESSURE, GAS_EXPONENT, GAS_VENT = 1.2e-3, 5e-4, 101325.0, 1.4, 1e-6
# Quadratic and linear loss of the sharp-edged opening: p = R q + L q |q|, equal at 8 Pa.
_INERTIAL = 0.5 * 1.2 / (0.6 * GAS_VENT) ** 2
_VISCOUS = 2.0 * math.sqrt(_INERTIAL)


@njit
def _gas_force(s: Any) -> float:
    d = s[0] - X0
    return max(GAS_K * d + s[2] + GAS_AREA * s[3], 0.0) if d > 0.0 else 0.0


@njit
def _gas_rates(s: Any, u: float, mode: Any, ds: Any) -> None:
    d = s[0] - X0
    ds[0], ds[1] = s[1], (u - B * s[1] - _gas_force(s)) / M
    v = s[1] if d > 0.0 else 0.0
    flow = 2.0 * s[3] / (_VISCOUS + math.sqrt(_VISCOUS * _VISCOUS + 4.0 * _INERTIAL * abs(s[3])))
    volume = GAS_VOLUME - GAS_AREA * max(d, 0.0)
    ds[2] = GAS_MAXWELL * v - s[2] / GAS_TAU
    ds[3] = GAS_EXPONENT * (GAS_PRESSURE + s[3]) / volume * (GAS_AREA * v - flow)


@njit
def _touch_guards(s: Any, u: float, mode: Any, g: Any) -> None:
    d = s[0] - X0
    g[0] = d if mode[0] == 0 else -d


@njit
def _gas_output(s: Any, mode: Any) -> tuple[float, float, float]:
    return s[0], s[1], _gas_force(s)


# ------------------------------------------------------------------------------------------ stick and slip

COULOMB, BREAKAWAY, STRIBECK = 3.0, 5.0, 2e-3
WALL_K, WALL_MAXWELL, WALL_TAU = 2000.0, 2000.0, 0.15


@njit
def _wall_force(s: Any) -> float:
    d = s[0] - X0
    return max(WALL_K * d + s[2], 0.0) if d > 0.0 else 0.0


@njit
def _sliding_net(s: Any, u: float, direction: int) -> float:
    x = s[1] / STRIBECK
    friction = COULOMB + (BREAKAWAY - COULOMB) * math.exp(-x * x)
    return u - B * s[1] - _wall_force(s) - direction * friction


@njit
def _friction_rates(s: Any, u: float, mode: Any, ds: Any) -> None:
    # mode[1]: 0 sticks, 1 closes, -1 opens.
    if mode[1] == 0:
        ds[0] = ds[1] = 0.0
    else:
        ds[0], ds[1] = s[1], _sliding_net(s, u, mode[1]) / M
    ds[2] = (WALL_MAXWELL * ds[0] if s[0] > X0 else 0.0) - s[2] / WALL_TAU


@njit
def _friction_guards(s: Any, u: float, mode: Any, g: Any) -> None:
    _touch_guards(s, u, mode, g)
    if mode[1] == 0:
        g[1] = abs(u - _wall_force(s)) - BREAKAWAY
    else:
        # At rest, and not about to be pushed further.
        g[1] = -mode[1] * s[1] if mode[1] * _sliding_net(s, u, mode[1]) <= 0.0 else -1.0


@njit
def _friction_jump(k: int, s: Any, u: float, mode: Any) -> None:
    if k == 0:
        mode[0] = 1 - mode[0]
    elif mode[1] == 0:
        mode[1] = 1 if u > _wall_force(s) else -1
    else:
        s[1], mode[1] = 0.0, 0
        net = u - _wall_force(s)
        if abs(net) > BREAKAWAY:
            mode[1] = 1 if net > 0.0 else -1


@njit
def _friction_output(s: Any, mode: Any) -> tuple[float, float, float]:
    return s[0], s[1], _wall_force(s)


# ------------------------------------------------------------------------------------------------ linkage

LINK = LINKAGES["pr2"]
LINK_K = 2000.0
linkage = njit(gap_and_rate)
_ROTOR = (2.0 * math.pi) ** 2 * CONFIG.rotor_kg_m2


@njit
def _linkage_rates(s: Any, u: float, mode: Any, ds: Any) -> None:
    gap, jacobian = linkage(LINK, s[0])
    force = LINK_K * max(OPEN_M - gap - X0, 0.0)
    ds[0] = s[1]
    ds[1] = jacobian / _ROTOR * (force - u - B * jacobian * s[1])


@njit
def _linkage_guards(s: Any, u: float, mode: Any, g: Any) -> None:
    gap, _ = linkage(LINK, s[0])
    d = OPEN_M - gap - X0
    g[0] = d if mode[0] == 0 else -d


@njit
def _linkage_output(s: Any, mode: Any) -> tuple[float, float, float]:
    gap, jacobian = linkage(LINK, s[0])
    return OPEN_M - gap, -jacobian * s[1], LINK_K * max(OPEN_M - gap - X0, 0.0)


# --------------------------------------------------------------------------------------------------- snap

SNAP_K1, SNAP_AT, SNAP_DROP, SNAP_FALL, SNAP_K2 = 2000.0, 4e-3, 3.0, 5e-4, 4000.0


@njit
def _snap_force(d: float) -> float:
    if d <= SNAP_AT:
        return SNAP_K1 * max(d, 0.0)
    if d < SNAP_AT + SNAP_FALL:
        return SNAP_K1 * SNAP_AT - SNAP_DROP * (d - SNAP_AT) / SNAP_FALL
    return SNAP_K1 * SNAP_AT - SNAP_DROP + SNAP_K2 * (d - SNAP_AT - SNAP_FALL)


@njit
def _snap_rates(s: Any, u: float, mode: Any, ds: Any) -> None:
    ds[0], ds[1] = s[1], (u - B * s[1] - _snap_force(s[0] - X0)) / M


@njit
def _snap_guards(s: Any, u: float, mode: Any, g: Any) -> None:
    # mode[0]: how many of the three corners of the characteristic were passed.
    d = s[0] - X0
    g[0] = g[1] = -1.0
    corner = 0.0 if mode[0] == 0 else (SNAP_AT if mode[0] == 1 else SNAP_AT + SNAP_FALL)
    if mode[0] < 3:
        g[0] = d - corner
    below = 0.0 if mode[0] <= 1 else (SNAP_AT if mode[0] == 2 else SNAP_AT + SNAP_FALL)
    if mode[0] > 0:
        g[1] = below - d


@njit
def _snap_jump(k: int, s: Any, u: float, mode: Any) -> None:
    mode[0] += 1 if k == 0 else -1


@njit
def _snap_output(s: Any, mode: Any) -> tuple[float, float, float]:
    return s[0], s[1], _snap_force(s[0] - X0)


# ----------------------------------------------------------------------------------------------- breaking

HERTZ, CRUSH, BROKEN = 1e6, 10.0, 3000.0


@njit
def _rigid_force(d: float, broken: int) -> float:
    if d <= 0.0:
        return 0.0
    return BROKEN * d if broken == 1 else HERTZ * d * math.sqrt(d)


@njit
def _rigid_rates(s: Any, u: float, mode: Any, ds: Any) -> None:
    ds[0], ds[1] = s[1], (u - B * s[1] - _rigid_force(s[0] - X0, mode[1])) / M


@njit
def _rigid_guards(s: Any, u: float, mode: Any, g: Any) -> None:
    _touch_guards(s, u, mode, g)
    g[1] = _rigid_force(s[0] - X0, 0) - CRUSH if mode[1] == 0 else -1.0


@njit
def _rigid_jump(k: int, s: Any, u: float, mode: Any) -> None:
    if k == 0:
        mode[0] = 1 - mode[0]
    else:
        mode[1] = 1


@njit
def _rigid_output(s: Any, mode: Any) -> tuple[float, float, float]:
    return s[0], s[1], _rigid_force(s[0] - X0, mode[1])


_START_REV = revolutions_at(LINK, OPEN_M)
SCENES: Final = (
    PeerScene(
        name="linear contact",
        says="1 kg meets a light surface (20 g on 2 kN/m, 5 N s/m) through 20 kN/m",
        config=CONFIG,
        start=np.zeros(4),
        positions=(True, False, True, False),
        rates=_surface_rates,
        guards=_surface_guards,
        jump=_toggle,
        output=_surface_output,
        n_guards=1,
        inertia=M,
        scale=np.array([1e-2, 1e-2, 1e-2, 1e-2]),
    ),
    PeerScene(
        name="gas behind a vent",
        says="1 kg compresses half a litre behind 1 mm2, in a wall that is half viscous",
        config=scene_config("gas"),
        start=np.zeros(4),
        positions=(True, False, False, False),
        rates=_gas_rates,
        guards=_touch_guards,
        jump=_toggle,
        output=_gas_output,
        n_guards=1,
        inertia=M,
        scale=np.array([1e-2, 1e-2, 10.0, 1e3]),
    ),
    PeerScene(
        name="stick and slip",
        says="breakaway friction of 5 N above 3 N of Coulomb friction (Stribeck), a wall that relaxes",
        config=scene_config("viscous", coulomb_n=COULOMB, breakaway_n=BREAKAWAY, stribeck_m_s=STRIBECK),
        start=np.zeros(3),
        positions=(True, False, False),
        rates=_friction_rates,
        guards=_friction_guards,
        jump=_friction_jump,
        output=_friction_output,
        n_guards=2,
        inertia=M,
        scale=np.array([1e-2, 1e-2, 10.0]),
    ),
    PeerScene(
        name="linkage",
        says="the PR2's rotor through its linkage (75 to 120 kg on the gap) bounces on 2 kN/m",
        config=scene_config("spring", transmission="pr2"),
        start=np.array([_START_REV, 0.0]),
        positions=(True, False),
        rates=_linkage_rates,
        guards=_linkage_guards,
        jump=_toggle,
        output=_linkage_output,
        n_guards=1,
        inertia=_ROTOR,
        scale=np.array([1e1, 1e1]),
    ),
    PeerScene(
        name="snap",
        says="a shell that snaps through at 8 N, falls by 3 N and stiffens",
        config=scene_config("snap"),
        start=np.zeros(2),
        positions=(True, False),
        rates=_snap_rates,
        guards=_snap_guards,
        jump=_snap_jump,
        output=_snap_output,
        n_guards=2,
        inertia=M,
        scale=np.array([1e-2, 1e-2]),
    ),
    PeerScene(
        name="breaking",
        says="a rigid body (Hertz) that breaks at 10 N",
        config=scene_config("breaking"),
        start=np.zeros(2),
        positions=(True, False),
        rates=_rigid_rates,
        guards=_rigid_guards,
        jump=_rigid_jump,
        output=_rigid_output,
        n_guards=2,
        inertia=M,
        scale=np.array([1e-2, 1e-2]),
    ),
)
