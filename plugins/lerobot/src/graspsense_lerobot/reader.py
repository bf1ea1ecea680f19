"""The episodes of a LeRobot data set as labelled recordings: `lerobot:FOLDER`.

Each squeeze of an episode is a recording. Its opening, forces and arrays come from the numbers of the observations by
their names. What looks wrong is told as a notice, with the option that mends it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense.gripper_api import squeezes
from graspsense.plugin_api import (
    ConfigError,
    DataDamaged,
    GraspColumns,
    LabelledRecording,
    UnreadableRecording,
    checked_recording,
    each_readable,
)
from graspsense_lerobot.folder import DataColumn, Episode, read_folder
from graspsense_lerobot.names import CellArray, channel_name
from graspsense_lerobot.notices import LONG_STEP, moments_of, notices_of, notices_of_gap, repeated_frames
from graspsense_lerobot.place import folder_and_options
from graspsense_lerobot.understood import (
    Understood,
    numbers_of,
    numbers_of_feature,
    times_of,
    understand,
    units_of,
)

Numbers = NDArray[np.float64]


def recordings(place: str) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield every squeeze of every episode, with its task as the label. Raises ConfigError, DataDamaged."""
    path, options = folder_and_options(place)
    understood = understand(read_folder(path), options)
    for part in _parts(understood):
        if isinstance(part, UnreadableRecording):
            yield part
        else:
            yield from each_readable(part[2].source, partial(_grasp, understood, *part))


def numbered_parts(place: str, folder: Path) -> Iterator[tuple[int, GraspColumns] | None]:
    """Yield the episode and the frames of each recording of a place, read from this folder; None for a damaged one.

    The times are those of the episode. The place gives the options. Raises ConfigError, DataDamaged.
    """
    for part in _parts(understand(read_folder(folder), folder_and_options(place)[1])):
        yield None if isinstance(part, UnreadableRecording) else (part[0].index, part[2])


def _parts(understood: Understood) -> Iterator[tuple[Episode, int, GraspColumns] | UnreadableRecording]:
    """Yield each squeeze of each episode, with its number in the episode; of a damaged one the reason."""
    for episode in understood.folder.episodes():
        if isinstance(episode, UnreadableRecording):
            yield episode
            continue
        squeezes_of = partial(frames_of, understood, episode)
        for k, part in enumerate(each_readable(f"episode {episode.index}", squeezes_of)):
            yield part if isinstance(part, UnreadableRecording) else (episode, k, part)


@np.errstate(all="ignore")  # what is infinite is refused by `checked_recording`
def frames_of(understood: Understood, episode: Episode) -> list[GraspColumns]:
    """Return the squeezes of an episode, with the times of the episode. Raises DataDamaged."""
    columns = _columns(understood, episode)
    parts = _without_gaps(columns, understood) if understood.options.gaps == "cut" else [columns]
    if understood.options.split == "none":
        return parts
    try:
        return [squeeze for part in parts for squeeze in squeezes(part)]
    except DataDamaged as error:
        chosen = "; ".join(
            note for note in understood.notes if note.startswith(("gap:", "force:", "further"))
        )
        raise DataDamaged(f"{error} ({chosen}; ?gap=NAME&force=NAME chooses others)") from error


def label_of_task(task: str) -> str:
    """Return the text of a task as a label, which has no spaces and none of : # , beside that of CLASS:STATE.

    A full stop at its end says nothing: data sets have the same task with and without one.

    >>> label_of_task("Pick up: the red cup."), label_of_task("can:full_open")
    ('Pick_up-_the_red_cup', 'can:full_open')
    """
    if re.fullmatch(r"[^\s:#,]+:[^\s:#,]+", task):
        return task
    return re.sub(r"[:#,]", "-", re.sub(r"\s+", "_", task.strip().rstrip(".")))


@np.errstate(all="ignore")
def _grasp(
    understood: Understood, episode: Episode, number: int, columns: GraspColumns
) -> tuple[LabelledRecording]:
    start_s = float(columns.t_s[0])
    frame = int(np.searchsorted(times_of(understood, episode), start_s))
    where = [
        f"video {key}: {path}, from {first_s + start_s:.3f} s"
        + ("" if (understood.folder.place / path).is_file() else ", which is missing")
        for key, (path, first_s) in episode.videos.items()
    ]
    moved = evolve(
        columns,
        t_s=columns.t_s - start_s,
        notes=(*understood.notes, *columns.notes, moments_of(columns), *where),
    )
    return (
        LabelledRecording(
            recording=checked_recording(moved),
            source=columns.source,
            label=label_of_task(episode.tasks[frame]),
            order=episode.index + number / 1000.0,
            notices=(*notices_of(understood, episode), *columns.warnings, *notices_of_gap(columns)),
        ),
    )


