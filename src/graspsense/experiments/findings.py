"""The findings of an experiment beyond its rates: an answer, tables and pictures."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Final

from attrs import field, frozen

from graspsense.evaluation.intervals import percent
from graspsense.experiments.summary import ConditionResult
from graspsense.recording.provenance import commit_text
from graspsense.report.found_table import FoundTable, markdown_cell
from graspsense.report.html import Section, bullets

MARKDOWN: Final = "report.md"
CONTROLS: Final[Mapping[str, str]] = {
    "majority_class": "most frequent label",
    "shuffled_labels": "shuffled labels",
    "before_contact": "before contact",
    "width_only": "width alone",
    "instance_held_out": "new bottles",
}
"""The controls in a table of rates, each with the title of its column."""


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
            lines += ["## Notes", "", *(f"- {markdown_cell(note)}" for note in self.notes), ""]
        return "\n".join(lines)
