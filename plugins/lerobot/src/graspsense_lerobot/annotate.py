"""A copy of a LeRobot data set with what graspsense found in it: phase, event and prediction of each frame.

The trials were imported from the data set, so that each is a part of an episode. The table of episodes gets what was
grasped and felt, a list with an item for each trial. The original is only read.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow
from attrs import frozen
from pyarrow import parquet

from graspsense.gripper_api import StoredGrasp
from graspsense.plugin_api import ConfigError, DataDamaged, GraspColumns
from graspsense_lerobot.columns import statistics
from graspsense_lerobot.folder import INFO, json_lines, read_folder
from graspsense_lerobot.reader import numbered_parts
from graspsense_lerobot.writer import Meanings, about, write_json

NO_GRASP: Final = -1
"""The phase of a frame that is in no trial."""
COLUMNS: Final = ("graspsense.phase", "graspsense.event", "graspsense.prediction")
_KIND: Final = "lerobot:"


@frozen(eq=False)
class Placed:
    """A trial and the times (s) of its episode that it lasts."""

    grasp: StoredGrasp
    start_s: float
    end_s: float


def annotate(grasps: Sequence[StoredGrasp], original: Path, copy: Path) -> dict[str, int]:
    """Write an annotated copy of the data set into an empty folder, and return how many trials and frames it has.

    A data file that cannot be read is copied as it is, and counted. Raises ConfigError if the trials are not of this
    data set or the copy is in it, DataDamaged.
    """
    if copy.resolve().is_relative_to(original.resolve()):
        raise ConfigError(f"{original} is not changed: name a folder for the copy that is not in it")
    folder = read_folder(original)
    placed = _placed(grasps, original)
    meanings = Meanings.of_grasps(grasps)
    shutil.copytree(original, copy, dirs_exist_ok=True)
    every: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    unreadable = 0
    for path in sorted((copy / "data").rglob("*.parquet")):
        columns = _annotate_file(path, placed, meanings)
        unreadable += not columns
        for name, values in columns.items():
            every[name] += values
    added = {name: np.concatenate(values) for name, values in every.items() if values}
    if not added:
        raise DataDamaged(f"{original} has no Parquet file in its folder data that can be read")
    _annotate_episodes(copy, folder.version, placed)
    declared = {name: {"dtype": "int64", "shape": [1], "names": None} for name in COLUMNS}
    write_json(copy / INFO, {**folder.info, "features": {**folder.info["features"], **declared}})
    described = meanings.as_json()
    described["graspsense.phase"][str(NO_GRASP)] = "no grasp"
    write_json(copy / "meta" / "graspsense.json", described)
    stats = copy / "meta" / "stats.json"
    if stats.is_file():
        known = json.loads(stats.read_text("utf-8"))
        write_json(stats, {**known, **{name: statistics(values) for name, values in added.items()}})
    counts = {"trials": len(grasps), "frames": len(added[COLUMNS[0]])}
    return {**counts, "unreadable": unreadable} if unreadable else counts


def _placed(grasps: Sequence[StoredGrasp], original: Path) -> dict[int, list[Placed]]:
    """Return the trials of each episode. Raises ConfigError for one that was not imported from this data set."""
    places = {grasp.source.rpartition("#")[0] for grasp in grasps}
    if len(places) != 1 or not all(place.startswith(_KIND) for place in places):
        raise ConfigError(
            f"annotate={original}: not all trials were imported from one LeRobot data set. Import it into a store of "
            f"its own: graspsense import lerobot:{original} --save DIR"
        )
    parts = list(numbered_parts(places.pop().removeprefix(_KIND), original))
    placed: dict[int, list[Placed]] = {}
    for grasp in grasps:
        number = int(grasp.source.rpartition("#")[2]) - 1
        part = parts[number] if number < len(parts) else None
        if part is None:
            raise ConfigError(
                f"trial {grasp.number} is recording {number + 1} of another data set: {original} has {len(parts)}"
            )
        episode, columns = part
        if not _same(grasp, columns):
            raise ConfigError(
                f"trial {grasp.number} has another gap than {columns.source} of {original}: the data sets differ"
            )
        start_s, end_s = float(columns.t_s[0]), float(columns.t_s[-1])
        placed.setdefault(episode, []).append(Placed(grasp, start_s, end_s))
    return placed


def _same(grasp: StoredGrasp, columns: GraspColumns) -> bool:
    """Return whether a trial has the gap of this squeeze of the data set."""
    known = np.isfinite(columns.gap_m)
    t_s, gap, trace = columns.t_s[known] - columns.t_s[0], columns.gap_m[known], grasp.trace()
    if not known.any() or len(trace) > len(columns):
        return False
    return bool(
        np.allclose(
            np.interp(trace.t_s, t_s, gap), trace.gap_m, rtol=0.0, atol=1e-6 * float(np.ptp(gap)) + 1e-12
        )
    )


def _annotate_file(
    path: Path, placed: Mapping[int, Sequence[Placed]], meanings: Meanings
) -> dict[str, list[Any]]:
    """Add the columns to a data file, one group of rows after the other, and return them; none if it is damaged."""
    part = path.with_suffix(".part")
    added: dict[str, list[Any]] = {name: [] for name in COLUMNS}
    writer = None
    try:
        with parquet.ParquetFile(path) as file:
            for k in range(file.num_row_groups):
                table = file.read_row_group(k)
                for name, values in _numbers(table, placed, meanings).items():
                    table = _with_column(table, name, values)
                    added[name].append(values)
                # What another library says of the columns does not name the new ones.
                table = table.replace_schema_metadata(None)
                writer = writer or parquet.ParquetWriter(part, table.schema)
                writer.write_table(table)
    except (pyarrow.ArrowException, KeyError, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise  # of the disk
        part.unlink(missing_ok=True)
        return {}
    if writer is not None:
        writer.close()
        part.replace(path)
    return added


def _numbers(table: Any, placed: Mapping[int, Sequence[Placed]], meanings: Meanings) -> dict[str, Any]:
    episodes = table["episode_index"].to_numpy()
    times = table["timestamp"].to_numpy().astype(np.float64)
    phase = np.full(len(table), NO_GRASP, dtype=np.int64)
    event, prediction = np.zeros(len(table), dtype=np.int64), np.zeros(len(table), dtype=np.int64)
    for episode in np.unique(episodes).tolist():
        for squeeze in placed.get(int(episode), ()):
            within = (
                (episodes == episode) & (times >= squeeze.start_s - 1e-6) & (times <= squeeze.end_s + 1e-6)
            )
            own_s = times[within] - squeeze.start_s
            if not len(own_s):
                continue
            trace = squeeze.grasp.trace()
            tick = np.clip(np.searchsorted(trace.t_s, own_s + 1e-6, side="right") - 1, 0, len(trace) - 1)
            phase[within] = trace.phase[tick]
            event[within], prediction[within] = meanings.numbers(squeeze.grasp, own_s)
    return dict(zip(COLUMNS, (phase, event, prediction), strict=True))


def _annotate_episodes(copy: Path, version: int, placed: Mapping[int, Sequence[Placed]]) -> None:
    """Add what is known of the trials of each episode to its description."""
    if version == 2:
        rows = json_lines(copy, "meta/episodes.jsonl")
        for row in rows:
            row["graspsense"] = [about(squeeze.grasp) for squeeze in placed.get(row["episode_index"], ())]
        lines = [json.dumps(row) + "\n" for row in rows]
        (copy / "meta" / "episodes.jsonl").write_text("".join(lines), "utf-8")
        return
    names = dict.fromkeys(
        name for some in placed.values() for squeeze in some for name in about(squeeze.grasp)
    )
    for path in sorted((copy / "meta" / "episodes").glob("*/*.parquet")):
        table = parquet.read_table(path)
        known = [
            [about(squeeze.grasp) for squeeze in placed.get(index, ())]
            for index in table["episode_index"].to_pylist()
        ]
        for name in names:
            table = _with_column(table, name, [[labels.get(name) for labels in some] for some in known])
        parquet.write_table(table.replace_schema_metadata(None), path)


def _with_column(table: Any, name: str, values: Any) -> Any:
    """Return the table with this column, in place of one of the same name."""
    kept = table.drop_columns([name]) if name in table.column_names else table
    return kept.append_column(name, pyarrow.array(values))
