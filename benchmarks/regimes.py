"""Where the chosen steps have the accuracy that is asked for. Simulated.

    python benchmarks/regimes.py [--scenes 1500] [--rows FILE] [--first N] [--short]

The scenes are drawn from the ranges that gripper, object and controller may physically have, not from those in which
the simulator works, and apart from those of `random_scenes.py`. Their seeds are fresh unless `--first` names the first.
Each is grasped by the hybrid controller in the steps that are selected for 10, 1 and 0.1 %, and in the reference. The
error is that of `graspsense_sim_gripper.run.accuracy.error`; a different outcome is an infinite error. A reference that
has not settled in some tick, or that a selected grasp differs from, is compared with even steps of 10 us. Finished
scenes are appended to the file of `--rows`, and are not run again if the program is started again with the same file.
"""

from __future__ import annotations

import argparse
import json
import math
import secrets
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from arguments import parser_of
from attrs import evolve
from random_scenes import Bench, Scene, controller_is_stable, error_of, flags_of

from graspsense.evaluation.intervals import wilson
from graspsense.experiments.versions import where_measured
from graspsense.plugin_api import ConfigError
from graspsense.report.found_table import markdown_table
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.batch.job import FinishedGrasp
from graspsense_sim_gripper.scene.spec import ObjectSpec
from graspsense_sim_gripper.scene.terms.registry import in_order

Row = dict[str, Any]
ACCURACIES: Final = (0.1, 0.01, 0.001)
EVEN_S: Final = 1e-5
"""Steps so short that they show whether a reference in doubt is right."""
REFERENCE: Final = 1e-4
ATMOSPHERE_PA: Final = 101325.0


def drawn_terms(
    rng: np.random.Generator, log: Callable[[float, float], float], stiffness: float, mass: float
) -> dict[str, dict[str, float]]:
    """Return the terms of an object about this stiff (N/m), for a jaw of this mass (kg), drawn by `log`."""
    terms: dict[str, dict[str, float]] = {"elastic": {"k1_n_m": stiffness}}
    if rng.random() < 0.2:
        terms = {"rigid": {"hertz_n_m15": (stiffness / 1.5) ** 1.5 / math.sqrt(20.0)}}
    if rng.random() < 0.5:
        ratio = log(1e-5, 10.0)
        terms["surface"] = {"mass_kg": mass * ratio, "k_n_m": max(stiffness * log(0.01, 1.0), 100.0)}
        critical = 2.0 * math.sqrt(terms["surface"]["k_n_m"] * mass * ratio)
        terms["surface"] |= {"damping_n_s_m": critical * log(0.01, 10.0), "contact_n_m": stiffness}
    if rng.random() < 0.5:
        terms["loss"] = {"damping_n_s_m": log(1e-3, 30.0) * 2.0 * math.sqrt(stiffness * mass)}
    if rng.random() < 0.5:
        relaxation_s = log(1e-6, 1e4)
        terms["maxwell"] = {"k_n_m": stiffness * log(0.01, 3.0), "tau_s": relaxation_s}
    if rng.random() < 0.5:
        head_space_m3 = log(1e-7, 2e-3)
        vent_m2 = log(1e-11, 1e-4) if rng.random() < 0.7 else 0.0
        terms["gas"] = {
            "area_m2": log(1e-4, 5e-3),
            "area_slope_m": 0.0,
            "volume_m3": head_space_m3,
        }
        terms["gas"] |= {"pressure_pa": ATMOSPHERE_PA, "exponent": 1.4, "bulge_m3_pa": log(1e-11, 1e-9)}
        terms["gas"] |= {"heat_s": log(1e-2, 1e2), "vent_m2": vent_m2}
    if rng.random() < 0.15:
        slosh_hz = log(0.5, 2000.0)
        terms["slosh"] = {
            "mass_kg": log(1e-3, 1.0),
            "frequency_hz": slosh_hz,
            "damping_ratio": log(1e-3, 2.0),
        }
    return terms


