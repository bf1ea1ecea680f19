"""Whether `graspsense identify` brings known scenes back, and at how many recordings a simulator stops paying.

    python benchmarks/identify.py [--repeats 4] [--only NAME...] [--transfer] [--json] [--short]

Each scene below is grasped in simulation by the hybrid controller with a hold, with ideal sensors and with PR2 pads,
once, three times and ten times. With three and ten grasps the stiffness differs between objects (10 %). The scene is
then identified from these grasps. A row counts how often the true terms were chosen, how often the 90 % intervals hold
the true values where the true terms were chosen, and gives the median error and time. An interval of a single squeeze
is of this squeeze, whose object has the nominal stiffness.

With `--transfer`: four containers of the catalogue are the real world. From 1, 3, 10 and 30 recordings of each,
a classifier is trained on the recordings, and another on simulated squeezes of the scenes that they were identified as.
Both are tested on 40 other recordings of each container.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import tempfile
import time
import tomllib
from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import asdict, frozen

from graspsense import load_pipeline
from graspsense.core.identification import Identification, RecordedSqueeze
from graspsense.plugin_api import RunConfig, create, table_of
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.identify.run import identify

WIDTH_M: Final = 0.05
AT_M: Final = 0.01
SCENES: Final[Mapping[str, tuple[Mapping[str, Any], ...]]] = {
    "spring": ({"type": "elastic", "k1_n_m": 1500.0},),
    "stiffening": ({"type": "elastic", "k1_n_m": 800.0, "k3_n_m3": 1.5e7},),
    "softening": ({"type": "elastic", "k1_n_m": 3000.0, "k3_n_m3": -1e7},),
    "hertz": ({"type": "rigid", "hertz_n_m15": 30000.0},),
    "foam": ({"type": "foam", "force_n": 8.0, "at_m": AT_M, "exponent": 2.3},),
    "creeping": (
        {"type": "elastic", "k1_n_m": 1200.0},
        {"type": "maxwell", "k_n_m": 500.0, "tau_s": 0.2},
    ),
    "damped": ({"type": "elastic", "k1_n_m": 1500.0}, {"type": "loss", "damping_n_s_m": 60.0}),
    "creeping foam": (
        {"type": "foam", "force_n": 8.0, "at_m": AT_M, "exponent": 2.0},
        {"type": "maxwell", "k_n_m": 300.0, "tau_s": 0.3},
    ),
}
COUNTS: Final = (1, 3, 10)
SENSORS: Final = ("ideal", "pads")
STIFFNESS_SPREAD: Final = 0.1
HOLD_S: Final = 1.5
FORCE_N: Final = 18.0
CONTAINERS: Final = ("odwalla:empty_open", "naked:empty_open", "can:empty_open", "water:empty_open")
TRANSFER_COUNTS: Final = (1, 3, 10, 30)
TESTED: Final = 40
SIMULATED_INSTANCES: Final = 10
SIMULATED_TRIALS: Final = 4


@frozen(kw_only=True)
class Row:
    """The result for a scene, a sensor, and a number of recordings."""

    scene: str
    sensor: str
    recordings: int
    repeats: int
    right_terms: int
    covered: int
    intervals: int
    median_error: float
    """Relative error of the values, where the true terms were chosen."""
    seconds: float


def scene_text(terms: Sequence[Mapping[str, Any]], spread: float) -> str:
    """Return the text of a scene with these terms."""
    lines = [f"width_m = {WIDTH_M}", f"stiffness_spread = {spread}", "share = 0.6", "share_spread = 0.01"]
    for term in terms:
        lines.append("[[terms]]")
        lines += [f"{key} = {json.dumps(value)}" for key, value in term.items()]
    return "\n".join(lines) + "\n"


def squeezes_of(scene: str, label: str, sensor: str, seeds: Sequence[int]) -> list[RecordedSqueeze]:
    """Return simulated recordings of a scene, each of another object."""
    config = SimConfig(sensor=sensor)  # type: ignore[arg-type]
    backend = create("sensor-backend", "sim", sensor=sensor)
    controller = create("controller", "hybrid", probing_force_n=FORCE_N)
    names = [f"{scene}#{seed}" for seed in seeds]
    run = RunConfig(hold_s=HOLD_S)
    done = backend.run_many(controller, names, list(seeds), run=run, traces=True)
    return [
        RecordedSqueeze(
            name=f"{label}-{seed}",
            sha256="0" * 64,
            trace=grasp.trace,
            label=label,
            instance=f"{label}#{seed}",
            gripper={"sensor": sensor, "pad_stiffness_n_m": config.pad_stiffness_n_m},
            simulated=True,
        )
        for seed, grasp in zip(seeds, done, strict=True)
    ]


def true_values(terms: Sequence[Mapping[str, Any]], identified: str) -> dict[str, float]:
    """Return the true values of the parameters, with a foam's force at the compression of the identified scene."""
    at_m = {one["type"]: one.get("at_m") for one in tomllib.loads(identified)["terms"]}
    values = {}
    for term in terms:
        for name, value in term.items():
            if name in ("type", "at_m"):
                continue
            if term["type"] == "foam" and name == "force_n" and at_m.get("foam"):
                value = value * (at_m["foam"] / term["at_m"]) ** term["exponent"]
            values[f"{term['type']}.{name}"] = float(value)
    return values


