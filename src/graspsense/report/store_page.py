"""The page of a store: its trials, their measurements, and how well they can be recognised."""

from __future__ import annotations

import base64
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, Final

from graspsense.core.learn.copies import without_copies
from graspsense.core.learn.labelled import Target
from graspsense.core.settings.selected import select_component
from graspsense.core.values.errors import ConfigError, DataDamaged, counted
from graspsense.core.values.label_text import natural_order
from graspsense.evaluation.evaluate import evaluate
from graspsense.evaluation.results import Evaluation
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.provenance import commit_text
from graspsense.recording.readable import note_on, readable
from graspsense.recording.reader import read_recorded
from graspsense.report.evaluation_page import beside, features_section, result_sections
from graspsense.report.film import picture_of_trial
from graspsense.report.further_channels import channel_figures
from graspsense.report.grasp_curve import GraspCurve, grasp_curve
from graspsense.report.html import (
    Page,
    Section,
    bullets,
    code,
    facts,
    figure,
    folded,
    pair,
    panels,
    paragraph,
    table,
)
from graspsense.report.tactile import tactile_figures
from graspsense.report.traces import features_table, one_grasp, traces_by_class
from graspsense.report.trial_curves import trial_curves
from graspsense.report.verdict import headline, verdict
from graspsense.report.wording import TARGETS
from graspsense.store.changes import Change, history
from graspsense.store.dataset import labelled_store
from graspsense.store.rows import StoredTrial, TrialSummary
from graspsense.store.store import Store

GRASPS: Final = 3
"""Grasps of each label that are drawn over each other."""
CURVES: Final = 60
"""Largest number of trials that are shown as small curves."""
PNG: Final = b"\x89PNG\r\n\x1a\n"
LARGEST_PICTURE: Final = 4 * 1024 * 1024
NO_LABEL: Final = "no label"
LISTED: Final = 200
"""Largest number of trials in the list at the end; the newest are listed."""
Progress = Callable[[str, int, int], None]


def store_page(
    folder: str,
    *,
    classifier: str = "c45",
    target: Target = "both",
    folds: int = 10,
    seed: int = 0,
    grasp: int | None = None,
    progress: Progress | None = None,
) -> Page:
    """Return the page of the store in this folder; `grasp` is the number of the trial that is shown over time.

    Raises ConfigError if there is no store, no trial, or no trial of this number, and DataDamaged.
    """
    with Store.read(folder) as store:
        listed = store.page(set_aside=None, limit=LISTED)
        if not listed:
            raise ConfigError(f"the store in {folder} has no trials yet: graspsense collect --save {folder}")
        trial = _newest_readable(store, listed) if grasp is None else store.trial(grasp)
        counts = store.query(
            f"""SELECT coalesce(label, '{NO_LABEL}'), outcome, iif(set_aside IS NULL, 'counts', 'set aside'), count(*)
            FROM trial GROUP BY label, outcome, set_aside IS NULL ORDER BY label, outcome, set_aside IS NOT NULL"""
        )
        curves, unreadable = _curves(store)
        changes = history(store)
    learner = select_component("classifier", classifier)
    labelled, evaluation, problem = None, None, ""
    try:
        labelled = without_copies(labelled_store(folder))
        evaluation = evaluate(
            learner,
            labelled,
            target=target,
            folds=folds,
            seed=seed,
            learning_curve=False,
            progress=progress,
        )
    except ConfigError as error:
        problem = str(error)
    sections: list[Section] = []
    if evaluation is not None and labelled is not None:
        sections += result_sections(evaluation, learner, labelled)
    sections += _measurement_sections(folder, trial, curves, unreadable)
    if labelled is not None:
        sections.append(features_section(labelled))
    sections.append(_provenance(folder, listed, trial, counts, changes))
    return Page(
        kind="Store of trials",
        title=f"Grasps in {folder}",
        question=f"Can a gripper recognise {TARGETS[target]} by touch?",
        answer=_answer(evaluation, sum(trials for *_, trials in counts), problem),
        headline="" if evaluation is None else headline(evaluation),
        beside="" if evaluation is None or labelled is None else beside(evaluation, labelled),
        sections=tuple(sections),
    )


def _newest_readable(store: Store, listed: Sequence[TrialSummary]) -> StoredTrial:
    """Return the newest trial that is complete, not set aside, and readable; else another one.

    Raises DataDamaged if none can be read.
    """
    newest = sorted(listed, key=lambda summary: not summary.complete or summary.set_aside is not None)
    return store.first_readable(summary.id for summary in newest)


def _curves(store: Store) -> tuple[list[GraspCurve], list[UnreadableRecording]]:
    """Return the newest complete grasps and the newest of each label, newest first, and those that cannot be read."""
    rows = store.query(
        """SELECT coalesce(label, ''), id, recording, recording_sha256 FROM trial
        WHERE complete = 1 AND set_aside IS NULL ORDER BY id DESC"""
    )
    count: Counter[str] = Counter()
    curves: list[GraspCurve] = []
    unreadable: list[UnreadableRecording] = []
    for label, number, recording, sha256 in rows:
        if len(curves) >= CURVES and (count[label] >= GRASPS or not label):
            continue
        try:
            with readable(f"trial {number} of {store.folder}"):
                trace = read_recorded(store.recording_path(recording), sha256=sha256).trace()
        except (ConfigError, DataDamaged) as error:
            unreadable.append(UnreadableRecording(source=f"trial {number}", error=error))
            continue
        count[label] += 1
        curves.append(grasp_curve(trace, label or NO_LABEL, number).until_release())
    return curves, unreadable


