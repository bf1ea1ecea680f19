"""The columns that the expressions of a manifest can use for one table, and their values in SI units."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from graspsense.core.values.errors import ConfigError, listed
from graspsense.core.values.written_numbers import number_in
from graspsense.sources.manifest.description import ReadManifest
from graspsense.sources.manifest.expression import Expression, ExpressionError
from graspsense.sources.manifest.table import ColumnTable, Numbers

TO_SI: Final[Mapping[str, Mapping[str, float]]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "gap": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "force": {"N": 1.0, "mN": 1e-3, "kN": 1e3, "gf": 9.80665e-3, "kgf": 9.80665, "lbf": 4.4482216152605},
    "effort": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
}
"""The units of each quantity with their factor to the SI unit."""


class AvailableColumns(dict[str, Any]):
    """The columns of a table that expressions can use: its numbers, its fields that are numbers, and channels."""

    def __init__(self, manifest: ReadManifest, table: ColumnTable) -> None:
        super().__init__(table.numbers)
        self.manifest, self.table = manifest, table
        for name, text in table.fields.items():
            if name not in self and (number := number_in(text)) is not None:
                self[name] = np.full(len(table), number)

    def value(self, key: str, parts: Sequence[Expression], quantity: str) -> tuple[Numbers, str] | None:
        """Return the value of the first expression whose columns exist and its unit, None if there are none."""
        if not parts:
            return None
        chosen = self.chosen(parts)
        values = self.computed(key, lambda: chosen.numbers(self, len(self.table)))
        return self._in_si(key, values, self.unit(chosen, quantity), quantity)

    def chosen(self, parts: Sequence[Expression]) -> Expression:
        """Return the first expression whose columns exist, or the first if there is none."""
        return next((part for part in parts if self.has(part)), parts[0])

    def unit(self, expression: Expression, quantity: str) -> str:
        """Return the unit behind an expression, or the one that the file states for a column on its own."""
        stated = self.stated(expression)
        return expression.unit or (stated if stated in (*TO_SI[quantity], "counts") else "")

    def stated(self, expression: Expression) -> str:
        """Return the unit that the file states for an expression that is a column, empty if there is none."""
        return self.table.units.get(expression.column, "")

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
