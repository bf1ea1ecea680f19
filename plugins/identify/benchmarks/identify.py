"""Whether `graspsense identify` brings known scenes back, and at how many recordings a simulator stops paying.

    python plugins/identify/benchmarks/identify.py [--repeats 4] [--only NAME...] [--sensors NAME...] [...]
    python plugins/identify/benchmarks/identify.py --delays 0 0.01 0.025 [...] [--rows FILE] [--markdown FILE]
    python plugins/identify/benchmarks/identify.py --spreads 0 0.3 [...] [--rows FILE] [--markdown FILE]
    python plugins/identify/benchmarks/identify.py --rows FILE --markdown FILE
    python plugins/identify/benchmarks/identify.py --transfer [--rows FILE] [--markdown FILE] [--png FILE]

Each scene below is grasped in simulation by the hybrid controller with a hold, with ideal sensors, with PR2 pads, and
with pads at the 60 Hz of Robotiq's TSF-85 whose fingertips harden, once, three times and ten times. In each repeat,
every value of the scene is multiplied by a factor from 0.74 to 1.35. With three and ten grasps the stiffness differs
between objects (10 %). The scene is then identified from these grasps. A row says whether the true terms were
chosen, and how many of the 90 % intervals hold the true values where they were. An interval of a single squeeze is of
this squeeze, whose object has the nominal stiffness. Rows are appended to the file of `--rows`, and `--markdown` writes
its tables between the marks of a page.

With `--delays`: the forces of the recordings are late by these times (s), of which the settings of the gripper do not
know, and their table is that of the delays that come back.

With `--spreads`: one parameter of each scene of `OWN_SPREADS` differs between objects by these standard deviations of
its logarithm, and their table is that of the spreads that are claimed.

With `--transfer`: four containers of the catalogue are the real world. From 1, 3, 10 and 30 recordings of each,
a classifier is trained on the recordings, and another on simulated squeezes of the scenes that they were identified as.
A third is trained on as many simulated squeezes of the true scenes: an identification does no better on average. All
are tested on 40 other recordings of each container.
"""

from __future__ import annotations

import argparse
import json
import math
import tempfile
import time
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby, product
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import asdict, evolve, frozen

