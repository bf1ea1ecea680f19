"""The events that are labelled in a recording, as a manifest says where: when each begins and ends."""

from __future__ import annotations

import re
from functools import partial
from typing import Final

import numpy as np

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.signals import NOT_KNOWN
from graspsense.core.values.written_numbers import is_missing, number_in
from graspsense.sources.columns.grasp_columns import Spans
from graspsense.sources.formats.table import Numbers
from graspsense.sources.manifest.available import AvailableColumns
from graspsense.sources.manifest.expression import Expression
from graspsense.sources.units import TO_SI

_SEPARATORS: Final = re.compile(r"[\s;,|]+")


def labelled_events(columns: AvailableColumns, t_s: Numbers, origin_s: float) -> dict[str, Spans]:
    """Return begin and end (s) of the labelled events of each kind, on the clock of `t_s`.

    An expression with a unit of time gives the times of events, one without says in each sample whether the event goes
    on (1) or not (0). The begin of an event is known only behind a 0. `origin_s` is what was subtracted from the times
    of the file. Raises ConfigError, DataDamaged.
    """
    events: dict[str, Spans] = {}
    for kind, expression in columns.manifest.events.items():
        if expression.unit:
            events[kind] = _at_times(columns, kind, expression, t_s, origin_s)
        else:
            values = columns.computed(f"events.{kind}", partial(expression.numbers, columns, len(t_s)))
            _check_flags(columns, kind, values)
            if not np.isnan(values).all():
                events[kind], events[kind + NOT_KNOWN] = _where_set(values, t_s)
    return events


def _check_flags(columns: AvailableColumns, kind: str, values: Numbers) -> None:
    """Raise DataDamaged for the first value that is neither 0 nor 1 nor missing."""
    wrong = np.flatnonzero((values != 0.0) & (values != 1.0) & ~np.isnan(values))
    if len(wrong):
        table, k = columns.table, int(wrong[0])
        place = f"sample {k + 1}" if table.lines is None else f"line {table.lines[k]}"
        raise DataDamaged(
            f"{table.source}, {place}: the label of events.{kind} is {values[k]:g}; it must be 0 or 1, or missing. For "
            f'times of events write their unit: {kind} = "COLUMN [s]"'
        )


def _where_set(values: Numbers, t_s: Numbers) -> tuple[Spans, Spans]:
    """Return the events, and the times in which it is not known whether one goes on, or when it began."""
    events, unknown = [], []
    edges = np.diff((values != 0.0).astype(np.int8), prepend=0, append=0)
    for begin, end in zip(
        np.flatnonzero(edges > 0).tolist(), np.flatnonzero(edges < 0).tolist(), strict=True
    ):
        missing = np.flatnonzero(np.isnan(values[begin:end]))
        known = begin + int(missing[0]) if len(missing) else end
        known = known if begin else 0
        if known > begin:
            events.append((float(t_s[begin]), float(t_s[known - 1])))
        if known < end:
            unknown.append((float(t_s[known]), float(t_s[end - 1])))
    return tuple(events), tuple(unknown)


def _at_times(
    columns: AvailableColumns, kind: str, expression: Expression, t_s: Numbers, origin_s: float
) -> Spans:
    """Return the events at the times that a field, a column or an expression gives; each ends where it begins."""
    manifest, table = columns.manifest, columns.table
    if expression.unit not in TO_SI["time"]:
        raise ConfigError(
            f"{manifest.place}: events.{kind}: the unit {expression.unit!r} is not one of time. There are "
            f"{', '.join(TO_SI['time'])}; a column of 0 and 1 has none"
        )
    if expression.column in table.blank and expression.column not in columns:
        return ()
    text = table.value(expression.column) if expression.column else None
    if text is None:
        column = columns.computed(f"events.{kind}", lambda: expression.numbers(columns, len(table)))
        distinct = np.unique(column)
        if len(distinct) > 1:
            raise ConfigError(
                f"{manifest.place}: events.{kind} changes during {table.source}: take first(...) or last(...)"
            )
        text = repr(float(distinct[0]))
    times = []
    for word in filter(None, _SEPARATORS.split(text)):
        number = number_in(word)
        if number is None and not is_missing(word):
            raise DataDamaged(f"{table.source}: events.{kind}: {word!r} is not a time")
        if number is not None:
            times.append(number * TO_SI["time"][expression.unit] - origin_s)
    for time_s in times:
        if not t_s[0] <= time_s <= t_s[-1]:
            raise DataDamaged(
                f"{table.source}: events.{kind}: {time_s:g} s is outside of the recording, which is from {t_s[0]:g} to "
                f"{t_s[-1]:g} s"
            )
    return tuple((time_s, time_s) for time_s in sorted(times))
