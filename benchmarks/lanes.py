"""What grasps side by side would gain: ticks of the plant one grasp after the other, and several grasps in turn.

    python benchmarks/lanes.py [--repeats 10] [--json] [--short]

In free air, the encoder, the velocity loop and the motion of a tick are the simulator's own functions, compiled for one
grasp and for 4, 8 and 16 grasps, whose states lie side by side in one array. In contact, a plant compiled for
the terms of its object is pressed by a varying effort: one plant, and two plants in turn in one loop. The results are
the same to the bit. Nanoseconds of processor for a tick of a grasp, all ways measured in turn: the median, the least
and the greatest. Simulated.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import time
from collections.abc import Callable, Sequence
from datetime import date
from typing import Any, Final

import numpy as np
from numba import njit

from graspsense.core.transmission import gap_and_rate
from graspsense.plugin_api import bind, create, first_call
from graspsense.plugins.controllers.velocity import closing_effort
from graspsense_sim_gripper.build import unverified_setup
from graspsense_sim_gripper.compiled.compose import composed_move
from graspsense_sim_gripper.compiled.jit import compile_part
from graspsense_sim_gripper.compiled.padding import composition_of, padded
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.drive_models import ENCODER_TICKS
from graspsense_sim_gripper.dynamics.drive import Drive, Friction, stribeck_excess
from graspsense_sim_gripper.dynamics.state import Motion, PlantState
from graspsense_sim_gripper.problem import GraspSetup
from graspsense_sim_gripper.sensing import sense_motion
from graspsense_sim_gripper.stepping.coast import _coasted
from graspsense_sim_gripper.stepping.scheme import PlantParams

OBJECT: Final = "odwalla:full_open"
LANES: Final = (4, 8, 16)
GRASPS: Final = 64
FREE_TICKS: Final = 2000
CONTACT_TICKS: Final = 2000
TICK_S: Final = 1e-3
NUMBERS: Final = 8
"""Numbers of a grasp in free air that change: of the motor and the gap (4), the encoder (3) and the controller (1)."""
INLINED: Final[dict[str, Any]] = {"forceinline": True, "error_model": "numpy", "no_cpython_wrapper": True}

Way = Callable[[], tuple[float, Any]]
"""Runs all ticks and returns the nanoseconds of each, and the states at the end."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="one repeat")
    given = parser.parse_args()
    repeats = 1 if given.short else given.repeats
    rows = {**measured(in_free_air(), repeats), **measured(in_contact(), repeats)}
    made = {"date": date.today().isoformat(), "load": round(os.getloadavg()[0], 1), "repeats": repeats}
    if given.json:
        print(json.dumps({"made": made, "ns_a_tick": rows}, indent=2))
        return
    print(", ".join(f"{key} {value}" for key, value in made.items()))
    for name, row in rows.items():
        same = "same" if row["same"] else "OTHER RESULTS"
        print(f"{name:<28}{row['ns']:7.1f} ns ({row['least']:.1f} to {row['greatest']:.1f}), {same}")


def measured(ways: dict[str, Way], repeats: int) -> dict[str, dict[str, float]]:
    """Return the nanoseconds of a tick in each way, and whether the results are those of the first way."""
    spent: dict[str, list[float]] = {name: [] for name in ways}
    ends = {}
    for k in range(repeats + 1):
        for name, way in ways.items():
            ns, ends[name] = way()
            if k:
                spent[name].append(ns)
    first = ends[next(iter(ways))]
    return {
        name: {
            "ns": statistics.median(of),
            "least": min(of),
            "greatest": max(of),
            "same": bool(np.array_equal(ends[name], first)),
        }
        for name, of in spent.items()
    }


# ------------------------------------------------------------------------------------------------- free air

_shown = njit(**INLINED)(sense_motion)
_effort = njit(**INLINED)(closing_effort)
_moved = njit(**INLINED)(
    bind(
        _coasted, gap_and_rate=njit(**INLINED)(gap_and_rate), stribeck_excess=njit(**INLINED)(stribeck_excess)
    )
)


@njit(**INLINED)  # type: ignore[untyped-decorator]
def _free_tick(constants: Any, friction: Any, now: Any) -> Any:
    """Return the numbers of a grasp after a tick in free air; `friction`: Coulomb and breakaway."""
    plant, sensor, loop = constants
    drive = plant.drive
    coulomb_n, breakaway_n = friction
    own = Friction(coulomb_n, breakaway_n, drive.friction.stribeck_m_s, 0.0, drive.friction.damping_n_s_m)
    drive = Drive(drive.link, drive.inertia, own, drive.closed_rev, drive.open_rev, drive.lag_s)
    revolutions, speed, gap, jacobian, encoder, shown_gap, velocity, integral = now
    motion = Motion(revolutions, speed, gap, jacobian)
    encoder, shown_gap, velocity = _shown(sensor, (encoder, shown_gap, velocity), motion, TICK_S)
    effort, integral = _effort(loop, integral, velocity, TICK_S)
    _, motion = _moved(PlantParams(drive, plant.object, plant.steps), motion, 0.0, effort, TICK_S)
    return (
        motion.revolutions,
        motion.speed_rev_s,
        motion.gap_m,
        motion.jacobian_m_rev,
        encoder,
        shown_gap,
        velocity,
        integral,
    )


@njit(nogil=True, error_model="numpy")  # type: ignore[untyped-decorator]
def _one_by_one(constants: Any, frictions: Any, states: Any, columns: Any) -> None:
    for grasp in range(states.shape[1]):
        s = states[:, grasp]
        now = s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7]
        friction = frictions[0, grasp], frictions[1, grasp]
        for tick in range(FREE_TICKS):
            now = _free_tick(constants, friction, now)
            columns[0, tick], columns[1, tick] = now[5], now[6]
        s[0], s[1], s[2], s[3], s[4], s[5], s[6], s[7] = now


