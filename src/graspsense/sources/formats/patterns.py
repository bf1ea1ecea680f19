"""Patterns that a manifest gives: regular expressions, wildcards of column names, and templates of file names.

All of them run in RE2, whose time grows in proportion to the text that is searched, whatever the pattern. Python's own
`re` can need years for a short one. RE2 has no backreferences and no lookaround, so a pattern with one is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from itertools import product
from typing import Final

import re2
from attrs import frozen

LONGEST_PATTERN: Final = 1000
"""Limit on the characters of a pattern."""
LONGEST_PATH: Final = 500
"""Limit on the characters of a path for a template that names a field twice."""
MOST_TRIES: Final = 1000
"""Limit on the values that are tried for a field that a template names twice."""

_TEMPLATE: Final = re.compile(r"\{(?P<name>\w+)(?P<digits>:d)?\}|(?P<deep>\*\*/)|(?P<any>\*)|(?P<single>\?)")
_WILDCARD: Final = re.compile(r"(\[(?:(!)([^]]*)|([^!][^]]*))\]|.)", re.DOTALL)
_OF_A_CHOICE: Final = re.compile(r"([\\\]\[^])")
_UNSUPPORTED: Final = re.compile(r"\\[1-9]|\(\?P=|\(\?<?[=!]|\(\?>|[*+?}]\+")


_OPTIONS: Final = re2.Options()
_OPTIONS.log_errors = False


class PatternError(ValueError):
    """A pattern that cannot be used, with the reason."""


def regular_expression(text: str) -> re.Pattern[str]:
    r"""Return the compiled regular expression. Raises PatternError that says why it cannot be used.

    >>> regular_expression(r"begin (?P<label>\w+)").search("begin jar").groupdict()
    {'label': 'jar'}
    """
    _check_length(text)
    return _compiled(text)


def _check_length(text: str) -> None:
    if len(text) > LONGEST_PATTERN:
        raise PatternError(f"a pattern has at most {LONGEST_PATTERN} characters, and this has {len(text)}")


def _compiled(text: str) -> re.Pattern[str]:
    try:
        compiled: re.Pattern[str] = re2.compile(text, _OPTIONS)
    except (re2.error, UnicodeEncodeError) as error:
        said = error.args[0] if error.args else ""
        words = said.decode(errors="replace") if isinstance(said, bytes) else str(error)
        if _UNSUPPORTED.search(text):
            words += (
                ". Backreferences, lookaround, atomic groups and possessive quantifiers are not supported, because "
                "patterns are matched in a time in proportion to the text (by RE2)"
            )
        raise PatternError(f"{text!r} is not a regular expression that can be used: {words}") from None
    return compiled


def wildcard(text: str) -> re.Pattern[str]:
    """Return the pattern of names in which `*` stands for any text, `?` for any character and `[ab]` for a choice.

    Raises PatternError.
    """
    _check_length(text)
    parts = [
        "[" + "^" * len(mark) + _OF_A_CHOICE.sub(r"\\\1", others or choice) + "]"
        if len(sign) > 1
        else {"*": ".*", "?": "."}.get(sign) or re2.escape(sign)
        for sign, mark, others, choice in _WILDCARD.findall(text)
    ]
    return _compiled(f"(?s:{''.join(parts)})")


@frozen
class FileTemplate:
    """A pattern of paths such as `{label}/**/{label}_{order:d}.csv`, whose fields are read from a path."""

    text: str
    pieces: tuple[tuple[str, str], ...]
    """The regular expression of each piece, with the name of its field, empty if it is none."""
    whole: re.Pattern[str]
    """The pieces in a row, in which a field that is named again may have any value."""

    def fields(self, path: str) -> dict[str, str] | None:
        """Return the fields of a path, None if the path does not match. Raises PatternError for too many tries."""
        readable = path.encode("utf-8", "replace").decode()
        match = self.whole.fullmatch(readable)
        if match is None:
            return None
        names = [name for name, _ in self.pieces if name]
        again = [name for name in dict.fromkeys(names) if names.count(name) > 1]
        if again and len(readable) > LONGEST_PATH:
            raise PatternError(
                f"{self.text!r} names a field twice: a path has at most {LONGEST_PATH} characters then, and "
                f"{path[:80]!r}... has {len(path)}"
            )
        values = [[match[name], *_repeated(readable, names.count(name))] for name in again]
        for tries, chosen in enumerate(product(*values)):
            if tries == MOST_TRIES:
                raise PatternError(
                    f"{self.text!r} names a field twice, and {path[:80]!r} fits in too many ways"
                )
            known = dict(zip(again, chosen, strict=True))
            expression = _compiled(_joined(self.pieces, known)) if known else self.whole
            if match := expression.fullmatch(readable):
                return {name: known.get(name) or match[name] for name in names}
        return None


def file_template(text: str) -> FileTemplate:
    """Return the template: `*` any text in a name, `**/` any folders, `{name}` any text, `{name:d}` digits.

    Raises PatternError.
    """
    _check_length(text)
    pieces, end = [], 0
    for match in _TEMPLATE.finditer(text):
        pieces.append(("", re2.escape(text[end : match.start()])))
        end = match.end()
        if match["name"]:
            pieces.append((match["name"], "[0-9]+" if match["digits"] else "[^/]+"))
        else:
            pieces.append(("", "(?:.+/)?" if match["deep"] else "[^/]*" if match["any"] else "[^/]"))
    pieces.append(("", re2.escape(text[end:])))
    return FileTemplate(text, tuple(pieces), _compiled(_joined(pieces, {})))


def _joined(pieces: list[tuple[str, str]] | tuple[tuple[str, str], ...], known: Mapping[str, str]) -> str:
    """Return one regular expression; a field of `known` stands as its value, and others as named groups, each once."""
    parts, named = [], set()
    for name, piece in pieces:
        if name in known:
            parts.append(re2.escape(known[name]))
        elif name and name not in named:
            named.add(name)
            parts.append(f"(?P<{name}>{piece})")
        else:
            parts.append(piece)
    return "(?s:" + "".join(parts) + ")"


def _repeated(path: str, times: int) -> Iterator[str]:
    """Yield each text without a slash that occurs so often in a path, the longest first."""
    for length in range(len(path) // times, 0, -1):
        seen = set()
        for start in range(len(path) - length + 1):
            text = path[start : start + length]
            if "/" not in text and text not in seen and path.count(text) >= times:
                seen.add(text)
                yield text
