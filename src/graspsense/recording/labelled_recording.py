"""A recorded grasp of a data set with its label: what a reader of a data set yields for `import` and `replay`."""

from __future__ import annotations

from collections.abc import Mapping

from attrs import field, frozen

from graspsense.recording.replayable import Recording


@frozen(kw_only=True, eq=False)
class LabelledRecording:
    """A recorded grasp, and what its data set says about it.

    `source` names the file, and its part, for people. `label` is `class:state` or a class, `instance` identifies the
    individual object among those of its class; both are empty where they are not known. `recorded_at` is the time of
    the recording (ISO 8601), `order` a number that increases in the order of recording. `values` are measured
    properties of the object or of the grasp, under their names with units: `{"break_force [N]": 2.6}`. `notices` are
    sentences on what looks wrong, each with its remedy.
    """

    recording: Recording
    source: str
    label: str = ""
    instance: str = ""
    recorded_at: str = ""
    order: float | None = None
    values: Mapping[str, float] = field(factory=dict)
    notices: tuple[str, ...] = ()