from graspsense import load_pipeline
from graspsense.classifier_api import table_of
from graspsense.core.components.identification import Identification, RecordedSqueeze
from graspsense.evaluation.intervals import wilson
from graspsense.experiments.versions import where_measured
from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig
from graspsense_identify.interval import interval_of_mean
from graspsense_identify.laws import SLOTS
from graspsense_identify.run import identify
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.scene.instance import _draws_of_number
from graspsense_sim_gripper.scene.library import SCENE_IN_MEMORY

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
    "two branches": (
        {"type": "elastic", "k1_n_m": 1000.0},
        {"type": "maxwell", "k_n_m": 600.0, "tau_s": 0.08},
        {"type": "maxwell", "k_n_m": 400.0, "tau_s": 0.5},
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
OWN_SPREADS: Final = {"creeping": "maxwell.tau_s", "stiffening": "elastic.k3_n_m3", "foam": "foam.exponent"}
"""The parameter with a spread of its own in the rows of `--spreads`."""
HOLD_S: Final = 1.5
TOLD_APART: Final = 1.03
"""Terms whose fits differ by less than this factor are not told apart by the data."""
FORCE_N: Final = 18.0
CONTAINERS: Final = ("odwalla:empty_open", "naked:empty_open", "can:empty_open", "water:empty_open")
TRANSFER_COUNTS: Final = (1, 3, 10, 30)
TESTED: Final = 40
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
    late_s: float = 0.0
    """By how much the forces of the recordings were late."""
    delay: tuple[float, float, float, bool] | None = None
    """The identified delay, the ends of its interval, and whether it was used; None if none was determined."""
    own_spread: float = 0.0
    """The spread of the parameter of `OWN_SPREADS`."""
    spreads: tuple[tuple[str, float, float, float], ...] = ()
    """The parameters for which a spread of their own was claimed, with it and the ends of its interval."""


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


def scene_text(
    terms: Sequence[Mapping[str, Any]], spread: float, own: str = "", own_spread: float = 0.0
) -> str:
    """Return the text of a scene with these terms. `own`: the parameter with a spread of its own."""
    lines = [f"width_m = {WIDTH_M}", f"stiffness_spread = {spread}", "share = 0.6", "share_spread = 0.01"]
    for term in terms:
        lines.append("[[terms]]")
        lines += [f"{key} = {json.dumps(value)}" for key, value in term.items()]
        kind, _, name = own.partition(".")
        if own_spread > 0.0 and kind == term["type"]:
            lines.append(f"spread = {{ {name} = {own_spread} }}")
    return "\n".join(lines) + "\n"


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


def delayed(squeeze: RecordedSqueeze, late_s: float) -> RecordedSqueeze:
    """Return the recording of a sensor whose forces, and times of images, are late by a number of ticks."""
    trace = squeeze.trace
    ticks = round(late_s / float(np.median(np.diff(trace.t_s))))
    last = len(trace.t_s) - ticks

    def late(force: Any) -> Any:
        return np.concatenate([np.full(ticks, force[0]), force[:last]])

    left, right = late(trace.force_left_n), late(trace.force_right_n)
    return evolve(
        squeeze,
        trace=evolve(trace, pad_t_s=trace.pad_t_s + late_s, force_left_n=left, force_right_n=right),
    )


def true_values(terms: Sequence[Mapping[str, Any]], identified: str) -> dict[str, float]:
    """Return the true values of the parameters, with a foam's force at the compression of the identified scene.

    The first of two Maxwell branches is the one that is the first in the identified scene, by their relaxation times.
    """
    scene = tomllib.loads(identified)["terms"]
    at_m = {term["type"]: term.get("at_m") for term in scene}
    times = [term["tau_s"] for term in scene if term["type"] == "maxwell"]
    branches = sorted(
        (row for row in terms if row["type"] == "maxwell"), key=lambda branch: float(branch["tau_s"])
    )
    if times != sorted(times):
        branches.reverse()
    values = {}
    for term in terms:
        name = "maxwell 2" if term["type"] == "maxwell" and term is not branches[0] else term["type"]
        for key, value in term.items():
            if key in ("type", "at_m"):
                continue
            if term["type"] == "foam" and key == "force_n" and at_m.get("foam"):
                value = value * (at_m["foam"] / term["at_m"]) ** term["exponent"]
            values[f"{name}.{key}"] = float(value)
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


def mean_is_covered(row: Mapping[str, Any]) -> bool:
    """Return whether the 90 % interval of Student's t from the stiffness of the row's objects covers the true mean.

    It uses what was drawn and no measurement: where it does not cover, no identification would.
    """
    seeds = seeds_of(row["scene"], row["sensor"], row["recordings"], row["repeat"])
    drawn = np.array([_draws_of_number(SCENE_IN_MEMORY, seed, 2)[0] for seed in seeds])
    low, high = interval_of_mean(drawn)
    return low < 0.0 < high


def measured(
    name: str,
    sensor: str,
    count: int,
    repeat: int,
    late_s: float = 0.0,
    own_spread: float = 0.0,
) -> Row:
    """Return the row of a scene."""
    terms = drawn(SCENES[name], repeat)
    text = scene_text(terms, STIFFNESS_SPREAD if count > 1 else 0.0, OWN_SPREADS.get(name, ""), own_spread)
    seeds = seeds_of(name, sensor, count, repeat)
    squeezes = squeezes_of(text, name, SENSORS[sensor], [str(seed) for seed in seeds], seeds)
    late = [delayed(squeeze, late_s) for squeeze in squeezes]
    result = identify(SimConfig(), late, lambda *_: None)
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
        late_s=late_s,
        delay=_delay(result),
        own_spread=own_spread,
        spreads=tuple(
            (parameter.name.removesuffix(".spread"), parameter.value, parameter.low, parameter.high)
            for parameter in result.parameters
            if parameter.name.endswith(".spread")
        ),
    )