def _columns(understood: Understood, episode: Episode) -> GraspColumns:
    """Return the frames of an episode as columns, on the clock of the episode."""
    numbers = numbers_of(understood.folder, episode)
    options, meaning, table = understood.options, understood.meaning, episode.table
    arrays: dict[str, Numbers] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    sides: list[Numbers] = []
    units: dict[str, str] = {}
    named = units_of(understood.folder)
    for cells in meaning.arrays:
        units[cells.name] = named.get(cells.numbers[0], "counts")
        arrays[cells.name], shapes[cells.name] = _cells(cells, numbers)
        sides.append(_sum([numbers[name] for name in cells.normal]))
    for feature in understood.images:
        name = channel_name(feature.key)
        arrays[name] = numbers_of_feature(understood.folder, feature, episode)
        shapes[name] = _grid(feature)
        components = shapes[name][2] if len(shapes[name]) > 2 else 1
        sides.append(_sum(list(arrays[name][:, components - 1 :: components].T)))
    if understood.forces:
        sides = [np.abs(numbers[name]) for name in understood.forces]
    sides = [
        side for side in sides if np.isfinite(side).any()
    ] or sides  # without a finger that is not connected
    newtons = options.force_n_per_unit or 1.0
    unit = "" if options.force_n_per_unit else _unit_of_force(understood)
    gap = numbers[understood.gap]
    columns = GraspColumns(
        source=f"episode {episode.index}",
        t_s=times_of(understood, episode),
        gap_m=understood.metres_per_unit * (gap - options.gap_zero),
        left_n=newtons * sides[0],
        right_n=newtons * (np.mean(sides[1:], axis=0) if len(sides) > 1 else sides[0]),
        effort_n=_effort(understood, numbers),
        scalars={channel_name(name): numbers[name] for name in meaning.effort if named.get(name) != "N"},
        arrays=arrays,
        shapes=shapes,
        units={"gap": understood.gap_unit, "force": unit, **units},
    )
    repeated = repeated_frames(understood, episode)
    if options.repeated == "drop" and repeated.any():
        columns = evolve(
            columns.rows(~repeated),
            notes=(f"{int(repeated.sum())} of {len(table)} frames repeat the one before: left out",),
        )
    _check_times(columns, understood)
    return columns


def _check_times(columns: GraspColumns, understood: Understood) -> None:
    """Raise DataDamaged if the time does not increase."""
    wrong = np.flatnonzero(~(np.diff(columns.t_s) > 0.0))
    if len(wrong):
        earlier_s, later_s = columns.t_s[wrong[0] : wrong[0] + 2].tolist()
        raise DataDamaged(
            f"{columns.source}: the time goes from {earlier_s:g} s to {later_s:g} s at frame {int(wrong[0]) + 1}, and "
            f"must increase. With ?fps={understood.folder.fps:g} it follows from the numbers of the frames, and "
            "?repeated=drop leaves out frames with the time of the one before"
        )


def _effort(understood: Understood, numbers: Mapping[str, Numbers]) -> Numbers | None:
    """Return the effort (N): what the metadata says is in newtons, or the load that an option converts to the force."""
    units, efforts = units_of(understood.folder), understood.meaning.effort
    for name in efforts:
        if units.get(name) == "N":
            return numbers[name]
    newtons = understood.options.force_n_per_unit
    if newtons is not None and understood.forces and understood.forces[0] in efforts:
        return newtons * np.abs(numbers[understood.forces[0]])
    return None


def _cells(cells: CellArray, numbers: Mapping[str, Numbers]) -> tuple[Numbers, tuple[int, ...]]:
    values = np.column_stack([numbers[name] for name in cells.numbers])
    grid = (cells.rows, cells.columns)
    return values, (*grid, len(cells.axes)) if len(cells.axes) > 1 else grid


def _grid(feature: DataColumn) -> tuple[int, ...]:
    """Return the rows, columns and components of an array: (cells, 3) are cells with three axes."""
    if len(feature.shape) == 2:
        return (1, feature.shape[0], 3) if feature.shape[1] == 3 else feature.shape
    rows, columns, components = feature.shape
    if components > 3:
        raise ConfigError(f"{feature.key} has the shape {feature.shape}; a cell has at most 3 numbers")
    return (rows, columns) if components == 1 else (rows, columns, components)


def _sum(cells: Sequence[Numbers]) -> Numbers:
    """Return the sum of the cells that have a number, NaN where none has."""
    values = np.column_stack(cells)
    total: Numbers = np.where(np.isfinite(values).any(axis=1), np.nansum(values, axis=1), np.nan)
    return np.abs(total)


def _unit_of_force(understood: Understood) -> str:
    units = units_of(understood.folder)
    arrays = understood.meaning.arrays
    names = understood.forces or tuple(array.numbers[0] for array in arrays if not understood.images)
    if names and all(units.get(name) == "N" for name in names):
        return ""
    if not understood.forces:
        return "counts"
    name = understood.forces[0].lower()
    return "%" if name.endswith("load") else "mA" if name.endswith("current") else "counts"


def _without_gaps(columns: GraspColumns, understood: Understood) -> list[GraspColumns]:
    longest = LONG_STEP / (understood.options.fps or understood.folder.fps)
    ends = [0, *(np.flatnonzero(np.diff(columns.t_s) > longest) + 1).tolist(), len(columns)]
    return [
        columns.rows(slice(start, end), f"part {k}")
        for k, (start, end) in enumerate(pairwise(ends), 1)
        if end - start > 2
    ]
