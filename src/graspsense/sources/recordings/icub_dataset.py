"""The iCub Grasp Dataset as labelled trials: `icub:FOLDER`.

`icub.recording_of` turns each grasp into a trace, as for replay. All of it is in the phase `approach`, because no
controller of graspsense was involved. Features are extracted from that trace, so they are relative to the first frame.
The variant `absolute` adds the gap and the force of the first frame to `p_first`, `p_steady` and `f_steady`; contact
and rest are the same. The control from before contact uses the 74 raw numbers of the first frame, in which nothing is
squeezed yet. All of this was decided before any recognition rate was computed.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from operator import itemgetter
from pathlib import Path
from typing import Any, Final

import numpy as np

from graspsense.core.components.caller import option
from graspsense.core.components.roles import FeatureSet
from graspsense.core.learn.labelled import ControlFeatures, Labelled
from graspsense.core.pipeline.wiring import check_recording
from graspsense.core.values.errors import ConfigError, counted
from graspsense.core.values.features import FeatureTable, table_of
from graspsense.recording.controls import controls
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.readable import each_readable, error_of_all, note_on
from graspsense.recording.replayable import recorded_channels
from graspsense.sources.recordings.icub import (
    DATA_FOLDER,
    FINGERS,
    FIRST_JOINT,
    FORCE_N_PER_COUNT,
    GAP_M_PER_DEG,
    IcubGrasp,
    read_grasp,
    recording_of,
)

UNRELIABLE: Final = "full_coke"
"""The class whose data the author of the data set calls unreliable in its README."""
_FILE: Final = re.compile(r"(?P<label>[a-z_]+)_(?P<number>\d+)\.txt")
GraspFile = tuple[Path, str, int]
"""A file with the label and the number in its name."""
_SHIFTED_BY: Final = {"p_first": "gap", "p_steady": "gap", "f_steady": "force"}


def read_dataset(folder: str, features: FeatureSet[Any], *, unreliable: bool = False) -> Labelled:
    """Return the grasps in this folder, or in its subfolder `iCubGraspDataset`.

    With `unreliable`, the class that the author calls unreliable is included. A file that cannot be read is left out,
    with a note. Raises ConfigError if there are no grasps, DataDamaged if none can be read.
    """
    every = _grasps(folder)
    paths = [named for named in every if unreliable or named[1] != UNRELIABLE]
    if not paths:
        raise ConfigError(
            f"all grasps in {folder} are of {UNRELIABLE}, which the author calls unreliable: include them with "
            f"{option('unreliable', python='unreliable=True')}"
        )
    read = list(_each(paths))
    unreadable = [grasp for _, grasp in read if isinstance(grasp, UnreadableRecording)]
    known = {named: grasp for named, grasp in read if isinstance(grasp, IcubGrasp)}
    grasps = list(known.values())
    if not grasps:
        raise error_of_all(unreadable)
    recordings = [recording_of(grasp, path.name) for (path, *_), grasp in known.items()]
    check_recording(recorded_channels(recordings[0]), f"icub:{folder}", features)
    table = table_of([features.extract(recording.trace()) for recording in recordings])
    notes = [
        "the data of the iCub hand have no time stamps: times are frame numbers (delta_t is in frames)",
        "metres and newtons are nominal, and relative to the first frame (docs/icub.md)",
        "class, object and session are the same here: no rate tells whether the squeeze or the session is recognised",
        *note_on(unreadable, len(read)),
    ]
    if len(paths) < len(every):
        notes.append(
            f"{counted(len(every) - len(paths), 'grasp')} of {UNRELIABLE} left out: their author calls them unreliable "
            f"(include them with {option('unreliable', python='unreliable=True')})"
        )
    without = int(np.isnan(table.values).all(axis=1).sum())
    if without:
        notes.append(
            f"{without} of {counted(len(grasps), 'grasp')} have no contact as the feature set needs it, and so "
            "no features"
        )
    variants = {}
    if set(_SHIFTED_BY) <= set(table.names):
        what = "the same features plus the gap and the force of the first frame (p_first, p_steady, f_steady)"
        variants["absolute"] = ControlFeatures(table=_absolute(table, grasps), what=what)
    return Labelled(
        source=f"icub:{folder}",
        table=table,
        labels=tuple(label for _, label, _ in known),
        no_interval="every class is one object, recorded in one session",
        no_instances="every class of this data set is a single object, so none can be held out",
        order=tuple(number for _, _, number in known),
        **controls(
            table,
            _first_frame(grasps),
            before_what="the first frame alone: its 74 raw numbers",
            width_meaning="how far the hand closed until contact",
        ),
        variants=variants,
        notes=tuple(notes),
        provenance={"simulated": False, "frames_not_seconds": True},
    )


def read_recordings(folder: str) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield the grasps in this folder, without those of the class that the author calls unreliable.

    Raises ConfigError if there are none.
    """
    for (path, label, number), grasp in _each(named for named in _grasps(folder) if named[1] != UNRELIABLE):
        if isinstance(grasp, UnreadableRecording):
            yield grasp
        else:
            yield LabelledRecording(
                recording=recording_of(grasp, path.name), source=path.name, label=label, order=float(number)
            )


def _each(files: Iterable[GraspFile]) -> Iterator[tuple[GraspFile, IcubGrasp | UnreadableRecording]]:
    """Yield each file with the grasp in it, or with why it cannot be read."""
    for named in files:
        for grasp in each_readable(named[0].name, lambda path=named[0]: [read_grasp(path)]):  # type: ignore[misc]
            yield named, grasp


def _grasps(folder: str) -> list[GraspFile]:
    """Return the path, label and number of every grasp, sorted by label and number."""
    given = Path(os.path.expanduser(folder))
    within = given / DATA_FOLDER
    place = within if within.is_dir() else given
    if not place.is_dir():
        raise ConfigError(f"there is no folder {given}: name the folder of the iCub Grasp Dataset")
    matches = [(path, _FILE.fullmatch(path.name)) for path in place.glob("*.txt")]
    grasps = [(path, match["label"], int(match["number"])) for path, match in matches if match]
    if not grasps:
        raise ConfigError(f"{place} contains no file of the iCub Grasp Dataset (CLASS_NUMBER.txt)")
    return sorted(grasps, key=itemgetter(1, 2))


def _absolute(table: FeatureTable, grasps: list[IcubGrasp]) -> FeatureTable:
    values = table.values.copy()
    for i, grasp in enumerate(grasps):
        pressure = FORCE_N_PER_COUNT * (255.0 - grasp.taxels[0]).sum(axis=1)
        start = {
            "gap": -GAP_M_PER_DEG * grasp.flexion_deg[0],
            "force": (pressure[0] + pressure[1:].max()) / 2.0,
        }
        for name, what in _SHIFTED_BY.items():
            values[i, table.names.index(name)] += start[what]
    return FeatureTable(names=table.names, units=table.units, values=values)


def _first_frame(grasps: list[IcubGrasp]) -> FeatureTable:
    joints = [f"joint_{FIRST_JOINT + k}" for k in range(9)]
    maxima = [f"{finger}_maximum" for finger in FINGERS]
    taxels = [f"{finger}_{k + 1}" for finger in FINGERS for k in range(12)]
    numbers = [(*grasp.encoders_deg[0], *grasp.maxima[0], *grasp.taxels[0].ravel()) for grasp in grasps]
    names = (*joints, *maxima, *taxels)
    return FeatureTable(names=names, units=("deg",) * 9 + ("counts",) * 65, values=np.array(numbers))