def _delay(result: Identification) -> tuple[float, float, float, bool] | None:
    """Return the delay, the ends of its interval, and whether it was used; None if it was refused."""
    delay = next((parameter for parameter in result.parameters if parameter.name == "delay_s"), None)
    refused = any(undetermined.what == "delay of the sensor" for undetermined in result.undetermined)
    used = tomllib.loads(result.scene)["identified"]["sensor"]["delay_s"] != 0.0
    return None if delay is None or (refused and not used) else (delay.value, delay.low, delay.high, used)


def in_words(row: Row) -> str:
    """Return a row as a line of text."""
    errors = ", ".join(f"{100.0 * (value / truth - 1.0):+.2f}" for _, truth, value, *_ in row.parameters)
    covered = _covered([row.parameters])
    right = (
        "right terms" if row.right_terms else f"{row.chosen}{'' if row.told_apart else ' (as good a fit)'}"
    )
    return (
        f"{row.scene:20} {row.sensor:10} {row.recordings:3} {right}, covered {sum(covered)} of {len(covered)}, "
        f"errors {errors} %, {row.seconds:.1f} s"
    )


def _covered(rows: Sequence[Sequence[Sequence[Any]]]) -> list[bool]:
    """Return whether each interval holds the true value."""
    return [low <= truth <= high for row in rows for _, truth, _, low, high in row]


def _share(part: int, whole: int) -> str:
    if not whole:
        return "–"
    low, high = wilson(part, whole)
    return f"{100.0 * part / whole:.0f} % ({part} of {whole}; {100.0 * low:.0f} to {100.0 * high:.0f})"


def _covered_share(group: Sequence[Mapping[str, Any]]) -> str:
    """Return the share of the intervals that cover, with the Wilson interval of the effective number of intervals.

    The intervals of a scene share their error, so that they count as fewer: by the design effect, which is the variance
    between scenes over that of independent intervals (Korn and Graubard, Survey Methodology 24, 1998).
    """
    sizes = np.array([len(row["parameters"]) for row in group if row["parameters"]])
    if not len(sizes):
        return "–"
    hits = np.array([sum(_covered([row["parameters"]])) for row in group if row["parameters"]])
    whole, part, scenes = int(sizes.sum()), int(hits.sum()), len(sizes)
    share = part / whole
    effective = float(scenes)
    if scenes > 1 and 0 < part < whole:
        between = float(np.sum((hits - share * sizes) ** 2)) * scenes / (scenes - 1) / whole**2
        effective = min(share * (1.0 - share) / max(between, 1e-12), float(whole))
    low, high = wilson(share * effective, effective)
    return f"{100.0 * share:.0f} % ({part} of {whole}; {100.0 * low:.0f} to {100.0 * high:.0f})"


