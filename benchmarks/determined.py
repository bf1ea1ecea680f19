"""What a squeeze determines of the terms that `graspsense identify` does not fit: liquid, slosh, surface and worn.

    python benchmarks/determined.py [--markdown docs/identify.md]

A scene with each term is grasped in simulation by the hybrid controller, with a hold. The forces along the gap of this
grasp are computed again with each parameter changed by 1 %. What the other parameters of the term and the width can
mimic is subtracted, and then also what the terms can mimic that are identified (`elastic`, `maxwell`, `loss`). What
remains, against the noise of a sensor, gives the standard deviation of the logarithm of the parameter (Cramér and Rao).
A parameter is determined if its 90 % interval is within a factor of four.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import time
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import asdict, frozen
from identify import SENSORS, scene_text, squeezes_of, write_between
from numpy.typing import NDArray

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.driven import RecordedPath, follow_many
from graspsense_sim_gripper.identify.interval import normal
from graspsense_sim_gripper.identify.refuse import WIDE

Floats = NDArray[np.float64]

SHELL: Final = {"type": "elastic", "k1_n_m": 1500.0}
LIQUID: Final = {
    "type": "liquid",
    "area_m2": 0.5e-3,
    "neck_m2": 3.8e-4,
    "column_m": 0.03,
    "bulge_m3_pa": 3e-10,
    "viscosity_pa_s": 1e-3,
}
WORN: Final = {
    "type": "worn",
    "k1_n_m": 2200.0,
    "k3_n_m3": 2e6,
    "wear_j": 3.0,
    "softening": 0.3,
    "set_m": 0.002,
    "earlier_j": 1.0,
}
SCENES: Final[Mapping[str, tuple[Mapping[str, Any], ...]]] = {
    "liquid": (LIQUID, SHELL),
    "liquid, area and neck known": (LIQUID, SHELL),
    "slosh": ({"type": "slosh", "mass_kg": 0.02, "frequency_hz": 3.5, "damping_ratio": 0.01}, SHELL),
    "surface": (
        {"type": "surface", "mass_kg": 0.02, "k_n_m": 2000.0, "damping_n_s_m": 5.0, "contact_n_m": 20000.0},
    ),
    "worn, earlier work known": (WORN,),
}
"""The values of `flimsy_bottle`, `peers_surface` and `worn_bottle` (`graspsense_sim_gripper/objects/scenes`)."""
KNOWN: Final[Mapping[str, tuple[str, ...]]] = {
    "liquid, area and neck known": ("area_m2", "neck_m2", "viscosity_pa_s"),
    # Where a squeeze wears little, softening and dent over this work are all that shows of it.
    "worn, earlier work known": ("wear_j", "earlier_j"),
}
BESIDE: Final[tuple[Mapping[str, Any], ...]] = (
    {"type": "elastic", "k1_n_m": 15.0},
    {"type": "elastic", "k1_n_m": 1e-3, "k3_n_m3": 3e5},
    {"type": "loss", "damping_n_s_m": 1.0},
    *({"type": "maxwell", "k_n_m": 15.0, "tau_s": tau} for tau in (0.05, 0.2, 0.8)),
)
"""A little of each term that is identified."""
STEP: Final = 1e-4
"""Small, since the phase of an oscillation shifts by the whole duration of the squeeze."""
SHOWN: Final = 0.01
"""The change that the table is for."""
WIDTH_STEP_M: Final = 1e-5
NOISE: Final[Mapping[str, tuple[float, float]]] = {
    "ideal": (0.01, 1e-3),
    "60 Hz pads": (1.0 / 60.0, 3e-3),
    "PR2 pads": (0.041, 3.6e-3),
}
"""Time between measurements (s), and their error over the peak force: the residuals of the known scenes."""


@frozen(kw_only=True)
class Row:
    """What a squeeze shows of a parameter."""

    term: str
    parameter: str
    change: float
    """The rms change of the force over the peak for 1 %."""
    alone: float
    """Of it, what neither the other parameters of the term nor the width can mimic."""
    beside: float
    """And what the terms that are identified cannot mimic either."""
    deviation: Mapping[str, float]
    """Standard deviation of the logarithm with each sensor, beside the terms that are identified."""


def rows_of(name: str) -> list[Row]:
    """Return the rows of a term."""
    terms = SCENES[name]
    (squeeze,) = squeezes_of(scene_text(terms, 0.0), name, SENSORS["ideal"], ["1"], [1])
    path = RecordedPath(t_s=squeeze.trace.t_s, gap_m=squeeze.trace.gap_m)
    width = float(squeeze.trace.gap_m[int(np.argmax(squeeze.trace.force_left_n > 0.0))])
    first = {key: value for key, value in terms[0].items() if key != "type"}

    def forces(
        changed: Mapping[str, float], more: Sequence[Mapping[str, Any]] = (), wider: float = 0.0
    ) -> Floats:
        own = {"type": terms[0]["type"], **first, **changed}
        text = scene_text([own, *terms[1:], *more], 0.0).replace(
            "width_m = 0.05", f"width_m = {width + wider}"
        )
        config = SimConfig(sensor="ideal", spread=False, compile="never")
        return follow_many(config, path, [text], [1])[0].force_n

    base = forces({})
    touched = np.flatnonzero(base > 0.0)
    part = slice(int(touched[0]), int(touched[-1]) + 1)
    peak = float(base.max())
    own = {
        key: (forces({key: value * (1.0 + STEP)}) - forces({key: value * (1.0 - STEP)})) / (2.0 * STEP)
        for key, value in first.items()
        if key not in KNOWN.get(name, ())
    }
    nuisance = [forces({}, wider=WIDTH_STEP_M) - base]
    if len(terms) > 1:
        nuisance.append(forces({}, [{"type": "elastic", "k1_n_m": 15.0}]) - base)
    others = [forces({}, [one]) - base for one in BESIDE]
    rows = []
    for key, change in own.items():
        rest = [two for other, two in own.items() if other != key]
        left = {}
        for which, by in (("alone", [*rest, *nuisance]), ("beside", [*rest, *nuisance, *others])):
            left[which] = _unmimicked(change[part], [one[part] for one in by]) / peak
        deviation = {}
        for sensor, (period_s, noise) in NOISE.items():
            every = max(round(period_s / 1e-3), 1)
            at = slice(part.start, part.stop, every)
            seen = _unmimicked(change[at], [one[at] for one in (*rest, *nuisance, *others)]) / peak
            deviation[sensor] = noise / max(float(np.linalg.norm(seen)), 1e-12)
        rms = {which: SHOWN * float(np.sqrt(np.mean(one**2))) for which, one in left.items()}
        total = SHOWN * float(np.sqrt(np.mean((change[part] / peak) ** 2)))
        rows.append(Row(term=name, parameter=key, change=total, deviation=deviation, **rms))
    return rows


def _unmimicked(change: Floats, others: Sequence[Floats]) -> Floats:
    """Return what no linear combination of the others gives."""
    table = np.array(others).T
    size = np.linalg.norm(table, axis=0)
    table = table[:, size > 0.0] / size[size > 0.0]
    known, *_ = np.linalg.lstsq(table, change, rcond=1e-9)
    left: Floats = change - table @ known
    return left


def as_markdown(rows: Sequence[Row]) -> str:
    """Return the table."""
    columns = [
        "term",
        "parameter",
        "change of the force per 1 %",
        "not mimicked by its other parameters and the width",
    ]
    columns += ["nor by the terms that are identified"]
    columns += [f"90 % interval, {sensor}" for sensor in NOISE]
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    for row in rows:
        cells = [
            row.term,
            f"`{row.parameter}`",
            *(f"{1e6 * one:.2g} ppm" for one in (row.change, row.alone, row.beside)),
        ]
        for deviation in row.deviation.values():
            span = 2.0 * normal() * deviation
            factor = math.exp(min(span, 700.0))
            cells.append(f"a factor of {factor:.2g}" if factor <= WIDE else "not determined")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--markdown", type=Path, help="write the table to this page")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    asked = parser.parse_args()
    begin = time.monotonic()
    rows = [row for name in (asked.only[:1] if asked.short else asked.only) for row in rows_of(name)]
    made = {"date": str(date.today()), "python": platform.python_version(), "cores": os.cpu_count()}
    if asked.markdown:
        write_between(asked.markdown, "determined", as_markdown(rows))
    elif asked.json:
        print(json.dumps({"rows": [asdict(one) for one in rows], "made": made}, indent=2))
    else:
        print(as_markdown(rows))
        print(f"{made}, {time.monotonic() - begin:.0f} s")


if __name__ == "__main__":
    main()
