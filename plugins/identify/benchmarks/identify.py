"""Whether `graspsense identify` brings known scenes back, and at how many recordings a simulator stops paying.

    python plugins/identify/benchmarks/identify.py [--repeats 4] [--only NAME...] [--sensors NAME...] [--rows FILE]
    python plugins/identify/benchmarks/identify.py --transfer [--rows FILE]

Each scene below is grasped in simulation by the hybrid controller with a hold, with ideal sensors, with PR2 pads, and
with pads at the 60 Hz of Robotiq's TSF-85 whose fingertips harden, once, three times and ten times. In each repeat,
every value of the scene is multiplied by a factor from 0.74 to 1.35. With three and ten grasps the stiffness differs
between objects (10 %). The scene is then identified from these grasps. A row says whether the true terms were
chosen, and how many of the 90 % intervals hold the true values where they were. An interval of a single squeeze is of
this squeeze, whose object has the nominal stiffness. Rows are appended to the file of `--rows`, whose tables are
printed; with `--repeats 0` nothing is run.

With `--transfer`: four containers of the catalogue are the real world. From 1, 3, 10 and 30 recordings of each,
a classifier is trained on the recordings, and another on simulated squeezes of the scenes that they were identified as.
A third is trained on as many simulated squeezes of the true scenes: an identification does no better on average. All
are tested on 40 other recordings of each container.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import asdict, frozen

from graspsense import load_pipeline
from graspsense.classifier_api import table_of
from graspsense.core.components.identification import RecordedSqueeze
from graspsense.core.files.toml_text import toml_value
from graspsense.evaluation.intervals import clustered, wilson
from graspsense.experiments.versions import where_measured
from graspsense.plugin_api import create
from graspsense.report.found_table import markdown_table
from graspsense.simulator_api import RunConfig
from graspsense_identify.laws import SLOTS
from graspsense_identify.run import identify
from graspsense_sim_gripper.config import SimConfig

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
    "snap": (
        {
            "type": "snap",
            "k1_n_m": 3000.0,
            "critical_m": 2e-3,
            "drop_n": 2.0,
            "fall_m": 1e-3,
            "k2_n_m": 2500.0,
        },
    ),
    "creeping foam": (
        {"type": "foam", "force_n": 8.0, "at_m": AT_M, "exponent": 2.0},
        {"type": "maxwell", "k_n_m": 300.0, "tau_s": 0.3},
    ),
    "creeping hertz": (
        {"type": "rigid", "hertz_n_m15": 20000.0},
        {"type": "maxwell", "k_n_m": 400.0, "tau_s": 0.25},
    ),
    "creeping and damped": (
        {"type": "elastic", "k1_n_m": 1200.0},
        {"type": "maxwell", "k_n_m": 600.0, "tau_s": 0.4},
        {"type": "loss", "damping_n_s_m": 40.0},
    ),
}
COUNTS: Final = (1, 3, 10)
SENSORS: Final[Mapping[str, Mapping[str, Any]]] = {
    "ideal": {"sensor": "ideal"},
    "PR2 pads": {"sensor": "pads"},
    "60 Hz pads": {"sensor": "pads", "pad_period_s": 1.0 / 60.0, "pad_hardening_m": 0.001},
}
"""The settings of the gripper."""
FACTOR: Final = 0.3
"""The logarithm of the largest factor on the values of a scene."""
STIFFNESS_SPREAD: Final = 0.1
HOLD_S: Final = 1.5
TOLD_APART: Final = 1.03
"""Terms whose fits differ by less than this factor are not told apart by the data."""
FORCE_N: Final = 18.0
CONTAINERS: Final = ("odwalla:empty_open", "naked:empty_open", "can:empty_open", "water:empty_open")
TRANSFER_COUNTS: Final = (1, 3, 10, 30)
TESTED: Final = 40
FIRST_SIMULATED: Final = 10_000
SIMULATED: Final = 40
"""Simulated squeezes of each scene, each of another object: with fewer objects, their spreads show less."""


@frozen(kw_only=True)
class Row:
    """The result for a scene, a sensor, a number of recordings, and a repeat."""

    scene: str
    sensor: str
    recordings: int
    repeat: int
    chosen: str
    """The chosen terms."""
    right_terms: bool
    told_apart: bool
    """Whether the data tell the true terms from the chosen ones: the chosen ones fit worse, or are more."""
    parameters: tuple[tuple[str, float, float, float, float], ...]
    """Each parameter with its true value, its value, and the ends of its interval, where the true terms were chosen."""
    seconds: float


def drawn(terms: Sequence[Mapping[str, Any]], repeat: int) -> list[dict[str, Any]]:
    """Return the terms of a repeat, with every value but that of `at_m` times a factor of its own."""
    rng = np.random.default_rng([repeat, len(terms)])
    return [
        {
            key: value if key in ("type", "at_m") else value * math.exp(rng.uniform(-FACTOR, FACTOR))
            for key, value in term.items()
        }
        for term in terms
    ]


def scene_text(terms: Sequence[Mapping[str, Any]], spread: float) -> str:
    """Return the text of a scene with these terms."""
    numbers = {"width_m": WIDTH_M, "stiffness_spread": spread, "share": 0.6, "share_spread": 0.01}
    values = {**numbers, "terms": list(terms)}
    return "".join(f"{key} = {toml_value(value)}\n" for key, value in values.items())


def squeezes_of(
    scene: str, label: str, gripper: Mapping[str, Any], names: Sequence[str], seeds: Sequence[int]
) -> list[RecordedSqueeze]:
    """Return simulated recordings of a scene, one of each object, which the names tell apart."""
    config = SimConfig(**gripper)
    backend = create("sensor-backend", "sim", **gripper)
    controller = create("controller", "hybrid", probing_force_n=FORCE_N)
    objects = [f"{scene}#{name}" for name in names]
    run = RunConfig(hold_s=HOLD_S)
    done = backend.run_many(controller, objects, list(seeds), run=run, traces=True)
    return [
        RecordedSqueeze(
            name=f"{label}-{seed}",
            sha256="0" * 64,
            trace=grasp.trace,
            label=label,
            instance=f"{label}#{name}",
            gripper={"pad_stiffness_n_m": config.pad_stiffness_n_m, **gripper},
            simulated=True,
        )
        for name, seed, grasp in zip(names, seeds, done, strict=True)
    ]


def true_values(terms: Sequence[Mapping[str, Any]], identified: str) -> dict[str, float]:
    """Return the true values of the parameters, with a foam's force at the compression of the identified scene."""
    at_m = {term["type"]: term.get("at_m") for term in tomllib.loads(identified)["terms"]}
    values = {}
    for term in terms:
        for key, value in term.items():
            if key in ("type", "at_m"):
                continue
            if term["type"] == "foam" and key == "force_n" and at_m.get("foam"):
                value = value * (at_m["foam"] / term["at_m"]) ** term["exponent"]
            values[f"{term['type']}.{key}"] = float(value)
    return values


