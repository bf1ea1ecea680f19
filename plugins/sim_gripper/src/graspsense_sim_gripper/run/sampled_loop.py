"""The stability of the sampled loop of controller and fingers, in the approach and on a contact.

A controller acts once a tick. A gain that is stable in continuous time may therefore make deviations of the speed grow
from tick to tick, the more so with a drive that lags. A grasp with such a loop depends on every small error: no model
of the object makes it accurate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.gripper_api import no_pads
from graspsense.plugin_api import Frame, Reading
from graspsense.simulator_api import NOT_FREE, FreeMotion
from graspsense_sim_gripper.plant.fingertip import CELLS
from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.problem import GraspController, GraspSetup

STABLE: Final = 1.0 + 1e-9
"""A loop is stable if no deviation grows by more than this from tick to tick. That of the gap remains as it is."""
DIFFERENCE: Final = 1e-6
"""The change (m, m/s, or units of its memory) of each input by which the law of the controller is linearised."""

TAYLOR_TERMS: Final = 13
LARGEST_NORM: Final = 0.125
"""The Taylor series of an exponential is summed for a duration over which the norm of the matrix is at most this."""

Array = NDArray[np.float64]


def growth_per_tick(setup: GraspSetup, controller: GraspController, chosen: ChosenSteps) -> float | None:
    """Return the factor by which a deviation of the speed grows from tick to tick: at most `STABLE` if it decays.

    It is the spectral radius of the map from tick to tick, linearised at open fingers, of the free mass or of the mass
    on the stiffest contact of the object, whichever is larger. The effort is constant within a tick; a drive that lags
    follows it with its time constant. None if the controller does not declare its law (`Controller.free_motion`) or
    does not command an effort.
    """
    law = _linearised(setup, controller)
    if law is None:
        return None
    drive, dt = setup.plant.drive, setup.dt_s
    mass = drive.inertia / setup.state.motion.jacobian_m_rev**2
    stiffest = mass * (chosen.frequency / dt) ** 2
    rows = tuple(map(tuple, law.tolist()))
    return _growth(rows, mass, drive.friction.damping_n_s_m, stiffest, drive.lag_s, dt)


@lru_cache(maxsize=1024)
def _growth(
    law: tuple[tuple[float, ...], ...],
    mass_kg: float,
    damping_n_s_m: float,
    stiffest_n_m: float,
    lag_s: float,
    dt_s: float,
) -> float:
    """Return what `growth_per_tick` does, given the linearised law; the grasps of many batches have the same."""
    rates = np.array(
        [[[0.0, 1.0], [-stiffness / mass_kg, -damping_n_s_m / mass_kg]] for stiffness in (0.0, stiffest_n_m)]
    )
    return _spectral_radius(np.array(law), rates, 1.0 / mass_kg, lag_s, dt_s)


def instability(setup: GraspSetup, controller: GraspController, chosen: ChosenSteps) -> str:
    """Return why the sampled loop is unstable and what to change; empty if it is stable or cannot be examined."""
    growth = growth_per_tick(setup, controller, chosen)
    if growth is None or growth <= STABLE:
        return ""
    return (
        f"the sampled loop is unstable: a deviation of the speed grows by a factor of {growth:.3g} in each tick of "
        f"{1e3 * setup.dt_s:.3g} ms; lower the gain of the controller, or raise gripper.rate_hz"
    )


def _linearised(setup: GraspSetup, controller: GraspController) -> Array | None:
    """Return the derivatives of (effort, memory) by (gap, rate of the gap, memory); None if there is no law."""
    free: FreeMotion | None = getattr(controller.step, "free_motion", None)
    if free is None:
        return None
    params, state, gap_m = (
        controller.controller.params(),
        controller.controller.init(),
        setup.state.motion.gap_m,
    )
    nan = math.nan
    frame = Frame(
        t_s=0.0,
        dt_s=setup.dt_s,
        gap_m=gap_m,
        velocity_m_s=0.0,
        effort_n=0.0,
        force_left_n=0.0,
        force_right_n=0.0,
        edge_left_n=nan,
        edge_right_n=nan,
        status=0,
    )
    _, state = controller.step(params, state, Reading(frame, no_pads(CELLS)))
    memory, limits = free.begin(params, state, frame)
    if limits == NOT_FREE:
        return None
    given = np.array([gap_m, 0.0, *_numbers(memory)])

    def out(values: Array) -> Array:
        gap, speed, *remembered = values.tolist()
        memory_now = tuple(remembered) if isinstance(memory, tuple) else remembered[0]
        effort, after = free.command(params, memory_now, gap, speed, setup.dt_s)
        return np.array([effort, *_numbers(after)])

    steps = DIFFERENCE * np.eye(len(given))
    return np.array([(out(given + step) - out(given - step)) / (2.0 * DIFFERENCE) for step in steps]).T


def _numbers(memory: Any) -> Sequence[float]:
    return tuple(memory) if isinstance(memory, tuple) else (float(memory),)


def _spectral_radius(law: Array, rates: Array, by_effort: float, lag_s: float, dt_s: float) -> float:
    """Return the largest spectral radius of the maps of closure, speed, effort and memory from tick to tick.

    `rates` are the matrices of closure and speed (1/s), shape (n, 2, 2); an effort of 1 N accelerates by `by_effort`.
    """
    driven = np.array([0.0, by_effort])
    if lag_s > 0.0:
        lagging = np.zeros((len(rates), 3, 3))
        lagging[:, :2, :2], lagging[:, :2, 2], lagging[:, 2, 2] = rates, driven, -1.0 / lag_s
        rates, driven = lagging, np.array([0.0, 0.0, 1.0 / lag_s])
    n, n_memory = len(driven), len(law) - 1
    ahead, integral = _exponential(rates, dt_s)
    # The gap and its rate are the closure and the closing speed with the opposite sign.
    measured = np.zeros((len(law), n + n_memory))
    measured[:, :2], measured[:, n:] = -law[:, :2], law[:, 2:]
    onward = np.zeros((len(rates), n + n_memory, n + n_memory))
    onward[:, :n, :n] = ahead
    onward[:, :n] += (integral @ driven)[:, :, None] * measured[0]
    onward[:, n:] = measured[1:]
    return float(np.max(np.abs(np.linalg.eigvals(onward))))


def _exponential(rates: Array, dt_s: float) -> tuple[Array, Array]:
    """Return exp(A dt) and its integral over 0 to dt, for matrices A (1/s) of shape (n, k, k).

    A Taylor series, with scaling and squaring. E - I is squared instead of E, so that the eigenvalue 1 of a free mass,
    whose place does not matter, is not lost to rounding.
    """
    norm = float(np.abs(rates).sum(axis=-1).max()) * dt_s
    halvings = max(0, math.ceil(math.log2(max(norm, 1e-300) / LARGEST_NORM)))
    h, eye = math.ldexp(dt_s, -halvings), np.eye(rates.shape[-1])
    term, less_eye, integral = np.broadcast_to(eye, rates.shape), np.zeros_like(rates), h * eye
    for k in range(1, TAYLOR_TERMS + 1):
        term = term @ rates * (h / k)
        less_eye = less_eye + term
        integral = integral + h / (k + 1) * term
    for _ in range(halvings):
        integral = 2.0 * integral + less_eye @ integral
        less_eye = 2.0 * less_eye + less_eye @ less_eye
    return eye + less_eye, integral
