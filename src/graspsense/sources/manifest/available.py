"""The columns that the expressions of a manifest can use for one table, and their values in SI units."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from graspsense.core.values.errors import ConfigError, listed
from graspsense.core.values.fingers import PREFIX
from graspsense.core.values.written_numbers import number_in
from graspsense.sources.formats.table import MOST_NAMES, ColumnTable, Numbers
from graspsense.sources.manifest.description import ReadManifest, quantity_of
from graspsense.sources.manifest.expression import Expression, ExpressionError
from graspsense.sources.units import GRAM_FORCE, TO_SI, WITHOUT_UNIT, known_unit, unit_since_1970


class AvailableColumns(dict[str, Any]):
    """The columns of a table that expressions can use: its numbers, its fields that are numbers, and channels.

    A table with one column of values, and one that says what each is of, has a column for each of these names.
    """

    def __init__(self, manifest: ReadManifest, table: ColumnTable) -> None:
        super().__init__(table.numbers)
        self.manifest, self.table, self.zero = manifest, table, 0
        for name, text in table.fields.items():
            if name not in self and (number := number_in(text)) is not None:
                self[name] = np.full(len(table), number)
        times = {name for part in manifest.expressions["time"] for name in part.names}
        values = [name for name, column in table.numbers.items() if column.ndim == 1 and name not in times]
        for cells in table.texts.values() if len(values) == 1 else ():
            names = dict.fromkeys(cells)
            for name in names if 1 < len(names) <= MOST_NAMES else ():
                rows = np.array([cell == name for cell in cells])
                self[f"{name}.{values[0]}"] = np.where(rows, table.numbers[values[0]], np.nan)

    def value(self, key: str) -> tuple[Numbers, str] | None:
        """Return what the manifest gives for a key and its unit, None if it gives nothing.

        A force is less the mean of the first `zero` samples.
        """
        chosen, quantity = self.chosen(key), quantity_of(key)
        if chosen is None:
            return None
        place = f"fingers.{key.removeprefix(PREFIX)}" if key.startswith(PREFIX) else key
        values = self.computed(place, lambda: chosen.numbers(self, len(self.table)))
        if quantity == "force" and self.zero:
            values -= np.nanmean(values[: self.zero])
        return self._in_si(place, values, self.unit(chosen, quantity), quantity)

    def chosen(self, key: str) -> Expression | None:
        """Return the first expression of a key whose columns exist, or the first; None if the key has none."""
        parts = self.manifest.expressions[key]
        return next((part for part in parts if self.has(part)), next(iter(parts), None))

    def unit(self, expression: Expression, quantity: str) -> str:
        """Return the unit behind an expression, or the one that the file states for its columns.

        A mass stands for no unit: it is doubtful which force is meant. Times since 1970 tell their unit themselves.
        """
        stated = expression.unit or self.stated(expression)
        other = expression.unit or (quantity in ("force", "gap") and stated.lower() not in GRAM_FORCE)
        kept = stated if other and stated not in WITHOUT_UNIT else ""
        return known_unit(stated, quantity) or kept or self.since_1970(expression, quantity)

    def since_1970(self, expression: Expression, quantity: str = "time") -> str:
        """Return the unit of numbers that are times since 1970, empty if that is s, or if they are no such times."""
        if quantity != "time" or not len(self.table):
            return ""
        return unit_since_1970(float(expression.numbers(self, len(self.table))[0]))

    def stated(self, expression: Expression) -> str:
        """Return the unit that the file states for an expression that keeps it, empty if there is none."""
        names = expression.columns(tuple(self)) if expression.keeps_unit and self.has(expression) else ()
        units = {self.table.units.get(name, "") for name in names} - {""}
        return units.pop() if len(units) == 1 else ""

    def has(self, expression: Expression) -> bool:
        """Return whether all columns of an expression exist."""
        try:
            expression.columns(tuple(self))
        except ExpressionError:
            return False
        return True

    def computed(self, key: str, compute: Callable[[], Numbers]) -> Numbers:
        """Return what an expression gives. Raises ConfigError that names the manifest, the key and the file."""
        try:
            return compute()
        except ExpressionError as error:
            texts = [name for name in self.table.texts if name not in self and repr(name) in str(error)]
            lines = self.table.not_numbers
            words = [f"{name} ({lines[name]})" if name in lines else name for name in texts]
            aside = f"\n    columns of text, which are not numbers: {listed(words)}" if texts else ""
            raise ConfigError(
                f"{self.manifest.place}: {key}, for {self.table.source}: {error}{aside}"
            ) from None

    def _in_si(self, key: str, values: Numbers, unit: str, quantity: str) -> tuple[Numbers, str]:
        factors = TO_SI[quantity]
        if unit in factors or not unit:
            return values * factors.get(unit, 1.0), ""
        if quantity in ("force", "gap"):
            return values, unit
        raise ConfigError(
            f"{self.manifest.place}: {key}: the unit {unit!r} is not known. There are {', '.join(factors)}"
        )
