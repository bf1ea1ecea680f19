"""The page of a comparison of experiments."""

from __future__ import annotations

from graspsense.evaluation.intervals import span
from graspsense.experiments.comparison import ConditionDifference, ExperimentComparison, condition_name
from graspsense.experiments.page import SIMULATED
from graspsense.report.found_table import FoundTable
from graspsense.report.html import Page, bullets, paragraph
from graspsense.report.wording import TARGETS


def comparison_page(comparison: ExperimentComparison) -> Page:
    """Return the page."""
    reference = comparison.experiments[0].name
    simulated = any(condition.simulated for e in comparison.experiments for condition in e.summary.conditions)
    text = (
        f"Differences are those from {reference}. Where both experiments simulate the same trials with the same seeds, "
        "they are paired by seed; otherwise the interval follows from those of both rates."
    )
    return Page(
        kind="Comparison of experiments",
        title=comparison.names,
        question=" ".join(
            dict.fromkeys(
                experiment.summary.planned.experiment.question for experiment in comparison.experiments
            )
        ).strip(),
        answer=comparison.answer,
        beside=paragraph(text)
        + bullets(doubts(comparison), "warning")
        + bullets([SIMULATED] if simulated else [], "notes"),
        sections=tuple(table.section() for table in comparison_tables(comparison)),
    )


def doubts(comparison: ExperimentComparison) -> list[str]:
    """Return what the results of each experiment lack, and what casts doubt on them, a sentence each."""
    return [
        f"{each.name}: {line}"
        for each in comparison.experiments
        for line in (*each.summary.left_out, *each.summary.doubts)
    ]


def comparison_tables(comparison: ExperimentComparison) -> tuple[FoundTable, FoundTable, FoundTable]:
    """Return the settings that differ, the rates of all conditions, and the differences from the first experiment."""
    reference = comparison.experiments[0].name
    settings = FoundTable(
        id="settings",
        title="What differs",
        header=("setting", *(experiment.name for experiment in comparison.experiments), "meaning"),
        rows=tuple((setting.key, *setting.values, setting.meaning) for setting in comparison.settings),
        note="Settings that differ. Several values are those of the cases of an experiment."
        if comparison.settings
        else "No setting differs.",
    )
    rates = FoundTable(
        id="rates",
        title="Recognition rates",
        header=("experiment", "case", "recognises", "recognised", "95 % interval", "trials", "seeds"),
        rows=tuple(
            (
                experiment.name,
                condition_name(condition),
                TARGETS[condition.recognised],
                f"{100 * condition.rate.mean:.1f} %",
                span(condition.rate.interval),
                str(condition.rate.n),
                str(len(condition.by_seed)),
            )
            for experiment in comparison.experiments
            for condition in experiment.summary.conditions
        ),
        numbers=3,
    )
    differences = FoundTable(
        id="differences",
        title=f"Differences from {reference}",
        header=("experiment", "case", "recognises", "points", "95 % interval", "result", "interval is"),
        rows=tuple(map(_difference_cells, comparison.differences)),
        note=f"Rate minus that of {reference}, in percentage points."
        if comparison.differences
        else f"No other experiment recognises what {reference} does.",
        verdicts=(5,),
    )
    return settings, rates, differences


def _difference_cells(difference: ConditionDifference) -> tuple[str, ...]:
    interval = difference.difference.interval
    case = condition_name(difference.other)
    if difference.other.name != difference.base.name:
        case = f"{case} (here) and {condition_name(difference.base)} (first)"
    return (
        difference.other_name,
        case,
        TARGETS[difference.other.recognised],
        f"{100 * difference.difference.value:+.1f}",
        "none" if interval is None else f"{100 * interval[0]:+.1f} to {100 * interval[1]:+.1f}",
        difference.verdict,
        difference.how,
    )
