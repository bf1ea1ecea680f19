"""What the columns and the classes of a tree are called."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Attribute:
    """One column: numeric (``values`` is None; ``unit`` may be empty) or nominal with its declared values in order."""

    name: str
    unit: str = ""
    values: tuple[str, ...] | None = None

    @property
    def is_nominal(self) -> bool:
        """Whether the column holds one of a few declared values."""
        return self.values is not None


@dataclass(frozen=True, slots=True)
class Schema:
    """The columns in order, and the declared classes in order, absent ones included.

    A class label is a string, an integer, a float or a boolean, and keeps its type through JSON.
    """

    attributes: tuple[Attribute, ...]
    classes: tuple[str | int | float | bool, ...]
