"""`graspsense run`: one grasp, live in the terminal."""

from __future__ import annotations

from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from secrets import randbelow
from typing import TYPE_CHECKING, Any, Final

import click

from graspsense.cli.live import LiveOptions, live_options, shown_live, viewer_options
from graspsense.cli.live_rows import LiveRows
from graspsense.cli.model_table import print_report
from graspsense.cli.options import contradiction, names_object, pipeline_options, plot_option, settings_of
from graspsense.cli.output import echo_values, file_to_write, json_option
from graspsense.cli.terminal import (
    LABEL_WIDTH,
    Style,
    echo,
    echo_entries,
    echo_entry,
    echo_rows,
    prediction_style,
    state_style,
    talk,
    values_alone,
    warn,
)
from graspsense.core.components.entries import PipelineEntry
from graspsense.core.components.registry import installed
from graspsense.core.files.toml_text import toml_value
from graspsense.core.pipeline.wiring import check
from graspsense.core.values.errors import ExitCode, GraspsenseError
from graspsense.core.values.signals import Outcome
from graspsense.core.values.trial import Trial, trial_as_json
from graspsense.core.values.units import display_unit, in_column, with_unit
from graspsense.store.labels import agrees, check_label, labels_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from graspsense.core.grasp.pair import Member
    from graspsense.core.grasp.sinks import Sink
    from graspsense.core.settings.resolved import Settings
    from graspsense.core.values.device import DeviceInfo
    from graspsense.report.film import Film
    from graspsense.store.record_grasp import Beside

Ended = tuple["Trial", bool, dict[str, Any] | None]
"""A trial, whether it was interrupted, and what is printed about the stored trial."""
LARGEST_DRAWN_SEED: Final = 999_999
MANY_GUARDED: Final = 0.1
"""Share of the ticks of a grasp from which on `run` names the settings by which the guard limits the approach."""


@click.command()
@pipeline_options
@click.option(
    "--save",
    metavar="DIR",
    help="Store the trial and its recording in DIR. Without --seed, a new seed is drawn.",
)
@click.option(
    "--label", metavar="CLASS:STATE", help="With --save: label of the object, as in can:full_open#2."
)
@click.option(
    "--changed", is_flag=True, help="With --save: accept another gripper or other settings than before."
)
@click.option(
    "--explain-model",
    is_flag=True,
    help="Simulated: list what every term contributed, and what each feature would lose without it. (gripper.explain)",
)
@click.option(
    "--beside",
    metavar="PIPELINE",
    help="Grasp with a second gripper at the same time: its pipeline, by name or file. --seed, --object and -o are of "
    "the first.",
)
@plot_option
@click.option(
    "--picture",
    metavar="FILE.png",
    callback=file_to_write(".png"),
    help="Take a picture before the gripper opens again; for grippers with a view, such as mujoco.",
)
@click.option(
    "--video",
    metavar="FILE",
    callback=file_to_write(".mp4", ".webp", ".gif"),
    help="Film the grasp: .mp4, .webp or .gif; for grippers with a view.",
)
@click.option("--viewer", is_flag=True, help="Show the grasp in a window; for grippers with a view.")
@live_options
@viewer_options
@click.option("--dry-run", is_flag=True, help="Print what would be done, and open nothing.")
@json_option("Print the trial as JSON.")
def run(
    save: str | None,
    label: str | None,
    changed: bool,
    explain_model: bool,
    beside: str | None,
    plot: str | None,
    picture: str | None,
    video: str | None,
    viewer: bool,
    dry_run: bool,
    **asked: Any,
) -> None:
    """Open, tare, close, squeeze and release; print the outcome, the features and the prediction.

    Without options, a simulated gripper squeezes a full, closed bottle. Exit codes: 0 the grasp ended by itself,
    whatever its outcome; 2 wrong settings; 3 device not found; 4 grasp aborted or device lost.
    """
    live = LiveOptions.taken_from(asked)
    if beside and any((plot, explain_model, dry_run, picture, video, viewer, live != LiveOptions())):
        raise click.UsageError(
            "--beside goes without --plot, --explain-model, --dry-run, --picture, --video, --viewer, --live, "
            "--foxglove and --rerun"
        )
    if explain_model:
        asked["options"] = (*asked["options"], "gripper.explain=true")
    settings, drawn = _settings_to_run(save, label, asked)
    check(settings)
    if dry_run:
        _say_what_would_be_done(settings)
        return
    if (label is not None or changed) and save is None:
        given = "--changed" if label is None else "--label"
        raise click.UsageError(f"{given} goes with a trial that is kept: add --save DIR")
    if beside is not None:
        _run_beside(settings, beside, save, label)
        return
    film: tuple[Film, ...] = ()
    if viewer or picture is not None or video is not None:
        from graspsense.report.film import Film

        film = (Film(picture, video, window=viewer),)
    sinks: tuple[Sink, ...] = film if values_alone() else (LiveRows(), *film)
    with shown_live(live, save) as shown:
        sinks = (*sinks, *shown.sinks)
        if save is None:
            trial, interrupted, kept = (*grasped(settings, sinks), None)
        else:
            trial, interrupted, kept = _kept(save, label, settings, sinks, changed=changed)
        if drawn is not None:
            talk(f"seed {drawn}, drawn for this trial; --seed {drawn} repeats the grasp")
        shown.finished(trial, save)
        echo_values(_as_json(trial, kept))
        print_trial(trial)
        _print_better(settings, trial)
        print_report(trial.report)
        if plot is not None:
            draw_grasp(trial, Path(plot))
        _write_film(film, save, kept)
    finish(trial, interrupted, "" if kept is None else kept["problem"])


