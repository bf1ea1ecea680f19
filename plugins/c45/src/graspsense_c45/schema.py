"""The names of the attributes and classes of a tree."""

from __future__ import annotations

from attrs import frozen


@frozen
class Attribute:
    """A column of the table.

    name: its name.
    unit: the unit of a numeric attribute; may be empty.
    values: the declared values of a nominal attribute, in order; None for a numeric one.
    """

    name: str
    unit: str = ""
    values: tuple[str, ...] | None = None

    @property
    def is_nominal(self) -> bool:
        """Whether the attribute has a few declared values instead of numbers."""
        return self.values is not None


@frozen
class Schema:
    """The attributes and the declared classes, both in order; a declared class need not occur.

    A class label is a string, an integer, a float or a boolean, and keeps its type through JSON.
    """

    attributes: tuple[Attribute, ...]
    classes: tuple[str | int | float | bool, ...]