def has_true_terms(result: Identification, terms: Sequence[Mapping[str, Any]]) -> bool:
    """Return whether the chosen parameters are those of the true terms."""
    names = {one.name for one in result.parameters if "." in one.name}
    return names == set(true_values(terms, result.scene))


def measured(name: str, sensor: str, count: int, repeats: int) -> Row:
    """Return the row of a scene."""
    terms = SCENES[name]
    text = scene_text(terms, STIFFNESS_SPREAD if count > 1 else 0.0)
    right = covered = intervals = 0
    errors: list[float] = []
    seconds: list[float] = []
    for k in range(repeats):
        # Other objects in every row: the number of an object fixes its stiffness, whatever its terms.
        series = 1000 * list(SCENES).index(name) + 10 * count + (sensor == "pads")
        seeds = [1_000_000 * (series + 1) + 1000 * k + i for i in range(count)]
        result = identify(SimConfig(), squeezes_of(text, name, sensor, seeds), lambda *_: None)
        seconds.append(result.seconds)
        if not has_true_terms(result, terms):
            continue
        right += 1
        truth = true_values(terms, result.scene)
        for one in result.parameters:
            if one.name in truth:
                intervals += 1
                covered += one.low <= truth[one.name] <= one.high
                errors.append(abs(one.value / truth[one.name] - 1.0))
    return Row(
        scene=name,
        sensor=sensor,
        recordings=count,
        repeats=repeats,
        right_terms=right,
        covered=int(covered),
        intervals=intervals,
        median_error=float(np.median(errors)) if errors else math.nan,
        seconds=float(np.median(seconds)),
    )


def in_words(row: Row) -> str:
    """Return a row as a line of text."""
    return (
        f"{row.scene:14} {row.sensor:6} {row.recordings:3} recordings: "
        f"right terms {row.right_terms} of {row.repeats}, covered {row.covered} of {row.intervals}, "
        f"median error {100.0 * row.median_error:.2f} %, {row.seconds:.1f} s"
    )


def transfer(counts: Sequence[int], tested: int, classifier: str = "forest") -> list[dict[str, float]]:
    """Return the recognition rates of classifiers trained on recordings, and on the scenes identified from them."""
    settings = load_pipeline("default", options=[f"classifier.type={classifier}"]).settings
    extract = settings.features.create().extract
    recorded = {name: squeezes_of(name, name, "pads", range(max(counts) + tested)) for name in CONTAINERS}
    test = [(extract(one.trace), name) for name in CONTAINERS for one in recorded[name][-tested:]]
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for count in counts:
            own = [(extract(one.trace), name) for name in CONTAINERS for one in recorded[name][:count]]
            simulated = []
            for k, name in enumerate(CONTAINERS):
                path = Path(folder) / f"{k}-{count}.toml"
                result = identify(SimConfig(), recorded[name][:count], lambda *_: None)
                path.write_text(result.scene, encoding="utf-8")
                seeds = [10_000 + i for i in range(SIMULATED_INSTANCES * SIMULATED_TRIALS)]
                new = squeezes_of(str(path), name, "pads", seeds)
                simulated += [(extract(one.trace), name) for one in new]
            rows.append(
                {
                    "recordings": count,
                    "on_recordings": _rate(settings, own, test),
                    "on_identified": _rate(settings, simulated, test),
                    "on_both": _rate(settings, [*own, *simulated], test),
                }
            )
            print(rows[-1], flush=True)
    return rows


def _rate(settings: Any, train: Sequence[tuple[Any, str]], test: Sequence[tuple[Any, str]]) -> float:
    classifier = settings.classifier.create()
    classifier.fit(table_of([row for row, _ in train]), [label for _, label in train], seed=0)
    best = np.argmax(classifier.probabilities(table_of([row for row, _ in test])), axis=1)
    names = classifier.classes()
    return float(np.mean([names[k] == label for k, (_, label) in zip(best, test, strict=True)]))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=4)
    parser.add_argument("--only", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--recordings", nargs="+", type=int, default=list(COUNTS))
    parser.add_argument("--transfer", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    asked = parser.parse_args()
    if asked.short:
        asked.only, asked.recordings, asked.repeats = ["creeping"], [1], 1
    begin = time.monotonic()
    if asked.transfer:
        rows: list[Any] = transfer(TRANSFER_COUNTS, TESTED)
    else:
        rows = []
        for name in asked.only:
            for sensor in SENSORS[-1:] if asked.short else SENSORS:
                for count in asked.recordings:
                    row = measured(name, sensor, count, asked.repeats)
                    rows.append(asdict(row))
                    if not asked.json:
                        print(in_words(row), flush=True)
    made = {"date": str(date.today()), "python": platform.python_version(), "cores": os.cpu_count()}
    if asked.json:
        print(json.dumps({"rows": rows, "made": made}, indent=2))
    else:
        print(f"{made}, {time.monotonic() - begin:.0f} s")


if __name__ == "__main__":
    main()