def _run_beside(settings: Settings, pipeline: str, save: str | None, label: str | None) -> None:
    """Grasp with the grippers of these settings and of another pipeline at once, and print both trials.

    Ends the command with the exit code of the first trial that was not kept or did not end by itself.
    """
    from graspsense.core.grasp.pair import run_pair
    from graspsense.store.record_grasp import Beside
    from graspsense.store.store import Store

    other, _ = _settings_to_run(save, label, {"pipeline": pipeline})
    check(other)
    recordings: tuple[Path, ...] = ()
    if save is not None:
        with Store.open(save) as store:
            made_at = datetime.now(UTC).isoformat(timespec="milliseconds")
            recordings = store.new_recording(made_at), store.new_recording(made_at)

    def grasp(member: Member, own: Settings, place: int) -> tuple[Ended, str]:
        if save is None:
            ended: Ended = (*grasped(own, (), member), None)
        else:
            pair = Beside(member=member, recording=recordings[place], other=recordings[1 - place].name)
            ended = _kept(save, label, own, beside=pair)
        trial = ended[0]
        failed = trial.outcome in (Outcome.ABORTED, Outcome.DEVICE_LOST)
        return ended, f"ended as {trial.outcome.words} ({trial.reason})" if failed else ""

    both = run_pair(lambda member: grasp(member, settings, 0), lambda member: grasp(member, other, 1))
    echo_values({"grippers": [_as_json(trial, kept) for trial, _, kept in both]})
    for trial, _, kept in both:
        echo()
        echo_entry("gripper", trial.device.name)
        print_trial(trial)
        if kept is not None and kept["trial"] is not None:
            talk(f"kept as trial {kept['trial']} in {save}")
    for trial, interrupted, kept in both:
        finish(trial, interrupted, "" if kept is None else kept["problem"])


def _as_json(trial: Trial, kept: Mapping[str, Any] | None) -> dict[str, Any]:
    """Return a trial as JSON values, with what is known of its place in a store."""
    return {**trial_as_json(trial), **({} if kept is None else {"kept": kept})}


def grasped(settings: Settings, sinks: Sequence[Sink], beside: Member | None = None) -> tuple[Trial, bool]:
    """Grasp, as one of a pair with `beside`, and return the trial and whether it was interrupted."""
    from graspsense.core.pipeline.pipeline import GraspInterrupted, grasp_with

    try:
        return grasp_with(settings, installed(), sinks=sinks, beside=beside), False
    except GraspInterrupted as error:
        return error.trial, True


def finish(trial: Trial, interrupted: bool, problem: str = "") -> None:
    """End the command with an exit code if the trial was not stored, did not end by itself, or was interrupted."""
    if problem:
        talk(f"graspsense: {problem}")
        raise click.exceptions.Exit(ExitCode.WRONG_USE)
    if trial.outcome in (Outcome.ABORTED, Outcome.DEVICE_LOST):
        raise click.exceptions.Exit(ExitCode.NOT_FINISHED)
    if interrupted:  # during the release, when the grasp had its outcome
        raise KeyboardInterrupt