def _newest_of_labels(curves: Sequence[GraspCurve]) -> list[GraspCurve]:
    """Return the newest grasps of each label, the labels in natural order."""
    by_label: dict[str, list[GraspCurve]] = {}
    for curve in curves:
        if curve.label != NO_LABEL:
            by_label.setdefault(curve.label, []).append(curve)
    return [curve for label in natural_order(by_label) for curve in by_label[label][:GRASPS]]


def _answer(evaluation: Evaluation | None, total: int, problem: str) -> str:
    if evaluation is None:
        grasps = f"There {'is' if total == 1 else 'are'} {counted(total, 'grasp')}"
        return f"{grasps}, but no recognition rate: {problem}."
    return verdict(evaluation)


def _measurement_sections(
    folder: str, trial: StoredTrial, curves: Sequence[GraspCurve], unreadable: Sequence[UnreadableRecording]
) -> list[Section]:
    """Return one grasp over time with its features and its picture, and grasps drawn over each other."""
    summary = trial.summary
    label = summary.label or NO_LABEL
    further = ""
    try:
        recorded = read_recorded(trial.recording, sha256=trial.recording_sha256)
        trace = recorded.trace()
        curve = grasp_curve(trace, label, summary.id)
        body = one_grasp(curve, f"Trial {summary.id}: {label}, {summary.outcome}, made {summary.made_at}.")
        channels = recorded.channels
        figures = [*tactile_figures(trace, channels), *channel_figures(trace, channels)]
        further = panels(figures) if figures else ""
    except (ConfigError, DataDamaged) as error:
        body = paragraph(f"The recording of trial {summary.id} cannot be shown: {error}")
    features = trial.result.features
    pairs = tuple(zip(features.names, features.units, strict=True))
    values = features_table(f"Features of trial {summary.id}", pairs, tuple(features.as_dict().values()))
    warnings = [str(warning) for warning in trial.result.details.get("warnings") or ()]
    body = bullets(warnings, "warning") + pair(body, values)
    sections = [Section(id="grasp", title="One grasp, from the approach to rest", body=body)]
    if further:
        sections.append(
            Section(id="signals", title="The same grasp: tactile arrays and further channels", body=further)
        )
    newest = _newest_of_labels(curves)
    if newest:
        text = f"The newest grasps of each label, at most {GRASPS}, drawn over each other."
        notes = note_on(unreadable, len(curves) + len(unreadable))
        body = paragraph(text) + traces_by_class(newest) + bullets(notes, "warning")
        sections.append(Section(id="traces", title="Force and gap over time", body=body))
    sections += _picture_section(folder, trial)
    if curves:
        sections.append(trial_curves(curves[:CURVES]))
    return sections


def _picture_section(folder: str, trial: StoredTrial) -> list[Section]:
    """Return the picture that `run --picture` took of this trial, if there is one."""
    path = picture_of_trial(folder, trial.summary.id)
    if not path.is_file() or path.stat().st_size > LARGEST_PICTURE:
        return []
    data = path.read_bytes()
    if not data.startswith(PNG):
        return []
    source = f"data:image/png;base64,{base64.b64encode(data).decode()}"
    caption = f"Trial {trial.summary.id}, before the fingers opened again."
    image = f'<img src="{source}" alt="The gripper in trial {trial.summary.id}" style="max-width:100%">'
    return [Section(id="picture", title="The same grasp, seen", body=figure(image, caption))]


def _provenance(
    folder: str,
    listed: Sequence[TrialSummary],
    trial: StoredTrial,
    counts: Sequence[Sequence[Any]],
    changes: Sequence[Change],
) -> Section:
    total = sum(trials for *_, trials in counts)
    made = trial.record.provenance
    pairs = [
        ("store", folder),
        ("trials", f"{total}, the newest made {listed[0].made_at}"),
        ("grippers", ", ".join(sorted({summary.device for summary in listed}))),
        ("simulated", f"{sum(summary.simulated for summary in listed)} of the newest {len(listed)}"),
        ("machine", f"{made.get('host', '?')}, {made.get('system', '?')}"),
        ("code", f"graspsense {made.get('graspsense', '?')}, commit {commit_text(made)}"),
        *(
            (f"component {name}", str(component))
            for name, component in (made.get("components") or {}).items()
        ),
    ]
    order = natural_order(label for label, *_ in counts)
    by_label = [tuple(map(str, count)) for count in sorted(counts, key=lambda count: order.index(count[0]))]
    rows = [
        (
            str(summary.id),
            summary.made_at,
            summary.label or "",
            summary.instance or "",
            summary.outcome,
            summary.set_aside or "",
        )
        for summary in listed
    ]
    newest = f"The newest {len(rows)} of {counted(total, 'trial')}" if total > len(rows) else "All trials"
    header = ("trial", "made", "label", "instance", "outcome", "set aside")
    body = (
        facts(pairs)
        + table("Trials by label and outcome", ("label", "outcome", "state", "trials"), by_label, 3)
        + folded(newest, table(newest, header, rows))
        + _changes(changes)
        + folded(f"Settings of trial {trial.summary.id}", code(trial.record.settings_text, "settings"))
    )
    return Section(id="made", title="Provenance", body=body)


def _changes(changes: Sequence[Change]) -> str:
    """Return the table of labels that were changed and of trials that were set aside or brought back."""
    if not changes:
        return ""
    rows = [(str(change.trial), change.made_at or "unknown", change.words, change.why) for change in changes]
    title = f"Changes after recording: {len(rows)}"
    return folded(title, table(title, ("trial", "when", "change", "why"), rows))
