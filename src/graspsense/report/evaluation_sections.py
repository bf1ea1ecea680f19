"""Sections of a page about an evaluation: controls, confusion matrices, prediction sets, the decision tree."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from graspsense.core.values.label_text import natural_order
from graspsense.core.values.reasons import TreeNode
from graspsense.evaluation.doubt import Reliability, SetCoverage
from graspsense.evaluation.intervals import percent
from graspsense.evaluation.results import Confusion
from graspsense.report.confusion import confusion_table
from graspsense.report.html import Section, bullets, figure, folded, pair, paragraph, wide
from graspsense.report.rates import RateRow, rate_row, rates_list, rates_picture, rates_table
from graspsense.report.svg import INKS, QUIET, AxisScale, Picture


def controls_section(rows: Sequence[RateRow], missing: Sequence[str], subject: str) -> Section:
    """Return the section with a rate, the first of `rows`, and its controls; `missing` lists those not measured."""
    text = (
        "A rate may come from the recording rather than from the objects, for example if classes were recorded on "
        f"different days. The controls measure this. The figures are those of {subject}."
    )
    picture = rates_picture(rows, "The rate and its controls. Bars are 95 % intervals.")
    return Section(
        id="controls",
        title="Controls",
        body=paragraph(text) + pair(picture, rates_list(rows)) + bullets(missing),
    )


def confusion_section(
    headline: tuple[str, Confusion], others: Sequence[tuple[str, Confusion]] = ()
) -> Section:
    """Return the section with the most important confusion matrix, and folded ones with the others."""
    body = confusion_table(headline[1], f"{headline[0]}.")
    body += "".join(folded(name, confusion_table(matrix, f"{name}.")) for name, matrix in others)
    return Section(id="confusion", title="Confusion matrix", body=body)


def doubt_section(sets: SetCoverage, reliability: Reliability) -> Section:
    """Return the section with the coverage of the prediction sets and the reliability of the probabilities."""
    text = (
        f"A prediction set has the labels that cannot be ruled out. It should contain the true label of "
        f"{100 * sets.asked:.0f} % of new {'objects' if sets.unit == 'instances' else 'grasps of the same objects'}."
    )
    rows = []
    if sets.covered is None or sets.mean_size is None or sets.single is None:
        text += f" Not measured here: {sets.reason}."
    else:
        rows = [rate_row("all labels", sets.covered, strong=True)]
        if (below := sets.covered_below) is not None:
            rows.append(
                rate_row(f"labels recognised in less than {100 * sets.asked:.0f} %", below, strong=True)
            )
        rows += [rate_row(name, sets.by_label[name]) for name in natural_order(sets.by_label)]
        text += (
            f" In held-out grasps the sets contain it in {sets.covered.words}. They have {sets.mean_size:.2f} "
            f"labels on average; {percent(sets.single.rate)} have a single one. The prediction is always a "
            "member, so a label is covered at least as often as it is recognised."
        )
    raw = reliability.uncalibrated_error
    raw_words = "" if raw is None else f", and {percent(raw)} before calibration"
    probabilities = (
        f"Where the probabilities are right, predictions of 80 % are correct in 80 of 100 grasps. The Brier score is "
        f"{reliability.brier:.3f} (0 is perfect, 2 the worst); the expected calibration error is "
        f"{percent(reliability.calibration_error)}{raw_words}."
    )
    covered = rates_table("Sets that contain the true label", rows, "contain it") if rows else ""
    return Section(
        id="doubt",
        title="Prediction sets and probabilities",
        body=paragraph(text) + covered + paragraph(probabilities) + _reliability_curve(reliability),
    )


def _reliability_curve(reliability: Reliability) -> str:
    """Return the rate over the probability of the predicted label, beside the line on which they are equal."""
    picture = Picture(330)
    x, y = AxisScale(0.0, 100.0, 44.0, picture.width - 16), AxisScale(0.0, 100.0, 280.0, 24.0)
    with picture.axes(x, y, "probability of the predicted label, in %", "recognised, in %"):
        picture.line([(x(0.0), y(0.0)), (x(100.0), y(100.0))], QUIET)
        for point in reliability.curve:
            place = x(100 * point.probability)
            if point.rate.interval is not None:
                low, high = point.rate.interval
                picture.line([(place, y(100 * low)), (place, y(100 * high))], INKS[0])
            words = f"{percent(point.probability)}: {point.rate.words}"
            picture.mark(place, y(100 * point.rate.rate), INKS[0], words=words)
    caption = "Recognition rate over probability, in ten bins. Bars are 95 % intervals; the line is perfect agreement."
    return figure(picture.svg(caption), caption)


def tree_section(nodes: Sequence[TreeNode], what: str) -> Section:
    """Return the section with a decision tree; `what` completes the sentence 'The tree that ...'."""
    text = (
        f"The tree that {what}. Read it from the top: each line is a condition on a feature, and an arrow leads to "
        "the predicted label."
    )
    return Section(id="tree", title="Decision tree", body=paragraph(text) + tree_list(nodes))


MOST: Final = 400
"""Largest number of nodes that are shown; the page says so if a tree has more."""


def tree_list(nodes: Sequence[TreeNode]) -> str:
    """Return the tree, from the root on."""
    children: dict[int | None, list[int]] = {}
    for k, node in enumerate(nodes[:MOST]):
        children.setdefault(node.parent, []).append(k)

    def item(k: int) -> str:
        node = nodes[k]
        below = children.get(k, [])
        branch = f"{escape(node.branch)} " if node.branch else ""
        if not below:
            wrong = f", {node.wrong:.3g} of them wrong" if node.wrong else ""
            return (
                f'<li>{branch}→ <span class="leaf">{escape(node.label)}</span> '
                f'<span class="count">({node.trials:.4g} trials{wrong})</span></li>'
            )
        inner = "".join(map(item, below))
        return f"<li>{branch or 'all trials '}<ul>{inner}</ul></li>"

    cut = f"<p>Only the first {MOST} of {len(nodes)} nodes are shown.</p>" if len(nodes) > MOST else ""
    return wide("Decision tree", f'<ul class="tree">{"".join(map(item, children.get(None, [])))}</ul>') + cut
