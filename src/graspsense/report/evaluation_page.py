"""The page of an evaluation: the rate, its controls, what is confused, and the features that the trials have."""

from __future__ import annotations

from collections.abc import Sequence

from graspsense import __version__
from graspsense.core.learn.labelled import Labelled
from graspsense.core.settings.selected import SelectedComponent
from graspsense.evaluation.results import Evaluation
from graspsense.report.evaluation_sections import (
    confusion_section,
    controls_section,
    doubt_section,
    tree_section,
)
from graspsense.report.html import Page, Section, bullets, facts, paragraph, table
from graspsense.report.rates import rate_row
from graspsense.report.traces import features_by_class
from graspsense.report.verdict import headline, verdict
from graspsense.report.wording import TARGETS, about_grasps, control_words, protocol_words


def evaluation_page(
    evaluation: Evaluation, learner: SelectedComponent, labelled: Labelled, command: str
) -> Page:
    """Return the page of an evaluation of these trials; `command` is the command line that measured it."""
    return Page(
        kind="Evaluation",
        title=evaluation.source,
        question=f"Is {TARGETS[evaluation.recognised]} recognised by touch?",
        answer=verdict(evaluation),
        headline=headline(evaluation),
        beside=beside(evaluation, labelled),
        sections=(
            *result_sections(evaluation, learner, labelled),
            features_section(labelled),
            _made_of(evaluation, command),
        ),
    )


def beside(evaluation: Evaluation, labelled: Labelled) -> str:
    """Return what must be read with the answer, with the warnings."""
    guess = evaluation.controls["majority_class"].rate
    answers = len(evaluation.confusion.labels)
    about = about_grasps(
        labelled.table.names, evaluation.recognised, answers, None if guess is None else guess.rate
    )
    text = (
        f"{about} Every grasp is classified by {protocol_words(evaluation.protocol)}. "
        "A 95 % interval contains the true rate in 95 of 100 such collections."
    )
    notes = list(evaluation.notes)
    if labelled.provenance.get("simulated") and not any("simulated" in note for note in notes):
        notes.append("grasps are simulated, with a model of gripper and objects")
    return paragraph(text) + bullets(evaluation.warnings, "warning") + bullets(notes, "notes")


def result_sections(evaluation: Evaluation, learner: SelectedComponent, labelled: Labelled) -> list[Section]:
    """Return the controls, the confusion matrix, the prediction sets, and a tree if the classifier grows one."""
    classifier = learner.component.name
    head = evaluation.headline
    rows = [rate_row(classifier, head, "the answer above", strong=True)]
    missing = []
    for name, measured in {**evaluation.protocols, **evaluation.controls}.items():
        title, purpose = control_words(name, measured.what)
        if measured.rate is None:
            missing.append(f"{title}: not measured ({measured.reason})")
        elif name != evaluation.protocol:
            n = measured.rate.n
            among = "" if n == head.n else f" ({n} of {head.n} trials)"
            rows.append(rate_row(title + among, measured.rate, purpose))
    title = f"{classifier}: {evaluation.confusion.n} predictions"
    sections = [
        controls_section(rows, missing, classifier),
        confusion_section((title, evaluation.confusion)),
    ]
    if evaluation.sets is not None and evaluation.reliability is not None:
        sections.append(doubt_section(evaluation.sets, evaluation.reliability))
    if evaluation.target != "state":
        trials = labelled.aimed(evaluation.target)
        fitted = learner.create()
        fitted.fit(trials.table, trials.labels, evaluation.seed)
        nodes = fitted.tree()
        if nodes is not None:
            sections.append(tree_section(nodes, f"{classifier} grows on all of these grasps"))
    return sections


def features_section(labelled: Labelled) -> Section:
    """Return the section with a picture of each feature."""
    body = paragraph(
        "Each dot is one grasp. The bar spans the first to the third quartile, with the median across it. Labels "
        "that lie apart here can be distinguished."
    ) + features_by_class(
        list(zip(labelled.table.names, labelled.table.units, strict=True)),
        labelled.labels,
        [[None if v != v else v for v in row] for row in labelled.table.values.tolist()],
    )
    return Section(id="features", title="Features", body=body)


def _made_of(evaluation: Evaluation, command: str) -> Section:
    pairs: Sequence[tuple[str, str]] = [
        ("command", command),
        ("trials", f"{evaluation.headline.n} of {evaluation.source}"),
        ("classifier", evaluation.classifier),
        ("settings", ", ".join(f"{key} = {value}" for key, value in evaluation.settings.items()) or "none"),
        ("protocol", f"{evaluation.protocol}, {evaluation.folds} folds, seed {evaluation.seed}"),
        ("code", f"graspsense {__version__}"),
    ]
    curve = [
        (f"{point.trained_on:.0f}", f"{100 * point.rate.rate:.1f} %") for point in evaluation.learning_curve
    ]
    body = facts(pairs)
    if curve:
        body += table("Rate by the number of training trials", ("training trials", "recognised"), curve, 1)
    return Section(id="made", title="Provenance", body=body)
