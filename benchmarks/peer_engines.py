"""The engines that grasp in a scene of `peer_scenes`: the controller is closed in each, and each keeps the same trace.

Every engine is a function that performs one grasp and returns its trace. What comes before the first grasp (compiling,
choosing a model, loading) is set-up and timed apart.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import evolve, frozen
from numba import njit
from peer_scenes import (
    KC,
    LIGHT,
    MODES,
    SCENES,
    TICK,
    TICKS,
    X0,
    B,
    C,
    K,
    Law,
    M,
    PeerScene,
    law,
)
from scipy.integrate import solve_ivp

from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.batch.compiled_grasps import CompiledGrasps
from graspsense_sim_gripper.run.batch.job import Job
from graspsense_sim_gripper.run.batch.scenes import Scenes
from graspsense_sim_gripper.run.compiled.loop_code import CompiledLoops

Trace = tuple[Any, Any, Any]
"""Gap closed (m), force (N) and what was commanded, at each millisecond."""

REFERENCE_STEPS: Final = 64
"""Steps a millisecond of the reference: fourth order, with every event located. Four times as many change the trace of
no scene by more than 3e-12 of the peak force."""
MOST_EVENTS: Final = 200
"""In one step of the reference; more would mean that two modes alternate without end."""


@frozen(kw_only=True, eq=False)
class Engine:
    """A way to integrate a scene: its name, its setting, and the function that performs one grasp."""

    name: str
    setting: str
    grasp: Callable[[], Trace]


# ---------------------------------------------------------------------------------------------------- ours

OUR_SETTINGS: Final[dict[str, dict[str, Any]]] = {
    "as shipped (1 %)": {},
    "accuracy 1e-4": {"accuracy": 1e-4},
    "every term, fixed steps of 1 ms": {"fidelity": "scene", "step_s": 1e-3},
    "every term, fixed steps of 0.1 ms": {"fidelity": "scene", "step_s": 1e-4},
}


def ours(scene: PeerScene) -> Iterator[Callable[[], Engine]]:
    """Yield what prepares our simulator in each setting, as a batch prepares it: with the model that it chooses."""
    for setting, changes in OUR_SETTINGS.items():
        config = evolve(scene.config, **changes)
        yield lambda config=config, setting=setting: _our_engine(config, setting)


def _our_engine(config: SimConfig, setting: str) -> Engine:
    job = Job(config=config, controller=Law(None), run=RunConfig(hold_s=0.0), extract=None, traces=True)
    scenes = Scenes(job)
    scenes.add(config.object, compiled=True)
    grasps = CompiledGrasps(scenes, CompiledLoops(Law.step))
    grasps.grasp(config.object, 0)

    def grasp() -> Trace:
        done = grasps.grasp(config.object, 0)
        assert done is not None
        trace = done.trace
        part = slice(0, TICKS)
        return config.open_gap_m - trace.gap_m[part], trace.force_left_n[part], trace.command[part]

    return Engine(name="graspsense", setting=setting, grasp=grasp)


# ------------------------------------------------------------------------- loops as a user would write them


def empty() -> Trace:
    return np.zeros(TICKS), np.zeros(TICKS), np.zeros(TICKS)


def _engine(name: str, setting: str, loop: Callable[..., None], scene: PeerScene) -> Engine:
    def grasp() -> Trace:
        trace = empty()
        loop(scene.start, *trace)
        return trace

    grasp()
    return Engine(name=name, setting=setting, grasp=grasp)


def settled(scene: PeerScene) -> Any:
    """Return a compiled function that applies what is due, as often as modes change in turn.

    `happened` is an event that was located and applied a moment ago. A root that lies a rounding error before the
    event would otherwise undo it.
    """
    guards, jump, n = scene.guards, scene.jump, scene.n_guards

    @njit
    def settle(s: Any, u: float, mode: Any, g: Any, happened: int = -1) -> None:
        for _ in range(4):
            changed = False
            guards(s, u, mode, g)
            for k in range(n):
                if g[k] > 0.0 and k != happened:
                    jump(k, s, u, mode)
                    changed = True
                    break
            if not changed:
                return

    return settle


def euler(scene: PeerScene, count: int) -> Engine:
    """Return a semi-implicit Euler loop: the speeds first, then the positions. Events count from the end of a step."""
    rates, output, settle, n_guards = scene.rates, scene.output, settled(scene), scene.n_guards
    h, positions = TICK / count, scene.positions

    @njit
    def loop(start: Any, xs: Any, forces: Any, us: Any) -> None:
        s, ds = start.copy(), np.zeros_like(start)
        mode, g = np.zeros(MODES, np.int64), np.zeros(n_guards)
        integral, since = 0.0, -1.0
        for tick in range(TICKS):
            x, v, force = output(s, mode)
            u, integral, since = law(tick * TICK, x, v, force, integral, since)
            xs[tick], forces[tick], us[tick] = x, force, u
            settle(s, u, mode, g)
            for _ in range(count):
                rates(s, u, mode, ds)
                for i in range(len(s)):
                    if not positions[i]:
                        s[i] += h * ds[i]
                rates(s, u, mode, ds)
                for i in range(len(s)):
                    if positions[i]:
                        s[i] += h * ds[i]
                settle(s, u, mode, g)

    return _engine("numba loop, Euler", f"{1e3 / count:g} us", loop, scene)


def _rk4_step(scene: PeerScene) -> Any:
    rates = scene.rates

    @njit
    def step(s: Any, u: float, mode: Any, h: float, k: Any, middle: Any) -> None:
        """Write the state after `h` to `k[4]`."""
        n = len(s)
        rates(s, u, mode, k[0])
        for stage in range(1, 4):
            share = h if stage == 3 else 0.5 * h
            for i in range(n):
                middle[i] = s[i] + share * k[stage - 1, i]
            rates(middle, u, mode, k[stage])
        for i in range(n):
            k[4, i] = s[i] + h / 6.0 * (k[0, i] + 2.0 * k[1, i] + 2.0 * k[2, i] + k[3, i])

    return step


def located_rk4(scene: PeerScene, count: int) -> Engine:
    """Return a Runge-Kutta loop that ends a step at the first event in it; with many steps, the reference."""
    output, guards, jump, n_guards = scene.output, scene.guards, scene.jump, scene.n_guards
    settle, step = settled(scene), _rk4_step(scene)
    whole = TICK / count

    @njit
    def due(s: Any, u: float, mode: Any, g: Any) -> int:
        guards(s, u, mode, g)
        for k in range(n_guards):
            if g[k] > 0.0:
                return k
        return -1

    @njit
    def loop(start: Any, xs: Any, forces: Any, us: Any) -> None:
        n = len(start)
        s, k, middle = start.copy(), np.zeros((5, n)), np.zeros(n)
        mode, g = np.zeros(MODES, np.int64), np.zeros(n_guards)
        integral, since = 0.0, -1.0
        for tick in range(TICKS):
            x, v, force = output(s, mode)
            u, integral, since = law(tick * TICK, x, v, force, integral, since)
            xs[tick], forces[tick], us[tick] = x, force, u
            settle(s, u, mode, g)
            for _ in range(count):
                left = whole
                for _ in range(MOST_EVENTS):
                    step(s, u, mode, left, k, middle)
                    if due(k[4], u, mode, g) < 0:
                        s[:] = k[4]
                        break
                    least, most = 0.0, left
                    for _ in range(60):
                        h = 0.5 * (least + most)
                        step(s, u, mode, h, k, middle)
                        if due(k[4], u, mode, g) < 0:
                            least = h
                        else:
                            most = h
                    step(s, u, mode, most, k, middle)
                    s[:] = k[4]
                    jump(due(s, u, mode, g), s, u, mode)
                    left -= most
                    if left <= 0.0:
                        break

    return _engine("numba loop, RK4, events located", f"{1e3 / count:g} us", loop, scene)


def loops(scene: PeerScene) -> Iterator[Callable[[], Engine]]:
    """Yield what prepares each loop."""
    for count in (1, 4, 16):
        yield lambda count=count: euler(scene, count)
    for count in (1, 4):
        yield lambda count=count: located_rk4(scene, count)


# ------------------------------------------------------------------------------- solvers with error control


def _piecewise(scene: PeerScene, solve: Callable[..., tuple[float, Any, int]]) -> Trace:
    """Grasp with a solver that is started anew at each tick and after each event.

    `solve(s, u, mode, t)` integrates from `t` (s) to the end of the tick, or to the first event before it, and returns
    the time, the state and the number of the event (-1: none).
    """
    xs, forces, us = empty()
    s, mode, g = scene.start.copy(), np.zeros(MODES, np.int64), np.zeros(scene.n_guards)
    settle = settled(scene)
    integral, since = 0.0, -1.0
    for tick in range(TICKS):
        x, v, force = scene.output(s, mode)
        u, integral, since = law(tick * TICK, x, v, force, integral, since)
        xs[tick], forces[tick], us[tick] = x, force, u
        settle(s, u, mode, g)
        t = 0.0
        while t < TICK * (1.0 - 1e-12):
            t, s, event = solve(s, u, mode, t)
            if event >= 0:
                scene.jump(event, s, u, mode)
                settle(s, u, mode, g, event)
    return xs, forces, us


def scipy_engine(scene: PeerScene, method: str, rtol: float) -> Engine:
    """Return SciPy's solver with the compiled right-hand side."""
    ds, g = np.zeros_like(scene.start), np.zeros(scene.n_guards)

    def solve(s: Any, u: float, mode: Any, t: float) -> tuple[float, Any, int]:
        def rates(_: float, y: Any) -> Any:
            scene.rates(y, u, mode, ds)
            return ds.copy()

        def guard(k: int) -> Any:
            def value(_: float, y: Any) -> float:
                scene.guards(y, u, mode, g)
                return float(g[k])

            value.terminal, value.direction = True, 1.0  # type: ignore[attr-defined]
            return value

        solution = solve_ivp(
            rates,
            (t, TICK),
            s,
            method=method,
            rtol=rtol,
            atol=rtol * scene.scale,
            events=[guard(k) for k in range(scene.n_guards)],
        )
        fired = [k for k, times in enumerate(solution.t_events) if len(times)]
        return solution.t[-1], solution.y[:, -1].copy(), fired[0] if fired else -1

    return Engine(
        name=f"SciPy {method}, restarted",
        setting=f"rtol {rtol:g}",
        grasp=lambda: _piecewise(scene, solve),
    )


