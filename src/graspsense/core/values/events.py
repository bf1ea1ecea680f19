"""What happened in a grasp, and when."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from attrs import frozen

from graspsense.core.values.signals import Phase

if TYPE_CHECKING:
    from graspsense.core.values.features import Prediction

EventSource = Literal["runner", "controller", "model"]
"""What an event of a grasp comes from."""


@frozen
class GraspEvent:
    """An event of a grasp: its time (s), the phase, and a sentence.

    `source` is `runner` for a change of phase, an action of the guard or a sink that failed, and `controller` for an
    event that the controller told; `what` is then the name of the event, one of `Controller.events`. It is `model` for
    a prediction while the grasp goes on, which `prediction` then has.
    """

    t_s: float
    phase: Phase
    what: str
    source: EventSource = "runner"
    prediction: Prediction | None = None


def event_name(names: Sequence[str], number: int) -> str:
    """Return the name of the event of a controller with this number, given its `events`."""
    return names[number] if number < len(names) else f"event {number}"


def event_as_json(event: GraspEvent) -> dict[str, Any]:
    """Return an event as JSON values."""
    return {
        "t_s": event.t_s,
        "phase": event.phase.name.lower(),
        "what": event.what,
        "source": event.source,
    }


def event_from_json(value: Mapping[str, Any]) -> GraspEvent:
    """Return the event of `event_as_json`; without a source it is of the runner. Raises KeyError, ValueError."""
    source: EventSource = "runner"
    if value.get("source") == "controller":
        source = "controller"
    elif value.get("source") == "model":
        source = "model"
    return GraspEvent(float(value["t_s"]), Phase[str(value["phase"]).upper()], str(value["what"]), source)
