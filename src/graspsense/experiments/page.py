"""The page of an experiment: question, answer, and everything that the answer rests on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from graspsense.core.model import worded
from graspsense.core.tree import TreeNode
from graspsense.experiments.answer import answer
from graspsense.experiments.findings import MARKDOWN, Findings, write_markdown
from graspsense.experiments.kinds import kind_of
from graspsense.experiments.results import EXPERIMENT, Results
from graspsense.experiments.summary import Arm, Summary
from graspsense.report.evaluation_sections import code, confusion_section, controls_section, tree_section
from graspsense.report.html import Page, Section, bullets, facts, folded, pair, paragraph, table
from graspsense.report.rates import RateRow, rates_over, rates_picture, rates_table
from graspsense.report.traces import features_by_class, one_grasp, traces_by_class
from graspsense.report.wording import TARGETS, control_words, protocol_words
from graspsense.report.write import write_html

NAME: Final = "report.html"
MATRICES: Final = 6
"""Confusion matrices that are shown; those of further cases are in the results."""
SIMULATED: Final = (
    "every figure of ours comes from a model of gripper and objects; none was measured on real things"
)
ROWS: Final = 40
"""Cases in one picture."""


def write_page(summary: Summary, results: Results) -> Path:
    """Write `report.html` beside the results and return its path. Raises SaveFailed."""
    path = results.folder / NAME
    write_html(path, experiment_page(summary, results))
    found = found_in(summary)
    if found is not None:
        text = found.markdown(summary.planned.experiment.title, results.provenance(), summary.cpu_seconds)
        write_markdown(results.folder / MARKDOWN, text)
    return path


def found_in(summary: Summary) -> Findings | None:
    """Return what came out beyond rates, None for a kind of experiment that has nothing else."""
    tells = kind_of(summary.planned.experiment.kind).findings()
    return None if tells is None else tells(summary)


def experiment_page(summary: Summary, results: Results) -> Page:
    """Return the page."""
    one = summary.planned.experiment
    found = found_in(summary)
    if found is not None:
        return Page(
            kind="Experiment",
            title=one.title,
            question=one.question,
            answer=found.answer,
            beside=_failures(summary) + bullets([SIMULATED], "warning"),
            sections=(*found.page_sections(), _made_of(summary, results)),
        )
    best = best_arm(summary)
    sections = [_rates(summary)] if summary.arms else []
    if best is not None:
        sections += [*_judged(summary, best), *felt_sections(summary, best)]
    sections.append(_made_of(summary, results))
    return Page(
        kind="Experiment",
        title=one.title,
        question=one.question,
        answer=answer(summary),
        beside=_beside(summary, best),
        sections=tuple(sections),
    )


def best_arm(summary: Summary) -> Arm | None:
    """Return the arm with the highest rate for the first target, None where there is none."""
    arms = [arm for arm in summary.arms if arm.target == summary.arms[0].target]
    return max(arms, key=lambda arm: arm.rate.mean) if arms else None


def rate_row(arm: Arm, *, strong: bool = False, name: str = "") -> RateRow:
    """Return an arm as a row of a picture."""
    return RateRow(
        name=name or arm.name,
        rate=arm.rate.mean,
        interval=arm.rate.interval,
        what=f"{TARGETS[arm.tells]}, {arm.protocol.replace('_', ' ')}",
        strong=strong,
    )


def _beside(summary: Summary, best: Arm | None) -> str:
    """Return what must be read with the answer: how it was measured, and what speaks against it."""
    if best is None:
        return _failures(summary)
    first = next(iter(best.judged.values()))
    result = next(one for (case, _), one in summary.results.items() if case == best.case.name)
    seeds = len(best.judged)
    labels = len(first["labels"])
    features = ", ".join(name for name, _ in result["features"])
    made = "made by a simulator" if best.simulated else "recorded"
    anew = f", anew for each of {seeds} seeds" if best.simulated and seeds > 1 else ""
    guess = best.controls.get("majority_class", ("", None, ""))[1]
    guessing = f" Guessing the commonest would be right in {100 * guess.mean:.0f} %." if guess else ""
    text = (
        "A gripper closes two fingers that feel force on a thing it cannot see into. From each grasp a few numbers are "
        f"drawn ({features}); a classifier learns from them {TARGETS[best.tells]}: {labels} possible answers."
        f"{guessing} Each case has {best.rate.n} grasps, {made}{anew}. Every grasp is judged by "
        f"{protocol_words(best.protocol)}. An interval holds the true mean in 95 of 100 such experiments."
    )
    warnings = list(dict.fromkeys(str(line) for line in first.get("warnings", ())))
    if best.simulated:
        warnings.append(
            "every figure here comes from a model of gripper and objects; none was measured on real things"
        )
    return paragraph(text) + _failures(summary) + bullets(warnings, "warning")


def _failures(summary: Summary) -> str:
    lines = []
    if summary.failed:
        reasons = list(dict.fromkeys(one.reason for one in summary.failed))
        lines.append(
            f"{len(summary.failed)} tasks failed and are not in these figures: {'; '.join(reasons[:5])}"
        )
    if summary.missing:
        lines.append(f"{summary.missing} tasks have no result yet: the figures are of those that have")
    return bullets(lines, "warning")


def _rates(summary: Summary) -> Section:
    body = []
    for target in dict.fromkeys(arm.target for arm in summary.arms):
        arms = [arm for arm in summary.arms if arm.target == target]
        best = max(arms, key=lambda arm: arm.rate.mean)
        rows = [rate_row(arm, strong=arm is best and len(arms) > 1) for arm in arms]
        title = f"How often {TARGETS[best.tells]} is told"
        body.append(f"<h3>{escape(title)}</h3>")
        picture = _picture(arms, rows, f"{title}. Bars are 95 % intervals.")
        body.append(pair(picture, rates_table("Case by case", rows)))
    return Section(id="rates", title="How often it is right", body="".join(body))


def _picture(arms: Sequence[Arm], rows: Sequence[RateRow], caption: str) -> str:
    """Return the rates against the one number that was swept, or else a row for each."""
    key = _swept_number(arms)
    if key is None:
        cut = "" if len(rows) <= ROWS else f" The first {ROWS} of {len(rows)}; all are in the table."
        return rates_picture(rows[:ROWS], caption + cut)
    series: dict[str, list[tuple[float, RateRow]]] = {}
    for arm, row in zip(arms, rows, strict=True):
        others = [str(value) for name, value in arm.case.at.items() if name != key]
        series.setdefault(", ".join([*others, arm.learner]), []).append((float(arm.case.at[key]), row))
    guess = arms[0].controls.get("majority_class", ("", None, ""))[1]
    what, one = worded(key.rpartition(".")[2], 1.0)
    factor, _, unit = one.partition(" ")
    series = {name: [(x * float(factor), row) for x, row in points] for name, points in series.items()}
    axis = f"{what}, {unit}" if unit else what
    return rates_over(series, axis, caption, None if guess is None else guess.mean)


def _swept_number(arms: Sequence[Arm]) -> str | None:
    """Return the key that takes the most different numbers, where it takes more than one."""
    numbers: dict[str, set[float]] = {}
    for arm in arms:
        for key, value in arm.case.at.items():
            if isinstance(value, int | float) and not isinstance(value, bool):
                numbers.setdefault(key, set()).add(float(value))
    most = max(numbers, key=lambda key: len(numbers[key]), default=None)
    everywhere = most is not None and all(most in arm.case.at for arm in arms)
    return most if everywhere and most is not None and len(numbers[most]) > 1 else None


def _judged(summary: Summary, best: Arm) -> list[Section]:
    sections = []
    if best.controls:
        rows = [rate_row(best, strong=True)]
        missing = []
        for name, (what, rate, reason) in best.controls.items():
            if name == best.protocol:
                continue
            called, good_for = control_words(name, what)
            if rate is None:
                missing.append(f"{called}: not measured ({reason})")
            else:
                rows.append(RateRow(name=called, rate=rate.mean, interval=rate.interval, what=good_for))
        sections.append(controls_section(rows, missing, best.name))
    arms = [arm for arm in summary.arms if arm.target == best.target]
    arms = sorted(arms, key=lambda arm: -arm.rate.mean)
    chosen = arms if len(arms) <= MATRICES else [*arms[: MATRICES - 1], arms[-1]]
    first, *others = [
        (
            f"{arm.name}: {arm.confusion.n} answers of {len(arm.judged)} seeds, {100 * arm.rate.mean:.1f} % right",
            arm.confusion,
        )
        for arm in chosen
    ]
    sections.append(confusion_section(first, others))
    tree = next((one["tree"] for one in best.judged.values() if one.get("tree")), None)
    if tree:
        nodes = [TreeNode.from_json(node) for node in tree]
        sections.append(tree_section(nodes, f"{best.learner} grows on all grasps of the first seed"))
    return sections


def felt_sections(summary: Summary, best: Arm) -> list[Section]:
    """Return what was felt, of the first seed that has a result."""
    seed = next((s for s in summary.planned.seeds if (best.case.name, s) in summary.results), None)
    if seed is None:
        return []
    result = summary.results[best.case.name, seed]
    where = f" Case: {best.case.name}." if best.case.name else ""
    sections = []
    grasps: Sequence[Mapping[str, Any]] = result.get("grasps") or ()
    if grasps:
        chosen = grasps[0]
        sections.append(
            Section(
                id="grasp",
                title="One grasp, from the approach to rest",
                body=one_grasp(
                    chosen,
                    f"{chosen['label']}, seed {seed}.{where} The fingers close until both touch, squeeze with a set "
                    "force, and hold until nothing moves.",
                ),
            )
        )
        sections.append(
            Section(
                id="traces",
                title="What the fingers felt",
                body=paragraph(f"Some grasps of each kind from seed {seed}, laid over each other.{where}")
                + traces_by_class(grasps),
            )
        )
    labels, values = result["labels"], result["values"]
    features = [(str(name), str(unit)) for name, unit in result["features"]]
    sections.append(
        Section(
            id="features",
            title="What was drawn from it",
            body=paragraph(
                f"Each dot is one grasp of seed {seed}; the bar reaches from the first to the third quartile, with the "
                f"median across it.{where} What lies apart here can be told apart."
            )
            + features_by_class(features, labels, values),
        )
    )
    return sections


def _made_of(summary: Summary, results: Results) -> Section:
    made = results.provenance()
    one = summary.planned.experiment
    git = (made.get("git") or {}).get("graspsense") or {}
    commit = f"{git.get('commit')}{' (with changes)' if git.get('dirty') else ''}" if git else "unknown"
    source = next(iter(summary.results.values()), {})
    notes = [str(line) for line in source.get("notes", ())]
    pairs = [
        ("experiment", f"{summary.planned.name} ({one.kind})"),
        ("command", str(made.get("command", ""))),
        ("begun", str(made.get("begun_at", ""))),
        ("trials", str(source.get("source", "none yet"))),
        ("cases, seeds", f"{len(summary.planned.cases)} cases, seeds {_ranges(summary.planned.seeds)}"),
        ("computing", f"{summary.seconds:.0f} s in all tasks together"),
        ("machine", f"{made.get('host', '?')}, {made.get('system', '?')}"),
        ("code", f"graspsense {made.get('graspsense', '?')}, commit {commit}"),
        *((f"hash of {name}", value) for name, value in (made.get("files") or {}).items()),
    ]
    versions = sorted((str(k), str(v)) for k, v in (made.get("versions") or {}).items())
    try:
        text = (results.folder / EXPERIMENT).read_text(encoding="utf-8")
    except OSError:
        text = ""
    settings = {}
    if summary.planned.cases:
        settings = {
            table: {key: value for key, value in keys.items() if value is not None}
            for table, keys in summary.planned.cases[0].settings.values.items()
            if table != "classifier"
        }
    body = (
        facts(pairs)
        + bullets(notes)
        + folded("Versions", facts(versions))
        + folded("The experiment, with everything filled in", code("experiment file", text))
        + folded("Settings of the first case", code("settings", json.dumps(settings, indent=1)))
        + paragraph(
            "The idea is that of S. Chitta, M. Piccoli and J. Sturm, Tactile Object Class and Internal State "
            "Recognition for Mobile Manipulation, ICRA 2010. Intervals over seeds are Student's, those of one "
            "run Wilson's (J. Am. Stat. Assoc. 22, 1927, 209)."
        )
    )
    if summary.failed:
        rows = [(failure.name, failure.reason) for failure in summary.failed]
        body += table("Tasks that failed", ("task", "reason"), rows)
    return Section(id="made", title="What it was made from", body=body)


def _ranges(seeds: Sequence[int]) -> str:
    if len(seeds) > 2 and list(seeds) == list(range(seeds[0], seeds[0] + len(seeds))):
        return f"{seeds[0]} to {seeds[-1]}"
    return ", ".join(map(str, seeds))
