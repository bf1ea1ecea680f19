"""Labels as an operator types them: `CLASS:STATE`, followed by `#N` to name the individual object."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Final

from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import UNKNOWN
from graspsense.core.values.label_text import label_text

if TYPE_CHECKING:
    from graspsense.core.settings.resolved import Settings
    from graspsense.core.values.device import DeviceInfo

_WORD: Final = re.compile(r"(?P<kind>[^\s:#,]+)(?P<state>:[^\s:#,]+)?(?P<number>#[^\s:#,]+)?")


def labels_of(word: str) -> dict[str, str]:
    """Return `label`, and `instance` if the text names an individual object (`can:full_open#2`: instance `can#2`).

    Raises ConfigError if the text is not such a label.
    """
    match = _WORD.fullmatch(label_text(word))
    if match is None:
        raise ConfigError(
            f"{word!r} is not a label: write CLASS:STATE, as in can:full_open, or can:full_open#2 for the second can. "
            "Class, state and number are without spaces and without the characters : # ,"
        )
    label = match["kind"] + (match["state"] or "")
    if match["kind"] == UNKNOWN:
        raise ConfigError(
            f"{UNKNOWN!r} is not a label: it is the answer for an object that is unlike all known ones"
        )
    return {"label": label, **({"instance": match["kind"] + match["number"]} if match["number"] else {})}


def word_of(label: str | None, instance: str | None) -> str | None:
    """Return the text that `labels_of` takes apart into these, None if there is no label."""
    if label is None:
        return None
    number = (instance or "").partition("#")[2]
    return f"{label}#{number}" if number else label


def agrees(settings: Settings, label: str) -> bool:
    """Return whether an object with this label can be what the gripper holds.

    A label contradicts the gripper only if the gripper holds a known object: an object from a file can have any label,
    and nobody but the user knows what a real gripper holds.
    """
    held = settings.held.partition("#")[0]
    known = {name for kind in settings.gripper.create().objects() for name in kind.full_names}
    named = label.partition("#")[0]
    return held == named or not known & {held, named}


def check_label(settings: Settings, device: DeviceInfo) -> None:
    """Raise ConfigError if this gripper is simulated and holds the same thing whatever the label says."""
    if device.simulated and not settings.gripper.create().objects():
        raise ConfigError(
            f"{device.name} is simulated and cannot be told what it holds, so a label would be given to whatever that "
            "is: its class needs `objects` and `with_object` (docs/roles/sensor-backend.md). Without labels it can be "
            "tried with `graspsense run`"
        )
