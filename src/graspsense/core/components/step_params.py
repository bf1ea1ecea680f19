"""The parameters of a control law, made from its config, so that an author declares each setting once.

A control law is compiled, so its parameters are a named tuple of numbers and not an attrs object. The type of this
tuple follows from the names of the settings alone: machine code on disk refers to its type by name, and another process
finds the type again by `__getattr__` of this module.
"""

from __future__ import annotations

from collections import namedtuple
from functools import cache
from typing import Any

import attrs

from graspsense.core.components.entries import KINDS


def params_of(config: Any, **further: float) -> Any:
    """Return the numbers of a config as a named tuple: each setting that is a float, an int or a bool.

    A bool becomes 0 or 1. The key `sends` of a law with several kinds of command becomes the number of the kind, such
    as `VELOCITY`. Settings of other types are left out. The `further` numbers, which a law computes from its settings,
    follow. Raises TypeError if `config` is not an attrs object.
    """
    cls = type(config)
    attrs.resolve_types(cls)
    # The annotation decides, so that the types of the tuple do not depend on the values.
    numbers: dict[Any, type[float] | type[int]] = {float: float, int: int, bool: int}
    values = {
        field.name: numbers[field.type](getattr(config, field.name))
        for field in attrs.fields(cls)
        if field.type in numbers
    }
    if "sends" in attrs.fields_dict(cls):
        values["sends"] = KINDS.index(config.sends)
    values |= further
    return _type_of(f"{cls.__name__}({','.join(values)})")(*values.values())


@cache
def _type_of(name: str) -> Any:
    """Return the named tuple that is called `Config(first_key,second_key)`."""
    config, _, keys = name.rstrip(")").partition("(")
    made: Any = namedtuple("made", keys.split(",") if keys else ())  # type: ignore[misc]
    made.__name__, made.__module__, made.__qualname__ = config, __name__, name
    return made


def __getattr__(name: str) -> Any:
    if not name.endswith(")"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return _type_of(name)
