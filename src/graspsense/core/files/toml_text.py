"""TOML texts: their values, refused in words where they are out of bounds, the lines of their keys, and writing them.

TOML allows whole numbers of 64 bits; Python would read longer ones. Tables and lists can be nested `MOST_NESTED` deep,
so that nothing that follows them runs out of stack.
"""

from __future__ import annotations

import json
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


KeyPath = tuple[str | int, ...]
"""The path to a value: keys from the outermost table inwards, and integers for indices of arrays."""

_BLANK: Final = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE: Final = re.compile(r"[ \t]*")
_PART: Final = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'|[A-Za-z0-9_-]+')
_STRING: Final = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*"{3,5}'
    r"|'''(?:[^']|'(?!''))*'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'",
    re.DOTALL,
)
_BARE_VALUE: Final = re.compile(r"[^,\]}#\n]+")


def key_lines(text: str) -> dict[KeyPath, int]:
    """Return the line, counted from 1, on which each table, key and array element of a TOML text begins.

    `tomllib` does not give these. The text must be valid: this only finds keys and the ends of values.
    """
    return _Scanner(text).scan()


class _Scanner:
    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0
        self.counted = (0, 1)
        self.lines: dict[KeyPath, int] = {}
        self.arrays: dict[KeyPath, int] = {}

    def scan(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        self.skip(_BLANK)
        while self.at < len(self.text):
            if self.text.startswith("[[", self.at):
                table = self.header(2)
            elif self.text[self.at] == "[":
                table = self.header(1)
            else:
                self.pair(table)
            self.skip(_BLANK)
        return self.lines

    def header(self, brackets: int) -> KeyPath:
        line = self.line()
        self.at += brackets
        path: KeyPath = ()
        parts = self.key()
        for i, part in enumerate(parts):
            path = (*path, part)
            self.lines.setdefault(path, line)
            if brackets == 2 and i == len(parts) - 1:
                self.arrays[path] = self.arrays.get(path, -1) + 1
            if path in self.arrays:
                path = (*path, self.arrays[path])
                self.lines.setdefault(path, line)
        self.at += brackets
        return path

    def pair(self, table: KeyPath) -> None:
        line = self.line()
        path = table
        for part in self.key():
            path = (*path, part)
            self.lines.setdefault(path, line)
        self.at += 1  # the equals sign
        self.skip(_SPACE)
        self.value(path)

    def value(self, path: KeyPath) -> None:
        opening = self.text[self.at]
        if opening == "[":
            self.at += 1
            self.skip(_BLANK)
            index = 0
            while self.text[self.at] != "]":
                self.lines[(*path, index)] = self.line()
                self.value((*path, index))
                self.separator()
                index += 1
            self.at += 1
        elif opening == "{":
            self.at += 1
            self.skip(_BLANK)
            while self.text[self.at] != "}":
                self.pair(path)
                self.separator()
            self.at += 1
        elif opening in "\"'":
            self.skip(_STRING)
        else:
            self.skip(_BARE_VALUE)

    def separator(self) -> None:
        self.skip(_BLANK)
        if self.text[self.at] == ",":
            self.at += 1
            self.skip(_BLANK)

    def key(self) -> list[str]:
        """Read a dotted key, and set the position to its end."""
        parts: list[str] = []
        while True:
            self.skip(_SPACE)
            part = self.skip(_PART)
            parts.append(_unquoted(part))
            self.skip(_SPACE)
            if self.text[self.at] != ".":
                return parts
            self.at += 1

    def skip(self, pattern: re.Pattern[str]) -> str:
        match = pattern.match(self.text, self.at)
        assert match is not None, f"no TOML at character {self.at}"
        self.at = match.end()
        return match.group()

    def line(self) -> int:
        start, count = self.counted
        self.counted = (self.at, count + self.text.count("\n", start, self.at))
        return self.counted[1]


def _unquoted(part: str) -> str:
    if part[0] not in "\"'":
        return part
    table: dict[str, Any] = tomllib.loads(f"key = {part}")
    return str(table["key"])


def toml_key(key: str) -> str:
    """Return a key as TOML writes it."""
    bare = key.isascii() and key.replace("-", "_").replace("_", "a").isalnum()
    return key if bare else _toml_text(key)


def toml_value(value: Any) -> str:
    """Return a plain value as TOML writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _toml_text(value)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        inner = (
            f"{toml_key(key)} = {toml_value(member)}" for key, member in value.items() if member is not None
        )
        return "{ " + ", ".join(inner) + " }" if value else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(member) for member in value) + "]"
    raise TypeError(f"{value!r} is not a TOML value")


def _toml_text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
