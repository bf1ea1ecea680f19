"""The simulator compared with other engines, many grasps at once, and the time of compiling. All is simulated.

    pip install -c constraints.txt -r benchmarks/requirements.txt
    python benchmarks/simulation.py [--json] [--only peers,plant,gas,many,compile] [--grasps 10000]
        [--engines mujoco,drake,scipy]

Peers: `simulation_scene.py` has the scene and its exact solution, `simulation_peers.py` the other engines. A ratio
is between the fastest settings of both sides whose rms error of the force trace is below a bound, both sides
timed in turn, the least of several: processor time of one thread, with the trace recorded. Many grasps: the catalogue
in turn, with features, on all cores. Compiling: all of the catalogue in a fresh process, with an empty cache and a full
one. Values that were not measured are null. Only processor times are meaningful on a busy machine.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import simulation_peers as theirs
from attrs import evolve
from simulation_scene import CONFIG, SETTINGS, Ours, Run, exact_closed, exact_open

from graspsense import __version__
from graspsense.plugin_api import APPROACH, HOLD, RunConfig, create
from graspsense_sim_gripper.batch import run_many
from graspsense_sim_gripper.build import unverified_setup
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.library import catalogue
from graspsense_sim_gripper.stepping.scheme import PlantParams

HERE = Path(__file__).parent
REPEATS = 7
BARS = {"4e-4": 4e-4, "1e-6": 1e-6}
SCENE = (
    "Scene: 1 kg on a damper meets a light surface (20 g on 2 kN/m) through 20 kN/m; 7 s, control at 1 kHz. Ours is an "
    "ordinary scene of the shipped loop with the controller closed; the others replay what it commanded."
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--only", default="peers,plant,gas,many,compile")
    parser.add_argument("--grasps", type=int, default=10_000)
    parser.add_argument("--engines", default="mujoco,drake,scipy")
    parser.add_argument("--compile-once", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.compile_once:
        print(json.dumps(compile_catalogue()))
        return
    wanted = set(given.only.split(","))
    engines = set(given.engines.split(","))
    parts = {"peers": lambda: peers(engines), "plant": plant, "gas": gas, "compile": compiling}
    result: dict[str, Any] = {"made": made(), "scene": SCENE, "runs": []}
    for name, part in parts.items():
        if name in wanted:
            result.update(part())
    if "many" in wanted:
        result.update(many(given.grasps))
    result["load_at_the_end"] = os.getloadavg()[0]
    if given.json:
        print(json.dumps(finite(result), indent=2))
        return
    for run in result.pop("runs"):
        print(
            f"{run['what']:<56}{1e3 * run['seconds']:>10.3f} ms  rms {run['rms']:.1e}  peak {run['peak']:.1e}"
        )
    for key, value in result.items():
        print(f"{key:<34}{value if not isinstance(value, float) else f'{value:.4g}'}")


def made() -> dict[str, Any]:
    found: dict[str, Any] = {
        "date": date.today().isoformat(),
        "processor": processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "graspsense": __version__,
        "load_at_the_start": round(os.getloadavg()[0], 1),
    }
    for name in ("numpy", "numba", "scipy", "mujoco", "drake"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found


def processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


# ------------------------------------------------------------------------------------------------- peers


def peers(engines: set[str]) -> dict[str, Any]:
    """Return every run, and the ratios at each error that a bar names."""
    closed = exact_closed()
    ours = {what: Ours(what, evolve(CONFIG, **settings)) for what, settings in SETTINGS.items()}
    runs = [
        ("graspsense in steps" if "step_s" in SETTINGS[what] else "graspsense", one.run(REPEATS), closed)
        for what, one in ours.items()
    ]
    us = runs[0][1].u
    replayed = exact_open(us)
    if "mujoco" in engines and find_spec("mujoco") is not None:
        for integrator, counts in theirs.MUJOCO_STEPS.items():
            runs += [
                (f"MuJoCo {integrator}", theirs.mujoco_run(us, integrator, n, 3), replayed) for n in counts
            ]
    if "drake" in engines and find_spec("pydrake") is not None:
        runs += [(f"Drake {one.what.split()[2].rstrip(',')}", one, replayed) for one in theirs.drake_runs(us)]
    if "scipy" in engines:
        runs += [(f"scipy {one.what.split()[2].rstrip(',')}", one, replayed) for one in theirs.scipy_runs(us)]
    result: dict[str, Any] = {"runs": [as_json(*run) for run in runs]}
    for bar, error in BARS.items():
        mine = cheapest([one for one in runs if one[0].startswith("graspsense")], error)
        for engine in ("mujoco", "drake", "scipy LSODA", "scipy Radau"):
            other = cheapest([one for one in runs if one[0].lower().startswith(engine.lower())], error)
            name = f"{engine.replace('scipy ', '').lower()}_{bar}"
            result[name] = None
            result[f"{name}_is"] = f"{other.what} over {mine.what}" if mine and other else "not reached"
            if mine is None or other is None:
                continue
            one = next(o for o in ours.values() if o.what == mine.what)
            if engine == "mujoco":
                integrator, count = other.what.split(", ")[1], round(1000 / float(other.what.split()[-2]))
                best, least = math.inf, math.inf
                # Each side has the same processor time to show its least in.
                often = max(1, round(other.seconds / mine.seconds))
                for _ in range(REPEATS):
                    best = min(best, one.run(often).seconds)
                    least = min(least, theirs.mujoco_run(us, integrator, count, 1).seconds)
                result[name] = least / best
            else:
                result[name] = other.seconds / mine.seconds
    return result


def cheapest(runs: list[tuple[str, Run, Run]], error: float) -> Run | None:
    """Return the fastest run whose rms error is at most this."""
    good = [run for _, run, reference in runs if run.error(reference)[0] <= error]
    return min(good, key=lambda run: run.seconds, default=None)


def as_json(engine: str, run: Run, reference: Run) -> dict[str, Any]:
    rms, peak = run.error(reference)
    return {"engine": engine, "what": run.what, "seconds": run.seconds, "rms": rms, "peak": peak}


# ------------------------------------------------------------------------------------------------- plant

NEAREST = """
<mujoco>
  <option timestep="{step:.12g}" integrator="implicitfast" gravity="0 0 0"><flag contact="disable"/></option>
  <worldbody>
    <body><joint name="x" type="slide" axis="1 0 0" damping="{damping}" frictionloss="{friction}" armature="{mass}"/>
      <geom type="sphere" size="0.01" mass="0.001"/></body>
  </worldbody>
  <tendon><fixed name="contact" stiffness="{stiffness}" springlength="-1000 {way}"><joint joint="x" coef="1"/></fixed>
  </tendon>
  <actuator><motor joint="x"/></actuator>
