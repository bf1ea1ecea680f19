"""Text for people: tables, paragraphs and colour, fitted to the terminal that they are printed on.

Everything that a command prints passes through here, and no character of it acts on the terminal: labels, notes and
names of files come from data (`core/values/printable.py`). No text can look like several: its further lines are
indented.

Where the output is not a terminal (a pipe, a file), nothing is coloured, wrapped or cut, so that programs can read it.
`NO_COLOR` and `TERM=dumb` switch the colour off, and `COLUMNS` overrides the width of the terminal.
"""

from __future__ import annotations

import os
import re
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from enum import Enum
from functools import partial
from io import StringIO
from typing import IO, Final, TypeVar
from unicodedata import combining, east_asian_width

import click

from graspsense.core.values.printable import in_one_line, printable


class Style(Enum):
    """What a piece of text means to the reader, with the colour for it."""

    GOOD = "green"
    CAUTION = "yellow"
    BAD = "red"
    RESULT = "cyan"
    HEADING = ""

    @property
    def bold(self) -> bool:
        """Whether the text is bold as well."""
        return self in (Style.BAD, Style.RESULT, Style.HEADING)


LABEL_WIDTH: Final = 12
"""Width of the labels in front of the entries of an output, such as `outcome     steady`."""

_GAP: Final = 2
_SHORT: Final = 24
"""Cells up to this width are not broken into lines as long as there is another way."""
_DEFAULT_WIDTH: Final = 80
_NUMBER: Final = re.compile(r"[+−-]?[0-9]+([.][0-9]+)?( ?[%\w/]{1,4})?")

_GOOD: Final = frozenset({"loaded", "ready", "pass", "ok", "steady", "yes"})
_BAD: Final = frozenset({"broken", "fail", "failed", "problem", "PROBLEM", "aborted", "device lost", "no"})

ItemT = TypeVar("ItemT")
StyleOf = Callable[[str], Style | None]
"""Returns the style of a cell with this text."""


_results: IO[str] | None = None
_as_values = False
_kept: int | None = None
"""A descriptor of stdout, while that of a process leads to stderr: libraries in C print without asking Python."""


@contextmanager
def results_alone_on_stdout() -> Iterator[None]:
    """Within this context stdout has what this module prints; what a plugin prints goes to stderr."""
    global _results, _as_values, _kept
    _results = sys.stdout
    try:
        with nullcontext() if sys.stdout is None else redirect_stdout(sys.stderr):
            yield
    finally:
        if _kept is not None:
            os.dup2(_kept, 1)
            os.close(_kept)
        _results, _as_values, _kept = None, False, None


def print_values_alone(asked: bool) -> None:
    """If asked, have stdout get only values, and no text, until the context of the results ends, or the command."""
    global _as_values, _kept
    _as_values = asked
    if asked and _results is None:  # a command that a test invokes by itself
        click.get_current_context().call_on_close(partial(print_values_alone, False))
    elif asked and _kept is None:
        with suppress(OSError, ValueError):  # of a stream without a descriptor, or a stderr that is closed
            if _results is not None and _results.fileno() == 1:
                _results.flush()
                os.fstat(2)
                _kept = os.dup(1)
                os.dup2(2, 1)


def values_alone() -> bool:
    """Return whether values are printed in place of text."""
    return _as_values


def _stream(err: bool = False) -> IO[str] | None:
    return sys.stderr if err else StringIO() if _as_values else _results or sys.stdout


def terminal_width(stream: IO[str] | None) -> int | None:
    """Return the number of columns of the terminal that a stream writes to, None if it is not a terminal."""
    if stream is None or stream.closed or not stream.isatty():
        return None
    asked = os.environ.get("COLUMNS", "")
    if asked.isdecimal() and int(asked) > 0:
        return int(asked)
    try:
        return os.get_terminal_size(stream.fileno()).columns or _DEFAULT_WIDTH
    except (OSError, ValueError):
        return _DEFAULT_WIDTH


def can_redraw(stream: IO[str] | None) -> bool:
    """Return whether the stream is a terminal that understands control sequences."""
    return terminal_width(stream) is not None and os.environ.get("TERM") != "dumb"


def writes_unicode(stream: IO[str] | None = None) -> bool:
    """Return whether the encoding of the stream, by default that of the results, has every character."""
    return (getattr(stream or _results or sys.stdout, "encoding", None) or "ascii").lower().startswith("utf")


def block(stream: IO[str] | None) -> str:
    """Return the character of which bars are made on this stream."""
    return "█" if writes_unicode(stream) else "#"


def has_colour(stream: IO[str] | None) -> bool:
    """Return whether text on this stream is coloured."""
    return can_redraw(stream) and not os.environ.get("NO_COLOR")


