"""Features of stored trials, extracted again from their recordings with other settings.

Each recording is replayed with the settings that it was made with and the changed ones, as `graspsense replay` does:
the controller decides again when contact and rest are, so that other thresholds act on phases and features alike.
Nothing in the store changes.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from attrs import evolve, frozen

from graspsense.core.components.caller import set_option
from graspsense.core.components.strict import nearest_path
from graspsense.core.grasp.runner import run_uninterrupted
from graspsense.core.learn.checkpoints import with_checkpoints
from graspsense.core.pipeline.wiring import check_recording
from graspsense.core.settings.layers import Flag, Layer
from graspsense.core.settings.resolved import NONE, Settings, default_paths, resolve, without_followers
from graspsense.core.values.errors import ComponentFailed, ConfigError, DataDamaged, named
from graspsense.core.values.features import Features
from graspsense.recording.before_contact import before_contact, contact_force_of
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.provenance import recipe
from graspsense.recording.readable import error_of_all, readable
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorded_grasp import with_phases_of
from graspsense.store.rows import StoredTrial
from graspsense.store.store import Store

CHANGEABLE: Final = ("features", "controller", "run")
"""Tables of settings that a recorded grasp can be evaluated with again; its gripper is the recording."""


@frozen(kw_only=True)
class ExtractedAgain:
    """The outcome and the features of one trial under other settings."""

    outcome: str
    features: Features
    before_contact: Features


@frozen(kw_only=True)
class ExtractedTrials:
    """Trials under other settings by their numbers, with the settings and components of the last of them.

    `unreadable` are the others that were asked for, with what is wrong.
    """

    trials: Mapping[int, ExtractedAgain]
    unreadable: tuple[UnreadableRecording, ...]
    settings: Mapping[str, Mapping[str, Any]]
    components: Mapping[str, str]


def extract_again(
    store: Store,
    numbers: Sequence[int],
    options: Sequence[str] = (),
    *,
    flags: Sequence[Flag] = (),
    checkpoints_s: Sequence[float] = (),
    progress: Callable[[int, int], None] | None = None,
) -> ExtractedTrials:
    """Return the features of these trials with changed settings; `options` are as typed after `-o`.

    `flags` are changes that did not come as text. With `checkpoints_s` (s after the contact), the features are those of
    `CheckpointFeatures`. A trial whose recording is lost or damaged does not stop the others. Raises ConfigError if a
    setting is not one of `CHANGEABLE` or wrong, ComponentFailed if a feature set fails, and DataDamaged if no trial can
    be read.
    """
    _refuse_other_tables(options)
    resolved: dict[str, Settings] = {}
    refused: dict[str, ConfigError] = {}
    extracted: dict[int, ExtractedAgain] = {}
    unreadable: list[UnreadableRecording] = []
    settings = None
    for done, number in enumerate(numbers):
        recording, text = f"store:{store.folder}#{number}", ""
        try:
            with readable(recording):
                trial = store.trial(number)
                recorded = trial.record.settings
                own = {table: keys for table, keys in recorded.items() if table != "gripper"}
                text = json.dumps(recipe(own), sort_keys=True)  # a grasp of other seed is replayed alike
                if text in refused:
                    raise refused[text]
                if text not in resolved:
                    resolved[text] = _resolved(own, recording, options, flags)
                extracted[number] = _extracted(resolved[text], recording, trial, checkpoints_s)
                settings = resolved[text]
        except (ConfigError, DataDamaged) as error:
            if isinstance(error, ConfigError) and text not in resolved:
                refused[text] = error
            unreadable.append(UnreadableRecording(source=recording, error=error))
        if progress is not None:
            progress(done + 1, len(numbers))
    if settings is None:
        if unreadable and all(isinstance(recording.error, ConfigError) for recording in unreadable):
            raise unreadable[0].error  # a mistake in the options, not in the recordings
        if unreadable:
            raise error_of_all(unreadable)
        raise ConfigError(f"the store in {store.folder} has no trial to extract features from")
    return ExtractedTrials(
        trials=extracted,
        unreadable=tuple(unreadable),
        settings=dict(settings.values),
        components=dict(settings.components),
    )


def _meant(option: str) -> str:
    path = option.partition("=")[0].strip()
    near = nearest_path(path, default_paths(sorted(CHANGEABLE)))
    return f"did you mean {near!r}? " if near else ""


def _refuse_other_tables(options: Sequence[str]) -> None:
    for option in options:
        table = option.partition(".")[0].strip()
        if table not in CHANGEABLE:
            raise ConfigError(
                f"{set_option(option)}: {_meant(option)}a stored grasp can be evaluated again with other keys of "
                f"{', '.join(f'[{table}]' for table in CHANGEABLE)} only; its gripper is the recording"
            )


def _resolved(
    own: Mapping[str, Any], recording: str, options: Sequence[str], flags: Sequence[Flag]
) -> Settings:
    values = {**without_followers(own), "classifier": {"type": NONE}}
    replay = (Flag("STORE", "gripper.type", "replay"), Flag("STORE", "gripper.recording", recording))
    # The settings of the recording have been accepted when it was made.
    return resolve(
        "default",
        experiment=Layer(label="the recording", values=values),
        options=options,
        flags=(*flags, *replay),
        force=True,
    )


def _extracted(
    settings: Settings, recording: str, trial: StoredTrial, checkpoints_s: Sequence[float]
) -> ExtractedAgain:
    gripper = settings.gripper
    backend = gripper.component.create(evolve(gripper.config, recording=recording))
    check_recording(backend.channels, recording, settings.controller, settings.features)
    grasp = run_uninterrupted(backend, settings.controller.create(), settings.run)
    trace = grasp.trace
    if trial.record.origin == "import":
        trace = with_phases_of(read_recorded(trial.recording).trace(), trace)
    try:
        features = with_checkpoints(settings.features.create(), checkpoints_s).extract(trace)
    except Exception as error:
        raise ComponentFailed(
            f"feature set {settings.features.component.qualified} failed on {recording}: {named(error)}"
        ) from error
    return ExtractedAgain(
        outcome=grasp.outcome.words,
        features=features,
        before_contact=before_contact(grasp.trace, contact_force_of(settings.values)),
    )