def _print_better(settings: Settings, trial: Trial) -> None:
    """Name the pipeline that recognises more, if the plugin of this one declares it."""
    shipped = {pipeline.entry.name: pipeline.entry for pipeline in installed().resources(PipelineEntry)}
    entry = shipped.get(settings.pipeline)
    if entry is not None and entry.better and trial.prediction is not None and trial.device.simulated:
        echo_entry(
            "better",
            f"this pipeline is {entry.name}; {entry.better} recognises more: --pipeline {entry.better}",
        )


def _settings_to_run(
    save: str | None, label: str | None, asked: Mapping[str, Any]
) -> tuple[Settings, int | None]:
    """Return the settings of a grasp, and the seed that was drawn for it; None where it was not drawn."""
    settings = _labelled_settings(label, asked)
    if save is None or settings.origins["run.seed"] != "default":
        return settings, None
    # A grasp with the seed of another one is a copy of it, not another trial.
    drawn = randbelow(LARGEST_DRAWN_SEED + 1)
    return _labelled_settings(label, {**asked, "seed": drawn}), drawn


def _labelled_settings(label: str | None, asked: Mapping[str, Any]) -> Settings:
    """Return the settings of a grasp of what the label says, where the gripper can be told what it holds."""
    if label is not None:
        labels_of(label)  # what is not a label is refused as such
    settings = settings_of(**asked)
    if label is None or agrees(settings, label):
        return settings
    if names_object(asked.get("object_name"), asked.get("options", ())):
        raise contradiction(settings, label)
    return settings_of(**{**asked, "object_name": label})


def draw_grasp(trial: Trial, path: Path) -> None:
    """Draw the trial and print the name of the picture. Raises PluginUnavailable, ConfigError."""
    from graspsense.report.grasp_picture import grasp_png

    grasp_png(trial, path)
    talk(f"picture written to {path}")


def _write_film(films: Sequence[Film], save: str | None, kept: dict[str, Any] | None) -> None:
    """Write the pictures; that of a kept trial also into the folder of the store, for its page."""
    from graspsense.report.film import picture_of_trial

    for film in films:
        for path in film.write():
            talk(f"written: {path}")
        png = film.png()
        if save is not None and kept is not None and kept["trial"] is not None and png is not None:
            picture_of_trial(save, kept["trial"]).write_bytes(png)


def _kept(
    save: str,
    label: str | None,
    settings: Settings,
    sinks: Sequence[Sink] = (),
    *,
    changed: bool = False,
    beside: Beside | None = None,
) -> Ended:
    """Grasp and store the trial; return it, whether it was interrupted, and what to print about the stored trial.

    Unless `changed`, or as one of a pair, settings and gripper must be those of the newest grasp in the store. Raises
    ConfigError.
    """
    from graspsense.store.comparable import check_device, check_settings, newest_grasp
    from graspsense.store.record_grasp import record_grasp
    from graspsense.store.store import Store

    labels = {} if label is None else labels_of(label)
    with Store.open(save) as store:
        earlier = None if changed or beside is not None else newest_grasp(store)
        if earlier is not None:
            check_settings(store, earlier, settings)

        def opened(device: DeviceInfo) -> None:
            if label is not None:
                check_label(settings, device)
            if earlier is not None:
                check_device(store, earlier, device)

        grasp = record_grasp(
            *(store, settings, installed()),
            labels=labels,
            origin="run",
            sinks=sinks,
            on_open=opened,
            beside=beside,
        )
    if grasp.number is not None and beside is None:  # those of a pair are told together
        talk(f"kept as trial {grasp.number} in {save}")
        if grasp.counts["dropped"]:
            warn(f"the recorder could not follow: {grasp.counts['dropped']} messages are missing")
    kept = {
        "store": save,
        "trial": grasp.number,
        "recorder": dict(grasp.counts),
        "problem": grasp.problem,
    }
    return grasp.trial, grasp.interrupted, kept if beside is None else {**kept, "beside": beside.other}


