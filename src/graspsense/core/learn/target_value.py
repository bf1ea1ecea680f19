"""A number to predict for each trial: a force at break, a ripeness, a fill level.

A trial has such numbers among its labels, under a heading with the unit as in a CSV file: `break_force [N]` is 2.62.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from attrs import frozen

from graspsense.core.values.errors import ConfigError, suggestion
from graspsense.core.values.written_numbers import number_in

RESERVED: Final = ("label", "instance", "order", "recorded_at", "operator")
"""Labels of a trial that are not numbers to predict."""


@frozen(kw_only=True)
class TargetValue:
    """The numbers to predict, one for each trial, with their name and unit (empty if it is not known)."""

    name: str
    unit: str
    values: tuple[float, ...]


def name_and_unit(heading: str) -> tuple[str, str]:
    """Return the name and the unit of a heading.

    >>> name_and_unit("break_force [N]"), name_and_unit("ripeness")
    (('break_force', 'N'), ('ripeness', ''))
    """
    name, bracket, unit = heading[:-1].rpartition("[") if heading.endswith("]") else ("", "", "")
    return (name.rstrip(), unit.strip()) if bracket and "]" not in unit else (heading, "")


def value_label(text: str) -> tuple[str, str]:
    """Return the heading and the number of a text such as `fill [ml]=250`, as labels of a trial hold them.

    Raises ConfigError if it is not of this form.
    """
    heading, equals, cell = (part.strip() for part in text.partition("="))
    if not equals or not heading or number_in(cell) is None or name_and_unit(heading)[0] in RESERVED:
        raise ConfigError(
            f'{text!r} is not a number of a trial: write NAME [UNIT]=NUMBER, as in "fill [ml]=250"; the name is none '
            f"of {', '.join(RESERVED)}"
        )
    return heading, cell


def values_of_labels(name: str, labels: Sequence[Mapping[str, str]], where: str) -> tuple[str, list[float]]:
    """Return the unit of a number and its value in each trial, NaN where a trial does not have it.

    `labels` are those of each trial. Raises ConfigError if no trial has the number, if its values are not
    numbers, or if it has several units.
    """
    units: dict[str, None] = {}
    known: set[str] = set()
    values = []
    for label in labels:
        value = math.nan
        for heading, cell in label.items():
            called, unit = name_and_unit(heading)
            number = number_in(cell)
            if number is not None and called not in RESERVED:
                known.add(called)
            if called != name or called in RESERVED:
                continue
            if number is None:
                raise ConfigError(
                    f"{name} of a trial of {where} is {str(cell)[:40]!r}, which is not a finite number"
                )
            units[unit] = None
            value = number
        values.append(value)
    if not units:
        have = (
            f"There are: {', '.join(sorted(known))}." if known else "Its trials have no numbers to predict."
        )
        raise ConfigError(
            f"no trial of {where} has a value {name!r}. {have}{suggestion(name, sorted(known))} A trial gets one "
            "when it is recorded: `graspsense collect --value`, or a column of the manifest of an import"
        )
    if len(units) > 1:
        said = ", ".join(unit or "none" for unit in units)
        raise ConfigError(
            f"{name} has several units in {where}: {said}. All trials need the same; in a store, change a "
            f'number with graspsense trials value DIR#7 --value "{name} [UNIT]=NUMBER"'
        )
    return next(iter(units)), values
