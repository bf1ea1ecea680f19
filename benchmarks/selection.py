"""Whether grasps have the accuracy that is asked for, on random scenes. Simulated.

    python benchmarks/selection.py [--scenes 500] [--first 0] [--json | --table] [--short]

A scene is drawn from the distribution below by its number. It is grasped by the hybrid controller, with ideal sensors,
in the steps that are chosen for an error of 10 %, 1 % and 0.1 %, and in the reference, in which the steps of each tick
are halved until the result no longer changes, starting from an accuracy of 0.01 %. The error is that of
`graspsense_sim_gripper.run.accuracy.error`; a different outcome is an infinite error, and a refusal is a miss.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import time
from collections import Counter
from datetime import date
from importlib.metadata import version
from typing import Any, Final

import numpy as np
from attrs import evolve, frozen

from graspsense.plugin_api import HOLD, ConfigError, create
from graspsense.simulator_api import RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.error import GraspRecord, deviation
from graspsense_sim_gripper.run.accuracy.model import Reduction
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.batch.buffers import Storage
from graspsense_sim_gripper.run.batch.compiled_grasps import CompiledStart, grasp_compiled
from graspsense_sim_gripper.run.batch.job import FinishedGrasp, Job, started
from graspsense_sim_gripper.run.build import Problem, instantiate
from graspsense_sim_gripper.run.compiled.compose import Composition
from graspsense_sim_gripper.run.compiled.loop_code import CompiledLoop, CompiledLoops, loop_start
from graspsense_sim_gripper.run.compiled.padding import composition_of, layout_of, padded
from graspsense_sim_gripper.run.model_report import NO_MODEL
from graspsense_sim_gripper.run.problem import GraspController, GraspSetup
from graspsense_sim_gripper.run.sampled_loop import instability
from graspsense_sim_gripper.scene.random_numbers import key_of
from graspsense_sim_gripper.scene.spec import ObjectSpec
from graspsense_sim_gripper.scene.terms.registry import in_order

ACCURACIES: Final = (0.1, 0.01, 0.001)
REFERENCE: Final = 1e-4
KINDS: Final = ("elastic", "rigid", "maxwell", "gas", "loss", "foam", "surface", "liquid", "slosh")
"""Every scene is compiled with all of these kinds, of which it keeps its own, so that there are few compositions."""


@frozen(kw_only=True)
class Scene:
    """A scene of the distribution."""

    number: int
    spec: ObjectSpec
    config: SimConfig
    speed_m_s: float


def scene_of(number: int) -> Scene:
    """Return the scene of this number."""
    rng = np.random.default_rng([20261121, number])

    def log(least: float, most: float) -> float:
        return float(math.exp(rng.uniform(math.log(least), math.log(most))))

    stiffness, speed = log(1e2, 1e6), log(1e-3, 0.2)
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
    return Scene(number=number, spec=spec, config=config, speed_m_s=speed)


def controller_is_stable(setup: GraspSetup, reduction: Reduction) -> bool:
    """Return whether the sampled loop of the hybrid controller is stable, see `sampled_loop.growth_per_tick`."""
    return not instability(setup, GraspController(create("controller", "hybrid"), RunConfig()), reduction)


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


def error_of(grasp: FinishedGrasp, reference: FinishedGrasp) -> tuple[float, str]:
    """Return the largest error of all quantities, and the quantity."""
    dt = 1.0 / SimConfig().rate_hz
    return deviation(record_of(grasp, dt), record_of(reference, dt))


class Bench:
    """The compiled loops, and what runs scenes in them."""

    def __init__(self) -> None:
        self.compiled: dict[Composition, Any] = {}
        self.storage = Storage()
        self.selection_s = self.compile_s = 0.0

    def grasp(
        self, scene: Scene, accuracy: float, fidelity: str
    ) -> tuple[FinishedGrasp, GraspSetup, Reduction, Job]:
        """Return the grasp, its setup, its reduced model and its job. Raises ConfigError for a refusal."""
        controller = create("controller", "hybrid", closing_speed_m_s=scene.speed_m_s)
        config = evolve(scene.config, accuracy=accuracy, fidelity=fidelity)
        run = RunConfig(grasp_timeout_s=20.0)
        problem = Problem(config, scene.spec)
        began = time.thread_time()
        reduction = select(problem, GraspController(controller, run), compiled=True, padding=KINDS)
        self.selection_s = time.thread_time() - began
        setup = instantiate(problem, reduction, 0)
        job = Job(config=config, controller=controller, run=run, extract=None, traces=True)
        full = padded(setup, KINDS)
        loop = self.loop_of(config, full, type(controller).step)
        return compiled_grasp(job, full, loop, self.storage), setup, reduction, job

    def loop_of(self, config: SimConfig, setup: GraspSetup, step: Any) -> Any:
        """Return the compiled loop of a padded setup."""
        composition = composition_of(setup, pad=False)
        if composition not in self.compiled:
            began = time.process_time()
            loop = CompiledLoops(step).loop_of(composition)
            controller = create("controller", "hybrid")
            short = RunConfig(grasp_timeout_s=0.01)
            job = Job(config=config, controller=controller, run=short, extract=None, traces=True)
            compiled_grasp(job, setup, loop, self.storage)
            self.compiled[composition] = loop
            self.compile_s += time.process_time() - began
        return self.compiled[composition]


def compiled_grasp(job: Job, setup: GraspSetup, loop: CompiledLoop, storage: Storage) -> FinishedGrasp:
    """Simulate a grasp that is padded for this loop."""
    key = None if setup.sensor.ideal == 1 else key_of(setup.seed)
    layout = layout_of(setup, setup.kinds)
    start = CompiledStart(loop_start(*started(job, setup)), lambda: setup, key, layout, NO_MODEL)
    return grasp_compiled(job, loop, start, storage)


def measure(bench: Bench, numbers: range) -> dict[str, Any]:
    """Return the errors of these scenes."""
    rows: list[dict[str, Any]] = []
    unstable = 0
    for number in numbers:
        scene = scene_of(number)
        reference, setup, reduction, _ = bench.grasp(scene, REFERENCE, "reference")
        if not controller_is_stable(setup, reduction):
            unstable += 1
            continue
        row: dict[str, Any] = {"scene": number, "outcome": reference.outcome.name}
        for accuracy in ACCURACIES:
            case: dict[str, Any] = {"error": math.inf}
            row[f"{accuracy:g}"] = case
            try:
                done, _, reduction, _ = bench.grasp(scene, accuracy, "scene")
            except ConfigError as error:
                case["refused"] = str(error)
                continue
            case["error"], case["quantity"] = error_of(done, reference)
            case["steps"], case["selection_s"] = done.state.step.n_steps, bench.selection_s
            level = reduction.level
            case["level"] = "a step per tick" if level.plain == 1 else f"{level.step_tol / accuracy:.3g}"
            verification = reduction.verification
            case["verified"] = None if verification is None else verification.error
        rows.append(row)
        print(f"\r{len(rows)} scenes", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return {
        **summary(rows),
        "left_out_unstable": unstable,
        "compiled": len(bench.compiled),
        "rows": rows,
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of these scenes, by accuracy where they have one."""
    within, worst, middle, refused, levels, selection = {}, {}, {}, {}, {}, {}
    for accuracy in ACCURACIES:
        cases = [row[f"{accuracy:g}"] for row in rows]
        run = [case["error"] / accuracy for case in cases if "refused" not in case]
        within[accuracy] = sum(case["error"] <= accuracy for case in cases) / len(rows)
        worst[accuracy] = max(run, default=math.inf)
        middle[accuracy] = float(np.median(run)) * accuracy if run else math.inf
        refused[accuracy] = sum("refused" in case for case in cases)
        levels[accuracy] = dict(Counter(case.get("level", "refused") for case in cases))
        seconds = [case["selection_s"] for case in cases if "selection_s" in case]
        selection[accuracy] = float(np.median(seconds) * 1e3)
    return {
        "scenes": len(rows),
        "within": within,
        "worst": worst,
        "median_error": middle,
        "refused": refused,
        "levels": levels,
        "selection_ms": selection,
    }


