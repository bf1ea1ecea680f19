"""The lines of the keys of a TOML file, which `tomllib` does not give.

The text must be valid TOML: this only finds keys and the ends of values.
"""

from __future__ import annotations

import re
import tomllib
from typing import Any, Final

KeyPath = tuple[str | int, ...]
"""The path to a value: keys from the outermost table inwards, and integers for indices of arrays."""

_BLANK: Final = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE: Final = re.compile(r"[ \t]*")
_KEY_PART: Final = re.compile(r'"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'|[A-Za-z0-9_-]+')
_STRING: Final = re.compile(
    r'"""(?:[^"\\]|\\.|"(?!""))*"{3,5}'
    r"|'''(?:[^']|'(?!''))*'{3,5}"
    r'|"(?:[^"\\\n]|\\.)*"'
    r"|'[^'\n]*'",
    re.DOTALL,
)
_BARE_VALUE: Final = re.compile(r"[^,\]}#\n]+")


def key_lines(text: str) -> dict[KeyPath, int]:
    """Return the line, counted from 1, on which each table, key and array element of the text begins."""
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
            part = self.skip(_KEY_PART)
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
