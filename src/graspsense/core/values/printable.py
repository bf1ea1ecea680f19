"""Text from data, made printable: no character of it acts on a terminal or changes the order in which text is read."""

from __future__ import annotations

import re
from typing import Final

_ACTING: Final = re.compile(
    "[\\x00-\\x09\\x0b-\\x1f\\x7f-\\x9f"  # the control characters, of which a line feed may stay
    "\\u061c\\u200b\\u200e\\u200f\\u202a-\\u202e\\u2060-\\u206f"  # invisible, or for the direction of writing
    "\\u2028\\u2029\\ufeff\\ufff9-\\ufffb\\ud800-\\udfff]"  # ends of lines, annotations, and what is no character
)


def printable(text: str) -> str:
    r"""Return a text of several lines in which every character that acts is written as in JSON: `\u001b`."""
    return _ACTING.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def in_one_line(text: str) -> str:
    r"""Return a text as one printable line: a line feed is written as `\u000a`."""
    return printable(text).replace("\n", "\\u000a")