def print_trial(trial: Trial, *, events: bool = True) -> None:
    """Print outcome, features, events, prediction, and what qualifies them."""
    echo()
    reason = f": {trial.reason}" if trial.reason else ""
    echo_entry("outcome", f"{trial.outcome.words}{reason}", state_style(trial.outcome.words))
    echo_entries("warning", trial.warnings, Style.CAUTION)
    features = trial.features
    rows, more = features.shown()
    wide = max([LABEL_WIDTH, *(len(name) + 1 for name, _, _ in rows)])
    for name, value, unit in rows:
        echo_entry(name, _shown(value, unit, features.reasons.get(name, "")), width=wide)
    if more:
        echo_entry("features", more, width=wide)
    unit = trial.trace.units["t"]
    for (what, phase), alike in groupby(
        trial.trace.events if events else (), lambda event: (event.what, event.phase)
    ):
        begin_s, *again_s = (event.t_s for event in alike)
        again = f", and {len(again_s)} more until {again_s[-1]:.3f} {unit}" if again_s else ""
        echo_entry("event", f"{what} at {begin_s:.3f} {unit} ({phase.name.lower()}){again}")
    if trial.prediction is not None:
        prediction = trial.prediction
        certainty = f"  ({prediction.certainty_in_words})" if prediction.certainty_in_words else ""
        echo_entry("prediction", f"{prediction.label}{certainty}", prediction_style(prediction.label))
        if prediction.set_in_words:
            echo_entry("set", prediction.set_in_words)
        for i, because in enumerate(prediction.because):
            echo_entry("" if i else "because", because.words)
        echo_entry("model", prediction.model)
        echo_entries("warning", prediction.warnings, Style.CAUTION)
    echo_entries("note", trial.device.notes)
    counts = trial.counts
    if guarded := counts.get("guarded"):
        why = ""
        if trial.device.clock == "device" and guarded > MANY_GUARDED * counts["ticks"]:
            why = ": until a contact, run.first_speed_m_s and run.first_effort_n limit this gripper"
            channels = {channel.name for channel in trial.device.channels}
            if channels and not channels & {"force_left", "force_right"}:
                why += ", which has no pads to feel one"
        echo_entry("note", f"the guard limited the command in {guarded} of {counts['ticks']} ticks{why}")
    if counts.get("late"):
        echo_entry("note", f"{counts['late']} of {counts['ticks']} frames came late")
    if trial.seconds_simulated is not None:
        echo_entry("took", f"{trial.seconds_simulated:.2f} {unit} of grasp in {trial.seconds_wall:.2f} s")


def _shown(value: float, unit: str, reason: str) -> str:
    if value != value:
        return f"{'-':>9}  ({reason})"
    shown, factor = display_unit(unit)
    return with_unit(in_column(value * factor), shown)


def effort_words(kinds: Sequence[str], least_n: float, most_n: float) -> str:
    """Return the effort that is commanded; of commands of a velocity or a position, the limit of the effort."""
    if not set(kinds) & {"effort", "force"}:
        return f"at most {most_n:.1f} N" if kinds else ""
    limits = " or its limit" if set(kinds) - {"effort", "force"} else ""
    return f"{least_n:+.1f} to {most_n:+.1f} N{limits}"


def _say_what_would_be_done(settings: Settings) -> None:
    from graspsense.core.grasp.dry_run import dry_run

    why_not = "nothing emulates this gripper"
    try:
        rehearsed = dry_run(settings.gripper.create(), settings.controller.create(), settings.run)
    except GraspsenseError as error:
        rehearsed, why_not = None, str(error)
    echo_values(
        {
            "dry_run": True,
            "components": dict(settings.components),
            "settings": settings.values,
            "rehearsed_on": rehearsed.device if rehearsed else None,
            "commands": [phase._asdict() for phase in rehearsed.phases] if rehearsed else None,
        }
    )
    echo("would open, tare, close, hold and release with:")
    for table, component in settings.components.items():
        echo(f"  {table:<11}{component}")
    for table, values in settings.values.items():
        for key, value in values.items():
            if key != "type":
                echo(f"    {table}.{key} = {'not set' if value is None else toml_value(value)}")
    if rehearsed is None:
        echo(f"commands: not rehearsed, {why_not}")
    else:
        echo(f"would command, as rehearsed on {rehearsed.device} ({rehearsed.outcome}):")
        echo_rows(
            rehearsed.phases,
            {
                "PHASE": lambda phase: phase.phase,
                "COMMAND": lambda phase: ", ".join(phase.kinds) or "none",
                "FOR": lambda phase: f"{phase.seconds:.2f} s",
                "EFFORT (+ squeezes)": lambda phase: effort_words(phase.kinds, phase.least_n, phase.most_n),
                "FASTEST": lambda phase: f"{phase.fastest_m_s * 1e3:.0f} mm/s",
                "BY THE GUARD": lambda phase: f"{phase.limited} limited" if phase.limited else "",
            },
        )
        if not any(phase.seconds for phase in rehearsed.phases):
            echo("the emulated gripper was commanded nothing: this rehearsal shows nothing of the real one")
    echo("nothing was opened")
