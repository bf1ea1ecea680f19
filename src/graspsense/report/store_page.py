"""The page of a store: what its trials are of, what was felt in them, and how well they can be told apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

from graspsense.core.config import SelectedComponent, select_component
from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.core.features import in_words
from graspsense.evaluation.evaluate import Evaluation, evaluate
from graspsense.recording.reader import read_recorded
from graspsense.report.evaluation_sections import code, confusion_section, controls_section, tree_section
from graspsense.report.grasps import grasp_as_json
from graspsense.report.html import Page, Section, bullets, facts, folded, paragraph, table
from graspsense.report.rates import RateRow
from graspsense.report.traces import features_by_class, one_grasp, traces_by_class
from graspsense.report.wording import TARGETS, control_words, protocol_words
from graspsense.store.dataset import labelled_store
from graspsense.store.store import Store

if TYPE_CHECKING:
    from graspsense.core.labelled import Labelled, Target
    from graspsense.store.rows import StoredTrial, TrialSummary

GRASPS: Final = 3
"""Of each label, drawn over each other."""
LISTED: Final = 200
"""Trials in the list at the end; of more, the newest."""
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

    Raises ConfigError where there is no store, no trial, or none of this number, DataDamaged.
    """
    with Store.read(folder) as store:
        listed = store.page(set_aside=None, limit=LISTED)
        if not listed:
            raise ConfigError(f"the store in {folder} has no trials yet: graspsense collect --save {folder}")
        chosen = (
            store.summary(grasp)
            if grasp is not None
            else next((one for one in listed if one.complete and one.set_aside is None), listed[0])
        )
        kept = store.trial(chosen.id)
        groups = store.query(
            "SELECT label, outcome, set_aside IS NOT NULL, count(*) FROM trial GROUP BY 1, 2, 3 ORDER BY 1, 2"
        )
        drawn = _drawn(store)
    labelled, why_not = _labelled(folder)
    found: Evaluation | None = None
    learner = select_component("classifier", classifier)
    if labelled is not None:
        try:
            found = evaluate(
                learner,
                labelled,
                classifier=f"{learner.component.qualified} {learner.component.version}",
                target=target,
                folds=folds,
                seed=seed,
                learning_curve=False,
                progress=progress,
            )
        except ConfigError as error:
            why_not = str(error)
    sections: list[Section] = []
    if found is not None and labelled is not None:
        sections += _judged(found, learner, labelled, classifier, seed)
    sections += _felt(chosen, kept, drawn)
    if labelled is not None:
        body = paragraph(
            "Each dot is one grasp; the bar reaches from the first to the third quartile, with the median across it. "
            "What lies apart here can be told apart."
        ) + features_by_class(
            list(zip(labelled.table.names, labelled.table.units, strict=True)),
            labelled.labels,
            [[None if one != one else one for one in row] for row in labelled.table.values.tolist()],
        )
        sections.append(Section(id="features", title="What was drawn from it", body=body))
    sections.append(_made_of(folder, listed, kept, groups))
    return Page(
        kind="Store of trials",
        title=f"Grasps in {folder}",
        question=f"Can a gripper tell by touch {TARGETS[target]}?",
        answer=_answer(found, groups, why_not),
        beside=_beside(found, labelled, target),
        sections=tuple(sections),
    )


def _labelled(folder: str) -> tuple[Labelled | None, str]:
    try:
        return labelled_store(folder), ""
    except ConfigError as error:
        return None, str(error)


def _drawn(store: Store) -> list[dict[str, Any]]:
    """Return the newest whole grasps of each label, as far as their recordings can be read."""
    rows = store.query(
        """SELECT label, id, recording FROM trial
        WHERE complete = 1 AND set_aside IS NULL AND label IS NOT NULL ORDER BY label, id DESC"""
    )
    count: Counter[str] = Counter()
    grasps = []
    for label, number, recording in rows:
        if count[label] >= GRASPS:
            continue
        try:
            trace = read_recorded(store.recording_path(recording)).trace()
        except (ConfigError, DataDamaged):
            continue
        count[label] += 1
        grasps.append({"label": label, "trial": number, **grasp_as_json(trace)})
    return grasps


def _answer(found: Evaluation | None, groups: Sequence[tuple[Any, ...]], why_not: str) -> str:
    total = sum(int(row[3]) for row in groups)
    if found is None:
        return f"There are {total} grasps, but no rate: {why_not}."
    low, high = found.headline.interval
    name = found.classifier.partition(" ")[0].rpartition("/")[2]
    return (
        f"In {100 * found.headline.rate:.1f} % (95 %: {100 * low:.1f} to {100 * high:.1f}) of "
        f"{found.headline.n} grasps, {name} tells {TARGETS[found.target]}."
    )


