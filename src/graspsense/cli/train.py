"""`graspsense train`: a model from labelled trials."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from attrs import evolve

from graspsense.cli.choosing import (
    Chosen,
    chosen,
    pipeline_beside,
    pipeline_text,
    say_chosen,
)
from graspsense.cli.options import refuse_typed, target_option, typed
from graspsense.cli.output import check_outputs, echo_values, file_to_write, json_option
from graspsense.cli.progress import ProgressLine
from graspsense.cli.sources import (
    SIMULATED,
    SOURCES,
    checkpoints_option,
    classifier_option,
    command_line,
    is_csv,
    keep_features,
    keep_option,
    learner_of,
    source_argument,
    source_options,
    trials_of,
)
from graspsense.cli.target_value import train_value
from graspsense.cli.terminal import echo, echo_as_it_is, echo_entry, talk
from graspsense.core.files.whole_file import write_whole
from graspsense.core.learn.labelled import Labelled, class_of
from graspsense.core.settings.selected import SelectedComponent
from graspsense.core.values.errors import ConfigError, counted
from graspsense.core.values.label_text import natural_order
from graspsense.evaluation.gathered_warnings import gathered_warnings

if TYPE_CHECKING:
    from graspsense.core.learn.checkpoints import CheckpointTrials
    from graspsense.core.learn.model import Model


_NOT_EVALUATED: Final = ("out", "keep", "overwrite", "calibration_instances", "choose")
"""Options of `train` that `evaluate` does not have."""


@click.command(
    help=f"""Train a classifier on all trials of SOURCE and write the model.

    The model is a JSON file without code. Use it with -o classifier.model=FILE. To measure its recognition rate, run
    `graspsense evaluate` with the same arguments.

    With --choose, classifier and features are those that recognise most of these trials, and the pipeline FILE.toml
    with them is written beside the model. The printed rate is that of the choice as a whole.

    {SOURCES}""",
)
@source_argument
@click.option(
    "--out", metavar="FILE.json", callback=file_to_write(".json"), required=True, help="File of the model."
)
@keep_option
@click.option("--overwrite", is_flag=True, help="Replace the files of --out and --keep if they exist.")
@target_option("What the model predicts; state needs --only CLASS.")
@checkpoints_option
@classifier_option
@click.option(
    "--calibration-instances",
    type=click.IntRange(1),
    help="simulated: measure certainty and sets on so many further instances of each object.  "
    "[default: by cross-validation on the training trials]",
)
@click.option(
    "--choose",
    is_flag=True,
    help="Choose classifier and features by the trials; one that is given by --classifier or -o stays.",
)
@source_options
@json_option()
def train(
    source: str,
    out: str,
    keep: str | None,
    overwrite: bool,
    target: str,
    classifier: str | None,
    checkpoints: str | None,
    calibration_instances: int | None,
    choose: bool,
    **given: Any,
) -> None:
    """Train a model, write it, and print what it was trained on."""
    from graspsense.core.learn.checkpoints import checkpoints_of
    from graspsense.core.learn.model_file import write_model

    pipeline = pipeline_beside(out) if choose and not is_csv(source) else None
    check_outputs(out, keep, pipeline, overwrite=overwrite, sources=[source])
    times = checkpoints_of(checkpoints)
    if choose:
        refuse_typed(("checkpoints", "calibration_instances", "target_value"), "does not go with --choose")
    if given["target_value"]:
        train_value(source, classifier, out, keep, given)
        return
    _refuse_single_scene(source)
    trained = chosen(source, classifier, given, partial(_with_target, target=target)) if choose else None
    held_out = None
    if trained is not None:
        learner, labelled = trained.learner, trained.labelled
    else:
        learner = learner_of(source, classifier, given)
        labelled, held_out = _trials(source, given, times, target, calibration_instances)
    notes = list(labelled.notes) if trained is None else []  # those of a choice are printed with it
    with gathered_warnings(notes):
        made = _maker(learner, Path(out).stem, target, given["seed"])
        labelled, model = _made(made, learner, labelled, held_out, trained, times, given["seed"])
    write_model(Path(out), model)
    if trained is not None and pipeline is not None:
        write_whole(Path(pipeline), pipeline_text(trained, out).encode())
    keep_features(keep, labelled)
    for note in notes:
        talk(f"note: {note}")
    choice = {} if trained is None else {"pipeline": pipeline, "choice": trained.as_values()}
    echo_values({"model": out, **_as_values(model), "trials": len(labelled), **choice})
    _say_trained(out, model)
    if trained is not None:
        say_chosen(
            trained, f"run --pipeline {pipeline}" if pipeline else f"predict {shlex.quote(out)} OTHER.csv"
        )
    else:
        _say_what_next(source, out, model, default=classifier is None and not given["options"])


def _maker(learner: SelectedComponent, name: str, target: str, seed: int) -> Callable[[Labelled], Model]:
    """Return a function that trains a model of this name, without calibration."""
    from graspsense.core.learn.training import train as trained

    return partial(
        trained,
        learner.component,
        learner.config,
        name=name,
        seed=seed,
        target=target,
        provenance={"command": command_line(("keep", "overwrite"))},
    )


def _say_what_next(source: str, out: str, model: Model, *, default: bool) -> None:
    """Print the commands that tell how good the model is and use it, and what to do where nobody chose its features."""
    from graspsense.sources.trial_source import kind_of

    use = f"graspsense predict {shlex.quote(out)} OTHER.csv"
    if not is_csv(source):
        of_run = ("pipeline", "gripper", "options", "force")
        use = command_line({*typed()}.difference(of_run), "run")
        use += f" -o classifier.type={model.component} -o classifier.model={shlex.quote(out)}"
        use += "" if kind_of(source) == SIMULATED else "   (and the pipeline of these trials)"
    # In one line each, so that they can be copied.
    echo_as_it_is(f"how good    {command_line(_NOT_EVALUATED, 'evaluate')}")
    echo_as_it_is(f"use it      {use}")
    if default:
        echo_entry(
            "choice", "classifier and features are the defaults; --choose finds those that suit the trials"
        )


def _made(
    made: Callable[[Labelled], Model],
    learner: SelectedComponent,
    labelled: Labelled,
    held_out: Labelled | None,
    trained: Chosen | None,
    times: Sequence[float],
    seed: int,
) -> tuple[Labelled, Model]:
    """Return the trials of whole grasps, and their model, calibrated, with those of the checkpoints.

    That of a choice, `trained`, is calibrated with the answers of the whole procedure.
    """
    from graspsense.core.learn.checkpoints import split_checkpoints
    from graspsense.evaluation.checkpoints import checkpoint_models
    from graspsense.evaluation.doubt import calibrated, calibrated_by, calibrated_with

    if trained is not None:
        return labelled, calibrated_with(made(labelled), trained.choice.answers, labelled)
    parts = split_checkpoints(labelled, times) if times else ()
    further: Sequence[CheckpointTrials] = ()
    if parts:
        labelled = parts[-1].labelled
        if held_out is not None:
            further = split_checkpoints(held_out, times)
            held_out = further[-1].labelled
    model = made(labelled)
    model = calibrated(model, learner, labelled, seed) if held_out is None else calibrated_by(model, held_out)
    early = checkpoint_models(model, learner, parts[:-1], seed, further)
    return labelled, evolve(model, checkpoints=early)


def _trials(
    source: str,
    given: Mapping[str, Any],
    times: Sequence[float],
    target: str,
    calibration_instances: int | None,
) -> tuple[Labelled, Labelled | None]:
    """Return the trials to learn from, and those of further objects to calibrate with, if they are asked for."""
    with ProgressLine() as progress:
        labelled = _with_target(trials_of(source, progress, given, times), target)
        if calibration_instances is None:
            return labelled, None
        # A seed that neither another training nor an evaluation is likely to have.
        others = {"instances": calibration_instances, "seed": (given["seed"] + 2**31) % 2**32}
        return labelled, trials_of(source, progress, {**given, **others}, times).aimed(target)


def _as_values(model: Model) -> dict[str, Any]:
    """Return what was trained as plain values."""
    return {
        "classifier": model.component,
        "target": model.target,
        "features": list(model.names),
        "labels": list(model.classifier.classes()),
        "provenance": dict(model.provenance),
        "sets": None if model.sets is None else model.sets.to_json(),
        "checkpoints": [
            {
                "after_contact_s": after_s,
                "trials": part.provenance["trials"],
                "sets": None if part.sets is None else part.sets.to_json(),
            }
            for after_s, part in model.checkpoints
        ],
    }


def _say_trained(out: str, model: Model) -> None:
    """Print what was trained."""
    from graspsense.core.learn.conformal import units_needed

    echo(f"{out}: {model.in_a_line}", indent=2)
    echo_entry("labels", ", ".join(natural_order(model.classifier.classes())))
    if model.sets is not None:
        echo_entry("sets", model.sets.in_words)
        if model.sets.trials:
            unknown, trials = model.sets.unknown, model.sets.trials
            echo_entry(
                "unknown",
                f"{100 * unknown / trials:.1f} % ({unknown} of {trials}) of the held-out trials are called unknown "
                "(false alarms); of new trials as many or fewer will be, since this model is trained on all of them",
            )
    if model.holds_for.endswith("sessions"):
        echo_entry(
            "drift",
            f"certainty and sets are for {model.holds_for}. If forces drift between sessions, name the session as the "
            f"instance ({units_needed()} sessions or more); else they are too sure",
        )
    for after_s, part in model.checkpoints:
        sets = "" if part.sets is None else f", sets {part.sets.in_words}"
        echo_entry(
            f"{after_s:g} s", f"after the contact: {counted(part.provenance['trials'], 'grasp')}{sets}"
        )


def _refuse_single_scene(source: str) -> None:
    """Raise ConfigError for a single identified scene, before squeezes of it are simulated."""
    from graspsense.sources.identified import IDENTIFIED, identified_scenes

    scenes = identified_scenes(source) if source.startswith(IDENTIFIED) else ()
    if len(scenes) == 1:
        raise ConfigError(
            f"{source} has the single label {scenes[0].label!r}, and a classifier needs two: name scenes of other "
            f"objects too, as in {IDENTIFIED}cup.toml,mug.toml"
        )


def _with_target(labelled: Labelled, target: str) -> Labelled:
    """Return the trials with the labels that the target asks for. Raises ConfigError if a model cannot learn them."""
    classes = natural_order(map(class_of, labelled.labels))
    if target == "state" and len(classes) > 1:
        raise ConfigError(
            "a model of states is for a single class; select it with --only: " + ", ".join(classes)
        )
    labelled = labelled.aimed(target)
    labelled.refuse_one_label()
    return labelled