def cvode_engine(scene: PeerScene, method: str, rtol: float) -> Engine:
    """Return SUNDIALS' CVODE (scikit-sundae) with the compiled right-hand side."""
    from sksundae.cvode import CVODE

    held: dict[str, Any] = {}

    def rates(_: float, y: Any, yp: Any) -> None:
        scene.rates(y, held["u"], held["mode"], yp)

    def guards(_: float, y: Any, g: Any) -> None:
        scene.guards(y, held["u"], held["mode"], g)

    guards.terminal, guards.direction = [True] * scene.n_guards, [1] * scene.n_guards  # type: ignore[attr-defined]
    solver = CVODE(
        rates,
        method=method,
        rtol=rtol,
        atol=rtol * scene.scale,
        eventsfn=guards,
        num_events=scene.n_guards,
        max_num_steps=100_000,
    )
    g = np.zeros(scene.n_guards)

    def solve(s: Any, u: float, mode: Any, t: float) -> tuple[float, Any, int]:
        held["u"], held["mode"] = u, mode
        solver.init_step(t, s)
        point = solver.step(TICK, tstop=TICK)
        y = np.array(point.y)
        if point.t >= TICK:
            return point.t, y, -1
        # The root is a rounding error before or after the event.
        scene.guards(y, u, mode, g)
        return point.t, y, int(np.argmax(g))

    return Engine(
        name=f"CVODE {method}, restarted", setting=f"rtol {rtol:g}", grasp=lambda: _piecewise(scene, solve)
    )