def as_markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the tables of these rows: by sensor and number of recordings, and by scene."""

    def line(head: Sequence[str], group: Sequence[Mapping[str, Any]]) -> Sequence[str]:
        apart = [row for row in group if row["told_apart"]]
        several = [row for row in group if row["recordings"] > 1]
        errors = [abs(value / truth - 1.0) for row in group for _, truth, value, *_ in row["parameters"]]
        return (
            *head,
            str(len(group)),
            _share(sum(row["right_terms"] for row in group), len(group)),
            _share(sum(row["right_terms"] for row in apart), len(apart)),
            _covered_share(group),
            _share(sum(mean_is_covered(row) for row in several), len(several)),
            f"{100.0 * float(np.median(errors)):.2g} %" if errors else "–",
            f"{float(np.median([row['seconds'] for row in group])):.1f} s",
        )

    columns = ("scenes", "right terms", "where the data tell them apart", "90 % intervals that cover")
    columns += ("scenes whose drawn objects cover", "median error", "median time")
    by_sensor = [line(map(str, head), group) for head, group in grouped(rows, "sensor", "recordings")]
    by_scene = [line(head, group) for head, group in grouped(rows, "scene")]
    return "\n\n".join(
        (
            table(("sensor", "squeezes", *columns), [*by_sensor, line(("all", "all"), rows)]),
            table(("scene", *columns), by_scene),
        )
    )


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    head, *lines = (f"| {' | '.join(cells)} |" for cells in (columns, *rows))
    return "\n".join((head, "|" + "---|" * len(columns), *lines))


def grouped(
    rows: Sequence[Mapping[str, Any]], *keys: str
) -> Iterator[tuple[tuple[Any, ...], Sequence[Mapping[str, Any]]]]:
    """Yield the rows with the same values of these keys, with these values: by sensor, and in order."""

    def values(row: Mapping[str, Any]) -> tuple[Any, ...]:
        return tuple(row[key] for key in keys)

    def place(row: Mapping[str, Any]) -> tuple[Any, ...]:
        order = {"sensor": list(SENSORS), "scene": list(SCENES)}
        return tuple(order[key].index(row[key]) if key in order else row[key] for key in keys)

    for group_values, group in groupby(sorted(rows, key=place), key=values):
        yield group_values, list(group)


def delays_markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of the delays: by sensor, number of recordings, and delay."""
    columns = ("sensor", "squeezes", "forces late by", "scenes", "delay used", "not determined")
    columns += ("90 % intervals of the delay that cover", "median error of the delay", "right terms")
    columns += ("90 % intervals of the parameters that cover",)
    lines = []
    for (sensor, count, late_s), group in grouped(rows, "sensor", "recordings", "late_s"):
        delays = [row["delay"] for row in group if row["delay"]]
        errors = [1e3 * abs(value - late_s) for value, *_ in delays]
        covered = _covered([row["parameters"] for row in group])
        lines.append(
            (
                *(sensor, str(count), f"{1e3 * late_s:.0f} ms", str(len(group))),
                *(str(sum(delay[3] for delay in delays)), str(len(group) - len(delays))),
                _share(sum(low <= late_s <= high for _, low, high, _ in delays), len(delays)),
                f"{float(np.median(errors)):.2g} ms" if errors else "–",
                _share(sum(row["right_terms"] for row in group), len(group)),
                _share(sum(covered), len(covered)),
            )
        )
    return table(columns, lines)


def spreads_markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of the spreads: by sensor, number of objects, parameter and spread."""
    columns = (
        "sensor",
        "objects",
        "parameter",
        "its spread",
        "scenes",
        "claimed",
        "claimed of another parameter",
    )
    columns += ("90 % intervals that cover", "median of what was claimed")
    lines = []
    for (sensor, count, scene, spread), group in grouped(rows, "sensor", "recordings", "scene", "own_spread"):
        parameter = OWN_SPREADS[scene]
        claims = [claim for row in group for claim in row["spreads"] if claim[0] == parameter]
        others = sum(any(claim[0] != parameter for claim in row["spreads"]) for row in group)
        lines.append(
            (
                *(sensor, str(count), f"`{parameter}`", f"{spread:g}", str(len(group))),
                *(_share(len(claims), len(group)), str(others)),
                _share(sum(low <= spread <= high for *_, low, high in claims), len(claims))
                if spread
                else "–",
                f"{float(np.median([value for _, value, *_ in claims])):.2g}" if claims else "–",
            )
        )
    return table(columns, lines)


def write_between(path: Path, mark: str, text: str) -> None:
    """Replace what is between the two comments `mark` of a page by a text."""
    begin, end = f"<!-- {mark} -->", f"<!-- end of {mark} -->"
    head, _, tail = path.read_text(encoding="utf-8").partition(begin)
    _, has_end, after = tail.partition(end)
    if not has_end:
        raise SystemExit(f"{path} has no lines {begin} and {end}")
    path.write_text(f"{head}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def transfer(counts: Sequence[int], tested: int, classifier: str = "forest") -> Iterator[dict[str, float]]:
    """Yield the recognition rates of classifiers trained on recordings, and on the scenes identified from them."""
    settings = load_pipeline("default", options=[f"classifier.type={classifier}"]).settings
    extract = settings.features.create().extract
    pads = SENSORS["PR2 pads"]
    recorded = {
        name: squeezes_of(name, name, pads, [str(i // 3) for i in seeds], seeds)
        for name in CONTAINERS
        for seeds in [range(max(TRANSFER_COUNTS) + tested)]
    }
    test = [(extract(squeeze.trace), name) for name in CONTAINERS for squeeze in recorded[name][-tested:]]
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


def simulated_of(scene: str, label: str, first_seed: int = 10_000) -> list[RecordedSqueeze]:
    """Return the simulated squeezes of a scene that a classifier is trained on."""
    seeds = [first_seed + i for i in range(SIMULATED)]
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


def transfer_markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the table of the transfer."""
    return table(
        ("recordings a class", *(f"trained on {name}" for _, name in _CURVES)),
        [
            (str(row["recordings"]), *(_share(int(row[key]), int(row["tested"])) for key, _ in _CURVES))
            for row in rows
        ],
    )


