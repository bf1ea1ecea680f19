"""The values of a TOML text, refused in words where they are out of bounds.

TOML allows whole numbers of 64 bits; Python would read longer ones. Tables and lists can be nested `MOST_NESTED` deep,
so that nothing that follows them runs out of stack.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from typing import Any, Final

from graspsense.core.values.limits import SETTINGS_BYTES

MOST_NESTED: Final = 50
"""Limit on the depth of tables and lists, and on the parts of a dotted key."""
LARGEST_INTEGER: Final = 2**63 - 1
"""The largest whole number of TOML; the smallest is one below its negative."""

# A part of a key with the dot behind it, or any other character.
_KEY_PART: Final = re.compile(r"(?:[A-Za-z0-9_-]+|\"[^\"\n]*\"|'[^'\n]*')[ \t]*(\.?)[ \t]*|.", re.DOTALL)
_PLACE: Final = re.compile(r" \(at (?:line (\d+), column (\d+)|end of document)\)\Z")


class TomlError(ValueError):
    """A text that is not TOML, or is out of bounds. `line` and `column` count from 1; 0 where they are not known."""

    def __init__(self, why: str, line: int = 0, column: int = 0) -> None:
        super().__init__(why)
        self.line, self.column = line, column


def toml_values(text: str) -> dict[str, Any]:
    """Return the values of a TOML text. Raises TomlError; ConfigError if the variable of the limit is malformed.

    >>> toml_values("seed = 3")
    {'seed': 3}
    """
    why = SETTINGS_BYTES.exceeded(len(text))
    if why:
        raise TomlError(why)
    if text.count(".") > MOST_NESTED:
        _check_dotted_keys(text)
    try:
        values = tomllib.loads(text)
    except RecursionError:
        raise TomlError("lists or tables nested too deep") from None
    except ValueError as error:
        place = _PLACE.search(str(error))
        said = str(error)[: place.start()] if place else str(error)
        line = int(place[1]) if place and place[1] else text.count("\n") + 1
        raise TomlError(f"not TOML: {said}", line, int(place[2] or 0) if place else 0) from None
    _check_bounds(values)
    return values


def _check_dotted_keys(text: str) -> None:
    """Raise TomlError for a key with too many parts, for which the parser would need hours."""
    parts = 0
    for match in _KEY_PART.finditer(text):
        parts = parts + 1 if match[1] else 0
        if parts > MOST_NESTED:
            line = text.count("\n", 0, match.start()) + 1
            raise TomlError(f"nested too deep: a dotted key has at most {MOST_NESTED} parts", line)


def _check_bounds(values: Mapping[str, Any]) -> None:
    """Raise TomlError for a number of more than 64 bits, and for what is nested too deep."""
    inside: list[tuple[str, Any]] = list(values.items())
    for _ in range(MOST_NESTED):
        below: list[tuple[str, Any]] = []
        for key, value in inside:
            if isinstance(value, dict):
                below.extend(value.items())
            elif isinstance(value, list):
                below.extend((key, item) for item in value)
            elif isinstance(value, int) and not -LARGEST_INTEGER - 1 <= value <= LARGEST_INTEGER:
                raise TomlError(
                    f"{key[:60]}: a whole number is at most {LARGEST_INTEGER} in TOML, and this is larger"
                )
        if not below:
            return
        inside = below
    raise TomlError(f"lists or tables nested too deep: at most {MOST_NESTED} in one another")
