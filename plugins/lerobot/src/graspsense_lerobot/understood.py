"""What the numbers of a LeRobot data set are, for all of its episodes: the gap, the forces and the arrays."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError, DataDamaged, UnreadableRecording
from graspsense.simulator_api import suggestion
from graspsense_lerobot.folder import DataColumn, Episode, Folder
from graspsense_lerobot.names import CELL, Meaning, meaning_of, unit_of_name
from graspsense_lerobot.place import PlaceOptions

Numbers = NDArray[np.float64]

METRES: Final = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""The units of a gap that need no option."""
GUESSES: Final = (("share", -0.05, 1.05), ("rad", -7.0, 7.0), ("%", -10.0, 110.0))
"""What a gap is taken as whose numbers are within these, where nothing names its unit."""
MOST_CHOICES: Final = 60
"""Names that are listed where one of them is to be chosen."""
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
    metres_per_unit: float
    """What its number is multiplied by; 1 where the unit is not known."""
    forces: tuple[str, ...]
    """The names of the force of each side where no array gives it."""
    images: tuple[DataColumn, ...]
    """The features that are arrays as a whole."""
    notes: tuple[str, ...]


def understand(folder: Folder, options: PlaceOptions) -> Understood:
    """Return what the names of a data set mean. Raises ConfigError if the opening or a force is not found."""
    names = [name for _, own in _named(folder) for name in own]
    images = tuple(
        column
        for column in folder.features.values()
        if column.key.startswith("observation.") and _is_number(column) and len(column.shape) in (2, 3)
    )
    for what, given in (("gap", options.gap), *(("force", name) for name in options.force.split(","))):
        _refuse_unknown(given, names, what)
    meaning = meaning_of(names, options.gap, options.force)
    counts = Counter(names)
    if twice := [name for name in counts if counts[name] > 1 and name not in meaning.others]:
        raise DataDamaged(
            f"{folder.place}: meta/info.json gives {some(twice)} to several numbers of a feature: give each a name of "
            "its own, as in left_gripper.pos"
        )
    gap = next(iter(meaning.gap), "")
    if not gap:
        raise ConfigError(
            f"{folder.place}: no name is known as the opening of a gripper (gripper.pos). Name it: "
            f"lerobot:FOLDER?gap=NAME. There are {some(names, MOST_CHOICES)}"
        )
    touch = bool(meaning.arrays or images)
    forces = meaning.felt_by(has_arrays=touch)
    if not forces and not touch:
        raise ConfigError(
            f"{folder.place}: nothing tells whether an object was felt: there is no tactile array, and no force, load "
            "or current of the gripper. Without one, record the data again with the load of its motor. Else name it: "
            f"lerobot:FOLDER?force=NAME. There are {some(names, MOST_CHOICES)}"
        )
    if gap in forces:
        raise ConfigError(
            f"{folder.place}: {gap} is the gap, so it is not the force too: ?gap=NAME&force=NAME"
        )
    metres, unit, notes = _unit_of_gap(folder, gap, options)
    notes += [f"gap: {gap}", f"force: {', '.join(forces) or 'the sum of the cells of each array along z'}"]
    if len(meaning.gap) > 1 and not options.gap:
        notes.append(f"further grippers are left out: {', '.join(meaning.gap[1:])} (?gap=NAME chooses)")
    if meaning.others:
        notes.append(f"not used: {some(meaning.others)}")
    return Understood(
        folder=folder,
        options=options,
        meaning=meaning,
        gap=gap,
        gap_unit=unit,
        metres_per_unit=metres,
        forces=forces,
        images=images,
        notes=tuple(notes),
    )


def numbers_of(folder: Folder, episode: Episode) -> dict[str, Numbers]:
    """Return the numbers of an episode by name. Raises DataDamaged if a column is not as it is declared."""
    numbers: dict[str, Numbers] = {}
    for feature, names in _named(folder):
        values = numbers_of_feature(folder, feature, episode)
        numbers |= {name: values[:, k] for k, name in enumerate(names)}
    return numbers