def draw_transfer(rows: Sequence[Mapping[str, Any]], path: Path) -> None:
    """Draw the rates over the number of recordings."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    counts = [row["recordings"] for row in rows]
    for key, name in _CURVES:
        rates = [100.0 * row[key] / row["tested"] for row in rows]
        ends = [wilson(int(row[key]), int(row["tested"])) for row in rows]
        low = [rate - 100.0 * end[0] for rate, end in zip(rates, ends, strict=True)]
        high = [100.0 * end[1] - rate for rate, end in zip(rates, ends, strict=True)]
        axes.errorbar(counts, rates, yerr=[low, high], marker="o", capsize=3.0, label=f"trained on {name}")
    axes.set_xscale("log")
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.minorticks_off()
    axes.set_xlabel("recordings a class")
    axes.set_ylabel("recognised, % (95 % interval)")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=2, frameon=False)
    figure.savefig(path, dpi=140)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="number of the first repeat")
    parser.add_argument("--only", nargs="+", choices=list(SCENES), default=list(SCENES))
    parser.add_argument("--sensors", nargs="+", choices=list(SENSORS), default=list(SENSORS))
    parser.add_argument("--recordings", nargs="+", type=int, help="the numbers of recordings")
    parser.add_argument("--delays", nargs="+", type=float, help="the times by which the forces are late (s)")
    parser.add_argument(
        "--spreads", nargs="+", type=float, help="the spreads of the parameters of OWN_SPREADS"
    )
    parser.add_argument("--transfer", action="store_true")
    parser.add_argument("--rows", type=Path, help="append the rows to this file (JSON lines)")
    parser.add_argument(
        "--markdown", type=Path, help="write the tables of --rows to this page, and run nothing"
    )
    parser.add_argument("--png", type=Path, help="draw the transfer of --rows, and run nothing")
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    asked = parser.parse_args()
    if asked.markdown or asked.png:
        if asked.rows is None:
            parser.error("--markdown and --png need --rows FILE")
        rows = [json.loads(line) for line in asked.rows.read_text(encoding="utf-8").splitlines()]
        if asked.png:
            draw_transfer(rows, asked.png)
        if asked.markdown:
            write_between(asked.markdown, *published(asked, rows))
        return
    if asked.short:
        asked.only, asked.recordings, asked.repeats = ["creeping"], [1], 1
        asked.sensors = ["PR2 pads"]
    begin, rows = time.monotonic(), []
    # A run that is stopped has all scenes in its rows.
    for row in transfer(asked.recordings or TRANSFER_COUNTS, TESTED) if asked.transfer else scenes(asked):
        rows.append(row)
        if asked.rows:
            with asked.rows.open("a", encoding="utf-8") as out:
                out.write(f"{json.dumps(row)}\n")
    print(published(asked, rows)[1])
    print(f"{where_measured()}, {time.monotonic() - begin:.0f} s")


def scenes(asked: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """Yield the rows of the scenes that are asked for."""
    repeats = range(asked.first, asked.first + asked.repeats)
    for repeat, count, sensor, name, late_s, own in product(
        *(repeats, asked.recordings or COUNTS, asked.sensors, asked.only),
        *(asked.delays or [0.0], asked.spreads or [0.0]),
    ):
        row = measured(name, sensor, count, repeat, late_s, own)
        print(in_words(row), flush=True)
        yield asdict(row)


def published(asked: argparse.Namespace, rows: Sequence[Mapping[str, Any]]) -> tuple[str, str]:
    """Return the mark on the page, and the tables, of rows of what is asked for."""
    if asked.transfer:
        return "transfer", transfer_markdown(rows)
    if asked.spreads:
        return "spreads", spreads_markdown(rows)
    if asked.delays:
        return "delays", delays_markdown(rows)
    return "known scenes", as_markdown(rows)


if __name__ == "__main__":
    main()