def named(terms: Sequence[Mapping[str, Any]]) -> str:
    """Return the name of the candidate with these terms."""
    cubic = sum(term.get("k3_n_m3", 0.0) for term in terms)
    form = "softening" if cubic < 0.0 else "k1, k3" if cubic > 0.0 else "k1"
    kinds = sorted((term["type"] for term in terms), key=SLOTS.index)
    return " + ".join(f"elastic ({form})" if kind == "elastic" else kind for kind in kinds)


def seeds_of(name: str, sensor: str, count: int, repeat: int) -> list[int]:
    """Return the seeds of the grasps of a row, which are the numbers of its objects as well.

    They are others in every row: the number of an object fixes its stiffness, whatever its terms.
    """
    series = (list(SCENES).index(name) * 10 + list(SENSORS).index(sensor)) * 100 + count
    return [100_000 * (series + 1) + 100 * repeat + i for i in range(count)]


def measured(name: str, sensor: str, count: int, repeat: int) -> Row:
    """Return the row of a scene."""
    terms = drawn(SCENES[name], repeat)
    text = scene_text(terms, STIFFNESS_SPREAD if count > 1 else 0.0)
    seeds = seeds_of(name, sensor, count, repeat)
    squeezes = squeezes_of(text, name, SENSORS[sensor], [str(seed) for seed in seeds], seeds)
    result = identify(SimConfig(), squeezes, lambda *_: None)
    chosen = next(candidate for candidate in result.candidates if candidate.chosen)
    true = next((candidate for candidate in result.candidates if candidate.terms == named(terms)), None)
    right = true is chosen
    truth = true_values(terms, result.scene) if right else {}
    known = [parameter for parameter in result.parameters if parameter.name in truth]
    alike = true is not None and chosen.fit_error <= TOLD_APART * true.fit_error
    return Row(
        scene=name,
        sensor=sensor,
        recordings=count,
        repeat=repeat,
        chosen=chosen.terms,
        right_terms=right,
        told_apart=right or true is None or not alike or chosen.parameters > true.parameters,
        parameters=tuple(
            (parameter.name, truth[parameter.name], parameter.value, parameter.low, parameter.high)
            for parameter in known
        ),
        seconds=result.seconds,
    )


