"""The page of a comparison of experiments."""

from __future__ import annotations

from html import escape

from graspsense.experiments.answer import answer
from graspsense.experiments.comparison import ExperimentComparison, condition_name
from graspsense.experiments.page import SIMULATED
from graspsense.experiments.summary import unreadable_lines
from graspsense.report.html import Page, Section, bullets, facts, pair, paragraph, table
from graspsense.report.rates import RateRow, rates_picture
from graspsense.report.wording import TARGETS, protocol_words

RATE_HEADER = ("experiment", "case", "recognises", "recognised", "95 % interval", "trials", "seeds")
DIFFERENCE_HEADER = ("experiment", "case", "recognises", "points", "95 % interval", "result", "interval is")


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
        headline=comparison.headline,
        beside=paragraph(text)
        + bullets(failure_lines(comparison), "warning")
        + bullets([SIMULATED] if simulated else [], "notes"),
        sections=(_settings(comparison), _rates(comparison), _differences(comparison), _made_of(comparison)),
    )


def failure_lines(comparison: ExperimentComparison) -> list[str]:
    """Return a sentence for each experiment of which tasks failed or are missing."""
    failed = [
        f"{experiment.name}: {len(experiment.summary.failed)} tasks failed and "
        f"{experiment.summary.missing} have no result; they are not included"
        for experiment in comparison.experiments
        if experiment.summary.failed or experiment.summary.missing
    ]
    return failed + [
        f"{experiment.name}: {line}"
        for experiment in comparison.experiments
        for line in unreadable_lines(experiment.summary)
    ]


def settings_rows(comparison: ExperimentComparison) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return header and rows of the settings that differ."""
    header = ("setting", *(experiment.name for experiment in comparison.experiments), "meaning")
    return header, [(setting.key, *setting.values, setting.meaning) for setting in comparison.settings]


def rate_rows(comparison: ExperimentComparison) -> list[tuple[str, ...]]:
    """Return the rates of all conditions, for `RATE_HEADER`."""
    rows: list[tuple[str, ...]] = []
    for experiment in comparison.experiments:
        for condition in experiment.summary.conditions:
            row = RateRow(name="", rate=condition.rate.mean, interval=condition.rate.interval)
            rows.append(
                (
                    experiment.name,
                    condition_name(condition),
                    TARGETS[condition.recognised],
                    f"{100 * condition.rate.mean:.1f} %",
                    row.interval_text,
                    str(condition.rate.n),
                    str(len(condition.by_seed)),
                )
            )
    return rows


def difference_rows(comparison: ExperimentComparison) -> list[tuple[str, ...]]:
    """Return the differences from the first experiment, for `DIFFERENCE_HEADER`."""
    rows: list[tuple[str, ...]] = []
    for difference in comparison.differences:
        interval = difference.difference.interval
        case = condition_name(difference.other)
        if difference.other.name != difference.base.name:
            case = f"{case} (here) and {condition_name(difference.base)} (first)"
        rows.append(
            (
                difference.other_name,
                case,
                TARGETS[difference.other.recognised],
                f"{100 * difference.difference.value:+.1f}",
                "none" if interval is None else f"{100 * interval[0]:+.1f} to {100 * interval[1]:+.1f}",
                difference.verdict,
                difference.how,
            )
        )
    return rows


def _settings(comparison: ExperimentComparison) -> Section:
    header, rows = settings_rows(comparison)
    body = paragraph(
        "Only the settings that differ. Several values are those of the cases of an experiment."
        if rows
        else "No setting differs."
    )
    if rows:
        body += table("Settings that differ", header, rows)
    return Section(id="settings", title="What differs", body=body)


def _rates(comparison: ExperimentComparison) -> Section:
    body = []
    conditions = [(e, condition) for e in comparison.experiments for condition in e.summary.conditions]
    for target in dict.fromkeys(condition.target for _, condition in conditions):
        recognising = [(e, condition) for e, condition in conditions if condition.target == target]
        best = max((condition for _, condition in recognising), key=lambda condition: condition.rate.mean)
        rows = [
            RateRow(
                name=f"{e.name}: {condition_name(condition)}",
                rate=condition.rate.mean,
                interval=condition.rate.interval,
                strong=condition is best,
            )
            for e, condition in recognising
        ]
        title = f"How often {TARGETS[best.recognised]} is recognised"
        protocols = dict.fromkeys(protocol_words(condition.protocol) for _, condition in recognising)
        notes = "".join(paragraph(f"Every grasp is classified by {words}.") for words in protocols)
        picture = rates_picture(rows, f"{title}. Bars are 95 % intervals.")
        body.append(f"<h3>{escape(title)}</h3>{pair(picture, notes)}")
    rates = table("Rates of all experiments", RATE_HEADER, rate_rows(comparison), 3)
    return Section(id="rates", title="Recognition rates", body="".join(body) + rates)


def _differences(comparison: ExperimentComparison) -> Section:
    reference = comparison.experiments[0].name
    rows = difference_rows(comparison)
    body = (
        table(f"Rate minus that of {reference}, in percentage points", DIFFERENCE_HEADER, rows, verdicts=(5,))
        if rows
        else paragraph(f"No other experiment recognises what {reference} does.")
    )
    return Section(id="differences", title=f"Differences from {reference}", body=body)


def _made_of(comparison: ExperimentComparison) -> Section:
    body = []
    for experiment in comparison.experiments:
        made, planned = experiment.results.provenance(), experiment.summary.planned
        pairs = [
            ("experiment", f"{planned.experiment.title} ({planned.name})"),
            ("folder", str(experiment.results.folder)),
            ("answer", answer(experiment.summary)),
            ("command", str(made.get("command", ""))),
            ("begun", str(made.get("begun_at", ""))),
        ]
        body.append(f"<h3>{escape(experiment.name)}</h3>{facts(pairs)}")
    return Section(id="made", title="Provenance", body="".join(body))
