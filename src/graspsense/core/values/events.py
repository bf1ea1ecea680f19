"""What happened in a grasp, and when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, Literal, get_args

from attrs import frozen

from graspsense.core.values.signals import Phase

if TYPE_CHECKING:
    from graspsense.core.values.features import Prediction

EventSource = Literal["runner", "controller", "model", "label"]
"""What an event of a grasp comes from."""
LABELLED: Final = "labelled_events"
"""Key in the report of a trial: the names of the events that were looked for in its recording, also without any."""
NOT_KNOWN: Final = " not known"
"""Behind the name of a labelled event: until then it is not known whether it goes on, or when it began."""


@frozen
class GraspEvent:
    """An event of a grasp: its time (s), the phase, and a sentence.

    `source` is `runner` for a change of phase, an action of the guard or a sink that failed, and `controller` for an
    event that the controller told; `what` is then the name of the event, one of `Controller.events`. It is `model` for
    a prediction while the grasp goes on, which `prediction` then has. It is `label` for what others labelled in a
    recording that they made: from `t_s` until `until_s`, which is `t_s` where only the beginning is known.
    """

    t_s: float
    phase: Phase
    what: str
    source: EventSource = "runner"
    prediction: Prediction | None = None
    until_s: float | None = None


def event_name(names: Sequence[str], number: int) -> str:
    """Return the name of the event of a controller with this number, given its `events`."""
    return names[number] if number < len(names) else f"event {number}"


def event_as_json(event: GraspEvent) -> dict[str, Any]:
    """Return an event as JSON values."""
    values = {
        "t_s": event.t_s,
        "phase": event.phase.name.lower(),
        "what": event.what,
        "source": event.source,
    }
    return values if event.until_s is None else {**values, "until_s": event.until_s}


def event_from_json(value: Mapping[str, Any]) -> GraspEvent:
    """Return the event of `event_as_json`; without a source it is of the runner. Raises KeyError, ValueError."""
    source: EventSource = next(
        (argument for argument in get_args(EventSource) if argument == value.get("source")), "runner"
    )
    until = value.get("until_s")
    return GraspEvent(
        float(value["t_s"]),
        Phase[str(value["phase"]).upper()],
        str(value["what"]),
        source,
        until_s=None if until is None else float(until),
    )