def _share(part: int, whole: int) -> str:
    if not whole:
        return "–"
    low, high = wilson(part, whole)
    return f"{100.0 * part / whole:.0f} % ({part} of {whole}; {100.0 * low:.0f} to {100.0 * high:.0f})"


def _covered_share(group: Sequence[Mapping[str, Any]]) -> str:
    """Return the share of the intervals that cover. The intervals of a scene share their error: they are clustered."""
    covered = [low <= truth <= high for row in group for _, truth, _, low, high in row["parameters"]]
    scenes = [str(k) for k, row in enumerate(group) for _ in row["parameters"]]
    if len(set(scenes)) < 2:
        return f"{sum(covered)} of {len(covered)}"
    low, high = clustered(covered, scenes)
    share = f"{100.0 * sum(covered) / len(covered):.0f} % ({sum(covered)} of {len(covered)}"
    return f"{share}; {100.0 * low:.0f} to {100.0 * high:.0f})"


def tables(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the tables of these rows: by sensor and number of recordings, and by scene."""

    def line(head: Sequence[str], group: Sequence[Mapping[str, Any]]) -> Sequence[str]:
        apart = [row for row in group if row["told_apart"]]
        errors = [abs(value / truth - 1.0) for row in group for _, truth, value, *_ in row["parameters"]]
        return (
            *head,
            str(len(group)),
            _share(sum(row["right_terms"] for row in group), len(group)),
            _share(sum(row["right_terms"] for row in apart), len(apart)),
            _covered_share(group),
            f"{100.0 * float(np.median(errors)):.2g} %" if errors else "–",
            f"{float(np.median([row['seconds'] for row in group])):.1f} s",
        )

    columns = ("scenes", "right terms", "where the data tell them apart", "90 % intervals that cover")
    columns += ("median error", "median time")
    by_sensor = [line([*map(str, head)], group) for head, group in grouped(rows, "sensor", "recordings")]
    yield from markdown_table(("sensor", "squeezes", *columns), [*by_sensor, line(("all", "all"), rows)])
    yield ""
    yield from markdown_table(
        ("scene", *columns), [line(head, group) for head, group in grouped(rows, "scene")]
    )


def grouped(
    rows: Sequence[Mapping[str, Any]], *keys: str
) -> Iterable[tuple[tuple[Any, ...], Sequence[Mapping[str, Any]]]]:
    """Return the rows with the same values of these keys, with these values, in the order of sensors and scenes."""
    order = {name: place for place, name in enumerate((*SENSORS, *SCENES))}
    groups: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in sorted(rows, key=lambda row: [order.get(row[key], row[key]) for key in keys]):
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    return groups.items()


def transfer(counts: Sequence[int]) -> Iterator[dict[str, float]]:
    """Yield the recognition rates of classifiers trained on recordings, and on the scenes identified from them."""
    settings = load_pipeline("default", options=["classifier.type=forest"]).settings
    extract = settings.features.create().extract
    pads = SENSORS["PR2 pads"]
    recorded = {
        name: squeezes_of(name, name, pads, [str(i // 3) for i in seeds], seeds)
        for name in CONTAINERS
        for seeds in [range(max(TRANSFER_COUNTS) + TESTED)]
    }
    test = [(extract(squeeze.trace), name) for name in CONTAINERS for squeeze in recorded[name][-TESTED:]]
    true = [(extract(squeeze.trace), name) for name in CONTAINERS for squeeze in simulated_of(name, name)]
    on_true = _right(settings, true, test)
    with tempfile.TemporaryDirectory() as folder:
        for count in counts:
            own = [
                (extract(squeeze.trace), name) for name in CONTAINERS for squeeze in recorded[name][:count]
            ]
            simulated = []
            begin = time.monotonic()
            for k, name in enumerate(CONTAINERS):
                path = Path(folder) / f"{k}-{count}.toml"
                result = identify(SimConfig(), recorded[name][:count], lambda *_: None)
                path.write_text(result.scene, encoding="utf-8")
                simulated += [(extract(squeeze.trace), name) for squeeze in simulated_of(str(path), name)]
            yield {
                "recordings": count,
                "tested": len(test),
                "on_recordings": _right(settings, own, test),
                "on_identified": _right(settings, simulated, test),
                "on_true": on_true,
                "on_both": _right(settings, [*own, *simulated], test),
                "seconds": time.monotonic() - begin,
            }


def simulated_of(scene: str, label: str) -> list[RecordedSqueeze]:
    """Return the simulated squeezes of a scene that a classifier is trained on."""
    seeds = [FIRST_SIMULATED + i for i in range(SIMULATED)]
    return squeezes_of(scene, label, SENSORS["PR2 pads"], [str(seed) for seed in seeds], seeds)


def _right(settings: Any, train: Sequence[tuple[Any, str]], test: Sequence[tuple[Any, str]]) -> int:
    """Return how many of the tested squeezes are recognised."""
    classifier = settings.classifier.create()
    classifier.fit(table_of([row for row, _ in train]), [label for _, label in train], seed=0)
    best = np.argmax(classifier.probabilities(table_of([row for row, _ in test])), axis=1)
    names = classifier.classes()
    return sum(names[k] == label for k, (_, label) in zip(best, test, strict=True))


_CURVES: Final = (
    ("on_recordings", "the recordings"),
    ("on_identified", "scenes identified from them"),
    ("on_both", "both"),
    ("on_true", "the true scenes"),
)


def transfer_table(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the table of the transfer."""
    header = ("recordings a class", *(f"trained on {name}" for _, name in _CURVES))
    shares = ([_share(int(row[key]), int(row["tested"])) for key, _ in _CURVES] for row in rows)
    cells = [(str(row["recordings"]), *share) for row, share in zip(rows, shares, strict=True)]
    yield from markdown_table(header, cells)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="number of the first repeat")
    parser.add_argument("--only", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--sensors", nargs="+", choices=list(SENSORS), default=list(SENSORS))
    parser.add_argument("--recordings", nargs="+", type=int, help="the numbers of recordings")
    parser.add_argument("--transfer", action="store_true")
    parser.add_argument("--rows", type=Path, help="append the rows to this file (JSON lines)")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    asked = parser.parse_args()
    if asked.short:
        asked.only, asked.recordings, asked.repeats = ["creeping"], [1], 1
        asked.sensors = ["PR2 pads"]
    begin, rows = time.monotonic(), []
    if asked.rows and asked.rows.exists():
        rows = [json.loads(line) for line in asked.rows.read_text(encoding="utf-8").splitlines()]
    counts = asked.recordings or (TRANSFER_COUNTS if asked.transfer else COUNTS)
    repeats = range(asked.first, asked.first + asked.repeats)
    cases = product(repeats, counts, asked.sensors, asked.only)
    known = (asdict(measured(name, sensor, count, repeat)) for repeat, count, sensor, name in cases)
    for row in transfer(counts if asked.repeats else ()) if asked.transfer else known:
        print(json.dumps(row), file=sys.stderr, flush=True)
        rows.append(row)
        # A run that is stopped has all scenes in its rows.
        if asked.rows:
            with asked.rows.open("a", encoding="utf-8") as out:
                out.write(f"{json.dumps(row)}\n")
    print("\n".join(transfer_table(rows) if asked.transfer else tables(rows)))
    print(f"\n{where_measured()}, {time.monotonic() - begin:.0f} s")


if __name__ == "__main__":
    main()
