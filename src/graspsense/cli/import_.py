"""`graspsense import`: import recordings of other programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click
from attrs import asdict, frozen

from graspsense.cli.import_check import echo_channels, show_files, suggest_manifest
from graspsense.cli.options import keys_option, pipeline_option, refuse_typed
from graspsense.cli.output import echo_values, file_to_write, json_option
from graspsense.cli.progress import ProgressLine
from graspsense.cli.run import draw_grasp
from graspsense.cli.sources import named_source
from graspsense.cli.terminal import (
    Style,
    echo,
    echo_as_it_is,
    echo_entries,
    echo_entry,
    echo_rows,
    talk,
    values_alone,
)
from graspsense.core.components.registry import installed
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.pipeline.wiring import check_recording
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import Settings, resolve
from graspsense.core.settings.selected import ImplausibleSettings
from graspsense.core.values.errors import (
    ConfigError,
    DataDamaged,
    GraspsenseError,
    PluginUnavailable,
    WiringError,
    counted,
)
from graspsense.core.values.units import display_unit
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.readable import error_of_all, readable
from graspsense.recording.replayable import recorded_channels
from graspsense.store.labels import labels_of

if TYPE_CHECKING:
    from graspsense.sources.importing.import_sources import ImportedRecording
    from graspsense.sources.importing.import_summary import ImportSummary

LISTED: Final = 20
"""Largest number of unreadable recordings whose errors are printed; `--json` lists all."""
PICTURE: Final = "import-check.png"
FEW: Final = 3
"""Largest number of recordings that are printed one by one."""


@click.command("import")
@click.argument(
    "sources", nargs=-1, required=True, metavar="FILE.csv|MANIFEST.toml|KIND:NAME...", callback=named_source
)
@click.option("--save", metavar="DIR", help="Store for the trials.")
@click.option("--check", is_flag=True, help="Only print what was understood, and draw one grasp.")
@click.option(
    "--suggest", metavar="FILE.toml", help="Write a manifest for the folder or file SOURCES, to correct."
)
@click.option(
    "--plot",
    metavar="FILE.png",
    callback=file_to_write(".png"),
    help="--check: the picture.  [default: import-check.png]",
)
@click.option("--label", metavar="CLASS:STATE", help="Label of the object: can:full_open#2.")
@click.option("--time", metavar="EXPRESSION", help='CSV: time. In ms: --time "STAMP [ms]".')
@click.option("--gap", metavar="EXPRESSION", help='CSV: gap. In mm: --gap "60 - POS [mm]".')
@click.option(
    "--force",
    "forces",
    metavar="EXPRESSION",
    multiple=True,
    help='CSV: force, as "max(F1, F2)". Repeat it for two pads.',
)
@click.option("--effort", metavar="EXPRESSION", help="CSV: effort, in N.")
@click.option(
    "--velocity", metavar="EXPRESSION", help="CSV: velocity of the gap, in m/s; negative when closing."
)
@pipeline_option("Pipeline that computes the features.  [default: default]")
@keys_option("Set a key of the pipeline: -o controller.probing_force_n=17.")
@json_option()
def import_(
    sources: tuple[str, ...],
    save: str | None,
    check: bool,
    suggest: str | None,
    plot: str | None,
    label: str | None,
    forces: tuple[str, ...],
    pipeline: str,
    options: tuple[str, ...],
    **named: str | None,
) -> None:
    """Import recorded grasps as trials, each with its recording, features and label.

    MANIFEST.toml names the files, their labels and their columns (docs/import.md). A FILE.csv is one grasp and needs
    --time, --gap and --force. KIND:NAME is a file of another reader, or the folder of a data set.
    """
    from graspsense.sources.importing.import_sources import is_csv, recordings_to_import

    if suggest is not None:
        suggest_manifest(sources, suggest)
        return
    given = {what: [text] for what, text in named.items() if text is not None}
    given |= {"force": list(forces)} if forces else {}
    for source in sources:
        if given and not is_csv(source):
            raise click.UsageError(f"--{next(iter(given))} is for a CSV; {source} is none")
    if not check and save is None:
        raise click.UsageError(
            "name a store for the trials: --save DIR. Or look at the recordings first: --check"
        )
    if not check:
        refuse_typed(["plot"], "is for --check")
    if label is not None:
        labels_of(label)  # what is not a label is refused as such, before any file is read
    chosen = _Chosen(pipeline, options)
    try:
        with chosen.doubted():
            recordings, unreadable = recordings_to_import(sources, given, label)
    except GraspsenseError:
        if check and not given and show_files(sources, plot or PICTURE):
            return
        raise
    if not recordings:
        raise ConfigError(f"{', '.join(sources)}: no recordings")
    recordings = chosen.fitting(recordings, unreadable)
    chosen.fit(recordings)
    if save is None or check:
        _show(recordings, unreadable, chosen, Path(plot or PICTURE))
    else:
        _import(save, recordings, unreadable, chosen)
    if unreadable:
        _echo_unreadable(unreadable)
        click.get_current_context().exit(DataDamaged.exit_code)


class _Chosen:
    """The settings of an import: those of the pipeline, and thresholds from the recordings where none is given."""

    def __init__(self, pipeline: str, options: Sequence[str]) -> None:
        self._pipeline, self._options = pipeline, tuple(options)
        self._added: tuple[str, ...] = ()
        self._any_unit = False
        self._doubt: ImplausibleSettings | None = None
        self.words = ""
        # A mistake in them is told before files are read.
        try:
            self._settings = self.settings("csv:the first recording")
        except ImplausibleSettings as doubt:  # unless the recordings are in other units
            self._doubt, self._any_unit = doubt, True
            self._settings = self.settings("csv:the first recording")
        self._leave_out_misfitting_model()

    def _leave_out_misfitting_model(self) -> None:
        """Import without predictions where other features are chosen than the model of the pipeline takes.

        Raises WiringError for a model that the user has chosen.
        """
        from graspsense.core.pipeline.pipeline import model_for

        self._unpredicted = ""
        try:
            model_for(self._settings, installed())
        except WiringError:
            if any(option.startswith("classifier.") for option in self._options):
                raise
            self._options = (*self._options, "classifier.type=none")
            self._settings = self.settings("csv:the first recording")
            self._unpredicted = "; no predictions, because the model of the pipeline takes other features"

    @contextmanager
    def doubted(self) -> Iterator[None]:
        """Tell a doubt about the settings if the recordings cannot be read, whose units would have decided it."""
        try:
            yield
        except GraspsenseError:
            self._refuse_doubt()
            raise

    def _refuse_doubt(self) -> None:
        if self._doubt is not None:  # whose own advice, --force, names a column here
            raise ConfigError(str(self._doubt))

    def fitting(
        self, recordings: Sequence[ImportedRecording], unreadable: list[UnreadableRecording]
    ) -> list[ImportedRecording]:
        """Return the recordings with the channels that controller and features need; `unreadable` gets the others.

        Raises WiringError if there is none.
        """
        users, fitting = (self._settings.controller, self._settings.features), []
        for recording in recordings:
            try:
                check_recording(
                    recorded_channels(recording.labelled.recording), recording.labelled.source, *users
                )
                fitting.append(recording)
            except WiringError as error:
                unreadable.append(UnreadableRecording(source=recording.labelled.source, error=error))
        if not fitting:
            raise error_of_all(unreadable)
        return fitting

    def fit(self, recordings: Sequence[ImportedRecording]) -> None:
        """Choose the thresholds that are not given. Raises ConfigError for implausible ones in SI units."""
        from graspsense.sources.recordings.noise_thresholds import open_thresholds

        used = [recording.labelled.recording for recording in recordings]
        self._any_unit = any(recording.units for recording in used)
        if not self._any_unit:
            self._refuse_doubt()
        thresholds = open_thresholds(self._settings, used)
        self.words = f"{thresholds.words}{self._unpredicted}"
        self._added = thresholds.options

    def settings(self, name: str) -> Settings:
        """Return the settings under which the recording of this name is replayed. Raises ConfigError."""
        flags = (
            Flag("--gripper", "gripper.type", "replay"),
            Flag("SOURCE", "gripper.recording", name),
        )
        options = (*self._added, *self._options)
        return resolve(self._pipeline, options=options, flags=flags, force=self._any_unit)


@frozen
class _Stored:
    """What became of the recordings of an import."""

    kept: list[dict[str, Any]]
    """Source, number of the trial, and outcome of each recording that was stored."""
    refused: list[str]
    """Why a recording was left out, although it can be read."""
    notes: list[tuple[str, ...]]
    """What the gripper of each trial notes, without what looks wrong: that is told for all trials together."""


def _import(
    save: str,
    recordings: Sequence[ImportedRecording],
    unreadable: list[UnreadableRecording],
    chosen: _Chosen,
) -> None:
    """Import the recordings and print what became of each; those that cannot be replayed join `unreadable`."""
    from graspsense.sources.importing.import_outcomes import refuse_useless, tried

    say = partial(echo, err=values_alone())
    outcomes, doubts = tried(recordings, chosen.settings)
    refuse_useless(recordings, outcomes, chosen.settings(recordings[0].name))
    stored = _store(save, recordings, unreadable, chosen)
    if not stored.kept and not stored.refused:
        raise error_of_all(unreadable)
    if not stored.kept and not unreadable:
        raise ConfigError(stored.refused[0])
    if not stored.kept:
        say(f"no new trial for {save}")
    elif len(recordings) <= FEW:
        for trial, notes in zip(stored.kept, stored.notes, strict=True):
            say(f"{trial['source']}: trial {trial['trial']}, {trial['outcome']}", indent=2)
            for note in notes:
                say(f"  {note}", Style.CAUTION)
    else:
        outcomes = Counter(trial["outcome"] for trial in stored.kept)
        words = ", ".join(f"{count} {outcome}" for outcome, count in outcomes.items())
        say(f"{counted(len(stored.kept), 'trial')} imported into {save}: {words}")
        for note in recordings[0].labelled.recording.notes[1:]:
            say(f"  {note}")
    if stored.kept:
        say(f"  {chosen.words}")
        for notice in (*_summary(recordings).notices, *doubts):
            say(f"  {notice}", Style.CAUTION, indent=2)
    if again := [trial for trial in stored.kept if "earlier" in trial]:
        known = f"{again[0]['source']} is that of trial {again[0]['earlier']}"
        say(
            f"  {counted(len(again), 'trial')} from sources with a name that the store has, and with another content: "
            f"{known}. A grasp that was read anew is stored twice now: set the earlier trials aside "
            f"(graspsense trials aside {save}#{again[0]['earlier']})",
            Style.CAUTION,
        )
    if stored.refused:
        say(f"  {counted(len(stored.refused), 'recording')} left out: {stored.refused[0]}", Style.CAUTION)
    echo_values(
        {
            "store": save,
            "trials": stored.kept,
            "refused": stored.refused,
            "unreadable": [recording.line for recording in unreadable],
            "thresholds": chosen.words,
        }
    )


def _store(
    save: str, recordings: Sequence[ImportedRecording], unreadable: list[UnreadableRecording], chosen: _Chosen
) -> _Stored:
    """Store the recordings that the store does not have. Raises SaveFailed."""
    from graspsense.sources.importing.import_recording import import_recording
    from graspsense.sources.recordings.dataset_recordings import handed_over
    from graspsense.store.imported_contents import AlreadyImported, ImportedContents, imported_alone
    from graspsense.store.recover import recover_store
    from graspsense.store.store import Store

    stored = _Stored([], [], [])
    waiting = partial(talk, f"waiting for another import into {save}")
    with Store.open(save) as store, imported_alone(store, waiting), ProgressLine() as progress:
        for left in recover_store(store):  # by a killed import, which is not imported again
            talk(left.words)
        contents = ImportedContents(store)
        for done, recording in enumerate(recordings):
            source = recording.labelled.source
            with handed_over(recording.name, recording.labelled.recording):
                try:
                    with readable(source):
                        settings = chosen.settings(recording.name)
                        trial, number = import_recording(
                            store, settings, installed(), recording.labelled, contents
                        )
                except AlreadyImported as error:
                    stored.refused.append(str(error))
                    continue
                except SaveFailed:
                    raise
                except GraspsenseError as error:
                    unreadable.append(UnreadableRecording(source=source, error=error))
                    continue
            kept = {"source": source, "trial": number, "outcome": trial.outcome.words}
            if (earlier := contents.earlier(source)) is not None:
                kept["earlier"] = earlier
            stored.kept.append(kept)
            noticed = recording.labelled.notices
            stored.notes.append(tuple(note for note in trial.device.notes if note not in noticed))
            progress("grasps imported", done + 1, len(recordings))
    return stored


def _echo_unreadable(unreadable: Sequence[UnreadableRecording]) -> None:
    """Print why each recording cannot be read, in one line each, and what to do."""
    echo(f"{counted(len(unreadable), 'recording')} cannot be read:", Style.CAUTION, err=True)
    for recording in unreadable[:LISTED]:
        echo_as_it_is(
            f"  {recording.line}", err=True
        )  # not wrapped, so that a program can take it line by line
    if len(unreadable) > LISTED:
        echo(f"and {len(unreadable) - LISTED} more; --json lists all", indent=2, err=True)
    echo(
        "Correct these, or leave them out (of `files` in a manifest). The same command then imports only what the "
        "store does not have.",
        err=True,
    )


def _show(
    recordings: Sequence[ImportedRecording],
    unreadable: Sequence[UnreadableRecording],
    chosen: _Chosen,
    picture: Path,
) -> None:
    """Print what was understood of the recordings, and draw one of them. Raises ConfigError if most are useless."""
    from graspsense.core.pipeline.pipeline import grasp_with
    from graspsense.sources.importing.import_outcomes import refuse_useless, tried
    from graspsense.sources.recordings.dataset_recordings import handed_over

    summary = _summary(recordings)
    outcomes, doubts = tried(recordings, chosen.settings)
    ends = {outcome.words: count for outcome, count in outcomes.most_common()}
    echo_values(
        {
            **asdict(summary),
            "unreadable": [recording.line for recording in unreadable],
            "thresholds": chosen.words,
            "outcomes": ends,
            "rests": "; ".join(doubts),
        }
    )
    _echo_summary(summary)
    echo_channels(summary.measured)
    echo_entry("thresholds", chosen.words.partition(": ")[2])
    some = "" if outcomes.total() == len(recordings) else f" (of {outcomes.total()} that were tried)"
    echo_entry("outcomes", ", ".join(f"{count} {words}" for words, count in ends.items()) + some)
    for notice in (*summary.notices, *doubts):
        echo(f"  {notice}", Style.CAUTION, indent=2)
    middle = recordings[len(recordings) // 2]
    try:
        with readable(middle.labelled.source), handed_over(middle.name, middle.labelled.recording):
            trial = grasp_with(
                chosen.settings(middle.name), installed(), labels={"label": middle.labelled.label}
            )
        draw_grasp(trial, picture)
    except (DataDamaged, PluginUnavailable) as error:
        echo(f"no picture: {error}", Style.CAUTION, err=True)
    refuse_useless(recordings, outcomes, chosen.settings(recordings[0].name))


def _summary(recordings: Sequence[ImportedRecording]) -> ImportSummary:
    from graspsense.sources.importing.import_summary import summary_of

    return summary_of([recording.labelled for recording in recordings])


def _echo_summary(summary: ImportSummary) -> None:
    gap, factor = display_unit(summary.units.get("gap", "m"))
    force = summary.units.get("force_left", "N")
    time = "Hz" if summary.units.get("t", "s") == "s" else f"per {summary.units['t']}"
    echo_rows(
        summary.labels,
        {
            "LABEL": lambda label: label.label or "none",
            "GRASPS": lambda label: str(label.grasps),
            "OBJECTS": lambda label: "unknown" if label.instances is None else str(label.instances),
            "SAMPLES": lambda label: _span(label.samples),
            f"RATE, {time}": lambda label: _span(label.rate_hz),
            f"GAP, {gap}": lambda label: _span(tuple(factor * value for value in label.gap)),
            f"LEFT, {force}": lambda label: _span(label.left),
            f"RIGHT, {force}": lambda label: _span(label.right),
        },
    )
    echo()
    echo_entry("grasps", str(summary.grasps))
    echo_entries("", summary.notes)
    recorded = "unknown" if summary.recorded is None else f"{summary.recorded[0]} to {summary.recorded[1]}"
    echo_entry("recorded", recorded)
    if summary.channels:
        echo_entry("channels", ", ".join(summary.channels))
    if summary.values:
        echo_entry("values", ", ".join(summary.values))


def _span(values: Sequence[float]) -> str:
    low, high = (f"{value:.4g}" for value in values)
    return low if low == high else f"{low} to {high}"
