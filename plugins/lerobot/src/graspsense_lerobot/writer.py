"""Trials of a store as a LeRobot data set v3.0: `graspsense export DIR --to lerobot:FOLDER`.

Each trial is an episode. Its channels are taken at the frames of the data set; `graspsense/raw` in the folder has them
at their own rates. `meta/graspsense.json` says what each column and each number stands for.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Self

import numpy as np
import pyarrow
from attrs import frozen
from pyarrow import parquet

from graspsense.gripper_api import Phase, StoredGrasp
from graspsense.plugin_api import ConfigError, TactileArray, Trace
from graspsense.testing_api import ImageTrace, SampleTrace
from graspsense_lerobot.columns import Column, parquet_columns, statistics
from graspsense_lerobot.folder import DATA_PATHS

FPS: Final = 30
"""Frames per second that are written unless the user gives others."""
JITTER: Final = 0.01
"""Share of a frame by which a measurement may be later and still be of it: times of data sets have 24 bits."""
FILE_BYTES: Final = 100 * 2**20
"""Size of the numbers of a data file beyond which the next one begins, as LeRobot has it."""
LARGEST_ARRAY: Final = 4096
"""Most numbers of an array in a frame. A larger one, such as the image of a camera, is in the raw files only."""
EPISODES: Final = "meta/episodes/chunk-000/file-000.parquet"
_FRAME: Final = {
    "gripper.pos": ("gap_m", "gap"),
    "gripper.vel": ("velocity_m_s", "velocity"),
    "gripper.effort": ("effort_n", "effort"),
    "left.force": ("force_left_n", "force_left"),
    "right.force": ("force_right_n", "force_right"),
}
"""Name in `observation.state` to the column of the trace and the channel, whose unit it has."""


@frozen(kw_only=True)
class Meanings:
    """The events that were told in these trials, and the labels that were predicted.

    Their numbers are their places in these lists, from 1 on; 0 is none.
    """

    events: tuple[str, ...]
    classes: tuple[str, ...]

    @classmethod
    def of_grasps(cls, grasps: Sequence[StoredGrasp]) -> Self:
        """Return those of these trials."""
        return cls(
            events=tuple(dict.fromkeys(what for grasp in grasps for _, what in _told(grasp))),
            classes=tuple(dict.fromkeys(label for grasp in grasps for _, label in predictions(grasp))),
        )

    def numbers(self, grasp: StoredGrasp, times: Any) -> tuple[Any, Any]:
        """Return the number of the event that was told in each frame, and of the prediction that holds in it."""
        event, prediction = np.zeros((2, len(times)), dtype=np.int64)
        for t_s, what in _told(grasp):
            event[_frame(times, t_s)] = self.events.index(what) + 1
        for t_s, label in predictions(grasp):
            prediction[_frame(times, t_s) :] = self.classes.index(label) + 1
        return event, prediction

    def as_json(self) -> dict[str, dict[str, str]]:
        """Return what the numbers of phase, event and prediction stand for."""
        return {
            "graspsense.phase": {str(int(phase)): phase.name.lower() for phase in Phase},
            "graspsense.event": {str(k): name for k, name in enumerate(("", *self.events))},
            "graspsense.prediction": {str(k): name for k, name in enumerate(("", *self.classes))},
        }


def _frame(times: Any, t_s: float) -> int:
    return min(int(np.searchsorted(times, t_s - 1e-9)), len(times) - 1)


@frozen(kw_only=True)
class Plan:
    """What all episodes have: frames per second, names of the state, arrays, and what numbers stand for."""

    fps: int
    state: tuple[str, ...]
    units: tuple[str, ...]
    arrays: tuple[TactileArray, ...]
    tasks: tuple[str, ...]
    meanings: Meanings
    commanded: bool
    """Whether all trials have commands; else the action is the position one frame later."""


def write_data_set(grasps: Sequence[StoredGrasp], fps: float | None, part: Path) -> dict[str, int]:
    """Write trials as a data set to a folder, and return how many trials and frames it has.

    `fps` is the number of frames per second, by default 30. Raises ConfigError if a trial cannot be an episode.
    """
    fps = fps or FPS
    if fps != int(fps):
        raise ConfigError(f"fps={fps:g}: LeRobot has whole numbers of frames per second")
    frames = _write(part, grasps, planned(grasps, int(fps)))
    return {"trials": len(grasps), "frames": frames}


def planned(grasps: Sequence[StoredGrasp], fps: int) -> Plan:
    """Return what all these trials have. Raises ConfigError if they differ in what a column needs."""
    state: dict[str, str] | None = None
    commanded, arrays = True, _arrays(grasps[0])
    for grasp in grasps:
        trace = grasp.trace()
        if trace.units["t"] != "s" or len(trace) < 2:
            raise ConfigError(
                f"trial {grasp.number} cannot be an episode: its times are no seconds, or it has no frames"
            )
        units = {name: unit for name, (values, unit) in _state(trace).items() if np.isfinite(values).any()}
        if state is not None and any(state[name] != unit for name, unit in units.items() if name in state):
            raise ConfigError(f"trial {grasp.number} is in other units than those before: export them apart")
        state = units if state is None else {name: unit for name, unit in state.items() if name in units}
        arrays = tuple(
            array for array in arrays if array in grasp.channels and len(trace.signals[array.name].t_s)
        )
        commanded &= bool(np.isfinite(trace.command).all())
    if not state:
        raise ConfigError("the trials have no channel in common, and an episode needs one")
    return Plan(
        fps=fps,
        state=tuple(state),
        units=tuple(state.values()),
        arrays=arrays,
        tasks=tuple(dict.fromkeys(map(task_of, grasps))),
        meanings=Meanings.of_grasps(grasps),
        commanded=commanded,
    )


def task_of(grasp: StoredGrasp) -> str:
    """Return the task of a trial: its label, or that there is none."""
    return grasp.label or "grasp"


def predictions(grasp: StoredGrasp) -> list[tuple[float, str]]:
    """Return the predictions of a trial with the time of each (s): those while it went on, and the final one."""
    running = [
        (float(event["t_s"]), str(event["what"]).rpartition(": ")[2])
        for event in grasp.events
        if event.get("source") == "model"
    ]
    final = grasp.prediction
    return running + ([(np.inf, str(final["label"]))] if final else [])


def _told(grasp: StoredGrasp) -> list[tuple[float, str]]:
    """Return the events that the controller told, with their times (s)."""
    return [
        (float(event["t_s"]), str(event["what"]))
        for event in grasp.events
        if event.get("source") == "controller"
    ]


def _arrays(grasp: StoredGrasp) -> tuple[TactileArray, ...]:
    return tuple(
        channel
        for channel in grasp.channels
        if isinstance(channel, TactileArray) and channel.name != "pads" and channel.numbers <= LARGEST_ARRAY
    )


def _state(trace: Trace) -> dict[str, tuple[Any, str]]:
    """Return the numbers of the state of a trial at each tick, with their units."""
    state = {
        name: (getattr(trace, column), trace.units[channel]) for name, (column, channel) in _FRAME.items()
    }
    return state | {
        name.replace("_", "."): (values, trace.units.get(name, "1"))
        for name, values in trace.signals.items()
        if isinstance(values, np.ndarray)
    }


def _write(folder: Path, grasps: Sequence[StoredGrasp], plan: Plan) -> int:
    """Write the data set and return its number of frames."""
    rows: list[dict[str, Any]] = []
    every: dict[str, list[Any]] = {}
    start = size = file = 0
    writer = None
    for k, grasp in enumerate(grasps):
        trace = grasp.trace()
        columns = _columns(grasp, trace, plan, k, start)
        table = parquet_columns(columns)
        if writer is None or size + table.nbytes > FILE_BYTES:
            if writer is not None:
                writer.close()
                file += 1
            size = 0
            path = folder / DATA_PATHS[3].format(chunk_index=file // 1000, file_index=file % 1000)
            path.parent.mkdir(parents=True, exist_ok=True)
            writer = parquet.ParquetWriter(path, table.schema)
        writer.write_table(table)
        size += table.nbytes
        for column in columns:
            every.setdefault(column.key, []).append(column.values)
        n = len(columns[0].values)
        rows.append(_episode_row(grasp, columns, k, start, n, file))
        start += n
        _write_raw(folder / "graspsense" / "raw", trace, k)
    assert writer is not None
    writer.close()
    _write_meta(folder, grasps, plan, rows, columns)
    write_json(
        folder / "meta" / "stats.json",
        {key: statistics(np.concatenate(parts)) for key, parts in every.items()},
    )
    return start


def _columns(grasp: StoredGrasp, trace: Trace, plan: Plan, episode: int, start: int) -> list[Column]:
    """Return the columns of an episode, the frames of which are from its first tick to its last."""
    start_s, last = float(trace.t_s[0]), float(trace.t_s[-1])
    n = max(int((last - start_s) * plan.fps + JITTER) + 1, 2)
    frame = np.arange(n)
    times = start_s + frame / plan.fps
    late = times + JITTER / plan.fps
    tick = np.clip(np.searchsorted(trace.t_s, late, side="right") - 1, 0, len(trace) - 1)
    known = _state(trace)
    state = np.column_stack([_filled(known[name][0])[tick] for name in plan.state])
    position = state[:, plan.state.index("gripper.pos")] if "gripper.pos" in plan.state else state[:, 0]
    action = trace.command[tick] if plan.commanded else np.append(position[1:], position[-1])
    event, prediction = plan.meanings.numbers(grasp, times)
    return [
        Column("observation.state", state.astype(np.float32), plan.state, plan.units),
        *(_array_column(array, trace, late) for array in plan.arrays),
        Column(
            "action", action.astype(np.float32), ("gripper.command" if plan.commanded else "gripper.pos",)
        ),
        Column("graspsense.phase", trace.phase[tick].astype(np.int64)),
        Column("graspsense.event", event),
        Column("graspsense.prediction", prediction),
        Column("timestamp", (frame / plan.fps).astype(np.float32)),
        Column("frame_index", frame),
        Column("episode_index", np.full(n, episode)),
        Column("index", start + frame),
        Column("task_index", np.full(n, plan.tasks.index(task_of(grasp)))),
    ]


def _filled(values: Any) -> Any:
    """Return numbers with the last known one in the place of each that is missing, and the first before it."""
    known = np.isfinite(values)
    places = np.maximum.accumulate(np.where(known, np.arange(len(values)), int(known.argmax())))
    return values[places]


def _array_column(array: TactileArray, trace: Trace, times: Any) -> Column:
    images = trace.signals[array.name]
    place = np.clip(np.searchsorted(images.t_s, times, side="right") - 1, 0, len(images.t_s) - 1)
    cells = np.nan_to_num(images.cells.reshape(len(images.t_s), -1)[place]).astype(np.float32)
    return Column(
        f"observation.tactile.{array.name}", cells, cell_names(array), (array.unit,) * array.numbers
    )


def cell_names(array: TactileArray) -> tuple[str, ...]:
    """Return a name for each number of an array: finger, row and column, and the axis if there are several."""
    axes = [f".f{axis}" for axis in "xyz"[: array.components]] if array.components > 1 else [""]
    columns = array.columns or array.cells
    places = [(k // columns, k % columns) for k in range(array.cells)]
    return tuple(f"{array.name}.r{row:02d}c{column:02d}{axis}" for row, column in places for axis in axes)


def _episode_row(
    grasp: StoredGrasp, columns: Sequence[Column], episode: int, start: int, n: int, file: int
) -> dict[str, Any]:
    stats = {
        f"stats/{column.key}/{name}": value
        for column in columns
        for name, value in statistics(column.values).items()
    }
    return {
        "episode_index": episode,
        "tasks": [task_of(grasp)],
        "length": n,
        "data/chunk_index": file // 1000,
        "data/file_index": file % 1000,
        "dataset_from_index": start,
        "dataset_to_index": start + n,
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
        **about(grasp),
        **stats,
    }


def about(grasp: StoredGrasp) -> dict[str, Any]:
    """Return what is known of a trial as columns of its episode."""
    told = [what for _, what in _told(grasp)]
    final = grasp.prediction
    return {
        "graspsense/trial": grasp.number,
        "graspsense/label": grasp.label,
        "graspsense/instance": grasp.instance,
        "graspsense/outcome": grasp.outcome,
        "graspsense/felt": "contact" in told,
        "graspsense/slipped": grasp.outcome == "slipped" or "slip" in told,
        "graspsense/crushed": grasp.outcome == "crushed",
        "graspsense/prediction": str(final["label"]) if final else "",
        **{f"graspsense/feature/{name}": value for name, value in grasp.features.items()},
    }


def _write_meta(
    folder: Path,
    grasps: Sequence[StoredGrasp],
    plan: Plan,
    rows: Sequence[Mapping[str, Any]],
    columns: Sequence[Column],
) -> None:
    (folder / EPISODES).parent.mkdir(parents=True)
    names = dict.fromkeys(name for row in rows for name in row)
    table = pyarrow.table({name: [row.get(name) for row in rows] for name in names})
    parquet.write_table(table, folder / EPISODES)
    parquet.write_table(_tasks(plan.tasks), folder / "meta/tasks.parquet")
    write_json(
        folder / "meta/info.json",
        {
            "codebase_version": "v3.0",
            "robot_type": grasps[0].device,
            "total_episodes": len(rows),
            "total_frames": rows[-1]["dataset_to_index"],
            "total_tasks": len(plan.tasks),
            "chunks_size": 1000,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": plan.fps,
            "splits": {"train": f"0:{len(rows)}"},
            "data_path": DATA_PATHS[3],
            "video_path": None,
            "features": {column.key: column.declared() for column in columns},
        },
    )
    write_json(folder / "meta/graspsense.json", _meanings(grasps, plan))
    write_json(folder / "meta/episodes.json", {"episodes": [_listed(row, plan) for row in rows]})
    (folder / "README.md").write_text(_card(grasps, plan), "utf-8")


def _meanings(grasps: Sequence[StoredGrasp], plan: Plan) -> dict[str, Any]:
    return {
        **plan.meanings.as_json(),
        "action": "the value that was commanded" if plan.commanded else "the position one frame later",
        "units of features": {name: unit for grasp in grasps for name, unit in grasp.units.items()},
        "raw": "graspsense/raw: the channels of each episode at their own rates",
    }


def _listed(row: Mapping[str, Any], plan: Plan) -> dict[str, Any]:
    path = DATA_PATHS[3].format(chunk_index=row["data/chunk_index"], file_index=row["data/file_index"])
    return {
        "episode_id": row["episode_index"],
        "task": row["tasks"][0],
        "frames": row["length"],
        "start_time": 0.0,
        "end_time": (row["length"] - 1) / plan.fps,
        "data_path": path,
        "action_shape": [1],
        "state_shape": [len(plan.state)],
    }


def _card(grasps: Sequence[StoredGrasp], plan: Plan) -> str:
    made = "Some or all grasps are synthetic (simulated)." if any(grasp.simulated for grasp in grasps) else (
        "The grasps were recorded; none is synthetic."
    )  # fmt: skip
    return f"""---