def table(result: dict[str, Any]) -> str:
    """Return the figures in Markdown."""
    lines = [
        f"{result['scenes']} scenes, seeds {result['seeds'][0]} to {result['seeds'][1]}, "
        f"{result['left_out_unstable']} more left out because the controller itself is unstable; {result['date']}, "
        f"{result['machine']}, Python {result['python']}.",
        "",
        "| accuracy | within | median error | largest error over accuracy | refused | levels: tolerances over it |",
        "|---|---|---|---|---|---|",
    ]
    for accuracy in ACCURACIES:
        within = round(result["within"][accuracy] * result["scenes"])
        levels = ", ".join(f"{name}: {n}" for name, n in sorted(result["levels"][accuracy].items()))
        lines.append(
            f"| {accuracy:g} | {within} of {result['scenes']} | {result['median_error'][accuracy]:.1e} "
            f"| {result['worst'][accuracy]:.2f} | {result['refused'][accuracy]} | {levels} |"
        )
    lines += [
        "",
        f"Selecting took {result['selection_ms'][0.01]:.0f} ms at 1 %.",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true")
    form.add_argument("--table", action="store_true", help="Markdown, as in benchmarks/results/simulator.md")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    if given.short:
        given.scenes = 1
    bench = Bench()
    result = {
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "graspsense-sim-gripper": version("graspsense-sim-gripper"),
        "seeds": [given.first, given.first + given.scenes - 1],
        **measure(bench, range(given.first, given.first + given.scenes)),
        "compile_s": bench.compile_s,
    }
    if given.json:
        print(json.dumps(result, indent=2, default=str))
        return
    if given.table:
        print(table(result))
        return
    rows = result.pop("rows")
    for key, value in result.items():
        print(f"{key:<28}{value}")
    print("\nmisses")
    for row in rows:
        for accuracy in ACCURACIES:
            case = row[f"{accuracy:g}"]
            if case["error"] > accuracy:
                what = case.get("refused") or (
                    f"{case['error']:<10.3g} {case['quantity']:<10} {case['verified']} {case['level']}"
                )
                print(f"{row['scene']:>6} {accuracy:<8g}{what}")


if __name__ == "__main__":
    main()
