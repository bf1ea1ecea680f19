"""The simulator beside other ways to integrate the same grasps: six scenes, the controller closed everywhere.

    pip install -c constraints.txt -r benchmarks/requirements.txt
    python benchmarks/peers.py [--short] > benchmarks/results/peers.md

`peer_scenes.py` has the scenes, written down apart from the simulator; `peer_engines.py` the engines. All engines of a
scene are prepared first (set-up: compiling, choosing a model, loading), then each grasps in turn, five times.
What is given is the median of the processor time of one grasp on one thread with its trace, and the least and greatest;
the rms error of the force trace over the peak force; and the error of the peak force; both against a reference with
every event located. `--short` runs one scene once, without the solvers with error control, and checks only that
everything runs. All is simulated.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np
from arguments import parser_of
from attrs import frozen
from peer_engines import REFERENCE_STEPS, located_rk4, loops, mujoco_engines, ours, prepared, solvers, timed
from peer_scenes import SCENES, PeerScene

from graspsense.experiments.versions import where_measured
from graspsense.report.found_table import markdown_table

WARM_S = 0.1
"""A shorter grasp is preceded by one that is not timed, since the engine before has left other data in the caches."""
REPEATS = 5
SHORT = ("snap",)
BOUND = 1e-2
"""Rms error within which the engines are compared."""
SHOWS = (
    "- The loops show what a user's own code for one known scene costs, written in an hour and compiled. They "
    "have none of the parts that make a simulator usable: other terms, sensors, features, an error that is "
    "controlled.",
    "- CVODE and Radau show what error control costs if a solver starts anew at each tick and event. Their "
    "right-hand sides are compiled; the calls from Python are a part of their time that a program in C would not have.",
    "- MuJoCo is called from C with its profiling clock removed. Its rows show the cost of its steps. In linear "
    "contact, object and contact are its own springs; elsewhere the loop computes the forces, since MuJoCo has no "
    "such laws. They do not show what MuJoCo is for: many bodies, and contacts that it finds itself.",
)


@frozen(kw_only=True)
class Row:
    """The figures of an engine in a scene: processor times of its grasps (ms), set-up (s), and relative errors."""

    engine: str
    setting: str
    times_ms: Sequence[float]
    setup_s: float
    rms: float
    peak: float

    @property
    def ms(self) -> float:
        return median(self.times_ms)


def main() -> None:
    short = parser_of(__doc__).parse_args().short
    repeats = 1 if short else REPEATS
    rows = {
        scene: compared(scene, repeats, adaptive=not short)
        for scene in SCENES
        if not short or scene.name in SHORT
    }
    print("\n".join(page(rows, repeats)))


def compared(scene: PeerScene, repeats: int, *, adaptive: bool) -> list[Row]:
    """Return every engine's times and errors in this scene."""
    _, reference, _ = located_rk4(scene, REFERENCE_STEPS).grasp()
    engines = []
    for prepare in (
        *ours(scene),
        *loops(scene),
        *mujoco_engines(scene),
        *(solvers(scene) if adaptive else ()),
    ):
        engines.append(prepared(prepare))
        print(f"{scene.name}: {engines[-1][0].name}, {engines[-1][0].setting} is ready", file=sys.stderr)
    runs = [[] for _ in engines]
    for _ in range(repeats):
        for run, (engine, _) in zip(runs, engines, strict=True):
            if not run or run[-1][1] < WARM_S:
                engine.grasp()
            run.append(timed(engine))
    rows = []
    for run, (engine, setup_s) in zip(runs, engines, strict=True):
        (_, force, _), _ = run[-1]
        rms, peak = errors(force, reference)
        times_ms = [1e3 * spent_s for _, spent_s in run]
        rows.append(
            Row(
                engine=engine.name,
                setting=engine.setting,
                times_ms=times_ms,
                setup_s=setup_s,
                rms=rms,
                peak=peak,
            )
        )
    return rows


