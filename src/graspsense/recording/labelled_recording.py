"""A recorded grasp of a data set with its label, and a recording that cannot be read: what a data set consists of."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Real

from attrs import field, frozen
from attrs.validators import instance_of

from graspsense.core.values.errors import GraspsenseError
from graspsense.core.values.label_text import label_text
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

    recording: Recording = field(validator=instance_of(Recording))
    source: str
    label: str = field(default="", converter=label_text)
    instance: str = field(default="", converter=label_text)
    recorded_at: str = ""
    order: float | None = None
    values: Mapping[str, float] = field(factory=dict)
    notices: tuple[str, ...] = ()

    def __attrs_post_init__(self) -> None:
        for name, text in (("source", self.source), ("recorded_at", self.recorded_at)):
            if not isinstance(text, str):
                raise TypeError(f"{name} is text, not {text!r}")
        # In the order of texts, 10 is before 2.
        for name, number in (("order", self.order or 0), *self.values.items()):
            if not isinstance(number, Real):
                raise TypeError(f"{name} is a number, not {number!r}")


@frozen(kw_only=True, eq=False)
class UnreadableRecording:
    """A file, or a part of it, that cannot be read, although the others of its data set can.

    `source` names it for people; `error` says what is wrong.
    """

    source: str
    error: GraspsenseError

    @property
    def line(self) -> str:
        """What is wrong, in one line that begins with the name of the file."""
        text = " ".join(str(self.error).split())
        return text if self.source in text else f"{self.source}: {text}"
