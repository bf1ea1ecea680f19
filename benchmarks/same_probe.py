"""One version's part of `benchmarks/same.py`: run inside that version's environment, it records results and times.

It reads one JSON request a line from standard input and answers each with one JSON line. It uses only what a user or a
plugin author calls (`graspsense`, `graspsense.plugin_api`, the public names of `graspsense_c45`), so that the same file
runs with both versions.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np

from graspsense import load_pipeline
from graspsense.plugin_api import create
from graspsense.simulator_api import RunConfig

CONTROLLERS: Final = ("hybrid", "velocity", "force")
SENSORS: Final = ("ideal", "pads")
TRACE_COLUMNS: Final = (
    "t_s",
    "gap_m",
    "velocity_m_s",
    "effort_n",
    "force_left_n",
    "force_right_n",
    "edge_left_n",
    "edge_right_n",
    "command",
    "phase",
    "pad_t_s",
    "pad_left",
    "pad_right",
)
C45_OPTIONS: Final[Mapping[str, Mapping[str, Any]]] = {
    "default": {},
    "unpruned": {"pruning": "none"},
    "reduced_error": {"pruning": "reduced_error"},
    "no_collapse": {"collapse": False},
    "binary": {"binary_splits": True},
    "laplace": {"laplace": True},
    "no_raising": {"subtree_raising": False},
    "midpoint": {"actual_split_value": False},
}
Arrays = dict[str, np.ndarray]


def flat(value: Any) -> list[Any]:
    """Return the numbers and texts inside nested lists, tuples and mappings, in order; names of keys do not count."""
    if isinstance(value, Mapping):
        return [leaf for item in value.values() for leaf in flat(item)]
    if isinstance(value, list | tuple | np.ndarray):
        return [leaf for item in value for leaf in flat(item)]
    return [value]


def numbers(values: Sequence[Any]) -> np.ndarray:
    """Return the numbers among these values as float64."""
    return np.array([float(v) for v in values if isinstance(v, int | float) and not isinstance(v, bool)])


def recorded(name: str, trace: Any, outcome: Any, figures: Sequence[float] = ()) -> Arrays:
    """Return a grasp as arrays: the columns of its trace, its outcome and further figures."""
    arrays = {f"{name}/{column}": np.asarray(getattr(trace, column)) for column in TRACE_COLUMNS}
    arrays[f"{name}/outcome"] = np.array([int(outcome)])
    if len(figures):
        arrays[f"{name}/figures"] = np.array([float(value) for value in figures])
    return arrays


def sim(config: Mapping[str, Any]) -> Any:
    return create("sensor-backend", "sim", **config)


def reported(report: Mapping[str, Any]) -> list[float]:
    return [float(report["true_peak_force_n"]), float(report["resolved"]), float(report["broken"])]


def single(objects: Sequence[str]) -> Arrays:
    """Every object under each controller with each sensor, one grasp at a time in the interpreter."""
    arrays: Arrays = {}
    for controller in CONTROLLERS:
        for sensor in SENSORS:
            options = [f"controller.type={controller!r}", f"gripper.sensor={sensor!r}"]
            pipeline = load_pipeline("default", options=options)
            for seed, name in enumerate(objects):
                trial = pipeline.grasp(object=name, seed=seed)
                figures = [*trial.features.values, *reported(trial.report)]
                arrays |= recorded(f"{controller}/{sensor}/{name}", trial.trace, trial.outcome, figures)
    return arrays


def batch(objects: Sequence[str]) -> Arrays:
    """The same grasps as batches through the compiled loop, on one thread."""
    arrays: Arrays = {}
    for controller in CONTROLLERS:
        for sensor in SENSORS:
            grasps = sim({"sensor": sensor, "compile": "always"}).run_many(
                create("controller", controller), objects, range(len(objects)), traces=True, workers=1
            )
            for name, grasp in zip(objects, grasps, strict=True):
                key = f"{controller}/{sensor}/{name}"
                arrays |= recorded(key, grasp.trace, grasp.outcome, reported(grasp.report))
    return arrays


def scenes(files: Sequence[Mapping[str, Any]]) -> Arrays:
    """Random scenes under the hybrid controller, with the spread of friction and without."""
    arrays: Arrays = {}
    for scene in files:
        controller = create("controller", "hybrid", closing_speed_m_s=scene["speed_m_s"])
        for spread in (False, True):
            key = f"{Path(scene['file']).stem}/{'spread' if spread else 'no spread'}"
            try:
                (grasp,) = sim({**scene["config"], "spread": spread, "compile": "never"}).run_many(
                    controller,
                    [scene["file"]],
                    [7],
                    traces=True,
                    workers=1,
                    run=RunConfig(grasp_timeout_s=20.0),
                )
            except (
                Exception
            ) as error:  # A refusal is a result: that both versions refuse is what is compared.
                arrays[f"{key}/refused"] = np.array([type(error).__name__])
                continue
            arrays |= recorded(key, grasp.trace, grasp.outcome, reported(grasp.report))
    return arrays


def pr2(objects: Sequence[str]) -> Arrays:
    """Grasps of the PR2 driver over its emulated board."""
    arrays: Arrays = {}
    options = ["gripper.type='pr2'", "gripper.transport='emulated'"]
    pipeline = load_pipeline("default", options=options)
    for seed, name in enumerate(objects[:2]):
        trial = pipeline.grasp(object=name, seed=seed)
        arrays |= recorded(name, trial.trace, trial.outcome, trial.features.values)
    return arrays


def c45_tables(folder: Path) -> Iterator[tuple[str, Any]]:
    """Yield the training data of the C4.5 oracles."""
    from graspsense_c45 import Attribute, Schema, make_table, read_arff

    for path in sorted((folder / "arff").glob("*.arff")):
        yield path.stem, read_arff(path)
    for path in sorted((folder / "data").glob("*.csv")):
        rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
        rows = [row for row in rows if row[0] == "train"]
        values = np.array([[float(cell.replace("?", "nan")) for cell in row[1:-2]] for row in rows])
        labels = [int(row[-2]) for row in rows]
        classes = tuple(f"c{k}" for k in range(max(labels) + 1))
        attributes = tuple(Attribute(f"x{k}") for k in range(values.shape[1]))
        weights = [float(row[-1] or 1) for row in rows]
        yield path.stem, make_table(Schema(attributes, classes), values, labels, weights)


def plain_engine() -> str:
    """Return the name of the engine that compiles nothing, which earlier versions had with numpy."""
    from graspsense_c45.options import Engine

    return str(get_args(Engine)[1])


def c45(folder: str) -> Arrays:
    """The trees of the C4.5 oracles, by the interpreter and by compiled code."""
    from graspsense_c45 import Options, fit

    arrays: Arrays = {}
    for name, table in c45_tables(Path(folder)):
        for variant, options in C45_OPTIONS.items():
            for form, engine in (("plain", plain_engine()), ("fast", "fast")):
                key = f"{name}/{variant}/{form}"
                try:
                    tree = fit(table, Options(**options), engine=engine)
                except ValueError as error:
                    arrays[f"{key}/refused"] = np.array([type(error).__name__])
                    continue
                arrays[key] = numbers([math.nan if leaf is None else leaf for leaf in flat(tree.to_dict())])
    return arrays


def default_model(folder: str) -> Arrays:
    """The default model as it is shipped, and as its own command makes it."""
    import graspsense_sim_gripper

    package = Path(graspsense_sim_gripper.__file__).parent
    (shipped,) = package.rglob("models/default.json")
    arrays = model_numbers("shipped", json.loads(shipped.read_text(encoding="utf-8")))
    from graspsense.cli.main import main

    out = Path(folder) / f"default-{os.getpid()}.json"
    words = ["train", "simulated", "--out", str(out), "--instances", "60", "--trials", "1"]
    with contextlib.redirect_stdout(sys.stderr), contextlib.suppress(SystemExit):
        main(words)
    return arrays | model_numbers("trained", json.loads(out.read_text(encoding="utf-8")))


def model_numbers(name: str, document: Mapping[str, Any]) -> Arrays:
    """Return the numbers of a stored model, without its provenance."""
    arrays = {f"{name}/model": numbers(flat(document["model"]))}
    return arrays | {f"{name}/unknown": numbers(flat(document["unknown"]))}


RECORDERS: Final[Mapping[str, Callable[[Mapping[str, Any]], Arrays]]] = {
    "catalogue, single": lambda request: single(request["objects"]),
    "catalogue, batch": lambda request: batch(request["objects"]),
    "random scenes": lambda request: scenes(request["scenes"]),
    "emulated PR2": lambda request: pr2(request["objects"]),
    "C4.5 oracles": lambda request: c45(request["c45"]),
    "default model": lambda request: default_model(request["folder"]),
}


def timed(function: Callable[[], object]) -> float:
    """Return the processor time (s) of one call."""
    begun_s = time.process_time()
    function()
    return time.process_time() - begun_s


class Timings:
    """What is timed, prepared once so that compiling and choosing models do not count."""

    def __init__(self, request: Mapping[str, Any]) -> None:
        from graspsense_c45 import Options, fit

        objects: list[str] = request["objects"]
        hybrid, seeds = create("controller", "hybrid"), range(len(objects))
        plain = load_pipeline("default")
        # Versions that predict while a grasp goes on do more than earlier ones, but not without a classifier.
        unrecognised = load_pipeline("default", options=["classifier.type='none'"])
        ideal = sim({"sensor": "ideal", "compile": "always"})
        pads = sim({"sensor": "pads", "compile": "always"})
        table = dict(c45_tables(Path(request["c45"])))["grasp_11c_1100"]
        self.of: dict[str, Callable[[], object]] = {
            "catalogue, plain": lambda: [plain.grasp(object=name, seed=0) for name in objects],
            "catalogue, plain, no classifier": lambda: [
                unrecognised.grasp(object=name, seed=0) for name in objects
            ],
            "batch, ideal sensors": lambda: ideal.run_many(hybrid, objects * 20, [*seeds] * 20, workers=1),
            "batch, pads": lambda: pads.run_many(hybrid, objects * 20, [*seeds] * 20, workers=1),
            "C4.5, plain": lambda: fit(table, Options(), engine=plain_engine()),
            "C4.5, compiled": lambda: fit(table, Options(), engine="fast"),
        }

    def seconds(self, name: str, repeats: int = 3) -> float:
        """Return the median processor time of a few calls."""
        return statistics.median(timed(self.of[name]) for _ in range(repeats))


def main() -> None:
    """Answer requests until standard input ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    timings: Timings | None = None
    for line in sys.stdin:
        request = json.loads(line)
        if "record" in request:
            arrays = RECORDERS[request["record"]](request)
            np.savez(request["to"], **{name.replace("/", "|"): value for name, value in arrays.items()})
            answer: dict[str, Any] = {"arrays": len(arrays)}
        elif "prepare" in request:
            timings = Timings(request)
            for name in timings.of:
                timings.seconds(name, 1)
            answer = {"timings": list(timings.of)}
        else:
            assert timings is not None
            answer = {"s": timings.seconds(request["time"])}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