def _side_by_side(n: int) -> Callable[..., None]:
    """Return the same as `_one_by_one` for so many grasps at once."""

    @njit(nogil=True, error_model="numpy")  # type: ignore[untyped-decorator]
    def side_by_side(constants: Any, frictions: Any, states: Any, columns: Any, a: Any) -> None:
        for begin in range(0, states.shape[1], n):
            for lane in range(n):
                for k in range(NUMBERS):
                    a[k * n + lane] = states[k, begin + lane]
            for tick in range(FREE_TICKS):
                for lane in range(n):
                    now = (
                        a[lane],
                        a[n + lane],
                        a[2 * n + lane],
                        a[3 * n + lane],
                        a[4 * n + lane],
                        a[5 * n + lane],
                        a[6 * n + lane],
                        a[7 * n + lane],
                    )
                    friction = frictions[0, begin + lane], frictions[1, begin + lane]
                    now = _free_tick(constants, friction, now)
                    a[lane], a[n + lane], a[2 * n + lane], a[3 * n + lane] = now[0], now[1], now[2], now[3]
                    a[4 * n + lane], a[5 * n + lane], a[6 * n + lane] = now[4], now[5], now[6]
                    a[7 * n + lane] = now[7]
                for lane in range(n):
                    columns[0, tick * n + lane] = a[5 * n + lane]
                    columns[1, tick * n + lane] = a[6 * n + lane]
            for lane in range(n):
                for k in range(NUMBERS):
                    states[k, begin + lane] = a[k * n + lane]

    return side_by_side


def in_free_air() -> dict[str, Way]:
    """Return the ways in free air. The fingers close at the speed of the hybrid controller."""
    config = SimConfig()
    setups = [unverified_setup(config, OBJECT, seed) for seed in range(GRASPS)]
    plant, loop = setups[0].plant, create("controller", "hybrid").params().velocity
    sensor = setups[0].sensor._replace(left=(), right=())
    constants = plant._replace(object=()), sensor, loop
    frictions = np.array(
        [(s.plant.drive.friction.coulomb_n, s.plant.drive.friction.breakaway_n) for s in setups]
    ).T.copy()
    begin_rev = plant.drive.open_rev - 1.0
    gap, jacobian = gap_and_rate(plant.drive.link, begin_rev)
    ticks, speed = float(math.floor(begin_rev * ENCODER_TICKS)), -loop.closing_speed_m_s
    begin = np.array([begin_rev, speed / jacobian, gap, jacobian, ticks, gap, speed, 20.0])

    def way(lanes: int) -> Way:
        run = _one_by_one if lanes == 1 else _side_by_side(lanes)
        rest = () if lanes == 1 else (np.zeros(NUMBERS * lanes),)
        columns = np.zeros((2, FREE_TICKS * lanes))

        def timed() -> tuple[float, Any]:
            states = np.repeat(begin[:, None], GRASPS, axis=1)
            begun = time.thread_time()
            run(constants, frictions, states, columns, *rest)
            return 1e9 * (time.thread_time() - begun) / (GRASPS * FREE_TICKS), states

        return timed

    return {
        "free air, one by one": way(1),
        **{f"free air, {n} side by side": way(n) for n in LANES},
    }


# -------------------------------------------------------------------------------------------------- contact


def _no_move(plant: Any, state: PlantState, effort_n: float, dt_s: float) -> PlantState:
    raise TypeError("in_contact binds a plant")


move: Callable[[Any, PlantState, float, float], PlantState] = _no_move


def _one_plant(first: Any, second: Any, a: PlantState, b: PlantState, ticks: int) -> Any:
    for tick in range(ticks):
        a = move(first, a, 12.0 + 6.0 * math.sin(0.01 * tick), 1e-3)
    for tick in range(ticks):
        b = move(second, b, 12.0 + 6.0 * math.sin(0.01 * tick), 1e-3)
    return a, b


def _two_plants(first: Any, second: Any, a: PlantState, b: PlantState, ticks: int) -> Any:
    for tick in range(ticks):
        effort = 12.0 + 6.0 * math.sin(0.01 * tick)
        a = move(first, a, effort, 1e-3)
        b = move(second, b, effort, 1e-3)
    return a, b


def in_contact() -> dict[str, Way]:
    """Return the ways in contact: two plants one after the other, and in turn."""
    config = SimConfig(sensor="ideal")
    setups = [padded(setup, setup.kinds) for setup in (unverified_setup(config, OBJECT, k) for k in (1, 2))]
    composition = composition_of(setups[0], pad=False)
    plant_move = composed_move(composition, interpreted=False)

    def way(function: Callable[..., Any]) -> Way:
        compiled = compile_part(bind(function, move=plant_move))
        plants = [setup.plant for setup in setups]
        states = [pressed(compiled, setups)[i] for i in (0, 1)]

        def timed() -> tuple[float, Any]:
            begun = time.thread_time()
            ends = compiled(*plants, *states, CONTACT_TICKS)
            spent = time.thread_time() - begun
            return 1e9 * spent / (2 * CONTACT_TICKS), [
                (end.motion.gap_m, end.contact.left_n, end.step.n_steps) for end in ends
            ]

        return timed

    return {"contact, one by one": way(_one_plant), "contact, two in turn": way(_two_plants)}


def pressed(compiled: Callable[..., Any], setups: Sequence[GraspSetup]) -> Any:
    """Return the states in which the fingers have met the object."""
    plants, states = [setup.plant for setup in setups], [setup.state for setup in setups]
    with first_call():
        while states[0].contact.left_n == 0.0:
            states = list(compiled(*plants, *states, 50))
    return states


if __name__ == "__main__":
    main()