def scene_of(number: int) -> Scene:
    """Return the scene with this number."""
    rng = np.random.default_rng([77_003, number])

    def log(least: float, most: float) -> float:
        return float(10.0 ** rng.uniform(math.log10(least), math.log10(most)))

    stiffness, speed, rate = log(1e2, 1e7), log(1e-3, 0.1), log(200.0, 5000.0)
    # A light plastic jaw to a large geared hand, as seen at the gap.
    mass = log(0.5, 300.0)
    terms = drawn_terms(rng, log, stiffness, mass)
    order = list(terms)
    spec = ObjectSpec(
        name=f"regime {number}",
        width_m=float(rng.uniform(0.01, 0.07)),
        mass_kg=log(5e-3, 2.0),
        held=bool(rng.random() < 0.2),
        offset_m=float(rng.uniform(-3e-3, 3e-3)) if rng.random() < 0.5 else 0.0,
        terms=tuple((order[i], terms[order[i]]) for i in in_order(order)),
    )
    straight = bool(rng.random() < 0.5)
    friction = log(0.1, 10.0)
    sensor: Any = "pads" if rng.random() < 0.3 else "ideal"
    config = SimConfig(
        sensor=sensor,
        spread=False,
        rate_hz=rate,
        transmission="straight" if straight else "pr2",
        moving_mass_kg=mass,
        coulomb_n=friction,
        # Above Coulomb friction, as with any real drive: no scene is piecewise linear.
        breakaway_n=1.2 * friction,
        coulomb_spread_n=0.0,
        load_friction_coefficient=float(rng.uniform(0.0, 0.5)),
        stribeck_m_s=log(1e-4, 1e-2),
        pad_stiffness_n_m=log(3e3, 1e6),
        pad_damping_n_s_m=0.0 if rng.random() < 0.5 else log(0.1, 100.0),
        open_gap_m=spec.width_m + 2.0 * abs(spec.offset_m) + min(max(0.5 * speed, 2e-3), 0.01),
    )
    return Scene(spec=spec, config=config, speed_m_s=speed)


def measured(bench: Bench, scene: Scene) -> Row:
    """Return the errors and flags of the grasps in a scene."""
    row: Row = {"sensor": scene.config.sensor}
    try:
        reference, setup, chosen, _ = bench.grasp(scene, REFERENCE, "reference")
    except ConfigError as error:
        return {**row, "failed": f"the reference: {error}"}
    row |= {"outcome": reference.outcome.name, "stable": controller_is_stable(setup, chosen)}
    row["reference_resolved"] = reference.state.step.unresolved + reference.state.contact.unbalanced == 0
    for accuracy in ACCURACIES:
        row[f"{accuracy:g}"] = _case(bench, scene, accuracy, reference)
    if not row["reference_resolved"] or any(row[f"{a:g}"]["error"] > a for a in ACCURACIES):
        even = evolve(scene, config=evolve(scene.config, step_s=EVEN_S))
        row["even"] = _case(bench, even, 0.01, reference)["error"]
    return row


def _case(bench: Bench, scene: Scene, accuracy: float, reference: FinishedGrasp) -> Row:
    try:
        done, _, chosen, job = bench.grasp(scene, accuracy, "scene")
    except ConfigError as error:
        return {"error": math.inf, "refused": str(error)[:200]}
    except ArithmeticError as error:
        return {"error": math.inf, "refused": f"{type(error).__name__}: {error}"}
    error, quantity = error_of(done, reference, scene.config)
    return {
        "error": error,
        "of": quantity,
        "flags": flags_of(done, chosen, job.config),
        "chosen": chosen.decisions[0].decision,
    }