tags:
- LeRobot
- graspsense
configs:
- config_name: default
  data_files: data/*/*.parquet
---
Grasps of a gripper with force sensors, written by graspsense. {made}

Robot: {grasps[0].device}. Tasks: {", ".join(plan.tasks)}.

Sensors: {", ".join((*plan.state, *(array.name for array in plan.arrays)))}. There is no camera.

Limitations: channels are taken at {plan.fps} frames per second; `graspsense/raw` has them at their own rates. \
`meta/graspsense.json` says what the numbers of phase, event and prediction stand for.
"""


def _tasks(tasks: Sequence[str]) -> Any:
    """Return the table of tasks, whose texts are its index when pandas reads it."""
    table = pyarrow.table({"task_index": list(range(len(tasks))), "task": list(tasks)})
    kinds = {"task_index": ("int64", "int64"), "task": ("unicode", "object")}
    described = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": [
            {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
            for name, (kind, numpy) in kinds.items()
        ],
        "creator": {"library": "pyarrow", "version": pyarrow.__version__},
        "pandas_version": "2.0.0",
    }
    return table.replace_schema_metadata({"pandas": json.dumps(described)})


def _write_raw(folder: Path, trace: Trace, episode: int) -> None:
    """Write the channels of a trial at their own rates."""
    folder.mkdir(parents=True, exist_ok=True)
    ticks = {"t_s": trace.t_s, "phase": trace.phase, "command": trace.command, "status": trace.status}
    ticks |= {name: values for name, (values, _) in _state(trace).items()}
    parquet.write_table(pyarrow.table(ticks), folder / f"episode_{episode:06d}.parquet")
    further = dict(trace.signals)
    if len(trace.pad_t_s):
        further["pads"] = ImageTrace(
            t_s=trace.pad_t_s, cells=np.concatenate([trace.pad_left, trace.pad_right], axis=1)
        )
    for name, signal in further.items():
        if isinstance(signal, ImageTrace | SampleTrace):
            values = signal.cells if isinstance(signal, ImageTrace) else signal.values
            flat = pyarrow.FixedSizeListArray.from_arrays(
                np.ascontiguousarray(values).ravel(), max(int(np.prod(values.shape[1:])), 1)
            )
            table = pyarrow.table({"t_s": signal.t_s, name: flat})
            parquet.write_table(table, folder / f"episode_{episode:06d}-{name}.parquet")


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file, and the folder that it is in."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value, indent=4, ensure_ascii=False), "utf-8")
