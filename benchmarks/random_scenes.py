"""Random scenes on which the simulator was developed, and what grasps in them with compiled loops. Simulated.

A scene is drawn from the distribution below by its number. It is grasped by the hybrid controller. The error of a grasp
is that of `graspsense_sim_gripper.run.accuracy.error` against another one; a different outcome is an infinite error.
`regimes.py`, `regimes_sensed.py`, `extremes.py`, `same.py` and tests of the simulator use it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np
from attrs import evolve, frozen

from graspsense.plugin_api import HOLD, create
from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.error import GraspRecord, deviation
from graspsense_sim_gripper.run.accuracy.propose import NOT_VERIFIED
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.batch.compiled_grasps import CompiledStart, grasp_compiled
from graspsense_sim_gripper.run.batch.job import FinishedGrasp, Job, grasp_plain, started
from graspsense_sim_gripper.run.buffers import Storage
from graspsense_sim_gripper.run.build import Problem, instantiate
from graspsense_sim_gripper.run.compiled.compose import Composition, composition
from graspsense_sim_gripper.run.compiled.loop_code import CompiledLoops, loop_start
from graspsense_sim_gripper.run.compiled.padding import padded, places_of
from graspsense_sim_gripper.run.model_report import NO_MODEL
from graspsense_sim_gripper.run.problem import GraspController, GraspSetup
from graspsense_sim_gripper.run.sampled_loop import instability
from graspsense_sim_gripper.scene.random_numbers import key_of
from graspsense_sim_gripper.scene.spec import ObjectSpec
from graspsense_sim_gripper.scene.terms.registry import in_order

KINDS: Final = ("elastic", "rigid", "maxwell", "gas", "loss", "foam", "surface", "liquid", "slosh")
"""Every scene is compiled with all of these kinds, of which it keeps its own, so that there are few compositions."""


@frozen(kw_only=True)
class Scene:
    """A scene of the distribution."""

    spec: ObjectSpec
    config: SimConfig
    speed_m_s: float


def drawn_terms(
    rng: np.random.Generator, log: Callable[[float, float], float], stiffness: float
) -> dict[str, dict[str, float]]:
    """Return the terms of an object about this stiff (N/m); `log` draws a number whose logarithm is uniform."""
    terms: dict[str, dict[str, float]] = {}
    body = rng.choice(["elastic", "rigid", "foam"], p=[0.6, 0.25, 0.15])
    if body == "elastic":
        # It stiffens, so that the softest is not pressed flat.
        terms["elastic"] = {"k1_n_m": stiffness, "k3_n_m3": stiffness * log(1e3, 1e5)}
    elif body == "rigid":
        # As stiff as that where it bears 20 N.
        terms["rigid"] = {"hertz_n_m15": (stiffness / 1.5) ** 1.5 / math.sqrt(20.0)}
    elif body == "foam":
        terms["foam"] = {"force_n": 20.0, "at_m": 20.0 / stiffness if stiffness > 1e3 else 0.02}
        terms["foam"] |= {"exponent": rng.uniform(1.2, 3.0), "arm1_n_m": stiffness * log(1e-3, 1.0)}
        terms["foam"] |= {"tau1_s": log(1e-6, 1e6)}
    if rng.random() < 0.9:
        # About 100 kg move with the gap.
        terms["surface"] = {
            "mass_kg": 100.0 * log(1e-3, 1e3),
            "k_n_m": max(stiffness * log(1e-2, 1e2), 500.0),
        }
        terms["surface"] |= {"damping_n_s_m": log(0.1, 1e5), "contact_n_m": stiffness}
    if rng.random() < 0.9:
        terms["maxwell"] = {"k_n_m": stiffness * log(1e-3, 2.0), "tau_s": log(1e-9, 1e9)}
    if rng.random() < 0.9:
        terms["gas"] = {"area_m2": log(1e-4, 2e-3), "area_slope_m": float(rng.choice([0.0, 0.02]))}
        terms["gas"] |= {"volume_m3": log(5e-7, 5e-4), "pressure_pa": 101325.0, "exponent": 1.4}
        terms["gas"] |= {"bulge_m3_pa": log(1e-11, 1e-9), "heat_s": log(1e-3, 1e3)}
        terms["gas"] |= {"vent_m2": 0.0 if rng.random() < 0.2 else log(1e-10, 1e-3)}
    if rng.random() < 0.9:
        terms["loss"] = {"damping_n_s_m": log(1e-3, 1e6)}
    if rng.random() < 0.3:
        terms["liquid"] = {"area_m2": log(1e-4, 2e-3), "neck_m2": log(1e-5, 1e-3), "column_m": log(0.01, 0.1)}
        terms["liquid"] |= {"bulge_m3_pa": log(1e-11, 1e-9), "viscosity_pa_s": log(1e-3, 10.0)}
    if rng.random() < 0.3:
        terms["slosh"] = {"mass_kg": log(1e-3, 3.0), "frequency_hz": log(1.0, 100.0)}
        terms["slosh"] |= {"damping_ratio": log(1e-3, 0.3)}
    return terms


def scene_of(number: int) -> Scene:
    """Return the scene of this number."""
    rng = np.random.default_rng([20261121, number])

    def log(least: float, most: float) -> float:
        return float(math.exp(rng.uniform(math.log(least), math.log(most))))

    stiffness, speed = log(1e2, 1e6), log(1e-3, 0.2)
    terms = drawn_terms(rng, log, stiffness)
    order = list(terms)
    spec = ObjectSpec(
        name=f"scene {number}",
        width_m=0.05,
        offset_m=float(rng.uniform(-2e-3, 2e-3)) if rng.random() < 0.5 else 0.0,
        mass_kg=log(1e-2, 1.0),
        held=bool(rng.random() < 0.3),
        terms=tuple((order[i], terms[order[i]]) for i in in_order(order)),
    )
    # Far enough to reach the speed, near enough for 20 s.
    config = SimConfig(
        sensor="ideal",
        spread=False,
        open_gap_m=spec.width_m + 2.0 * abs(spec.offset_m) + min(max(speed, 3e-3), 0.02),
        damping_n_s_m=log(1.0, 100.0),
        pad_stiffness_n_m=log(1e4, 1e5),
        pad_damping_n_s_m=0.0 if rng.random() < 0.5 else log(1.0, 1e3),
        pad_creep_n_m=0.0 if rng.random() < 0.5 else log(1e3, 3e4),
        pad_creep_s=log(1e-3, 1e3),
    )
    return Scene(spec=spec, config=config, speed_m_s=speed)


def controller_is_stable(setup: GraspSetup, chosen: ChosenSteps) -> bool:
    """Return whether the sampled loop of the hybrid controller is stable, see `sampled_loop.growth_per_tick`."""
    return not instability(setup, GraspController(create("controller", "hybrid"), RunConfig()), chosen)


def record_of(grasp: FinishedGrasp, dt_s: float) -> GraspRecord:
    """Return what a grasp is compared by."""
    trace = grasp.trace
    return GraspRecord(
        outcome=int(grasp.outcome),
        dt_s=dt_s,
        gap_m=trace.gap_m,
        speed_m_s=trace.velocity_m_s,
        left_n=trace.force_left_n,
        right_n=trace.force_right_n,
        n_rows=int(np.sum(trace.phase <= HOLD)),
        hold_from=int(np.sum(trace.phase < HOLD)),
        peak_n=grasp.state.peak_n,
    )


def error_of(grasp: FinishedGrasp, reference: FinishedGrasp, config: SimConfig) -> tuple[float, str]:
    """Return the largest error of all quantities, and the quantity. `config` is that of both grasps."""
    dt = 1.0 / config.rate_hz
    return deviation(record_of(grasp, dt), record_of(reference, dt))


def flags_of(done: FinishedGrasp, chosen: ChosenSteps, config: SimConfig) -> list[str]:
    """Return what the report of a grasp says against its trace; nothing if it is verified."""
    flags = [NOT_VERIFIED] if chosen.unresolved else []
    if done.state.step.unresolved + done.state.contact.unbalanced > 0:
        flags.append("not resolved")
    if chosen.verification is None and config.step_s is None:
        flags.append("not verified")
    return flags


class Bench:
    """Grasps scenes in compiled loops, of which it keeps those that it has compiled, or in the interpreter."""

    def __init__(self, *, compiled: bool = True) -> None:
        self.compiled = compiled
        self._loops: dict[Composition, Any] = {}
        self._storage = Storage()

    def grasp(
        self, scene: Scene, accuracy: float, fidelity: str
    ) -> tuple[FinishedGrasp, GraspSetup, ChosenSteps, Job]:
        """Return the grasp, its setup, its reduced model and its job. Raises ConfigError for a refusal."""
        controller = create("controller", "hybrid", closing_speed_m_s=scene.speed_m_s)
        config = evolve(scene.config, accuracy=accuracy, fidelity=fidelity)
        run = RunConfig(grasp_timeout_s=20.0)
        problem = Problem(config, scene.spec)
        chosen = self.selected(problem, GraspController(controller, run))
        setup = instantiate(problem, chosen, 0)
        job = Job(config=config, controller=controller, run=run, extract=None, traces=True)
        return self.run(job, setup), setup, chosen, job

    def selected(self, problem: Problem, controller: GraspController) -> ChosenSteps:
        """Return the steps that are chosen for a scene. Raises ConfigError for a refusal."""
        return select(problem, controller, compiled=self.compiled, padding=KINDS)

    def run(self, job: Job, setup: GraspSetup) -> FinishedGrasp:
        """Simulate a grasp."""
        if not self.compiled:
            return grasp_plain(job, setup)
        full = padded(setup, KINDS)
        composed = composition(full.kinds, full.plant)
        if composed not in self._loops:
            self._loops[composed] = CompiledLoops(type(job.controller).step).loop_of(composed)
        # Of a seed, but with ideal sensors, which draw nothing.
        key = None if full.sensor.ideal == 1 else key_of(full.seed)
        start = CompiledStart(
            loop_start(*started(job, full)), lambda: full, key, places_of(full.kinds), NO_MODEL
        )
        return grasp_compiled(job, self._loops[composed], start, self._storage)