def numbers_of_feature(folder: Folder, feature: DataColumn, episode: Episode) -> Numbers:
    """Return the numbers of a feature, a row for each frame. Raises DataDamaged if they are not as declared."""
    values = episode.table.numbers.get(feature.key)
    width = int(np.prod(feature.shape))
    if values is None:
        raise DataDamaged(
            f"{folder.place}: {episode.table.source} has no column of {width} numbers {feature.key}, which "
            "meta/info.json declares"
        )
    rows: Numbers = np.where(np.isfinite(values), values, np.nan).reshape(len(values), -1)
    if rows.shape[1] != width:
        raise DataDamaged(
            f"{folder.place}: {feature.key} in {episode.table.source} has {rows.shape[1]} numbers a frame, and "
            f"meta/info.json declares {width}"
        )
    return rows


def _named(folder: Folder) -> list[tuple[DataColumn, list[str]]]:
    """Return each vector of the observations with a name for each number; one of several has its feature before it."""
    named = [
        (feature, _names(feature))
        for feature in folder.features.values()
        if feature.key.startswith("observation.") and _is_number(feature) and len(feature.shape) == 1
    ]
    counts = Counter(name for _, names in named for name in set(names))
    return [
        (feature, [f"{_word(feature)}.{name}" if counts[name] > 1 else name for name in names])
        for feature, names in named
    ]


def _is_number(feature: DataColumn) -> bool:
    return re.fullmatch(r"float(16|32|64)|u?int(8|16|32|64)|bool", feature.dtype) is not None


def _names(feature: DataColumn) -> list[str]:
    """Return a name for each number of a vector."""
    word = _word(feature)
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


def _word(feature: DataColumn) -> str:
    return feature.key.removeprefix("observation.").removeprefix("state.")


def units_of(folder: Folder) -> dict[str, str]:
    """Return the unit of each number that has one in the metadata."""
    return {
        name: unit
        for feature, names in _named(folder)
        for name, unit in zip(names, feature.units, strict=False)
    }


def _refuse_unknown(name: str, names: Sequence[str], what: str) -> None:
    if name and name not in names:
        raise ConfigError(
            f"{what}={name!r} is not a number of the observations. There are {some(names, MOST_CHOICES)}."
            f"{suggestion(name, names)}"
        )


def some(names: Sequence[str], most: int = 12) -> str:
    """Return the first of these names in words, and how many more there are."""
    shown = ", ".join(name[:60] for name in names[:most])
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown or "none"


def _unit_of_gap(folder: Folder, gap: str, options: PlaceOptions) -> tuple[float, str, list[str]]:
    """Return the metres of a unit of the opening, the unit (empty for metres), and what has to be said of it."""
    if options.gap_m_per_unit is not None:
        words = f"gap = {options.gap_m_per_unit:g} * ({gap} - {options.gap_zero:g}) m"
        return options.gap_m_per_unit, "", [words]
    named = units_of(folder).get(gap, "") or unit_of_name(gap)
    if named in METRES:
        return METRES[named], "", []
    episodes = [episode for episode in folder.episodes() if not isinstance(episode, UnreadableRecording)]
    values = np.concatenate([[], *(numbers_of(folder, episode)[gap] for episode in episodes)])
    known = values[np.isfinite(values)]
    if not len(known):
        return 1.0, "", []  # each episode tells why
    low, high = float(known.min()), float(known.max())
    if not named and low >= -0.01 and high <= 0.25:
        return 1.0, "", [f"{gap} goes from {low:g} to {high:g}: taken as metres"]
    guesses = (unit for unit, least, most in GUESSES if least <= low and high <= most)
    unit = named or next(guesses, "counts")
    return (
        1.0,
        unit,
        [
            f"{gap} goes from {low:g} to {high:g}: taken as {unit}, not as metres. With the opening of one unit the "
            "gap is in metres: ?gap_m_per_unit=0.001"
        ],
    )


def times_of(understood: Understood, episode: Episode) -> Numbers:
    """Return the times of the frames of an episode (s), from its first on."""
    numbers, fps = episode.table.numbers, understood.options.fps
    times: Numbers = numbers["timestamp"].reshape(len(episode.table), -1)[:, 0]
    if fps:
        times = numbers["frame_index"] / fps
    since_first: Numbers = times - times[0]
    return since_first