def _beside(found: Evaluation | None, labelled: Labelled | None, target: Target) -> str:
    if found is None or labelled is None:
        return ""
    guess = found.controls["majority_class"].rate
    guessing = f" Guessing the commonest would be right in {100 * guess.rate:.0f} %." if guess else ""
    text = (
        "A gripper closes two fingers that feel force on a thing it cannot see into. From each grasp a few numbers are "
        f"drawn ({', '.join(labelled.table.names)}); a classifier learns from them {TARGETS[target]}: "
        f"{len(found.confusion.labels)} possible answers.{guessing} Every grasp is judged by "
        f"{protocol_words(found.protocol)}. An interval holds the true rate in 95 of 100 such collections."
    )
    warnings = list(found.warnings)
    if labelled.provenance.get("simulated"):
        warnings.append(
            "there are simulated grasps among these: they come from a model of gripper and objects"
        )
    return paragraph(text) + bullets(warnings, "warning")


def _judged(
    found: Evaluation, learner: SelectedComponent, labelled: Labelled, classifier: str, seed: int
) -> list[Section]:
    head = found.headline
    rows = [
        RateRow(name=classifier, rate=head.rate, interval=head.interval, what="the answer above", strong=True)
    ]
    missing = []
    for name, one in {**found.protocols, **found.controls}.items():
        called, good_for = control_words(name, one.what)
        if one.rate is None:
            missing.append(f"{called}: not measured ({one.reason})")
        elif name != found.protocol:
            rows.append(RateRow(name=called, rate=one.rate.rate, interval=one.rate.interval, what=good_for))
    sections = [
        controls_section(rows, missing, classifier),
        confusion_section((f"{classifier}: {found.confusion.n} answers", found.confusion)),
    ]
    if found.target != "state":
        aimed = labelled.aimed(found.target)
        fitted = learner.create()
        fitted.fit(aimed.table, aimed.labels, seed)
        nodes = fitted.tree()
        if nodes is not None:
            sections.append(tree_section(nodes, f"{classifier} grows on all of these grasps"))
    return sections


def _felt(chosen: TrialSummary, kept: StoredTrial, drawn: Sequence[dict[str, Any]]) -> list[Section]:
    sections = []
    label = chosen.label or "no label"
    try:
        shown = {"label": label, **grasp_as_json(read_recorded(kept.recording).trace())}
        caption = f"Trial {chosen.id}: {label}, {chosen.outcome}, made {chosen.made_at}."
        body = one_grasp(shown, caption)
    except (ConfigError, DataDamaged) as error:
        body = paragraph(f"The recording of trial {chosen.id} cannot be shown: {error}")
    values = [
        (name, "missing" if value is None else in_words(value, unit))
        for (name, unit), value in zip(
            kept.result.features.features, kept.result.features.values, strict=True
        )
    ]
    sections.append(
        Section(id="grasp", title="One grasp, from the approach to rest", body=body + facts(values))
    )
    if drawn:
        text = f"The newest grasps of each kind, at most {GRASPS}, laid over each other."
        sections.append(
            Section(id="traces", title="What the fingers felt", body=paragraph(text) + traces_by_class(drawn))
        )
    return sections


def _made_of(
    folder: str, listed: Sequence[TrialSummary], kept: StoredTrial, groups: Sequence[tuple[Any, ...]]
) -> Section:
    total = sum(int(row[3]) for row in groups)
    made = kept.record.provenance
    git = (made.get("git") or {}).get("graspsense") or {}
    pairs = [
        ("store", folder),
        ("trials", f"{total}, the newest made {listed[0].made_at}"),
        ("grippers", ", ".join(sorted({one.device for one in listed}))),
        ("simulated", f"{sum(one.simulated for one in listed)} of the newest {len(listed)}"),
        ("machine", f"{made.get('host', '?')}, {made.get('system', '?')}"),
        ("code", f"graspsense {made.get('graspsense', '?')}, commit {git.get('commit', 'unknown')}"),
        *((f"component {name}", str(one)) for name, one in (made.get("components") or {}).items()),
    ]
    counts = [
        (str(label or "no label"), str(outcome), "set aside" if aside else "counts", str(n))
        for label, outcome, aside, n in groups
    ]
    rows = [
        (str(one.id), one.made_at, one.label or "", one.instance or "", one.outcome, one.set_aside or "")
        for one in listed
    ]
    newest = f"The newest {len(rows)} of {total} trials" if total > len(rows) else "All trials"
    body = (
        facts(pairs)
        + table("Trials by label and outcome", ("label", "outcome", "state", "trials"), counts, 3)
        + folded(newest, table(newest, ("trial", "made", "label", "thing", "outcome", "set aside"), rows))
        + folded(f"Settings of trial {kept.summary.id}", code("settings", kept.record.settings_text))
    )
    return Section(id="made", title="What it was made from", body=body)
