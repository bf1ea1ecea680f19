"""A table of results, described once: for the terminal its header and rows, and its forms on a page and in Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from attrs import frozen

from graspsense.report.html import Section, paragraph, table


@frozen(kw_only=True)
class FoundTable:
    """A table of plain texts; columns from index `numbers` on are numbers."""

    id: str
    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    numbers: int = 99
    verdicts: tuple[int, ...] = ()
    """Columns that say whether something holds."""

    def section(self, drawn: str = "") -> Section:
        """Return the section of the table; `drawn` is the picture above it. Without rows it is the note alone."""
        body = (paragraph(self.note) if self.note else "") + drawn
        if self.rows:
            body += table(self.title, self.header, self.rows, self.numbers, self.verdicts, captioned=False)
        return Section(id=self.id, title=self.title, body=body)

    @property
    def markdown(self) -> list[str]:
        """The table as lines of Markdown."""
        lines = [f"## {self.title}", ""]
        if self.note:
            lines += [self.note, ""]
        return [*lines, *markdown_table(self.header, self.rows), ""]


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table of plain texts as lines of Markdown."""
    lines = [f"| {' | '.join(header)} |", "|---" * len(header) + "|"]
    return [*lines, *(f"| {' | '.join(map(markdown_cell, row))} |" for row in rows)]


def markdown_cell(text: str) -> str:
    """Return a plain text as the cell of a table in Markdown, or as an item of a list."""
    return text.replace("|", "\\|").replace("\n", " ")
