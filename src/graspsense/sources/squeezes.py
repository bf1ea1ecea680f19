"""The recorded squeezes that a user names for `graspsense identify`: recordings, imported files, and stores."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from attrs import evolve

from graspsense.core.components.caller import option
from graspsense.core.components.identification import RecordedSqueeze
from graspsense.core.learn.labelled import class_of
from graspsense.core.values.errors import ConfigError, suggestion
from graspsense.recording.recorded_grasp import RecordedGrasp
from graspsense.recording.trial_record import TrialRecord
from graspsense.store.opening import STORE, as_source, place_and_number


def recorded_squeezes(sources: Sequence[str], name: str | None = None) -> tuple[RecordedSqueeze, ...]:
    """Return the squeezes of these sources; `name`: those with this label or of this class only.

    Those of a class that the user names are of one object, whatever its state. A source is a FILE.mcap, `store:DIR`, a
    trial `DIR#NUMBER` of a store, or whatever `graspsense import` reads. Raises ConfigError if there are none,
    if they are of several objects, or if a channel is not in SI units; DataDamaged.
    """
    squeezes = [squeeze for source in sources for squeeze in _of_source(source)]
    if not squeezes:
        raise ConfigError(f"{', '.join(sources)}: there are no recordings")
    labels = sorted({squeeze.label for squeeze in squeezes if squeeze.label})
    if name is not None:
        known = sorted({*labels, *map(class_of, labels)})
        squeezes = [
            squeeze
            for squeeze in squeezes
            if squeeze.label and name in (squeeze.label, class_of(squeeze.label))
        ]
        if not squeezes:
            there_are = ", ".join(known) or "none has a label; leave out the name"
            raise ConfigError(
                f"no recording has the label or the class {name!r}. Known: {there_are}."
                + suggestion(name, known)
            )
        squeezes = [evolve(squeeze, label=name) for squeeze in squeezes]
        labels = [name]
    if len(labels) > 1:
        raise ConfigError(
            f"the recordings are of {len(labels)} objects, and a scene describes one. Name it: "
            f"{option('class', labels[0], python='name')} "
            f"(there are {', '.join(labels)})"
        )
    for squeeze in squeezes:
        _refuse_other_units(squeeze)
    return tuple(squeezes)


def _of_source(source: str) -> Iterator[RecordedSqueeze]:
    source = as_source(source)
    folder, number = place_and_number(source.removeprefix(STORE))
    if source.startswith(STORE) or (number is not None and Path(os.path.expanduser(folder)).is_dir()):
        yield from _of_store(folder, number)
    elif source.endswith(".mcap"):
        from graspsense.recording.reader import read_recorded

        path = Path(os.path.expanduser(source))
        grasp = read_recorded(path)
        yield _of_grasp(grasp, grasp.record(), path.name, hashlib.sha256(path.read_bytes()).hexdigest())
    else:
        yield from _of_import(source)


def _of_store(folder: str, number: int | None = None) -> Iterator[RecordedSqueeze]:
    """Yield this trial of a store, or all that were not set aside, oldest first."""
    from graspsense.recording.reader import read_recorded
    from graspsense.store.store import Store

    with Store.read(folder) as store:
        complete = (trial.id for trial in store.page(limit=1_000_000) if trial.complete)
        for k in [number] if number is not None else reversed([*complete]):
            trial = store.trial(k)
            grasp = read_recorded(trial.recording, sha256=trial.recording_sha256)
            yield _of_grasp(grasp, trial.record, f"{folder}#{k}", trial.recording_sha256)


def _of_grasp(grasp: RecordedGrasp, record: TrialRecord, name: str, sha256: str) -> RecordedSqueeze:
    labels = record.labels
    gripper = dict(record.settings.get("gripper", {})) if record.simulated else {}
    warnings = () if record.result is None else record.result.details.get("warnings", ())
    return RecordedSqueeze(
        name=name,
        sha256=sha256,
        trace=grasp.trace(),
        label=labels.get("label", ""),
        instance=labels.get("instance", ""),
        gripper=gripper,
        simulated=record.simulated,
        warnings=tuple(map(str, warnings)),
    )


def _of_import(source: str) -> Iterator[RecordedSqueeze]:
    from graspsense.recording.replayable import content_sha256
    from graspsense.sources.importing.import_sources import recordings_to_import

    readable, unreadable = recordings_to_import([source], {}, None)
    if unreadable:
        raise unreadable[0].error
    for imported in readable:
        labelled = imported.labelled
        instance = f"{class_of(labelled.label)}#{labelled.instance}" if labelled.instance else ""
        yield RecordedSqueeze(
            name=imported.name,
            sha256=content_sha256(labelled.recording),
            trace=labelled.recording.trace(),
            label=labelled.label,
            instance=instance,
            warnings=labelled.notices,
        )


def _refuse_other_units(squeeze: RecordedSqueeze) -> None:
    """Raise ConfigError for a recording whose time, gap or force is not in SI units."""
    units = squeeze.trace.units
    wrong = [
        f"{channel} in {units[channel]}"
        for channel, unit in (("t", "s"), ("gap", "m"), ("force_left", "N"), ("force_right", "N"))
        if units.get(channel, unit) != unit
    ]
    if wrong:
        raise ConfigError(
            f"{squeeze.name}: {', '.join(wrong)}. A scene is in SI units: convert the columns in the manifest "
            '(such as force = "F * 0.012 [N]")'
        )
