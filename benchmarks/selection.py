"""Whether reduced models have the accuracy asked for, and what they save, on random scenes. Simulated.

    python benchmarks/selection.py [--scenes 500] [--first 0] [--costs 100] [--json | --table] [--short]

A scene is drawn from the distribution below by its number. It is grasped by the hybrid controller, with ideal sensors,
in the reduced model for an error of 10 %, 1 % and 0.1 %, once more at 1 % with every term, and in the reference: every
term, and the steps of each tick halved until the result no longer changes, starting from an accuracy of 0.01 %. The
error is that of `graspsense_sim_gripper.reduction.error`; a different outcome is an infinite error, and a refusal is a
miss. `cost_ratio` is the median time of the compiled loop at 1 % over that of the full model, compiled and stepped by
the same rule. Selecting the model, compiling and computing matrix exponentials count in neither. It is measured on the
first scenes only, since each model is compiled for the terms that it keeps, which takes seconds.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from datetime import date
from importlib.metadata import version
from multiprocessing import get_context
from typing import Any, Final

import numpy as np
from attrs import evolve, frozen
from timed_loop import TimedLoop

from graspsense.plugin_api import HOLD, ConfigError, RunConfig, create
from graspsense_sim_gripper.batch.job import FinishedGrasp, Job, Storage, grasp_once
from graspsense_sim_gripper.build import instantiate, problem_of
from graspsense_sim_gripper.compiled.compose import Composition
from graspsense_sim_gripper.compiled.loop_code import CompiledLoops
from graspsense_sim_gripper.compiled.padding import composition_of, padded
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.spec import ObjectSpec
from graspsense_sim_gripper.problem import GraspController, GraspSetup
from graspsense_sim_gripper.reduction.error import GraspRecord, deviation
from graspsense_sim_gripper.reduction.model import Reduction
from graspsense_sim_gripper.reduction.select import select
from graspsense_sim_gripper.sampled_loop import instability
from graspsense_sim_gripper.terms.registry import in_order

ACCURACIES: Final = (0.1, 0.01, 0.001)
CASES: Final = (*((f"{accuracy:g}", accuracy, "scene") for accuracy in ACCURACIES), ("full", 0.01, "full"))
"""Name, accuracy and fidelity of each model that a scene is grasped in."""
REFERENCE: Final = 1e-4
COSTS_AT: Final = 0.01
REPEATS: Final = 7
SCENES_PER_PROCESS: Final = 4
KINDS: Final = ("elastic", "rigid", "maxwell", "gas", "loss", "foam", "surface", "liquid", "slosh")
"""Every scene is compiled with all of these kinds, of which it keeps its own, so that there are few compositions. Its
cost is measured in a loop that is compiled for the terms that its model keeps."""


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


@frozen
class Costs:
    """What a scene costs."""

    seconds: dict[str, float]
    """Those of a grasp in the compiled loop, by the name of the case."""
    compile_s: float
    compiled: int
    """The number of loops that were compiled for it."""


def costs_of(number: int) -> Costs:
    """Return the costs of the cases of `COSTS_AT`, measured in turn."""
    bench, scene = Bench(), scene_of(number)
    grasps = {}
    for name, accuracy, fidelity in CASES:
        if accuracy == COSTS_AT:
            _, setup, _, job = bench.grasp(scene, accuracy, fidelity)
            grasps[name] = setup, job
    seconds = bench.costs_s(list(grasps.values()))
    return Costs(dict(zip(grasps, seconds, strict=True)), bench.compile_s, len(bench.compiled))


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
        problem = problem_of(config, scene.spec)
        began = time.thread_time()
        reduction = select(problem, GraspController(controller, run), compiled=True, padding=KINDS)
        self.selection_s = time.thread_time() - began
        setup = instantiate(problem, reduction, 0)
        job = Job(config=config, controller=controller, run=run, extract=None, traces=True)
        full = padded(setup, KINDS)
        loop = self.loop_of(config, full, type(controller).step)
        return grasp_once(job, full, loop, self.storage), setup, reduction, job

    def costs_s(self, grasps: Sequence[tuple[GraspSetup, Job]]) -> list[float]:
        """Return the seconds that each takes in the loop that is compiled for its model, measured in turn."""
        best = [math.inf] * len(grasps)
        for _ in range(REPEATS):
            for i, (setup, job) in enumerate(grasps):
                best[i] = min(best[i], self._cost_s(padded(setup), job))
        return best

    def _cost_s(self, setup: GraspSetup, job: Job) -> float:
        loop = self.loop_of(job.config, setup, type(job.controller).step)
        timed = TimedLoop(loop)
        grasp_once(job, setup, timed, self.storage)
        return timed.spent_s

    def loop_of(self, config: SimConfig, setup: GraspSetup, step: Any) -> Any:
        """Return the compiled loop of a padded setup."""
        composition = composition_of(setup, pad=False)
        if composition not in self.compiled:
            began = time.process_time()
            loop = CompiledLoops(step).of(composition)
            controller = create("controller", "hybrid")
            short = RunConfig(grasp_timeout_s=0.01)
            job = Job(config=config, controller=controller, run=short, extract=None, traces=True)
            grasp_once(job, setup, loop, self.storage)
            self.compiled[composition] = loop
            self.compile_s += time.process_time() - began
        return self.compiled[composition]


def measure(bench: Bench, numbers: range, costs: int = 0) -> dict[str, Any]:
    """Return the errors of these scenes, and for the first `costs` of them also the times."""
    # A compiled loop takes some 60 MB, which only the end of its process gives back.
    with ProcessPoolExecutor(
        max_workers=1, mp_context=get_context("spawn"), max_tasks_per_child=SCENES_PER_PROCESS
    ) as other_process:
        return _measure(bench, numbers, costs, other_process)


def _measure(bench: Bench, numbers: range, costs: int, other_process: Executor) -> dict[str, Any]:
    rows: list[dict[str, Any]] = []
    unstable = compiled = 0
    for number in numbers:
        scene = scene_of(number)
        reference, setup, reduction, _ = bench.grasp(scene, REFERENCE, "reference")
        if not controller_is_stable(setup, reduction):
            unstable += 1
            continue
        row: dict[str, Any] = {"scene": number, "outcome": reference.outcome.name}
        n_costs = 0
        for name, accuracy, fidelity in CASES:
            case: dict[str, Any] = {"error": math.inf}
            row[name] = case
            try:
                done, _, reduction, _ = bench.grasp(scene, accuracy, fidelity)
            except ConfigError as error:
                case["refused"] = str(error)
                continue
            case["error"], case["quantity"] = error_of(done, reference)
            case["steps"], case["selection_s"] = done.state.step.n_steps, bench.selection_s
            n_costs += accuracy == COSTS_AT
            level = reduction.level
            case["level"] = f"{level.model_tol / accuracy:.3g}/{level.step_tol / accuracy:.3g}"
            case["decisions"] = {decision.term: decision.decision for decision in reduction.decisions}
            verification = reduction.verification
            case["verified"] = None if verification is None else verification.error
        if len(rows) < costs and n_costs == 2:
            spent = other_process.submit(costs_of, number).result()
            for name, seconds in spent.seconds.items():
                row[name]["s"] = seconds
            bench.compile_s += spent.compile_s
            compiled += spent.compiled
        rows.append(row)
        print(f"\r{len(rows)} scenes", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return {
        **summary(rows),
        "left_out_unstable": unstable,
        "compiled": compiled + len(bench.compiled),
        "rows": rows,
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of these scenes, by accuracy where they have one."""
    within, worst, middle, refused, levels, selection = {}, {}, {}, {}, {}, {}
    for name, accuracy, fidelity in CASES:
        if fidelity != "scene":
            continue
        cases = [row[name] for row in rows]
        run = [case["error"] / accuracy for case in cases if "refused" not in case]
        within[accuracy] = sum(case["error"] <= accuracy for case in cases) / len(rows)
        worst[accuracy] = max(run, default=math.inf)
        middle[accuracy] = float(np.median(run)) * accuracy if run else math.inf
        refused[accuracy] = sum("refused" in case for case in cases)
        levels[accuracy] = dict(Counter(case.get("level", "refused") for case in cases))
        seconds = [case["selection_s"] for case in cases if "selection_s" in case]
        selection[accuracy] = float(np.median(seconds) * 1e3)
    both = [(row["0.01"], row["full"]) for row in rows if "s" in row["0.01"] and "s" in row["full"]]
    costs = np.array([[case["s"] for case in pair] for pair in both]).reshape(-1, 2)
    steps = np.array([[case["steps"] for case in pair] for pair in both]).reshape(-1, 2)
    cost, full_cost = np.median(costs, axis=0) if both else (math.nan, math.nan)
    taken, full_taken = np.median(steps, axis=0) if both else (math.nan, math.nan)
    return {
        "scenes": len(rows),
        "within": within,
        "worst": worst,
        "median_error": middle,
        "refused": refused,
        "levels": levels,
        "selection_ms": selection,
        "costs_of": len(both),
        "cost_ratio": float(cost / full_cost),
        "cost_ratio_a_scene": float(np.median(costs[:, 0] / costs[:, 1])) if both else math.nan,
        "cost_ms": float(cost * 1e3),
        "full_cost_ms": float(full_cost * 1e3),
        "steps": float(taken),
        "full_steps": float(full_taken),
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
        f"At 1 % a grasp in the reduced model takes {result['cost_ms']:.2f} ms of the compiled loop "
        f"({result['steps']:.0f} steps), in the full model {result['full_cost_ms']:.2f} ms "
        f"({result['full_steps']:.0f} steps): {result['cost_ratio']:.0%} (medians of {result['costs_of']} scenes; "
        f"{result['cost_ratio_a_scene']:.0%} scene by scene). "
        f"Selecting took {result['selection_ms'][0.01]:.0f} ms.",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=500)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--costs", type=int, default=100, help="number of scenes whose times are measured")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true")
    form.add_argument("--table", action="store_true", help="Markdown, as in docs/simulator.md")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    if given.short:
        given.scenes, given.costs = 1, 0
    bench = Bench()
    result = {
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "graspsense-sim-gripper": version("graspsense-sim-gripper"),
        "seeds": [given.first, given.first + given.scenes - 1],
        **measure(bench, range(given.first, given.first + given.scenes), given.costs),
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
        for name, accuracy, _ in CASES:
            case = row[name]
            if case["error"] > accuracy:
                what = case.get("refused") or (
                    f"{case['error']:<10.3g} {case['quantity']:<10} {case['verified']} {case['level']} "
                    f"{case['decisions']}"
                )
                print(f"{row['scene']:>6} {name:<8}{what}")


if __name__ == "__main__":
    main()
