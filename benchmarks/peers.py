"""The simulator beside other ways to integrate the same grasps: six scenes, the controller closed everywhere.

    pip install -c constraints.txt -r benchmarks/requirements.txt
    python benchmarks/peers.py [--json FILE] [--markdown FILE] [--short] [--scenes linear,...] [--repeats 5]

`peer_scenes.py` has the scenes, written down apart from the simulator; `peer_engines.py` the engines. All engines of a
scene are prepared first (set-up: compiling, choosing a model, loading), then each grasps in turn, `--repeats` times.
What is given is the median of the processor time of one grasp on one thread with its trace, and the least and greatest;
the rms error of the force trace over the peak force; and the error of the peak force; both against a reference with
every event located. A ratio compares the fastest settings of both sides whose rms error is below a bound. `--short`
runs two scenes once, without the solvers with error control, and checks only that everything runs. All is simulated.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from peer_engines import (
    REFERENCE_STEPS,
    Engine,
    located_rk4,
    loops,
    mujoco_engines,
    ours,
    prepared,
    solvers,
    timed,
)
from peer_scenes import SCENES, PeerScene
from simulation_scene import Run

from graspsense.core.values.json_values import json_ready
from graspsense.experiments.versions import measured_on

WARM_S = 0.1
"""A shorter grasp is preceded by one that is not timed, since the engine before has left other data in the caches."""
REPEATS = 5
BOUNDS = (1e-2, 4e-4, 1e-6)
SHOWS = (
    "- The loops show what a user's own code for one known scene costs, written in an hour and compiled. They "
    "have none of the parts that make a simulator usable: other terms, sensors, features, an error that is "
    "controlled. The one by hand is for linear contact alone; the others are general in the scene.",
    "- graspsense integrates linear contact by steps, as any other scene. It has no method for linear scenes alone.",
    "- CVODE and Radau show what error control costs if a solver starts anew at each tick and event. Their "
    "right-hand sides are compiled; the calls from Python are a part of their time that a program in C would not have.",
    "- MuJoCo is called from C with its profiling clock removed. Its rows show the cost of its steps. In linear "
    "contact, object and contact are its own springs; elsewhere the loop computes the forces, since MuJoCo has no "
    "such laws. They do not show what MuJoCo is for: many bodies, and contacts that it finds itself.",
)
WRONG = 0.05
"""Relative error of a trace from which an engine is said to miss the scene."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", metavar="FILE", help="write every figure to this file")
    parser.add_argument("--markdown", metavar="FILE", help="write the tables as a page")
    parser.add_argument("--short", action="store_true", help="two scenes once: that everything runs")
    parser.add_argument("--scenes", default="", help="parts of the names of scenes, separated by commas")
    parser.add_argument("--repeats", type=int, default=REPEATS)
    given = parser.parse_args()
    wanted = ["snap", "linear"] if given.short else [name for name in given.scenes.split(",") if name]
    scenes = [s for s in SCENES if not wanted or any(name in s.name for name in wanted)]
    result: dict[str, Any] = {
        "made": measured_on(),
        "repeats": 1 if given.short else given.repeats,
        "scenes": [],
    }
    for scene in scenes:
        measured = compared(scene, result["repeats"], adaptive=not given.short)
        result["scenes"].append(measured)
        print("\n".join(table(measured)), flush=True)
    print(", ".join(f"{key} {value}" for key, value in result["made"].items()))
    if given.json:
        Path(given.json).write_text(json.dumps(json_ready(result), indent=2) + "\n", encoding="utf-8")
    if given.markdown:
        Path(given.markdown).write_text("\n".join(page(result)) + "\n", encoding="utf-8")


def compared(scene: PeerScene, repeats: int, *, adaptive: bool) -> dict[str, Any]:
    """Return every engine's time and errors in this scene, and the ratios at each bound."""
    reference = located_rk4(scene, REFERENCE_STEPS).grasp()
    engines: list[tuple[Engine, float]] = []
    for prepare in (
        *ours(scene),
        *loops(scene),
        *mujoco_engines(scene),
        *(solvers(scene) if adaptive else ()),
    ):
        engines.append(prepared(prepare))
        print(f"{scene.name}: {engines[-1][0].name}, {engines[-1][0].setting} is ready", file=sys.stderr)
    runs: list[list[tuple[Run, float]]] = [[] for _ in engines]
    for _ in range(repeats):
        for run, (engine, _) in zip(runs, engines, strict=True):
            if not run or run[-1][1] < WARM_S:
                engine.grasp()
            run.append(timed(engine))
    rows = [row(engine, setup, run, reference) for (engine, setup), run in zip(engines, runs, strict=True)]
    return {"name": scene.name, "says": scene.says, "runs": rows, "ratios": dict(ratios(rows))}


def row(
    engine: Engine, setup_s: float, timed_runs: list[tuple[Run, float]], reference: Run
) -> dict[str, Any]:
    """Return the figures of one engine."""
    seconds = [spent_s for _, spent_s in timed_runs]
    rms, peak = timed_runs[-1][0].error(reference)
    return {
        "engine": engine.name,
        "setting": engine.setting,
        "ms": 1e3 * statistics.median(seconds),
        "ms_least": 1e3 * min(seconds),
        "ms_greatest": 1e3 * max(seconds),
        "setup_s": setup_s,
        "rms": rms,
        "peak": peak,
    }


