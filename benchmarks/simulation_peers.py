"""Other engines on the same scene: each replays recorded control samples. Simulated; processor time of this thread.

MuJoCo has the scene as an expert would write it for speed: two sliding masses, the contact a tendon with a deadband.
So its contact is the scene's own law and no solver of constraints runs. Drake has it as a system of ordinary
differential equations in C++ (SymbolicVectorSystem) under its integrators with error control. scipy's solvers get the
right-hand side compiled by numba.
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import numpy as np
from simulation_scene import KC, LIGHT, TICK, TICKS, X0, B, C, K, M, Run

SECONDS = TICK * TICKS


def _least_time(repeats: int, run: Callable[[], Any]) -> tuple[float, Any]:
    best, result = math.inf, None
    for _ in range(repeats):
        began = time.thread_time()
        result = run()
        best = min(best, time.thread_time() - began)
    return best, result


# ----------------------------------------------------------------------------------------------- MuJoCo

EXPERT = f"""
<mujoco>
  <option timestep="{{step:.12g}}" integrator="{{integrator}}" gravity="0 0 0">
    <flag contact="disable" constraint="disable"/>
  </option>
  <worldbody>
    <body name="jaw"><joint name="x" type="slide" axis="1 0 0" damping="{B}"/>
      <geom type="sphere" size="0.01" mass="{M}"/></body>
    <body name="surface" pos="0.1 0 0"><joint name="y" type="slide" axis="1 0 0" damping="{C}" stiffness="{K}"/>
      <geom type="sphere" size="0.01" mass="{LIGHT}"/></body>
  </worldbody>
  <tendon><fixed name="contact" stiffness="{KC}" springlength="-1000 {X0}">
    <joint joint="x" coef="1"/><joint joint="y" coef="-1"/></fixed></tendon>
  <actuator><motor joint="x"/></actuator>
</mujoco>
"""
"""`springlength` is a deadband: no force between its ends."""

MUJOCO_STEPS = {
    "Euler": (1, 2, 3, 4, 5, 8, 10, 20, 50),
    "implicitfast": (1, 2, 3, 4, 5, 8, 10, 20, 50),
    "discrete": (1, 2, 4, 8),
    "RK4": (1, 2, 3, 4, 5, 6, 8, 10, 15),
}
"""Steps a millisecond."""


def mujoco_runs(us: Any, repeats: int) -> list[Run]:
    """Return MuJoCo's C rollout with each integrator and step."""
    found = []
    for integrator, counts in MUJOCO_STEPS.items():
        for count in counts:
            found.append(mujoco_run(us, integrator, count, repeats))
    return found


def mujoco_run(us: Any, integrator: str, count: int, repeats: int) -> Run:
    """Return one; what is timed is the one call, which records the states at every step."""
    states, seconds = mujoco_states(
        EXPERT.format(step=TICK / count, integrator=integrator), us, count, repeats
    )
    x, y = states[:, 1], states[:, 2]
    return Run(
        x=x,
        force=KC * np.maximum(x - y - X0, 0.0),
        u=us,
        seconds=seconds,
        what=f"MuJoCo {version('mujoco')} C rollout, {integrator}, {1000 / count:.4g} us",
    )


def mujoco_states(xml: str, us: Any, count: int, repeats: int) -> tuple[Any, float]:
    """Return time and state at each sample of `us` as the C rollout has them, and the least processor time."""
    import mujoco
    from mujoco import rollout

    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    spec = mujoco.mjtState.mjSTATE_FULLPHYSICS.value
    initial = np.zeros((1, mujoco.mj_stateSize(model, spec)))
    mujoco.mj_getState(model, data, initial[0], spec)
    control = np.repeat(us, count)[None, :, None]
    seconds, result = _least_time(repeats, lambda: rollout.rollout(model, data, initial, control))
    return np.concatenate([initial, result[0][0]])[: len(us) * count : count], seconds


# ------------------------------------------------------------------------------------------------- Drake