def echo(text: str = "", style: Style | None = None, *, indent: int = 0, err: bool = False) -> None:
    """Print lines of text; each is wrapped to the terminal, with `indent` more spaces from its second line on.

    A line that already begins with spaces keeps them on all its lines. Words are never broken, so that paths and
    commands can be copied.
    """
    stream = _stream(err)
    width = terminal_width(stream)
    lines = _lines(text)
    if width is not None:
        lines = [part for line in lines for part in _wrapped(line, width, indent)]
    _write(lines, style, err)


def echo_entry(
    label: str, text: str, style: Style | None = None, *, width: int = LABEL_WIDTH, err: bool = False
) -> None:
    """Print a label and its text, as in `outcome     steady`; lines that follow stand below the text."""
    stream = _stream(err)
    columns = terminal_width(stream)
    label = in_one_line(label)
    head = f"{label:<{width}}" if len(label) < width else f"{label} "
    lines = printable(text).split("\n")
    if columns is not None:
        room = max(columns - len(head), 20)
        lines = [part for line in lines for part in _wrapped(line, room, 0)]
    if style is not None and has_colour(stream):
        lines = [_coloured(line, style) for line in lines]
    _write([head + lines[0], *(" " * len(head) + line for line in lines[1:])], None, err)


def echo_entries(label: str, texts: Iterable[str], style: Style | None = None) -> None:
    """Print an entry with the same label for each text."""
    for text in texts:
        echo_entry(label, text, style)


def echo_as_it_is(text: str, *, err: bool = False, end: str = "\n") -> None:
    """Print text that is neither wrapped nor coloured, such as a path, a command or a file that the output is."""
    click.echo(printable(text) + end, _stream(err), nl=False)


def echo_text_of_values(text: str) -> None:
    """Print what values are written as, also where `print_values_alone` keeps all other text from stdout."""
    if _kept is None:
        click.echo(printable(text), _results or sys.stdout)
        return
    os.dup2(_kept, 1)
    try:
        click.echo(printable(text), _results)  # which flushes it
    finally:
        os.dup2(2, 1)


def echo_in_place(line: str) -> None:
    """Replace the current line of stderr, a terminal that `can_redraw`, by this one."""
    click.echo(f"\r\033[K{in_one_line(line)}", err=True, nl=False)


def talk(text: str) -> None:
    """Print a message about the work, which is not a result, on stderr."""
    echo(text, indent=2, err=True)


def warn(text: str) -> None:
    """Print a warning about the work on stderr."""
    echo(f"warning: {text}", Style.CAUTION, indent=2, err=True)


