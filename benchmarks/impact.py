"""The peak force of each controller, on the block at all phases of the pads' clock and on two hundred eggs. Simulated.

    python benchmarks/impact.py [--json] [--short]

The peak is the true force on a pad, which only the simulator knows. The block is grasped at 23 N from 41 opening gaps
that are 10 um apart, so that the contact falls on every phase of the pads' clock of 41 ms. The eggs are grasped at 20
N, each with a seed of its own.
"""

from __future__ import annotations

import argparse
import json
import platform
from datetime import date
from importlib.metadata import version

import numpy as np

from graspsense.plugin_api import create
from graspsense_sim_gripper.batch import run_many
from graspsense_sim_gripper.build import unverified_setup
from graspsense_sim_gripper.config import SimConfig

PHASES, EGGS = 41, 200


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    result = {
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()}, {platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "graspsense-sim-gripper": version("graspsense-sim-gripper"),
        **block(2 if given.short else PHASES),
        **eggs(2 if given.short else EGGS),
    }
    if given.json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key:<28}{value if not isinstance(value, float) else round(value, 2)}")


def block(phases: int) -> dict[str, float]:
    peak: dict[str, list[float]] = {"hybrid": [], "force": []}
    for name, peaks_n in peak.items():
        controller = create("controller", name, probing_force_n=23.0)
        for k in range(phases):
            config = SimConfig(spread=False, open_gap_m=0.086 + k * 1e-5)
            peaks_n.append(run_many(config, controller, ["block"], [0], compiled=True)[0].state.peak_n)
    return {
        "block_hybrid_least_n": min(peak["hybrid"]),
        "block_hybrid_most_n": max(peak["hybrid"]),
        "block_force_least_n": min(peak["force"]),
        "block_force_most_n": max(peak["force"]),
        "block_ratio_worst": min(peak["force"]) / max(peak["hybrid"]),
    }


def eggs(number: int) -> dict[str, float]:
    crush = np.array(
        [
            unverified_setup(SimConfig(), "egg", s).plant.object.terms[1].params.crush_force_n
            for s in range(number)
        ]
    )
    result: dict[str, float] = {"eggs": number, "egg_weakest_n": float(crush.min())}
    for name in ("hybrid", "force"):
        controller = create("controller", name, probing_force_n=20.0)
        done = run_many(SimConfig(), controller, ["egg"] * number, range(number))
        peaks = np.array([one.state.peak_n for one in done])
        broken = sum(one.state.contact.left.states[1].broken for one in done)
        result[f"egg_{name}_broken"] = broken
        result[f"egg_{name}_peak_most_n"] = float(peaks.max())
        if name == "hybrid":
            result["egg_hybrid_margin_least_n"] = float((crush - peaks).min())
    return result


if __name__ == "__main__":
    main()