def run(measure: Callable[[int], Row], file: Path | None, scenes: int, first_scene: int | None) -> list[Row]:
    """Measure scenes until the file holds as many, and append them; return all rows.

    The file may be the rows of several runs, one after the other. The seeds are fresh without a number of the first.
    """
    rows: list[Row] = []
    if file is not None and file.exists():
        rows = [json.loads(line) for line in file.read_text().splitlines()]
    if rows:
        first_scene = rows[-1]["scene"] + 1
    elif first_scene is None:
        first_scene = secrets.randbelow(2**31)
    for number in range(first_scene, first_scene + scenes - len(rows)):
        rows.append({"scene": number, **measure(number)})
        if file is not None:
            with file.open("a") as out:
                out.write(json.dumps(rows[-1]) + "\n")
        print(f"\r{len(rows)} scenes", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return rows


def options(description: str | None, scenes: int) -> argparse.ArgumentParser:
    """Return the options of a program that measures random scenes."""
    parser = parser_of(description)
    parser.add_argument("--scenes", type=int, default=scenes)
    parser.add_argument("--first", type=int)
    parser.add_argument("--rows", type=Path, help="JSON lines of the finished scenes, to go on with later")
    return parser


def share_words(n: int, total: int) -> str:
    """Return a number of scenes with the lower end of its 95 % interval."""
    if total == 0:
        return "-"
    return f"{n} of {total} ({n / total:.1%}; at least {wilson(n, total)[0]:.1%})"


def page(rows: Sequence[Row]) -> str:
    """Return the page in Markdown."""
    done = [row for row in rows if "failed" not in row]
    stable = [row for row in done if row["stable"] and row["sensor"] == "ideal"]
    pads = [row for row in done if row["stable"] and row["sensor"] == "pads"]
    unstable = [row for row in done if not row["stable"]]
    lines = [
        "# Regimes of the simulator",
        "",
        *_summary(stable),
        "Written by `python benchmarks/regimes.py > benchmarks/results/regimes.md`. Simulated.",
        "Scenes are drawn from physical ranges, apart from the scenes on which the simulator was developed:",
        "contact stiffness 1e2 to 1e7 N/m, moving mass 0.5 to 300 kg, mass ratio 1e-5 to 10, damping ratio",
        "1e-3 to 30, head space 1e-7 to 2e-3 m³, vent 0 to 1e-4 m², relaxation time 1e-6 to 1e4 s,",
        "approach 1 to 100 mm/s, tick 0.2 to 5 ms, slosh 0.5 to 2000 Hz, with pads or ideal sensors.",
        "",
        f"{len(rows)} scenes (seeds {_numbers(rows)}); the full count is 1500. "
        f"{len(unstable)} have an unstable sampled velocity loop, {len(rows) - len(done)} have no reference, "
        f"{sum(not row['reference_resolved'] for row in done)} have a reference in which a tick has not converged. "
        f"{where_measured()}.",
        "",
        "- *Within*: features, peak force and force trace differ from the reference by at most the accuracy.",
        "- *Flagged*: the report lists them under `not_verified`. *Refused*: the grasp did not run.",
        "- *Worst without a flag / accuracy*: the largest error of a grasp that is not flagged, over the accuracy.",
        "- *Unstable loop*: the sampled loop of controller and fingers amplifies a deviation from tick to tick. The "
        "report says so (`unstable_loop`), and lists peak, trace and features as not verified. This is not counted as "
        "a flag here.",
        "- *At least*: the lower end of the 95 % Wilson interval.",
        "",
        _confirmed(stable, "Stable loop, ideal sensors"),
        _confirmed(unstable, "Unstable loop"),
        "",
    ]
    for title, some in (
        ("Ideal sensors, stable loop", stable),
        (
            "Read by pads and encoder, stable loop: single grasps, which the condition of features limits",
            pads,
        ),
        ("Unstable loop", unstable),
    ):
        lines += ["", f"## {title}", "", *_within(some)]
    lines += ["", "## Largest errors without a flag", "", *_misses(stable)]
    return "\n".join(lines) + "\n"


def _summary(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the result for an accuracy of 1 % with ideal sensors and a stable loop."""
    kept = sum(_is_kept(row["0.01"], 0.01) for row in rows)
    yield (
        f"With ideal sensors and a stable loop, {kept} of {len(rows)} grasps are within an accuracy of 1 %, flagged or "
        "refused."
    )
    yield ""


def _is_kept(case: Row, accuracy: float) -> bool:
    """Return whether a grasp is within the accuracy, flagged or refused."""
    return case["error"] <= accuracy or "refused" in case or bool(case["flags"])


def _numbers(rows: Sequence[Row]) -> str:
    """Return the seeds of the scenes in words, one range for each run of the program."""
    numbers = sorted(row["scene"] for row in rows)
    begins = [a for k, a in enumerate(numbers) if k == 0 or numbers[k - 1] < a - 1]
    last = [a for k, a in enumerate(numbers) if k == len(numbers) - 1 or numbers[k + 1] > a + 1]
    return ", ".join(f"{a} to {b}" for a, b in zip(begins, last, strict=True))


def _confirmed(rows: Sequence[Row], what: str) -> str:
    """Return in words how many references that have not converged fixed steps confirm."""
    mine = [row["even"] for row in rows if not row["reference_resolved"]]
    counts = " and ".join(f"{sum(e <= a for e in mine)} within {a:.2%}" for a in (ACCURACIES[-1], 1e-4))
    return f"{what}: of {len(mine)} references that have not converged, fixed steps of 10 µs agree with {counts}."


def _within(rows: Sequence[Row]) -> list[str]:
    cells = []
    for accuracy in ACCURACIES if rows else ():
        mine = [row[f"{accuracy:g}"] for row in rows]
        within = sum(case["error"] <= accuracy for case in mine)
        refused = sum("refused" in case for case in mine)
        flagged = sum(bool(case.get("flags")) for case in mine)
        silent = [case["error"] / accuracy for case in mine if "refused" not in case and not case["flags"]]
        kept = sum(_is_kept(case, accuracy) for case in mine)
        shares = share_words(within, len(mine)), share_words(kept, len(mine))
        worst = f"{max(silent, default=math.nan):.3g}"
        cells.append((f"selected for {accuracy:.1%}", *shares, str(flagged), str(refused), worst))
    heads = ("steps", "within", "within, flagged or refused", "flagged", "refused")
    return markdown_table((*heads, "worst without a flag / accuracy"), cells)


def _misses(rows: Sequence[Row]) -> Iterator[str]:
    missed = [
        (row[f"{a:g}"]["error"] / a, a, row)
        for row in rows
        for a in ACCURACIES
        if not _is_kept(row[f"{a:g}"], a)
    ]
    if not missed:
        yield "None: every grasp with ideal sensors and a stable loop is within the accuracy, flagged or refused."
        return
    cells = []
    for _, accuracy, row in sorted(missed, key=lambda miss: -miss[0])[:20]:
        case = row[f"{accuracy:g}"]
        error = f"{case['error']:.3g}", case["of"]
        cells.append(
            (str(row["scene"]), f"{accuracy:g}", *error, row["outcome"], case["chosen"], f"{row['even']:.2g}")
        )
    heads = ("scene", "accuracy", "error", "of", "outcome of the reference", "steps")
    yield from markdown_table((*heads, "error of fixed steps of 10 µs"), cells)
    yield ""
    yield (
        "Where fixed steps of 10 µs differ from the reference by as much as the selected model, these two agree: it is "
        "the reference that meets a threshold of the controller in another tick."
    )


def main() -> None:
    given = options(__doc__, 1500).parse_args()
    if given.short:
        given.scenes, given.first = 1, 1  # a scene drawn anew may take minutes
    bench = Bench(compiled=not given.short)
    print(page(run(lambda number: measured(bench, scene_of(number)), given.rows, given.scenes, given.first)))


if __name__ == "__main__":
    main()
