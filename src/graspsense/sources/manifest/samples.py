"""The samples of a table as a manifest describes them: time, gap, forces and further channels."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Final

import numpy as np

from graspsense.core.values.errors import ConfigError, DataDamaged, counted, listed
from graspsense.core.values.fingers import PREFIX, FingerForce
from graspsense.core.values.signals import NO_GAP
from graspsense.sources.columns.column_guess import unit_in_name
from graspsense.sources.columns.force_and_gap import doubtful_delay
from graspsense.sources.columns.grasp_columns import (
    GraspColumns,
    finger_sides,
    is_channel_name,
    without_missing,
)
from graspsense.sources.formats.table import ColumnTable, Numbers
from graspsense.sources.manifest.available import AvailableColumns
from graspsense.sources.manifest.closings import without_number
from graspsense.sources.manifest.description import ReadManifest, hand_of, quantity_of, samples_of
from graspsense.sources.manifest.events import labelled_events
from graspsense.sources.manifest.expression import Expression
from graspsense.sources.manifest.steps import without_duplicates
from graspsense.sources.units import GRAM_FORCE, TO_SI, WITHOUT_UNIT, known_unit

EARLIEST_STAMP_S: Final = 1e6
"""A first time beyond this is a stamp of a clock, and times are counted from it."""
MOSTLY: Final = 0.5
"""Share of the samples with gap and force from which on these were measured together."""
QUANTITIES: Final = ("time", "gap", "force")
"""The quantities whose units are not those of another one."""


@np.errstate(all="ignore")  # what is infinite, or too large, is refused by `checked_recording`
def samples(manifest: ReadManifest, table: ColumnTable) -> GraspColumns:
    """Return the samples of a table as the manifest describes them. Raises ConfigError, DataDamaged."""
    keys, available = manifest.keys, AvailableColumns(manifest, table)
    if not len(table):
        raise DataDamaged(f"{table.source} has no rows")
    notes = [f"{len(table)} samples of {table.source}", *table.notes]
    t_s, origin_s, clock, time_notes = _times(available)
    notes += time_notes
    events = labelled_events(available, t_s, origin_s)
    notes += [
        f"labelled in the recording: {name}, {counted(len(spans), 'time')}"
        for name, spans in events.items()
        if spans
    ]
    scalars, arrays, units = _channels(available)
    zero = samples_of(keys.zero, t_s) if keys.zero else 0
    if zero:
        notes.append(f"zero of the forces: the mean of the first {zero} samples")
        for name, values in (*scalars.items(), *arrays.items()):
            if name not in manifest.fast and units.get(name, "") in ("N", "counts"):
                values -= np.nanmean(values[:zero], axis=0)
    available.update(scalars | arrays)
    gap = available.value("gap") or (np.zeros(len(table)), NO_GAP)
    available.zero = zero
    hand, each = _fingers(available)
    scalars |= each
    units |= {channel.name: channel.unit for channel in hand}
    if hand:
        left_n, right_n = finger_sides(hand, each)
        unit = "" if hand[0].unit == "N" else hand[0].unit
    else:
        left_n, right_n, unit = _sides(available)
    notes += [*_folds(manifest), *_assumed(available)]
    effort, velocity = available.value("effort"), available.value("velocity")
    columns = GraspColumns(
        source=table.source,
        t_s=t_s,
        gap_m=gap[0],
        left_n=left_n,
        right_n=right_n,
        effort_n=None if effort is None else effort[0],
        velocity_m_s=None if velocity is None else velocity[0],
        scalars=scalars,
        fingers=hand,
        arrays=arrays,
        shapes=_shapes(available, arrays),
        fast=manifest.fast,
        units={
            **units,
            "gap": gap[1],
            "force": unit,
            "t": clock,
        },
        notes=tuple(notes),
        warnings=(*table.warnings, *_doubts(available, t_s, gap[0], (left_n, right_n))),
        lines=table.lines,
        events=events,
    )
    whole = columns if keys.split == "force" and _is_mostly_known(columns) else without_missing(columns)
    return without_duplicates(whole) if keys.duplicates == "drop" else whole


def _is_mostly_known(columns: GraspColumns) -> bool:
    """Return whether gap and forces were measured together: what is missing in a squeeze is then of that squeeze."""
    known = np.isfinite(columns.gap_m + columns.force_n)
    return bool(np.isfinite(columns.t_s).all() and known.mean() > MOSTLY)


def _sides(columns: AvailableColumns) -> tuple[Numbers, Numbers, str]:
    """Return the forces of the two pads that a manifest names, and their unit. Raises ConfigError."""
    both = columns.value("force")
    left = both or columns.value("left")
    right = both or columns.value("right") or left
    left = left or right
    assert left is not None  # the manifest was checked for them
    assert right is not None
    if left[1] != right[1]:
        raise ConfigError(
            f"{columns.manifest.place}: left is in {left[1] or 'N'} and right in {right[1] or 'N'}: use one unit"
        )
    return left[0], right[0], left[1]


def _fingers(columns: AvailableColumns) -> tuple[tuple[FingerForce, ...], dict[str, Numbers]]:
    """Return the fingers that a manifest names, and the force of each by its channel. Raises ConfigError."""
    manifest = columns.manifest
    forces: dict[str, Numbers] = {}
    units: dict[str, str] = {}
    for name in manifest.keys.fingers:
        key = f"{PREFIX}{name}"
        given = columns.value(key)
        assert given is not None  # each finger has an expression
        forces[key], units[name] = given[0], given[1] or "N"
    if len(set(units.values())) > 1:
        words = listed([f"{name} in {unit}" for name, unit in units.items()])
        raise ConfigError(f"{manifest.place}: fingers: {words}: use one unit")
    return hand_of(manifest.keys, next(iter(units.values()), "N")), forces


def _doubts(
    columns: AvailableColumns, t_s: Numbers, gap: Numbers, pads: tuple[Numbers, Numbers]
) -> Iterator[str]:
    """Yield a sentence for each unit that is most likely another one, and for topics that may be apart in time."""
    yield from _doubtful_units(columns)
    yield from _counted_time(columns)
    if columns.manifest.keys.split == "force":
        yield from dict.fromkeys(text for force in pads for text in without_number(t_s, gap, force))
    if told := doubtful_delay(t_s, gap, pads[0] + pads[1], _later_s(columns)):
        yield told


def _later_s(columns: AvailableColumns) -> float:
    """Return how much later the topics of the force are recorded, after their headers, than those of the gap (s)."""
    delays: dict[str, set[float]] = {"gap": set(), "force": set()}
    for key in columns.manifest.expressions:
        quantity = quantity_of(key)
        chosen = columns.chosen(key) if quantity in delays else None
        for name in chosen.names if chosen is not None else ():
            delays[quantity] |= {
                delay for topic, delay in columns.table.delays_s.items() if name.startswith(f"{topic}.")
            }
    return max((force - gap for force in delays["force"] for gap in delays["gap"]), key=abs, default=0.0)


def _doubtful_units(columns: AvailableColumns) -> Iterator[str]:
    """Yield a sentence for each quantity whose unit the file or a name states otherwise than it is read."""
    for key in columns.manifest.expressions:
        quantity, chosen = quantity_of(key), columns.chosen(key)
        if chosen is None or not columns.has(chosen):
            continue
        stated = columns.stated(chosen)
        others = [what for what in QUANTITIES if what != quantity and known_unit(stated, what) in TO_SI[what]]
        said, written = (known_unit(unit, quantity) or unit for unit in (stated, chosen.unit))
        if quantity in QUANTITIES and others and stated not in WITHOUT_UNIT:
            yield f"{key}: the file states {stated}, which is no unit of a {quantity}: is it another column?"
        elif chosen.unit and stated not in WITHOUT_UNIT and said != written:
            yield f"{key}: the manifest says [{chosen.unit}], and the file states {stated}"
        elif columns.unit(chosen, quantity).lower() in ("", *GRAM_FORCE):
            yield from _not_read(key, chosen, columns, quantity)


def _not_read(key: str, chosen: Expression, columns: AvailableColumns, quantity: str) -> Iterator[str]:
    """Yield that numbers are read in the SI unit, although their file or their names state another one."""
    si, stated = next(iter(TO_SI[quantity])), chosen.unit or columns.stated(chosen)
    names = chosen.columns(tuple(columns)) if chosen.keeps_unit and not stated else ()
    of_names = {unit_in_name(name, quantity): name for name in names}
    unit = next((unit for unit in (stated, *of_names) if unit not in (*WITHOUT_UNIT, si, "counts")), "")
    if unit:
        meant = GRAM_FORCE.get(unit.lower(), unit) if quantity == "force" else unit
        said = "the file states" if stated else f"the name of {of_names[unit]} says"
        known = f'if it is in {meant}, write {key} = "{chosen.text} [{meant}]"'
        mended = known if meant in TO_SI[quantity] else "multiply it by a factor"
        yield f"{key}: {said} {unit}, and it is read in {chosen.unit or si}: {mended}"


def _counted_time(columns: AvailableColumns) -> Iterator[str]:
    """Yield that a time without a unit is most likely the number of the sample: it is whole, and rises by 1."""
    chosen = columns.chosen("time")
    if chosen is None or not columns.has(chosen) or columns.unit(chosen, "time"):
        return
    steps = np.diff(chosen.numbers(columns, len(columns.table)))
    if len(steps) and np.median(steps) == 1.0 and (steps == np.round(steps)).all():
        yield (
            "the time rises by 1 in each sample, as the number of a sample does: leave time out and write rate_hz, or "
            f'write time = "{chosen.text} [s]" if these are seconds'
        )


def _folds(manifest: ReadManifest) -> list[str]:
    """Return sentences on what stands for the two pads and for the gap."""
    expressions = manifest.expressions
    if manifest.keys.fingers:
        notes = []  # the runner says which fingers the forces are of
    elif expressions["force"] or not (expressions["left"] and expressions["right"]):
        notes = ["a single force was recorded; it is used for both pads"]
    else:
        texts = [expressions[side][0].text for side in ("left", "right")]
        notes = [f"the left pad is {texts[0]}, the right pad is {texts[1]}"]
    if not expressions["gap"]:
        notes.append("no gap was recorded: features of the force alone are computed")
    return notes


def _assumed(columns: AvailableColumns) -> Iterator[str]:
    """Yield which quantities are read in SI units although nothing states their unit: numbers alone do not tell it."""
    read = {}
    for key in columns.manifest.expressions:
        quantity, chosen = quantity_of(key), columns.chosen(key)
        if quantity in QUANTITIES and chosen is not None and columns.has(chosen):
            named = any(unit_in_name(name, quantity) for name in chosen.columns(tuple(columns)))
            if not (named or columns.unit(chosen, quantity)):
                read[key] = next(iter(TO_SI[quantity]))
    if read:
        words = listed([f"{key} in {si}" for key, si in read.items()])
        yield f"no unit is stated, so these are read as they are: {words}"


def _times(columns: AvailableColumns) -> tuple[Numbers, float, str, tuple[str, ...]]:
    """Return the time of each row, what was subtracted from it, its unit, empty for s, and what was chosen, in words.

    Raises ConfigError.
    """
    manifest, table, chosen = columns.manifest, columns.table, columns.chosen("time")
    missing = chosen is None or not columns.has(chosen)
    given = None if missing and manifest.keys.rate_hz else columns.value("time")
    if given is not None and chosen is not None:
        unit, origin = columns.since_1970(chosen), _origin(given[0])
        told = unit and unit == columns.unit(chosen, "time")
        return given[0] - origin, origin, "", (f"the time is in {unit} since 1970",) if told else ()
    if table.t_s is not None:
        origin = _origin(table.t_s)
        return table.t_s - origin, origin, "", ()
    if manifest.keys.rate_hz:
        return np.arange(len(table)) / manifest.keys.rate_hz, 0.0, "", ()
    if len(table) == 1:
        return np.zeros(1), 0.0, "sample", ()
    raise ConfigError(
        f'{manifest.place}: {table.source} has no time: write time = "COLUMN [ms]", or rate_hz = 100 where there is no '
        f"such column. Columns: {listed(tuple(table.numbers))}"
    )


def _origin(times: Numbers) -> float:
    """Return the first of these times where they are stamps of a clock such as seconds since 1970, else 0."""
    return float(times[0]) if abs(float(times[0])) > EARLIEST_STAMP_S else 0.0


def _channels(columns: AvailableColumns) -> tuple[dict[str, Numbers], dict[str, Numbers], dict[str, str]]:
    """Return the further channels with one number a sample, the arrays, and the units of both. Raises ConfigError."""
    manifest = columns.manifest
    scalars: dict[str, Numbers] = {}
    arrays: dict[str, Numbers] = {}
    units: dict[str, str] = {}
    for name, expression in manifest.channels.items():
        if not is_channel_name(name):
            raise ConfigError(
                f"{manifest.place}: channels: {name!r} cannot be the name of a channel: write small letters, digits "
                "and underscores, a letter first, and no name of a channel of every gripper"
            )
        values = columns.computed(f"channels.{name}", partial(expression.values, columns, len(columns.table)))
        if name in manifest.fast:
            values = values.reshape(len(values), -1)
        (scalars if values.ndim == 1 else arrays)[name] = values
        units[name] = expression.unit or columns.stated(expression) or "1"
    return scalars, arrays, units


def _shapes(available: AvailableColumns, arrays: Mapping[str, Numbers]) -> dict[str, tuple[int, ...]]:
    """Return the shape of each channel that is computed from a column with a shape, such as an image.

    The numbers of a fast channel without one are samples of one axis.
    """
    manifest, known_shapes = available.manifest, available.table.shapes
    shapes: dict[str, tuple[int, ...]] = {}
    for name, values in arrays.items():
        width = values.shape[1]
        columns = manifest.channels[name].columns(tuple(available))
        known = [known_shapes[column] for column in columns if column in known_shapes]
        # An expression may have taken some of the cells.
        if known and math.prod(known[-1]) == width:
            shapes[name] = known[-1]
        elif name in manifest.fast:
            shapes[name] = (width, 1)
    return shapes