def errors(force: Any, reference: Any) -> tuple[float, float]:
    """Return the rms error of the force over the peak force, and that of the peak, both relative."""
    if not np.all(np.isfinite(force)):
        return math.inf, math.inf
    peak = float(np.max(reference))
    return float(np.sqrt(np.mean((force - reference) ** 2))) / peak, abs(float(np.max(force)) - peak) / peak


def page(rows: Mapping[PeerScene, Sequence[Row]], repeats: int) -> Iterator[str]:
    """Yield the lines of the page."""
    yield "# The simulator beside other integrators"
    yield ""
    yield "Written by `python benchmarks/peers.py > benchmarks/results/peers.md`. All grasps are simulated."
    yield ""
    yield (
        "Each engine integrates the same 7 s under the same controller, which is closed at 1 kHz, and keeps the "
        f"trace. Times are processor times of one grasp on one thread: the median of {repeats}, then the least and the "
        "greatest, all engines in turn, each after a grasp of its own that is not timed (but for grasps of "
        f"{WARM_S:g} s and more). Set-up (compiling, choosing a model, loading) is apart; the first row of a new "
        "composition of terms contains its compilation. *rms* is the rms error of the force trace over the peak force, "
        "*peak* the relative error of the peak force, both against fourth-order steps of a "
        f"{REFERENCE_STEPS}th of a millisecond with every event located."
    )
    yield ""
    yield f"Measured with: {where_measured()}."
    yield ""
    yield "What the comparison shows, and what it does not:"
    yield ""
    yield from SHOWS
    yield ""
    yield f"Times over ours at an rms error of {BOUND:.0%}, each side with its fastest setting within the error:"
    yield ""
    yield from markdown_table(("engine", "scenes", "least", "greatest"), list(across(rows.values())))
    for scene, engines in rows.items():
        yield ""
        yield f"## {sentence(scene.name)}"
        yield ""
        yield f"{sentence(scene.says)}."
        yield ""
        yield from markdown_table(
            ("engine", "setting", "ms", "least to greatest", "set-up, s", "rms", "peak"),
            [cells(row) for row in engines],
        )
        yield ""
        yield f"Faster and with a smaller rms error than graspsense as shipped: {dominating(engines) or 'none'}."


def cells(row: Row) -> tuple[str, ...]:
    """Return the figures of an engine as text."""
    span = f"{min(row.times_ms):.3g} to {max(row.times_ms):.3g}"
    times = f"{row.ms:.3g}", span, f"{row.setup_s:.2g}"
    return row.engine, row.setting, *times, f"{row.rms:.1e}", f"{row.peak:.1e}"


def across(scenes: Sequence[Sequence[Row]]) -> Iterator[tuple[str, ...]]:
    """Yield how many times as long each engine takes as ours: in how many scenes, the least and the greatest."""
    ratios: dict[str, list[float]] = {}
    for rows in scenes:
        fast: dict[str, float] = {}
        for row in rows:
            if row.rms <= BOUND:
                fast[row.engine] = min(row.ms, fast.get(row.engine, row.ms))
        ours_ms = fast.pop("graspsense")
        for name, ms in fast.items():
            ratios.setdefault(name, []).append(ms / ours_ms)
    for name, of_scenes in ratios.items():
        yield name, str(len(of_scenes)), f"{min(of_scenes):.2g}", f"{max(of_scenes):.2g}"


def sentence(text: str) -> str:
    """Return the text with its first letter as a capital."""
    return text[:1].upper() + text[1:]


def dominating(rows: Sequence[Row]) -> str:
    """Return the engines that are both faster and more exact than the simulator as it is shipped."""
    shipped = rows[0]
    better = [row for row in rows if row.ms < shipped.ms and row.rms < shipped.rms]
    return "; ".join(f"{row.engine}, {row.setting}" for row in better)


if __name__ == "__main__":
    main()