def solvers(scene: PeerScene) -> Iterator[Callable[[], Engine]]:
    """Yield what prepares each solver."""
    yield lambda: scipy_engine(scene, "Radau", 1e-4)
    if find_spec("sksundae") is not None:
        for method in ("BDF", "Adams"):
            yield lambda method=method: cvode_engine(scene, method, 1e-6)


# -------------------------------------------------------------------------------------------------- MuJoCo

NATIVE = f"""
<mujoco>
  <option timestep="{{step:.12g}}" integrator="Euler" gravity="0 0 0">
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
</mujoco>
"""
"""Linear contact in MuJoCo's own terms; `springlength` is a deadband, with no force between its ends."""

APPLIED = """
<mujoco>
  <option timestep="{step:.12g}" integrator="Euler" gravity="0 0 0">
    <flag contact="disable" constraint="disable"/>
  </option>
  <worldbody>
    <body><joint name="x" type="slide" axis="1 0 0" armature="{armature:.17g}"/>
      <geom type="sphere" size="0.01" mass="1e-6"/></body>
  </worldbody>
</mujoco>
"""
"""A joint with the inertia of the drive; the loop applies the force of object and friction in each step."""


def mujoco_engine(scene: PeerScene, count: int) -> Engine:
    """Return MuJoCo's step, called as C from the compiled loop, with the controller closed.

    In the first scene object and contact are MuJoCo's own springs and dampers, with its own implicit treatment of
    dampers. Elsewhere the loop computes the force in each step and integrates the states that are not the joint's.
    """
    import mujoco

    # The profiling clock that the Python package installs takes a large part of each step.
    mujoco.set_mjcb_time(None)
    h, native, inertia = TICK / count, scene is SCENES[0], scene.inertia
    xml = NATIVE if native else APPLIED
    model = mujoco.MjModel.from_xml_string(xml.format(step=h, armature=inertia - 1e-6))
    data = mujoco.MjData(model)
    (library,) = Path(mujoco.__file__).parent.glob("libmujoco.so*")
    mj_step = ctypes.CDLL(str(library)).mj_step
    mj_step.argtypes, mj_step.restype = (ctypes.c_size_t, ctypes.c_size_t), None
    model_at, data_at = model._address, data._address
    rates, output, settle, n_guards = scene.rates, scene.output, settled(scene), scene.n_guards

    @njit
    def loop(start: Any, xs: Any, forces: Any, us: Any, position: Any, speed: Any, applied: Any) -> None:
        s, ds = start.copy(), np.zeros_like(start)
        mode, g = np.zeros(MODES, np.int64), np.zeros(n_guards)
        integral, since = 0.0, -1.0
        for tick in range(TICKS):
            x, v, force = output(s, mode)
            u, integral, since = law(tick * TICK, x, v, force, integral, since)
            xs[tick], forces[tick], us[tick] = x, force, u
            settle(s, u, mode, g)
            for _ in range(count):
                if native:
                    applied[0] = u
                    mj_step(model_at, data_at)
                    s[0], s[1], s[2], s[3] = position[0], speed[0], position[1], speed[1]
                    continue
                rates(s, u, mode, ds)
                position[0], speed[0] = s[0], s[1]
                applied[0] = inertia * ds[1]
                mj_step(model_at, data_at)
                s[0], s[1] = position[0], speed[0]
                for i in range(2, len(s)):
                    s[i] += h * ds[i]
                settle(s, u, mode, g)

    def grasp() -> Trace:
        mujoco.mj_resetData(model, data)
        trace = empty()
        loop(scene.start, *trace, data.qpos, data.qvel, data.qfrc_applied)
        return trace

    grasp()
    how = "own springs" if native else "forces applied"
    return Engine(
        name=f"MuJoCo {mujoco.__version__} Euler", setting=f"{how}, {1e3 / count:g} us", grasp=grasp
    )


def mujoco_engines(scene: PeerScene) -> Iterator[Callable[[], Engine]]:
    """Yield what prepares MuJoCo, if it is installed."""
    if find_spec("mujoco") is not None:
        for count in (1, 4):
            yield lambda count=count: mujoco_engine(scene, count)


def prepared(prepare: Callable[[], Engine]) -> tuple[Engine, float]:
    """Return the engine, ready to grasp, and the processor time (s) of its set-up."""
    began = time.thread_time()
    engine = prepare()
    return engine, time.thread_time() - began


def timed(engine: Engine) -> tuple[Trace, float]:
    """Return one grasp, and its processor time (s)."""
    began = time.thread_time()
    run = engine.grasp()
    return run, time.thread_time() - began
