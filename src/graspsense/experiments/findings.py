"""The findings of an experiment beyond its rates: an answer, tables and pictures."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, Final

from attrs import field, frozen

from graspsense.evaluation.intervals import percent
from graspsense.experiments.summary import ConditionResult
from graspsense.recording.provenance import commit_text
from graspsense.report.html import Section, bullets, paragraph, table

MARKDOWN: Final = "report.md"
CONTROLS: Final[Mapping[str, str]] = {
    "majority_class": "most frequent label",
    "shuffled_labels": "shuffled labels",
    "before_contact": "before contact",
    "width_only": "width alone",
    "instance_held_out": "new bottles",
}
"""The controls in a table of rates, each with the title of its column."""


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
        """Return the section of the table; `drawn` is the picture above it."""
        body = (paragraph(self.note) if self.note else "") + drawn
        rows = table(self.title, self.header, self.rows, self.numbers, self.verdicts)
        return Section(id=self.id, title=self.title, body=body + rows)

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
    return [*lines, *(f"| {' | '.join(map(_cell, row))} |" for row in rows)]


def control_cells(condition: ConditionResult) -> tuple[str, ...]:
    """Return the rate of each control of a condition, for the columns of `CONTROLS`; empty if it was not measured."""
    controls = [condition.controls.get(name) for name in CONTROLS]
    return tuple(
        "" if control is None or control.rate is None else percent(control.rate.mean) for control in controls
    )


@frozen(kw_only=True)
class Findings:
    """The findings. `drawn` has a picture for the id of a table; `values` go into the JSON output."""

    answer: str
    headline: str = ""
    """The answer as a person would say it, for the head of a page."""
    tables: tuple[FoundTable, ...] = ()
    notes: tuple[str, ...] = ()
    """What a reader must know besides the answer."""
    drawn: Mapping[str, str] = field(factory=dict)
    sections: tuple[Section, ...] = ()
    values: Mapping[str, Any] = field(factory=dict)

    def page_sections(self) -> list[Section]:
        """Return the tables with their pictures, then the notes and the further sections."""
        sections = [table.section(self.drawn.get(table.id, "")) for table in self.tables]
        if self.notes:
            sections.append(Section(id="notes", title="Notes", body=bullets(self.notes)))
        return [*sections, *self.sections]

    def markdown(self, title: str, made: Mapping[str, Any], cpu_seconds: float) -> str:
        """Return the findings as Markdown, with the command, date and machine."""
        lines = [
            f"# {title}",
            "",
            "All grasps are simulated, with models of the gripper and of the objects.",
            f"Made by `{made.get('command', '')}`, begun {made.get('begun_at', '?')}, written "
            f"{time.strftime('%Y-%m-%d', time.gmtime())}, on {made.get('system', '?')}, commit {commit_text(made)}; "
            f"{cpu_seconds:.0f} s of processor time in all tasks together.",
            "",
            self.answer,
            "",
        ]
        for shown in self.tables:
            lines += shown.markdown
        if self.notes:
            lines += ["## Notes", "", *(f"- {_cell(note)}" for note in self.notes), ""]
        return "\n".join(lines)


def code(text: str) -> str:
    """Return preformatted text, for a page."""
    return f'<pre tabindex="0" role="region" aria-label="text">{escape(text)}</pre>'


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
