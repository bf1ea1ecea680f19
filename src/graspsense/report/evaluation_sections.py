"""The parts of a page that say how a rate was judged: controls, confusion, the tree."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from graspsense.core.tree import TreeNode
from graspsense.evaluation.confusion import Confusion
from graspsense.report.html import Section, bullets, folded, pair, paragraph
from graspsense.report.matrix import confusion_table
from graspsense.report.rates import RateRow, rates_list, rates_picture
from graspsense.report.tree import tree_list


def controls_section(rows: Sequence[RateRow], missing: Sequence[str], of: str) -> Section:
    """Return the rate, first in `rows`, beside its controls; `missing` says which could not be measured, and why."""
    text = (
        "A rate can belong to the recording rather than to the things: classes recorded on different days, say. So the "
        f"same was measured where it must not work. The figures are those of {of}."
    )
    picture = rates_picture(rows, "The rate, and what it has to be held against. Bars are 95 % intervals.")
    return Section(
        id="controls",
        title="Whether to believe it",
        body=paragraph(text) + pair(picture, rates_list(rows)) + bullets(missing),
    )


def confusion_section(first: tuple[str, Confusion], others: Sequence[tuple[str, Confusion]] = ()) -> Section:
    """Return the confusion matrix that matters most, and others that are shown when they are asked for."""
    body = confusion_table(first[1], f"{first[0]}.")
    body += "".join(folded(name, confusion_table(matrix, f"{name}.")) for name, matrix in others)
    return Section(id="confusion", title="What is taken for what", body=body)


def tree_section(nodes: Sequence[TreeNode], of: str) -> Section:
    """Return a decision tree; `of` says what grew it on what."""
    text = (
        f"The tree that {of}. Read from the top: each line is a question about the grasp, and an arrow leads to the "
        "answer."
    )
    return Section(id="tree", title="How it decides", body=paragraph(text) + tree_list(nodes))


def code(label: str, text: str) -> str:
    """Return text as it stands, which scrolls by itself, also by keyboard."""
    return f'<pre tabindex="0" role="region" aria-label="{escape(label)}">{escape(text)}</pre>'
