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
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import evolve, frozen

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
from graspsense_lerobot.folder import DataColumn, Episode, Folder, read_folder
from graspsense_lerobot.names import CELL, CellArray, Meaning, channel_name, meaning_of
from graspsense_lerobot.place import PlaceOptions, folder_and_options

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]

OTHER_RATE: Final = 0.02
"""Share by which the time between frames may differ from that of `fps` before it is told."""
LONG_STEP: Final = 1.5
"""Frames that a step of time has to last to be a gap."""
MANY_REPEATED: Final = 0.2
"""Share of the frames from which on repeated ones are told."""
TOUCHED: Final = 0.2
"""Share of the range of the force above which an object is touched, as for the squeezes of a manifest."""
_OF_STATE: Final = ("velocity", "effort", "load", "current", "torque", "force")


@frozen(kw_only=True, eq=False)
class Understood:
    """A data set with what its names mean: the same for all episodes."""

    folder: Folder
    options: PlaceOptions
    meaning: Meaning
    gap: str
    gap_unit: str
    """Empty for metres."""
    forces: tuple[str, ...]
    """The names of the force of each side where no array gives it."""
    images: tuple[DataColumn, ...]
    """The features that are arrays as a whole."""
    notes: tuple[str, ...]


def recordings(place: str) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield every squeeze of every episode, with its task as the label. Raises ConfigError, DataDamaged."""
    path, options = folder_and_options(place)
    understood = understand(read_folder(path), options)
    for episode in understood.folder.episodes():
        yield from each_readable(f"episode {episode.index}", partial(_of_episode, understood, episode))


def understand(folder: Folder, options: PlaceOptions) -> Understood:
    """Return what the names of a data set mean. Raises ConfigError if the opening or a force is not found."""
    names = [name for feature in _vectors(folder) for name in _names(feature)]
    images = tuple(
        one
        for one in folder.features.values()
        if one.key.startswith("observation.") and _is_number(one) and len(one.shape) in (2, 3)
    )
    meaning = meaning_of(names)
    gap = _chosen(options.gap, names, "gap") if options.gap else next(iter(meaning.gap), "")
    if not gap:
        raise ConfigError(
            f"{folder.place}: no name is known as the opening of a gripper (gripper.pos). Name it: "
            f"lerobot:FOLDER?gap=NAME. There are {_some(names)}"
        )
    given = tuple(_chosen(name, names, "force") for name in options.force.split(",") if name)
    touch = bool(meaning.arrays or images)
    forces = given or meaning.forces or (() if touch else meaning.effort[:1])
    if not forces and not touch:
        raise ConfigError(
            f"{folder.place}: nothing tells whether an object was felt: there is no tactile array, and no force, load "
            f"or current of the gripper. Name one: lerobot:FOLDER?force=NAME. There are {_some(names)}"
        )
    unit, notes = _unit_of_gap(folder, gap, options)
    notes += [f"gap: {gap}", f"force: {', '.join(forces) or 'the sum of the cells of each array along z'}"]
    if len(meaning.gap) > 1 and not options.gap:
        notes.append(f"further grippers are left out: {', '.join(meaning.gap[1:])} (?gap=NAME chooses)")
    return Understood(
        folder=folder, options=options, meaning=meaning, gap=gap, gap_unit=unit, forces=forces, images=images,
        notes=tuple(notes),
    )  # fmt: skip


def numbered_parts(place: str, folder: Path) -> Iterator[tuple[int, float, float] | None]:
    """Yield the episode and the times (s) of each recording of a place, read from this folder; None for a damaged one.

    The place gives the options. Raises ConfigError, DataDamaged.
    """
    understood = understand(read_folder(folder), folder_and_options(place)[1])
    for episode in understood.folder.episodes():
        for part in each_readable(f"episode {episode.index}", partial(frames_of, understood, episode)):
            if isinstance(part, UnreadableRecording):
                yield None
            else:
                yield episode.index, float(part.t_s[0]), float(part.t_s[-1])


@np.errstate(all="ignore")  # what is infinite is refused by `checked_recording`
def frames_of(understood: Understood, episode: Episode) -> list[GraspColumns]:
    """Return the squeezes of an episode, with the times of the episode. Raises DataDamaged."""
    columns = _columns(understood, episode)
    parts = _without_gaps(columns, understood) if understood.options.gaps == "cut" else [columns]
    if understood.options.split == "none":
        return parts
    return [squeeze for part in parts for squeeze in squeezes(part)]


def label_of_task(task: str) -> str:
    """Return the text of a task as a label, which has no spaces and none of : # , beside that of CLASS:STATE.

    >>> label_of_task("Pick up: the red cup"), label_of_task("can:full_open")
    ('Pick_up-_the_red_cup', 'can:full_open')
    """
    if re.fullmatch(r"[^\s:#,]+:[^\s:#,]+", task):
        return task
    return re.sub(r"[:#,]", "-", re.sub(r"\s+", "_", task.strip()))


def _of_episode(
    understood: Understood, episode: Episode
) -> Iterator[LabelledRecording | UnreadableRecording]:
    with np.errstate(all="ignore"):
        notices = tuple(_notices(understood, episode))
    for k, squeeze in enumerate(frames_of(understood, episode)):
        yield from each_readable(
            squeeze.source, partial(_grasp, understood, episode, evolve(squeeze, warnings=notices), k)
        )


@np.errstate(all="ignore")
def _grasp(
    understood: Understood, episode: Episode, columns: GraspColumns, number: int
) -> tuple[LabelledRecording]:
    start_s = float(columns.t_s[0])
    where = [
        f"video {key}: {path}, from {first_s + start_s:.3f} s"
        for key, (path, first_s) in episode.videos.items()
    ]
    inverted = _inverted(columns)
    moved = evolve(
        columns,
        t_s=columns.t_s - start_s,
        notes=(*understood.notes, *columns.notes, _moments(columns), *where),
    )
    recording = checked_recording(moved)
    return (
        LabelledRecording(
            recording=recording,
            source=columns.source,
            label=label_of_task(episode.task),
            order=episode.index + number / 1000.0,
            notices=(*columns.warnings, *inverted),
        ),
    )


def _columns(understood: Understood, episode: Episode) -> GraspColumns:
    """Return the frames of an episode as columns, on the clock of the episode."""
    numbers = _numbers(understood.folder, episode)
    options, meaning, table = understood.options, understood.meaning, episode.table
    arrays: dict[str, Numbers] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    sides: list[Numbers] = []
    for cells in meaning.arrays:
        arrays[cells.name], shapes[cells.name] = _cells(cells, numbers)
        sides.append(_sum([numbers[name] for name in cells.normal]))
    for feature in understood.images:
        name = channel_name(feature.key)
        arrays[name] = _checked_width(understood.folder, feature, episode)
        shapes[name] = _grid(feature)
        components = shapes[name][2] if len(shapes[name]) > 2 else 1
        sides.append(_sum(list(arrays[name][:, components - 1 :: components].T)))
    if understood.forces:
        sides = [np.abs(numbers[name]) for name in understood.forces]
    newtons = options.force_n_per_unit or 1.0
    unit = "" if options.force_n_per_unit else _unit_of_force(understood)
    gap = numbers[understood.gap]
    metres = options.gap_m_per_unit
    columns = GraspColumns(
        source=f"episode {episode.index}",
        t_s=_times(understood, episode),
        gap_m=gap if metres is None else metres * (gap - options.gap_zero),
        left_n=newtons * sides[0],
        right_n=newtons * (np.mean(sides[1:], axis=0) if len(sides) > 1 else sides[0]),
        scalars={channel_name(name): numbers[name] for name in meaning.effort},
        arrays=arrays,
        shapes=shapes,
        units={"gap": understood.gap_unit, "force": unit, **dict.fromkeys(arrays, "counts")},
    )
    repeated = _repeated(understood, episode)
    if options.repeated == "drop" and repeated.any():
        kept = columns.rows(~repeated)
        return evolve(
            kept, notes=(f"{int(repeated.sum())} of {len(table)} frames repeat the one before: left out",)
        )
    return columns


def _numbers(folder: Folder, episode: Episode) -> dict[str, Numbers]:
    """Return the numbers of an episode by name. Raises DataDamaged if a column is not as it is declared."""
    found: dict[str, Numbers] = {}
    for feature in _vectors(folder):
        values = _checked_width(folder, feature, episode)
        found |= {name: values[:, k] for k, name in enumerate(_names(feature))}
    return found


def _checked_width(folder: Folder, feature: DataColumn, episode: Episode) -> Numbers:
    values = episode.table.numbers.get(feature.key)
    width = int(np.prod(feature.shape))
    if values is None:
        raise DataDamaged(
            f"{folder.place}: {episode.table.source} has no column of {width} numbers {feature.key}, which "
            "meta/info.json declares"
        )
    rows: Numbers = values.reshape(len(values), -1)
    if rows.shape[1] != width:
        raise DataDamaged(
            f"{folder.place}: {feature.key} in {episode.table.source} has {rows.shape[1]} numbers a frame, and "
            f"meta/info.json declares {width}"
        )
    return rows


def _vectors(folder: Folder) -> list[DataColumn]:
    return [
        one
        for one in folder.features.values()
        if one.key.startswith("observation.") and _is_number(one) and len(one.shape) == 1
    ]


def _is_number(feature: DataColumn) -> bool:
    return re.fullmatch(r"float(16|32|64)|u?int(8|16|32|64)|bool", feature.dtype) is not None


def _names(feature: DataColumn) -> list[str]:
    """Return a name for each number of a vector, unlike those of other features."""
    word = feature.key.removeprefix("observation.").removeprefix("state.")
    given = feature.names if len(feature.names) == feature.shape[0] else ()
    if feature.key == "observation.state":
        return list(given) or [f"state.{k}" for k in range(feature.shape[0])]
    if given and all(CELL.fullmatch(name) for name in given):
        return list(given)
    if feature.shape[0] == 1:
        return [word]
    if word in _OF_STATE:
        return [f"{name}.{word}" for name in given or map(str, range(feature.shape[0]))]
    return [f"{word}.{name}" for name in given or map(str, range(feature.shape[0]))]


def _units(folder: Folder) -> dict[str, str]:
    """Return the unit of each number that has one in the metadata."""
    return {
        name: unit
        for feature in _vectors(folder)
        for name, unit in zip(_names(feature), feature.units, strict=False)
    }


def _chosen(name: str, names: Sequence[str], what: str) -> str:
    if name not in names:
        raise ConfigError(f"{what}={name!r} is not a number of the observations. There are {_some(names)}")
    return name


def _some(names: Sequence[str]) -> str:
    shown = ", ".join(name[:60] for name in names[:12])
    return f"{shown} and {len(names) - 12} more" if len(names) > 12 else shown or "none"


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


def _times(understood: Understood, episode: Episode) -> Numbers:
    numbers, fps = episode.table.numbers, understood.options.fps
    times: Numbers = numbers["timestamp"].reshape(len(episode.table), -1)[:, 0]
    if fps:
        times = numbers["frame_index"] / fps
    since_first: Numbers = times - times[0]
    return since_first


def _unit_of_force(understood: Understood) -> str:
    if not understood.forces:
        return "counts"
    if _units(understood.folder).get(understood.forces[0]) == "N":
        return ""
    name = understood.forces[0].lower()
    return "%" if name.endswith("load") else "mA" if name.endswith("current") else "counts"


def _unit_of_gap(folder: Folder, gap: str, options: PlaceOptions) -> tuple[str, list[str]]:
    """Return the unit of the opening, empty for metres, and what has to be said of it."""
    if options.gap_m_per_unit is not None:
        return "", [f"gap = {options.gap_m_per_unit:g} * ({gap} - {options.gap_zero:g}) m"]
    if _units(folder).get(gap) == "m":
        return "", []
    values = np.concatenate([_numbers(folder, episode)[gap] for episode in folder.episodes()])
    known = values[np.isfinite(values)]
    if not len(known):
        raise DataDamaged(f"{folder.place}: {gap} has no number in any episode")
    low, high = float(known.min()), float(known.max())
    if low >= -0.01 and high <= 0.25:
        return "", [f"{gap} goes from {low:g} to {high:g}: taken as metres"]
    unit = "rad" if low >= -7.0 and high <= 7.0 else "%" if low >= -10.0 and high <= 110.0 else "counts"
    return unit, [
        f"{gap} goes from {low:g} to {high:g}: taken as {unit}, not as metres. With the opening of one unit the gap is "
        "in metres: ?gap_m_per_unit=0.001"
    ]


def _repeated(understood: Understood, episode: Episode) -> NDArray[np.bool_]:
    """Return which frames are equal to the one before in all observations, or have its time."""
    rows = np.column_stack(
        [
            values.reshape(len(values), -1)
            for key, values in episode.table.numbers.items()
            if key.startswith("obs")
        ]
    )
    same = np.concatenate(([False], (rows[1:] == rows[:-1]).all(axis=1)))
    times = _times(understood, episode)
    return same | np.concatenate(([False], np.diff(times) == 0.0))


def _without_gaps(columns: GraspColumns, understood: Understood) -> list[GraspColumns]:
    longest = LONG_STEP / (understood.options.fps or understood.folder.fps)
    ends = [0, *(np.flatnonzero(np.diff(columns.t_s) > longest) + 1).tolist(), len(columns)]
    return [
        columns.rows(slice(start, end), f"part {k}")
        for k, (start, end) in enumerate(pairwise(ends), 1)
        if end - start > 2
    ]


def _notices(understood: Understood, episode: Episode) -> Iterator[str]:
    """Yield what looks wrong with the frames of an episode, with the option that mends it."""
    times, options = _times(understood, episode), understood.options
    fps = options.fps or understood.folder.fps
    if understood.gap_unit:
        yield understood.notes[0]
    steps = np.diff(times)
    if len(steps) and not options.fps:
        step_s = float(np.median(steps))
        if step_s > 0.0 and abs(step_s * fps - 1.0) > OTHER_RATE:
            yield (
                f"the frames are {step_s:.4g} s apart, and fps = {fps:g} says {1 / fps:.4g} s. If the times are wrong: "
                f"?fps={fps:g}"
            )
            fps = 1.0 / step_s
    long = steps > LONG_STEP / fps
    if long.any():
        yield (
            f"{int(long.sum())} gaps between frames, the longest of {float(steps.max()):.3g} s: ?gaps=cut divides the "
            "episode there"
        )
    repeated = _repeated(understood, episode)
    if options.repeated == "keep" and repeated.sum() > MANY_REPEATED * len(times):
        yield (
            f"{int(repeated.sum())} of {len(times)} frames repeat the one before, as of a sensor slower than the "
            "frames: ?repeated=drop leaves them out"
        )
    missing = int(sum(np.isnan(values).any(axis=-1).sum() if values.ndim > 1 else np.isnan(values).sum()
                      for key, values in episode.table.numbers.items() if key.startswith("obs")))  # fmt: skip
    if missing:
        yield f"{missing} frames have an observation without a number: left out where gap or force is missing"


def _moments(columns: GraspColumns) -> str:
    """Return when the gripper begins to close and when it touches, in words."""
    known = np.isfinite(columns.force_n) & np.isfinite(columns.gap_m)
    if not known.any():
        return "no contact is found in the force"
    columns = columns.rows(known)
    force, gap = columns.force_n, columns.gap_m
    low = float(np.nanmin(force))
    touched = force > low + TOUCHED * (float(np.nanmax(force)) - low)
    if not touched.any():
        return "no contact is found in the force"
    contact = int(touched.argmax())
    widest = float(np.nanmax(gap[: contact + 1]))
    near = np.flatnonzero(gap[: contact + 1] >= widest - 0.02 * float(np.ptp(gap)))
    closing = int(near[-1]) if len(near) else 0
    return (
        f"closing from {columns.t_s[closing]:.3f} s of the episode, contact at {columns.t_s[contact]:.3f} s"
    )


def _inverted(columns: GraspColumns) -> tuple[str, ...]:
    """Return a notice if the gap grows while the force rises."""
    force = np.nan_to_num(columns.force_n)
    peak = int(force.argmax())
    span = float(np.ptp(columns.gap_m))
    if span > 0.0 and columns.gap_m[peak] > columns.gap_m[0] + 0.3 * span:
        return (
            "the number of the gap grows while the force rises: if it is closed there, ?gap_m_per_unit=-0.001",
        )
    return ()
