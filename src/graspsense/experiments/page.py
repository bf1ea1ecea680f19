"""The page of an experiment: the question, the answer, and the evidence for it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Final

from graspsense.core.components.setting import worded
from graspsense.core.files.whole_file import write_or_replace
from graspsense.core.values.errors import FAILURES, ComponentFailed, GraspsenseError, counted, named, place_of
from graspsense.experiments.answer import answer, headline
from graspsense.experiments.cases import in_a_name
from graspsense.experiments.findings import MARKDOWN, Findings
from graspsense.experiments.kinds import kind_of
from graspsense.experiments.results import EXPERIMENT, Results
from graspsense.experiments.summary import ConditionResult, Summary
from graspsense.experiments.task_results import RecognitionResult
from graspsense.recording.provenance import commit_text
from graspsense.report.evaluation_sections import confusion_section, controls_section, tree_section
from graspsense.report.html import Page, Section, bullets, code, facts, folded, pair, paragraph, table
from graspsense.report.rates import RateRow, rates_over, rates_picture, rates_table
from graspsense.report.traces import features_by_class, features_table, one_grasp, traces_by_class
from graspsense.report.wording import TARGETS, about_grasps, control_words, protocol_words
from graspsense.report.write import write_html

NAME: Final = "report.html"
MATRICES: Final = 6
"""Confusion matrices on the page; those of further cases are in the results."""
SIMULATED: Final = (
    "all figures of graspsense are simulated, with models of gripper and objects; none was measured "
    "on real objects"
)
ROWS: Final = 40
"""Largest number of cases in one picture."""


def write_page(summary: Summary, results: Results) -> Path:
    """Write `report.html` beside the results and return its path. Raises SaveFailed."""
    path = results.folder / NAME
    write_html(path, experiment_page(summary, results))
    findings = findings_of(summary)
    if findings is not None:
        text = findings.markdown(summary.planned.experiment.title, results.provenance(), summary.cpu_seconds)
        write_or_replace(results.folder / MARKDOWN, text.encode())
    return path


def findings_of(summary: Summary) -> Findings | None:
    """Return the findings beyond rates, None for a kind of experiment without any. Raises ComponentFailed."""
    kind = kind_of(summary.planned.experiment.kind)
    report_with = kind.findings()
    if report_with is None:
        return None
    code = f"{kind.declared.entry.findings}, which reports the kind {kind.declared.qualified},"
    kept = "correct it; the results are kept, and `graspsense report DIR` writes the page again"
    try:
        findings = report_with(summary)
    except GraspsenseError:
        raise
    except FAILURES as error:
        raise ComponentFailed(f"{code} raised {named(error)}{place_of(error)}: {kept}") from error
    if not isinstance(findings, Findings):
        raise ComponentFailed(f"{code} returned {type(findings).__name__} in place of Findings: {kept}")
    return findings


def experiment_page(summary: Summary, results: Results) -> Page:
    """Return the page."""
    experiment = summary.planned.experiment
    findings = findings_of(summary)
    beside = bullets([*summary.left_out, *summary.doubts], "warning") + bullets([SIMULATED], "notes")
    if findings is None:
        best = max(summary.of_first_target, key=lambda condition: condition.rate.mean, default=None)
        sections, beside = [], bullets(summary.left_out, "warning")
        if best is not None:
            sections = [_rates(summary), *_evaluation_sections(summary, best)]
            sections += measurement_sections(summary, best)
            beside = _beside(summary, best)
        findings = Findings(answer=answer(summary), headline=headline(summary), sections=tuple(sections))
    return Page(
        kind="Experiment",
        title=experiment.title,
        question=experiment.question,
        answer=findings.answer,
        headline=findings.headline,
        beside=beside,
        sections=(*findings.page_sections(), _made_of(summary, results)),
    )


def rate_row(condition: ConditionResult, *, strong: bool = False) -> RateRow:
    """Return a condition as a row of a picture."""
    return RateRow(
        name=condition.name,
        rate=condition.rate.mean,
        interval=condition.rate.interval,
        what=f"{TARGETS[condition.recognised]}, {control_words(condition.protocol, '')[0]}",
        strong=strong,
    )


def _beside(summary: Summary, best: ConditionResult) -> str:
    """Return what must be read with the answer: how it was measured, and what casts doubt on it."""
    result = summary.recognition(best.case.name, best.first_seed)
    seeds = len(best.by_seed)
    features = [name for name, _ in result.trials.features] if result and result.trials else []
    origin = "simulated" if best.simulated else "recorded"
    if best.simulated and seeds > 1:
        origin += f" anew for each of {seeds} seeds"
    guess = best.majority
    answers = len(best.of_first_seed.confusion.labels)
    about = about_grasps(features, best.recognised, answers, None if guess is None else guess.mean)
    text = (
        f"{about} Each case has {counted(best.rate.n, 'grasp')}, {origin}. "
        f"Every grasp is classified by {protocol_words(best.protocol)}. A 95 % interval contains the true mean in "
        "95 of 100 such experiments."
    )
    warnings = list(dict.fromkeys(best.of_first_seed.warnings))
    notes = [SIMULATED] if best.simulated else []
    doubts = [*summary.left_out, *summary.doubts, *warnings]
    return paragraph(text) + bullets(doubts, "warning") + bullets(notes, "notes")


def _rates(summary: Summary) -> Section:
    body = []
    for target in dict.fromkeys(condition.target for condition in summary.conditions):
        conditions = [condition for condition in summary.conditions if condition.target == target]
        best = max(conditions, key=lambda condition: condition.rate.mean)
        rows = [
            rate_row(condition, strong=condition is best and len(conditions) > 1) for condition in conditions
        ]
        title = f"How often {TARGETS[best.recognised]} is recognised"
        body.append(f"<h3>{escape(title)}</h3>")
        picture = _picture(conditions, rows, f"{title}. Bars are 95 % intervals.")
        body.append(pair(picture, rates_table("Case by case", rows)))
    return Section(id="rates", title="Recognition rates", body="".join(body))


def _picture(conditions: Sequence[ConditionResult], rows: Sequence[RateRow], caption: str) -> str:
    """Return the rates against the number that was swept, or else one row per condition."""
    key = _swept_number(conditions)
    if key is None:
        cut = "" if len(rows) <= ROWS else f" The first {ROWS} of {len(rows)}; the table has all of them."
        return rates_picture(rows[:ROWS], caption + cut)
    series: dict[str, list[tuple[float, RateRow]]] = {}
    for condition, row in zip(conditions, rows, strict=True):
        others = [in_a_name(name, value) for name, value in condition.case.levels.items() if name != key]
        series.setdefault(", ".join([*others, condition.classifier]), []).append(
            (float(condition.case.levels[key]), row)
        )
    guess = conditions[0].majority
    what, in_unit = worded(key.rpartition(".")[2], 1.0)
    factor, _, unit = in_unit.partition(" ")
    series = {name: [(x * float(factor), row) for x, row in points] for name, points in series.items()}
    axis = f"{what}, {unit}" if unit else what
    return rates_over(series, axis, caption, None if guess is None else guess.mean)


def _swept_number(conditions: Sequence[ConditionResult]) -> str | None:
    """Return the swept key with the most different numbers, None if no key has more than one."""
    numbers: dict[str, set[float]] = {}
    for condition in conditions:
        for key, value in condition.case.levels.items():
            if isinstance(value, int | float) and not isinstance(value, bool):
                numbers.setdefault(key, set()).add(float(value))
    most = max(numbers, key=lambda key: len(numbers[key]), default=None)
    everywhere = most is not None and all(most in condition.case.levels for condition in conditions)
    return most if everywhere and most is not None and len(numbers[most]) > 1 else None


def _evaluation_sections(summary: Summary, best: ConditionResult) -> list[Section]:
    """Return the controls of the best condition, confusion matrices, and a tree if there is one."""
    sections = []
    if best.controls:
        rows, missing = _control_rows(best)
        sections.append(controls_section([rate_row(best, strong=True), *rows], missing, best.name))
    conditions = [condition for condition in summary.conditions if condition.target == best.target]
    conditions = sorted(conditions, key=lambda condition: -condition.rate.mean)
    chosen = conditions if len(conditions) <= MATRICES else [*conditions[: MATRICES - 1], conditions[-1]]
    headline, *others = [
        (
            f"{condition.name}: {condition.confusion.n} predictions of {counted(len(condition.by_seed), 'seed')}, "
            f"{100 * condition.rate.mean:.1f} % correct",
            condition.confusion,
        )
        for condition in chosen
    ]
    sections.append(confusion_section(headline, others))
    tree = next((result.tree for result in best.by_seed.values() if result.tree), None)
    if tree:
        sections.append(tree_section(tree, f"{best.classifier} grows on all grasps of the first seed"))
    return sections


def _control_rows(best: ConditionResult) -> tuple[list[RateRow], list[str]]:
    """Return a row for each control that was measured, and a sentence for each that was not."""
    rows, missing = [], []
    for name, control in best.controls.items():
        if name == best.protocol:
            continue
        title, purpose = control_words(name, control.what)
        if control.rate is None:
            missing.append(f"{title}: not measured ({control.reason})")
        else:
            interval = control.rate.interval
            rows.append(RateRow(name=title, rate=control.rate.mean, interval=interval, what=purpose))
    return rows, missing


def measurement_sections(summary: Summary, best: ConditionResult) -> list[Section]:
    """Return the grasps and features of the first seed that has a result."""
    seed = best.first_seed
    result = summary.recognition(best.case.name, seed)
    if result is None:
        return []
    where = f" Case: {best.case.name}." if best.case.name else ""
    sections = []
    if result.grasps:
        chosen = result.grasps[0]
        caption = (
            f"{chosen.label}, seed {seed}.{where} The fingers close until both touch, squeeze with a set force, and "
            "hold until nothing moves."
        )
        body = one_grasp(chosen, caption)
        if result.trials is not None and chosen.trial < len(result.trials.values):
            values = result.trials.values[chosen.trial]
            body = pair(body, features_table("Features of this grasp", result.trials.features, values))
        sections.append(Section(id="grasp", title="One grasp, from the approach to rest", body=body))
        text = f"Some grasps of each label from seed {seed}, drawn over each other.{where}"
        body = paragraph(text) + traces_by_class(result.grasps)
        sections.append(Section(id="traces", title="Force and gap over time", body=body))
    if result.trials is not None:
        text = (
            f"Each dot is one grasp of seed {seed}. The bar spans the first to the third quartile, with the median "
            f"across it.{where} Labels that lie apart here can be distinguished."
        )
        trials = result.trials
        body = paragraph(text) + features_by_class(trials.features, trials.labels, trials.values)
        sections.append(Section(id="features", title="Features", body=body))
    return sections


def _made_of(summary: Summary, results: Results) -> Section:
    made = results.provenance()
    experiment = summary.planned.experiment
    result = next(iter(summary.results.values()), None)
    notes: list[str] = []
    if isinstance(result, RecognitionResult):
        of_classifiers = (note for classifier in result.classifiers for note in classifier.notes)
        notes = list(dict.fromkeys((*result.notes, *of_classifiers)))
    pairs = [
        ("experiment", f"{summary.planned.name} ({experiment.kind})"),
        ("command", str(made.get("command", ""))),
        ("begun", str(made.get("begun_at", ""))),
        ("trials", "none yet" if result is None else result.source),
        (
            "cases, seeds",
            f"{counted(len(summary.planned.cases), 'case')}, seeds {_ranges(summary.planned.seeds)}",
        ),
        ("computing time", f"{summary.seconds:.0f} s, all tasks together"),
        ("machine", f"{made.get('host', '?')}, {made.get('system', '?')}"),
        ("code", f"graspsense {made.get('graspsense', '?')}, commit {commit_text(made)}"),
        *(
            (f"hash of {name}", value)
            for name, value in (made.get("inputs") or {}).items()
            if name != "graspsense"  # its version
        ),
    ]
    versions = sorted((str(k), str(v)) for k, v in (made.get("versions") or {}).items())
    try:
        text = (results.folder / EXPERIMENT).read_text(encoding="utf-8")
    except OSError:
        text = ""
    settings = summary.planned.cases[0].params["settings"] if summary.planned.cases else {}
    body = (
        facts(pairs)
        + bullets(notes)
        + folded("Versions", facts(versions))
        + folded("The experiment with all its settings", code(text, "experiment file"))
        + folded("Settings of the first case", code(json.dumps(settings, indent=1), "settings"))
        + paragraph(
            "The method follows S. Chitta, M. Piccoli and J. Sturm, Tactile Object Class and Internal State "
            "Recognition for Mobile Manipulation, ICRA 2010. Intervals over seeds are Student's; those of one run "
            "are Wilson's, widened for trials of the same object (docs/evaluation.md)."
        )
    )
    if summary.failed:
        rows = [(failure.name, failure.reason) for failure in summary.failed]
        body += table("Tasks that failed", ("task", "reason"), rows)
    return Section(id="made", title="Provenance", body=body)


def _ranges(seeds: Sequence[int]) -> str:
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[0] + len(seeds))):
        return f"{seeds[0]} to {seeds[-1]}"
    return ", ".join(map(str, seeds))
