"""`graspsense replay`: a recording through a pipeline."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from graspsense.cli.options import force_option, keys_option, pipeline_option, plot_option
from graspsense.cli.output import echo_values, json_option
from graspsense.cli.run import draw_grasp, print_trial
from graspsense.cli.terminal import talk, warn
from graspsense.core.components.registry import installed
from graspsense.core.pipeline.wiring import check
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import Settings, resolve
from graspsense.core.values.trial import trial_as_json

if TYPE_CHECKING:
    from graspsense.sources.recordings.noise_thresholds import Thresholds


@click.command()
@click.argument("recording", metavar="FILE.mcap|DIR#NUMBER|KIND:NAME")
@pipeline_option("Another pipeline.  [default: the one it was recorded with]", default=None)
@keys_option("Set a key of the pipeline: -o controller.contact_force_n=0.1.")
@force_option
@plot_option
@json_option("Print the trial as JSON.")
def replay(
    recording: str,
    pipeline: str | None,
    options: tuple[str, ...],
    force: bool,
    plot: str | None,
) -> None:
    """Compute features and a prediction from a recording, as during the grasp; nothing moves.

    FILE.mcap is a recording of graspsense, DIR#NUMBER a trial of a store, and KIND:NAME a file of another reader, for
    example icub:FOLDER/full_vitamin_water_1.txt, or manifest:FILE.toml#3 for the third grasp of a manifest. Of such a
    file, thresholds of contact and rest that are not set are those that `import` would choose.
    """
    from graspsense.core.pipeline.pipeline import grasp_with
    from graspsense.sources.recordings.doubtful_rests import notices_of_rests
    from graspsense.sources.recordings.replay import kind_and_name, read_named

    settings = _settings(recording, pipeline, options, force)
    check(settings)
    trial = grasp_with(settings, installed())
    echo_values(trial_as_json(trial))
    print_trial(trial)
    kind, name = kind_and_name(settings.values["gripper"]["recording"])
    if kind not in ("store", "mcap"):
        for notice in notices_of_rests([(trial.features, read_named(kind, name))], "controller"):
            warn(notice)
    if plot is not None:
        draw_grasp(trial, Path(plot))


def _settings(recording: str, pipeline: str | None, options: tuple[str, ...], force: bool) -> Settings:
    from graspsense.sources.recordings.replay import kind_and_name, known_kinds
    from graspsense.store.stored_grasps import recorded_settings

    kind, name = kind_and_name(recording)
    kinds = known_kinds()
    folder, number, _ = recording.rpartition("#")
    if kind not in kinds and number and (not kind or Path(os.path.expanduser(folder)).is_dir()):
        kind, name = "store", recording
    own: Any = None
    if pipeline is None and kind in ("store", "mcap"):
        own = recorded_settings(kind, name)
    flags = (
        Flag("--gripper", "gripper.type", "replay"),
        Flag("RECORDING", "gripper.recording", f"{kind}:{name}" if kind in kinds else recording),
    )
    # The settings of the recording have been accepted when it was made.
    settings = resolve(
        pipeline or "default", experiment=own, options=options, flags=flags, force=force or own is not None
    )
    if kind in ("store", "mcap"):
        return settings
    thresholds = _thresholds_of_import(settings, kind, name)
    if not thresholds.options:
        return settings
    talk(thresholds.words)
    return resolve(pipeline or "default", options=(*thresholds.options, *options), flags=flags, force=True)


def _thresholds_of_import(settings: Settings, kind: str, name: str) -> Thresholds:
    """Return the thresholds that `import` chooses from a recording, and from the others of its data set."""
    from graspsense.sources.importing.import_sources import recordings_to_import
    from graspsense.sources.recordings.dataset_recordings import is_recording_number
    from graspsense.sources.recordings.noise_thresholds import open_thresholds

    source = f"{kind}:{name}"
    whole = source.rpartition("#")[0] if is_recording_number(kind, name) else source
    recordings, _ = recordings_to_import([whole], {}, None)
    return open_thresholds(settings, [recording.labelled.recording for recording in recordings])
