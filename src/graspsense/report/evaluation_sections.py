"""Sections of a page about an evaluation: controls, confusion matrices, the decision tree."""

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
    """Return the section with a rate, the first of `rows`, and its controls; `missing` lists those not measured."""
    text = (
        "A rate may come from the recording rather than from the objects, for example if classes were recorded on "
        f"different days. The controls measure this. The figures are those of {of}."
    )
    picture = rates_picture(rows, "The rate and its controls. Bars are 95 % intervals.")
    return Section(
        id="controls",
        title="Controls",
        body=paragraph(text) + pair(picture, rates_list(rows)) + bullets(missing),
    )


def confusion_section(first: tuple[str, Confusion], others: Sequence[tuple[str, Confusion]] = ()) -> Section:
    """Return the section with the most important confusion matrix, and folded ones with the others."""
    body = confusion_table(first[1], f"{first[0]}.")
    body += "".join(folded(name, confusion_table(matrix, f"{name}.")) for name, matrix in others)
    return Section(id="confusion", title="Confusion matrix", body=body)


def tree_section(nodes: Sequence[TreeNode], of: str) -> Section:
    """Return the section with a decision tree; `of` completes the sentence 'The tree that ...'."""
    text = (
        f"The tree that {of}. Read it from the top: each line is a condition on a feature, and an arrow leads to the "
        "predicted label."
    )
    return Section(id="tree", title="Decision tree", body=paragraph(text) + tree_list(nodes))


def code(label: str, text: str) -> str:
    """Return preformatted text in a scrollable box."""
    return f'<pre tabindex="0" role="region" aria-label="{escape(label)}">{escape(text)}</pre>'