def ratios(rows: list[dict[str, Any]]) -> Iterator[tuple[str, float]]:
    """Yield how many times as long the fastest setting of each engine takes as ours, at each bound on the error."""
    for bound in BOUNDS:
        fast: dict[str, float] = {}
        for engine in rows:
            if engine["rms"] <= bound:
                name = (
                    engine["engine"].split(",")[0] if "located" not in engine["engine"] else engine["engine"]
                )
                fast[name] = min(engine["ms"], fast.get(name, math.inf))
        mine = fast.pop("graspsense", None)
        if mine is not None:
            for name, ms in fast.items():
                yield f"{name} at {bound:g}", ms / mine


def table(measured: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of a scene."""
    yield f"\n{measured['name']}: {measured['says']}"
    yield f"{'engine':<44}{'setting':<36}{'ms':>9}{'least':>9}{'greatest':>10}{'set-up s':>10}{'rms':>10}{'peak':>10}"
    for figures in measured["runs"]:
        note = "  misses the scene" if not figures["rms"] <= WRONG else ""
        yield (
            f"{figures['engine']:<44}{figures['setting']:<36}{figures['ms']:>9.3f}{figures['ms_least']:>9.3f}{figures['ms_greatest']:>10.3f}"
            f"{figures['setup_s']:>10.2f}{figures['rms']:>10.1e}{figures['peak']:>10.1e}{note}"
        )
    for name, ratio in measured["ratios"].items():
        yield f"  {name:<60}{ratio:>10.2f} times our time"


def page(result: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the documentation's page."""
    made_with = ", ".join(f"{key} {value}" for key, value in result["made"].items())
    yield "# The simulator beside other integrators"
    yield ""
    yield "Written by `python benchmarks/peers.py --markdown benchmarks/results/peers.md`. All grasps are simulated."
    yield ""
    yield (
        "Each engine integrates the same 7 s under the same controller, which is closed at 1 kHz, and keeps the "
        f"trace. Times are processor times of one grasp on one thread: the median of {result['repeats']}, then the "
        "least and the greatest, all engines in turn, each after a grasp of its own that is not timed (but for grasps "
        f"of {WARM_S:g} s and more). Set-up (compiling, choosing a model, loading) is apart; the first row of a new "
        "composition of terms contains its compilation. *rms* "
        "is the rms error of the force trace over the peak force, *peak* the relative error of the peak force, both "
        f"against fourth-order steps of a {REFERENCE_STEPS}th of a millisecond with every event located."
    )
    yield ""
    yield f"Measured with: {made_with}."
    yield ""
    yield "What the comparison shows, and what it does not:"
    yield ""
    yield from SHOWS
    yield ""
    yield from across_scenes([scene["ratios"] for scene in result["scenes"]])
    for scene in result["scenes"]:
        yield ""
        yield f"## {sentence(scene['name'])}"
        yield ""
        yield f"{sentence(scene['says'])}."
        yield ""
        yield "| engine | setting | ms | least to greatest | set-up, s | rms | peak |"
        yield "|---|---|---|---|---|---|---|"
        for run in scene["runs"]:
            yield (
                f"| {run['engine']} | {run['setting']} | {run['ms']:.3g} | {run['ms_least']:.3g} to "
                f"{run['ms_greatest']:.3g} | {run['setup_s']:.2g} | {run['rms']:.1e} | {run['peak']:.1e} |"
            )
        yield ""
        yield from ratios_at_errors(scene["ratios"])
        yield ""
        yield f"Faster and with a smaller rms error than graspsense as shipped: {dominating(scene) or 'none'}."


def across_scenes(ratios: Sequence[dict[str, float]]) -> Iterator[str]:
    """Yield the table of the times over ours at an error of 1 %, from the least to the greatest of the scenes."""
    by_engine: dict[str, list[float]] = {}
    for some in ratios:
        for name, ratio in some.items():
            engine, _, error = name.rpartition(" at ")
            if float(error) == max(BOUNDS):
                by_engine.setdefault(engine, []).append(ratio)
    yield f"Times over ours at an rms error of {max(BOUNDS):.0%}, each side with its fastest setting within the error:"
    yield ""
    yield "| engine | scenes | least | greatest |"
    yield "|---|---|---|---|"
    for engine, some_ratios in by_engine.items():
        yield f"| {engine} | {len(some_ratios)} | {min(some_ratios):.2g} | {max(some_ratios):.2g} |"


def ratios_at_errors(ratios: dict[str, float]) -> Iterator[str]:
    """Yield the table of the times over ours, with a row for each engine and a column for each error."""
    engines = dict.fromkeys(name.rpartition(" at ")[0] for name in ratios)
    yield "Times over ours, each side with its fastest setting within the rms error:"
    yield ""
    yield f"| engine | {' | '.join(f'{error:g}' for error in BOUNDS)} |"
    yield f"|---|{'---|' * len(BOUNDS)}"
    for engine in engines:
        cells = (ratios.get(f"{engine} at {error:g}") for error in BOUNDS)
        yield f"| {engine} | {' | '.join('-' if cell is None else f'{cell:.2g}' for cell in cells)} |"


def sentence(text: str) -> str:
    """Return the text with its first letter as a capital."""
    return text[:1].upper() + text[1:]


def dominating(scene: dict[str, Any]) -> str:
    """Return the engines that are both faster and more exact than the simulator as it is shipped."""
    shipped = next(figures for figures in scene["runs"] if figures["setting"].startswith("as shipped"))
    return "; ".join(
        f"{figures['engine']}, {figures['setting']}"
        for figures in scene["runs"]
        if figures["ms"] < shipped["ms"] and figures["rms"] < shipped["rms"]
    )


if __name__ == "__main__":
    main()
