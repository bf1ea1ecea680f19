"""`graspsense collect`: record labelled trials with an operator."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from graspsense.cli.live import Live, LiveOptions, live_options, shown_live, viewer_options
from graspsense.cli.options import (
    GRIPPER_ALONE,
    contradiction,
    names_object,
    pipeline_options,
    settings_of,
)
from graspsense.cli.output import echo_values, json_option
from graspsense.cli.terminal import Style, echo_as_it_is, echo_entry, talk
from graspsense.core.components.registry import installed
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.learn.target_value import value_label
from graspsense.core.pipeline.wiring import check
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.units import in_words
from graspsense.store.changes import refuse_other_units
from graspsense.store.labels import agrees

if TYPE_CHECKING:
    from graspsense.core.values.trial import Trial
    from graspsense.store.collecting import Collection

_LABEL = 14


@click.command()
@click.option(
    "--labels",
    required=True,
    metavar="NAMES",
    help="Comma-separated labels: can:full_open,can:empty_open; #2 is the second can.",
)
@click.option("--each", type=int, default=10, show_default=True, help="Trials of each label.")
@click.option("--save", metavar="DIR", default="trials", show_default=True, help="Store for the trials.")
@click.option("--operator", metavar="NAME", help="Name of the operator, stored with every trial.")
@click.option(
    "--value",
    "values",
    metavar="NAME=NUMBER",
    multiple=True,
    help='A number of these objects, stored with every trial for --target-value: "fill [ml]=250". Can be repeated.',
)
@click.option("--changed", is_flag=True, help="Continue with another gripper or other settings.")
@pipeline_options
@live_options
@viewer_options
@json_option("Print a summary as JSON at the end.")
def collect(
    labels: str,
    each: int,
    save: str,
    operator: str | None,
    values: tuple[str, ...],
    changed: bool,
    **asked: Any,
) -> None:
    """Prompt for the next object, grasp it and store the trial.

    Keys: Enter grasps the object, u undoes the last trial, r repeats the last trial, s skips this object, q stops,
    ? shows the keys.

    Objects are grasped in rounds, so that no class is recorded as one batch. The command continues where it was stopped
    or killed. Ctrl-C opens the gripper, stores a running grasp as aborted, and stops. With a simulated gripper, the
    label selects the object. Answers can come from a file.
    """
    from graspsense.store.collecting import Collection, Wanted
    from graspsense.store.recover import recover_store
    from graspsense.store.store import Store

    live = LiveOptions.taken_from(asked)
    wanted = Wanted(
        words=tuple(word.strip() for word in labels.split(",") if word.strip()),
        each=each,
        seed=asked["seed"] or 0,
        labels={**({"operator": operator} if operator else {}), **dict(map(value_label, values))},
    )
    settings = settings_of(**asked)
    check(settings)
    if not _has_model(settings):
        asked["options"] = (*asked["options"], *GRIPPER_ALONE)
    selects = _label_selects_object(
        settings, wanted.words, names_object(asked["object_name"], asked["options"])
    )

    def settings_for(word: str, number: int) -> Settings:
        return settings_of(**{**asked, "seed": number, **({"object_name": word} if selects else {})})

    with Store.open(save) as store, shown_live(live, save) as shown:
        for left in recover_store(store):  # by an interrupted run
            talk(left.words)
        refuse_other_units(store, [value_label(text)[0] for text in values])
        collection = Collection(
            store=store,
            wanted=wanted,
            plugins=installed(),
            settings_for=settings_for,
            ask=_ask,
            say=talk,
            show=partial(_show, shown, save),
            changed=changed,
            sinks=shown.sinks,
        )
        _run(collection, save)


def _run(collection: Collection, save: str) -> None:
    """Run the collection and print what there is of each label, also if it is interrupted or a trial is not kept."""
    try:
        collection.run()
    except (KeyboardInterrupt, SaveFailed):
        with suppress(OSError):  # the terminal may have gone
            _print_counts(save, collection)
        raise
    _print_counts(save, collection)


def _show(shown: Live, save: str, word: str, trial: Trial) -> None:
    """Show how a trial ended; print the faults that were seen, what was felt, and what the object is taken for."""
    shown.finished(trial, save)
    for warning in trial.warnings:
        if warning != trial.reason:
            echo_entry("  warning", warning, Style.CAUTION, err=True, width=_LABEL)
    features = trial.features
    rows, more = features.shown()
    known = [f"{name} {in_words(value, unit)}" for name, value, unit in rows if value == value]
    felt = ", ".join([*known, more] if more else known)
    undefined = sum(value != value for value in features.values)
    felt += f"{', ' if felt else ''}{undefined} not defined" if undefined else ""
    echo_entry("  felt", felt, err=True, width=_LABEL)
    prediction = trial.prediction
    if prediction is not None:
        certainty = f" ({prediction.certainty_in_words})" if prediction.certainty_in_words else ""
        style = Style.GOOD if prediction.label == word.partition("#")[0] else Style.CAUTION
        echo_entry("  prediction", f"{prediction.label}{certainty}", style, err=True, width=_LABEL)
        if prediction.set_in_words:
            echo_entry("  set", prediction.set_in_words, err=True, width=_LABEL)


def _print_counts(save: str, collection: Collection) -> None:
    from graspsense.core.learn.conformal import COVERAGE, units_lacking

    counts, each = collection.counts(), collection.wanted.each
    unit, lacking = units_lacking(collection.store.counts())
    echo_values(
        {
            "store": save,
            "trials": list(collection.collected),
            "counts": counts,
            "each": each,
            "complete": all(n >= each for n in counts.values()),
            "sets": {"coverage": COVERAGE, "unit": unit, "lacking": lacking},
        }
    )
    for word, n in counts.items():
        more_than_asked = ", more than asked for" if n > each else ""
        echo_entry(word, f"{n:>4} of {each}{more_than_asked}", Style.GOOD if n >= each else None, width=24)
    more = [f"{label} {n}" for label, n in lacking.items() if n]
    if more:
        words = f"needed for prediction sets of {100 * COVERAGE:.0f} %: {', '.join(more)}"
        echo_entry(f"more {unit}", words, Style.CAUTION, width=24)


def _label_selects_object(settings: Settings, labels: Sequence[str], object_is_named: bool) -> bool:
    """Return whether the gripper is told to hold what the label says; a real gripper cannot be told.

    Raises UsageError if the user names an object that contradicts a label, UnknownName if a label is to select an
    object that the gripper does not know.
    """
    gripper = settings.gripper.create()
    if not gripper.objects():
        return False
    for label in labels if not object_is_named else ():
        gripper.with_object(label)
    for label in labels if object_is_named else ():
        if not agrees(settings, label):
            raise contradiction(settings, label)
    return not object_is_named


def _has_model(settings: Settings) -> bool:
    """Return whether the model of the pipeline can be used; if not, print why.

    A pipeline can name the model that is to be trained on these trials.
    """
    from graspsense.core.pipeline.pipeline import model_for

    try:
        model_for(settings, installed())
    except ConfigError as error:
        talk(f"note: collecting without predictions: {str(error).splitlines()[0]}")
        return False
    return True


def _ask(question: str) -> str | None:
    """Ask on the terminal and return the answer in lower case, None at the end of the input.

    Without a terminal, the next line of the standard input is the answer.
    """
    echo_as_it_is(question, err=True, end="")
    line = "" if sys.stdin is None else sys.stdin.readline()
    if not line or not sys.stdin.isatty():
        echo_as_it_is(line.rstrip("\n"), err=True)
    return line.strip().lower() if line else None