</mujoco>
"""


def plant() -> dict[str, Any]:
    """Return the PR2's own drive (rotor through the linkage, static friction, pads) beside MuJoCo's nearest model.

    MuJoCo has the rotor's inertia at contact, the sliding friction as joint friction, and pads and object as a spring,
    and it uses its constraint solver. It cannot represent a varying inertia, static friction above sliding friction, or
    friction that grows with the load. The error of that model is given for steps of a fiftieth of the tick.
    """
    if find_spec("mujoco") is None:
        return {"mujoco_plant": None}
    config = SimConfig(object=str(HERE / "spring.toml"), spread=False, sensor="ideal")
    shipped = Ours("PR2", config, create("controller", "hybrid"))
    reference = Ours("reference", evolve(config, fidelity="reference"), create("controller", "hybrid"))
    run, true = shipped.run(REPEATS), reference.run(1)
    trace = run_many(config, create("controller", "hybrid"), [config.object], [0], run=RunConfig(hold_s=0.0))[
        0
    ].trace
    n = int(np.sum((trace.phase >= APPROACH) & (trace.phase <= HOLD)))
    us = run.u[:n]
    params: PlantParams = unverified_setup(config, config.object, 0).plant
    drive, thing = params.drive, params.object
    _, rate = contact_rate(config)
    spring = 20000.0
    stiffness = 1.0 / (1.0 / spring + 1.0 / thing.pads.stiffness_n_m)
    way = config.open_gap_m - thing.width_m

    def model(count: int, repeats: int) -> Run:
        xml = NEAREST.format(
            step=1e-3 / count,
            damping=drive.friction.damping_n_s_m,
            friction=drive.friction.coulomb_n,
            mass=drive.inertia / rate**2,
            stiffness=stiffness,
            way=way,
        )
        states, seconds = theirs.mujoco_states(xml, us, count, repeats)
        force = stiffness * np.maximum(states[:, 1] - way, 0.0)
        return Run(x=states[:, 1], force=force, u=us, seconds=seconds, what="MuJoCo, nearest model")

    coarse, fine = model(1, REPEATS), model(50, 1)
    whole = Run(x=true.x[:n], force=true.force[:n], u=us)
    part = Run(x=run.x[:n], force=run.force[:n], u=us)
    return {
        "mujoco_plant": coarse.seconds / run.seconds,
        "mujoco_plant_model_error_rms": fine.error(whole)[0],
        "mujoco_plant_error_rms": coarse.error(whole)[0],
        "mujoco_plant_our_error_rms": part.error(whole)[0],
        "mujoco_plant_our_ms": 1e3 * run.seconds,
        "mujoco_plant_their_ms": 1e3 * coarse.seconds,
    }


def contact_rate(config: SimConfig) -> tuple[float, float]:
    from graspsense.plugin_api import gap_and_rate, revolutions_at
    from graspsense_sim_gripper.drive_models import LINKAGES

    link = LINKAGES[config.transmission]
    return gap_and_rate(link, revolutions_at(link, 0.05))


# --------------------------------------------------------------------------------------------------- gas


def gas() -> dict[str, Any]:
    """Return what a gas and its vent cost beside the linear scene, each in the cheapest setting of equal error."""
    closed = exact_closed()
    gas_config = evolve(CONFIG, object=str(HERE / "gas.toml"))
    reference = Ours("reference", evolve(gas_config, fidelity="reference", accuracy=1e-4)).run(1)
    found: dict[str, Any] = {}
    for bar, error in BARS.items():
        chosen = []
        for config, truth in ((CONFIG, closed), (gas_config, reference)):
            candidates = [Ours(what, evolve(config, **settings)) for what, settings in SETTINGS.items()]
            good = [one for one in candidates if one.once().error(truth)[0] <= error]
            chosen.append(min(good, key=lambda one: one.run(REPEATS).seconds))
        # In turn, so that both had the same machine.
        runs = [[one.once().seconds for one in chosen] for _ in range(10 * REPEATS)]
        times = np.min(runs, axis=0)
        name = "gas_over_linear" if bar == "4e-4" else f"gas_over_linear_{bar}"
        found[name] = float(times[1] / times[0])
    return found


# -------------------------------------------------------------------------------------------------- many


def many(n: int) -> dict[str, Any]:
    """Return grasps a second with features, of ideal and of full sensing; the cost of one by how many there are."""
    law, features = create("controller", "hybrid"), create("feature-set", "chitta")
    names = sorted(catalogue())
    result: dict[str, Any] = {"grasps": n}
    for sensor, name in (("ideal", "grasps_per_s_ideal"), ("pads", "grasps_per_s_full")):
        config = SimConfig(sensor=sensor)  # type: ignore[arg-type]

        def run(count: int, config: SimConfig = config) -> tuple[float, float]:
            scenes = [names[k % len(names)] for k in range(count)]
            began, spent = time.perf_counter(), time.process_time()
            run_many(config, law, scenes, range(count), extract=features.extract, traces=False, compiled=True)
            return time.perf_counter() - began, time.process_time() - spent

        run(len(names))
        counts = [c for c in (100, 1000, 10_000, 100_000) if c < n] + [n]
        by_count = {}
        for count in counts:
            wall, cpu = run(count)
            by_count[str(count)] = {
                "ms_of_processor_a_grasp": 1e3 * cpu / count,
                "largest_memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
            }
        result[name] = n / wall
        result[f"{name}_if_both_cores_were_free"] = (os.cpu_count() or 1) * n / cpu
        result[f"{name}_by_count"] = by_count
    return result


# ----------------------------------------------------------------------------------------------- compile


def compile_catalogue() -> dict[str, float]:
    """Compile for every object of the catalogue, or load that; return seconds on the clock and of processor."""
    law, names = create("controller", "hybrid"), sorted(catalogue())
    began, spent = time.perf_counter(), time.process_time()
    run_many(SimConfig(), law, names, range(len(names)), traces=False, compiled=True, workers=1)
    wall, cpu = time.perf_counter() - began, time.process_time() - spent
    began, again = time.perf_counter(), time.process_time()
    run_many(SimConfig(), law, names, range(len(names)), traces=False, compiled=True, workers=1)
    # The grasps themselves are no part of it.
    return {
        "wall": wall - (time.perf_counter() - began),
        "processor": cpu - (time.process_time() - again),
    }


def compiling() -> dict[str, Any]:
    """Return what compiling the catalogue takes with an empty and with a full cache: seconds of processor, and wall."""
    if find_spec("numba") is None:
        return {"compile_cold_s": None, "compile_warm_s": None}
    result: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder, "XDG_CACHE_HOME": folder}
        for name in ("compile_cold_s", "compile_warm_s"):
            done = subprocess.run(
                [sys.executable, __file__, "--compile-once"],
                env=environment,
                check=True,
                capture_output=True,
                text=True,
            )
            found = json.loads(done.stdout)
            result[name] = found["processor"]
            result[f"{name}_on_the_clock"] = found["wall"]
    return result


def finite(value: Any) -> Any:
    """Return the value with null for what JSON has no number for."""
    if isinstance(value, dict):
        return {key: finite(one) for key, one in value.items()}
    if isinstance(value, list):
        return [finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


if __name__ == "__main__":
    main()