def drake_runs(us: Any) -> list[Run]:
    """Return Drake's integrators at several accuracies; what is timed includes its log at 1 kHz."""
    return [
        drake_run(us, scheme, accuracy)
        for scheme, accuracies in {
            "runge_kutta3": (1e-3, 1e-4, 1e-5, 1e-6),
            "runge_kutta5": (1e-4, 1e-6, 1e-8),
            "radau3": (1e-3, 1e-5),
            "implicit_euler": (1e-3,),
        }.items()
        for accuracy in accuracies
    ]


def drake_run(us: Any, scheme: str, accuracy: float) -> Run:
    from pydrake.symbolic import Variable
    from pydrake.symbolic import max as larger
    from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
    from pydrake.systems.framework import DiagramBuilder
    from pydrake.systems.primitives import LogVectorOutput, SymbolicVectorSystem, TrajectorySource
    from pydrake.trajectories import PiecewisePolynomial

    x, v, y, w, u = (Variable(name) for name in "xvywu")
    f = KC * larger(x - y - X0, 0.0)
    system = SymbolicVectorSystem(
        state=[x, v, y, w],
        input=[u],
        dynamics=[v, (u - B * v - f) / M, w, (f - K * y - C * w) / LIGHT],
        output=[x, v, y, w],
    )
    builder = DiagramBuilder()
    plant = builder.AddSystem(system)
    times = np.arange(TICKS + 1) * TICK
    held = PiecewisePolynomial.ZeroOrderHold(times, np.append(us, us[-1])[None, :])
    source = builder.AddSystem(TrajectorySource(held))
    builder.Connect(source.get_output_port(), plant.get_input_port())
    log = LogVectorOutput(plant.get_output_port(), builder, publish_period=TICK)
    simulator = Simulator(builder.Build())
    integrator = ResetIntegratorFromFlags(simulator, scheme, 1e-3)
    integrator.set_target_accuracy(accuracy)
    integrator.set_maximum_step_size(TICK)
    simulator.Initialize()
    began = time.thread_time()
    simulator.AdvanceTo(SECONDS)
    seconds = time.thread_time() - began
    found = log.FindLog(simulator.get_context()).data()[:, :TICKS]
    return Run(
        x=found[0],
        force=KC * np.maximum(found[0] - found[2] - X0, 0.0),
        u=us,
        seconds=seconds,
        what=f"Drake {version('drake')} {scheme}, accuracy {accuracy:g}",
    )


# ------------------------------------------------------------------------------------------------- scipy


def scipy_runs(us: Any) -> list[Run]:
    """Return LSODA and Radau at several tolerances, over the whole run with steps of at most a millisecond."""
    wanted = {"LSODA": (1e-3, 1e-6, 1e-8), "Radau": (1e-3, 1e-5)}
    return [scipy_run(us, method, rtol) for method, rtols in wanted.items() for rtol in rtols]


def scipy_run(us: Any, method: str, rtol: float) -> Run:
    import numba
    from scipy.integrate import solve_ivp

    samples = np.ascontiguousarray(us)

    @numba.njit
    def rates(t: float, s: Any) -> Any:
        k = min(int(t / TICK + 1e-9), TICKS - 1)
        f = KC * max(s[0] - s[2] - X0, 0.0)
        return np.array([s[1], (samples[k] - B * s[1] - f) / M, s[3], (f - K * s[2] - C * s[3]) / LIGHT])

    rates(0.0, np.zeros(4))
    times = np.arange(TICKS) * TICK
    began = time.thread_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = solve_ivp(
            rates,
            (0.0, SECONDS),
            np.zeros(4),
            method=method,
            rtol=rtol,
            atol=rtol * 1e-4,
            t_eval=times,
            max_step=TICK,
        )
    seconds = time.thread_time() - began
    x, y = found.y[0], found.y[2]
    return Run(
        x=x,
        force=KC * np.maximum(x - y - X0, 0.0),
        u=us,
        seconds=seconds,
        what=f"scipy {version('scipy')} {method}, rtol {rtol:g}",
    )