def echo_table(
    header: Sequence[str], rows: Sequence[Sequence[str]], styles: Mapping[str, StyleOf] | None = None
) -> None:
    """Print rows of text in columns; `styles` has the style of the cells of a column, by its header.

    On a terminal that is too narrow, long texts are wrapped within their columns. If there is no room for this, the
    text of a long last column stands below its row, or shorter texts are wrapped too; else every row becomes a block
    with one line for each column.
    """
    if not rows:
        return
    header, *rows = [[in_one_line(cell) for cell in row] for row in (header, *rows)]
    columns = terminal_width(_stream())
    natural = [max(map(_shown_width, cells)) for cells in zip(header, *rows, strict=True)]
    right = [_all_numbers(cells) for cells in zip(*rows, strict=True)]
    of_column: list[StyleOf] = [(styles or {}).get(name, lambda _: None) for name in header]

    def printed(row: Sequence[str], widths: Sequence[int]) -> None:
        looks = [
            Style.HEADING if row is header else style(cell)
            for style, cell in zip(of_column, row, strict=True)
        ]
        _write(_row_lines(row, widths, right, looks), None, err=False)

    room = 0 if columns is None else columns - _GAP * (len(header) - 1)
    widths = natural if columns is None else _fitted(header, rows, natural, room, _SHORT)
    last_below = sum(natural[:-1]) - _GAP <= room and natural[-1] > _SHORT
    if widths is None and not last_below:
        widths = _fitted(header, rows, natural, room, _SHORT // 3)
    if widths is not None:
        for row in (header, *rows):
            printed(row, widths)
    elif last_below:
        *_, last = of_column
        for row in (header, *rows):
            printed(row, natural[:-1])
            if row is not header and row[-1]:
                echo(f"    {row[-1]}", last(row[-1]))
    else:
        wide = max(map(len, header)) + 2 + _GAP
        for row in rows:
            echo(row[0] or "-", Style.HEADING)
            for name, cell, style in list(zip(header, row, of_column, strict=True))[1:]:
                if cell:
                    echo_entry(f"  {name}", cell, style(cell), width=wide)


def echo_rows(
    items: Iterable[ItemT],
    columns: Mapping[str, Callable[[ItemT], str]],
    styles: Mapping[str, StyleOf] | None = None,
) -> None:
    """Print a table with one row for each item; `columns` tells the text below each header."""
    echo_table(tuple(columns), [[text(item) for text in columns.values()] for item in items], styles)


def _lines(text: str) -> list[str]:
    """Return the lines of one text: those after the first are indented deeper, so that none looks like another text."""
    lines = printable(text).split("\n")
    begin = next((k for k, line in enumerate(lines) if line.strip()), 0)
    margin = len(lines[begin]) - len(lines[begin].lstrip(" ")) + 1
    return lines[: begin + 1] + [
        " " * (margin + 1) + line.lstrip(" ") if line and not line.startswith(" " * margin) else line
        for line in lines[begin + 1 :]
    ]


def _wrapped(line: str, width: int, indent: int) -> list[str]:
    margin = " " * (len(line) - len(line.lstrip(" ")))
    if len(line) <= width:
        return [line]
    return textwrap.wrap(
        line.lstrip(" "),
        max(width, 20),
        initial_indent=margin,
        subsequent_indent=margin + " " * indent,
        break_long_words=False,
        break_on_hyphens=False,
    ) or [""]


def _coloured(text: str, style: Style) -> str:
    return click.style(text, fg=style.value or None, bold=style.bold or None)


def _write(lines: Sequence[str], style: Style | None, err: bool) -> None:
    coloured = has_colour(_stream(err))
    for line in lines:
        click.echo(
            _coloured(line, style) if style is not None and coloured and line else line,
            _stream(err),
            color=coloured,
        )


def _all_numbers(cells: Sequence[str]) -> bool:
    """Whether the cells of a column are quantities, with decimals or a unit; whole numbers may be names, as serials."""
    full = [cell for cell in cells if cell not in ("", "-")]
    return all(_NUMBER.fullmatch(cell) for cell in full) and not all(cell.isdigit() for cell in full)


def _fitted(
    header: Sequence[str], rows: Sequence[Sequence[str]], natural: Sequence[int], room: int, short: int
) -> list[int] | None:
    """Return the widths of the columns within `room`; None if a word, or a cell of up to `short`, has no room."""
    least = []
    for k, width in enumerate(natural):
        words = [len(word) for row in (header, *rows) for word in row[k].split()]
        least.append(min(width, max(short, *words, 0)))
    spare = room - sum(least)
    if spare < 0:
        return None
    # Short columns become as wide as they want first, so that the longest texts are wrapped.
    order = sorted(range(len(least)), key=lambda k: natural[k] - least[k])
    for done, k in enumerate(order):
        more = min(natural[k] - least[k], spare // (len(order) - done))
        least[k] += more
        spare -= more
    return least


def _row_lines(
    row: Sequence[str], widths: Sequence[int], right: Sequence[bool], looks: Sequence[Style | None]
) -> list[str]:
    """Return the lines of a row, each cell wrapped to the width of its column; there may be fewer widths than cells."""
    columns = []
    coloured = has_colour(_stream())
    for cell, width, at_right, look in zip(row, widths, right, looks, strict=False):
        shown = _shown_width(cell)
        parts = [cell]
        if shown > width:
            parts = textwrap.wrap(cell, max(width * len(cell) // shown, 1), break_on_hyphens=False)
        lines = []
        for part in parts:
            blank = " " * (width - _shown_width(part))
            text = _coloured(part, look) if look and coloured and part else part
            lines.append(blank + text if at_right else text + blank)
        columns.append(lines)
    blanks = [" " * width for width in widths]
    height = max(map(len, columns))
    full = [parts + [blank] * (height - len(parts)) for parts, blank in zip(columns, blanks, strict=True)]
    return [(" " * _GAP).join(line).rstrip() for line in zip(*full, strict=True)]


def _shown_width(text: str) -> int:
    """Return how many columns of a terminal a text takes: two for a wide character, none for a combining one."""
    return sum(0 if combining(c) else 2 if east_asian_width(c) in "WF" else 1 for c in text)


class Subcommands(click.Group):
    """A group whose help has the whole first sentence of each subcommand; click cuts it to one line."""

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of subcommands for the help."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, self.commands[name].get_short_help_str(10_000)) for name in self.list_commands(ctx)]
            )


def prediction_style(label: str) -> Style:
    """Return the style of a predicted label."""
    return Style.CAUTION if label == "unknown" else Style.RESULT


def state_style(state: str) -> Style:
    """Return the style of a state: of a plugin, a device, a check, a finding or a grasp, or of an answer, yes or no."""
    return Style.GOOD if state in _GOOD else Style.BAD if state in _BAD else Style.CAUTION
