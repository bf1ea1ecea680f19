"""TOML texts and files: their values, refused in words where they are out of bounds, the lines of their keys, and
writing them.

TOML allows whole numbers of 64 bits; Python would read longer ones. Tables and lists can be nested `MOST_NESTED` deep,
so that nothing that follows them runs out of stack.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from importlib.resources.abc import Traversable
from itertools import count
from pathlib import Path
from typing import Any, Final

from graspsense.core.files.whole_file import first_bytes
from graspsense.core.values.errors import ConfigError
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


def labelled_values(text: str, label: str) -> dict[str, Any]:
    """Return the values of a TOML text, which errors call `label`. Raises ConfigError."""
    try:
        return toml_values(text)
    except TomlError as error:
        line = f":{error.line}" if error.line else ""
        column = f", column {error.column}" if error.column else ""
        raise ConfigError(f"{label}{line}{column}: {error}") from None


def settings_text(source: Traversable, label: str, what: str) -> str:
    """Return the text of a file of settings, which errors call `label`; `what` is its kind. Raises ConfigError."""
    try:
        data = first_bytes(source, SETTINGS_BYTES.most)
    except FileNotFoundError:
        raise ConfigError(f"no {what} file {label!r}{_nearby(source)}") from None
    except OSError as error:
        raise ConfigError(f"cannot read the {what} file {label!r}: {error.strerror or error}") from None
    why = SETTINGS_BYTES.exceeded(len(data))
    if why:
        raise ConfigError(f"{label}: {why}")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ConfigError(
            f"{label}:{line}: not UTF-8 text (byte 0x{data[error.start]:02x}): "
            "TOML files are UTF-8; is this the right file?"
        ) from None


def _nearby(missing: Traversable) -> str:
    """Return the folder in which a file was sought, and the file there with the most similar name."""
    if not isinstance(missing, Path):
        return ""
    folder = missing.absolute().parent
    if not folder.is_dir():
        return f": there is no folder {str(folder)!r}"
    # Without the ending, which would make all names similar.
    near = get_close_matches(missing.stem, [path.stem for path in folder.glob("*.toml")], n=1)
    return f" in {folder}" + (f". Did you mean {near[0] + '.toml'!r}?" if near else "")


KeyPath = tuple[str | int, ...]
"""The path to a value: keys from the outermost table inwards, and integers for indices of arrays."""

_TOKEN: Final = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*"{3,5}'
    r"|'''(?:[^']|'(?!''))*'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*|[\[\]{}=,\n]|[^\s\[\]{}=,#\"']+",
    re.DOTALL,
)
"""A string, a comment, a sign of TOML, the end of a line, or the letters of a key or of a value up to one of these."""


def key_lines(text: str) -> dict[KeyPath, int]:
    """Return the line, counted from 1, on which each table, key and array element of a TOML text begins.

    `tomllib` does not give these. The text must be valid: this only finds keys and the ends of values.
    """
    return _Scanner(text).lines


class _Scanner:
    def __init__(self, text: str) -> None:
        line = 1
        self.tokens: list[tuple[str, int]] = []
        """The tokens that are left with their lines, the next one last."""
        for match in _TOKEN.finditer(text):
            if not match[0].startswith("#"):
                self.tokens.append((match[0], line))
            line += match[0].count("\n")
        self.tokens.reverse()
        self.lines: dict[KeyPath, int] = {}
        self.arrays: dict[KeyPath, int] = {}
        table: KeyPath = ()
        while token := self.next_token():
            if token == "[":
                table = self.header()
            else:
                self.pair(table)

    def next_token(self, passed: str = "\n") -> str:
        """Return the next token that is none of these signs, and stay before it; empty at the end."""
        while self.tokens and self.tokens[-1][0] in passed:
            self.tokens.pop()
        return self.tokens[-1][0] if self.tokens else ""

    def header(self) -> KeyPath:
        line = self.tokens.pop()[1]
        is_array = self.next_token() == "["
        if is_array:
            self.tokens.pop()
        path: KeyPath = ()
        parts = self.key("]")
        for i, part in enumerate(parts):
            path = (*path, part)
            self.lines.setdefault(path, line)
            if is_array and i == len(parts) - 1:
                self.arrays[path] = self.arrays.get(path, -1) + 1
            if path in self.arrays:
                path = (*path, self.arrays[path])
                self.lines.setdefault(path, line)
        if is_array:
            self.tokens.pop()
        return path

    def pair(self, table: KeyPath) -> None:
        path, line = table, self.tokens[-1][1]
        for part in self.key("="):
            path = (*path, part)
            self.lines.setdefault(path, line)
        self.value(path)

    def value(self, path: KeyPath) -> None:
        token, _ = self.tokens.pop()
        if token in ("[", "{"):
            for index in count():
                if self.next_token(",\n") in ("]", "}"):
                    self.tokens.pop()
                    break
                if token == "[":
                    self.lines[*path, index] = self.tokens[-1][1]
                    self.value((*path, index))
                else:
                    self.pair(path)
        # A date may have a space before its time.
        while self.tokens and self.tokens[-1][0] not in ("\n", ",", "]", "}"):
            self.tokens.pop()

    def key(self, end: str) -> list[str]:
        """Take the parts of a dotted key, and the sign behind it."""
        text = ""
        while (token := self.tokens.pop()[0]) != end:
            text += token
        return key_parts(text)


def key_parts(key: str) -> list[str]:
    """Return the parts of a dotted key; none if it is not one."""
    if _BARE.fullmatch(key):
        return key.split(".")
    try:
        table: Any = toml_values(f"{key}=0")
    except ValueError:
        return []
    parts = []
    while isinstance(table, dict):
        if len(table) != 1:
            return []
        part, table = next(iter(table.items()))
        parts.append(part)
    return parts


_BARE: Final = re.compile(r"[A-Za-z0-9_-]+(?:\.[A-Za-z0-9_-]+)*")


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
        return "{ " + ", ".join(_pairs(value)) + " }" if value else "{}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(member) for member in value) + "]"
    raise TypeError(f"{value!r} is not a TOML value")


def toml_lines(values: Mapping[str, Any]) -> list[str]:
    """Return values as the lines of a TOML file, the tables last; what is None is left out.

    >>> toml_lines({"run": {"seed": 3}, "title": "a"})
    ['title = "a"', '', '[run]', 'seed = 3']
    """
    lines, tables = [], []
    for key, value in values.items():
        if isinstance(value, Mapping):
            tables += ["", f"[{toml_key(key)}]", *_pairs(value)]
        else:
            lines += _pairs({key: value})
    return [*lines, *tables]


def _pairs(values: Mapping[str, Any]) -> list[str]:
    return [f"{toml_key(key)} = {toml_value(value)}" for key, value in values.items() if value is not None]


def _toml_text(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
