"""Types of ROS 2 messages: their definitions, their hashes (REP 2011, RIHS01), and their messages in CDR.

rosbags has the definitions of the common interfaces, encodes, decodes and hashes. The types of services and actions
that it lacks are defined here, as rosidl derives them.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from rosbags.interfaces.typing import Typesdict
    from rosbags.typesys.store import Typestore

MOST_BYTES: Final = 64 << 20
"""Limit on the bytes of a message that is decoded."""

_MESSAGES: Final = {
    "control_msgs/msg/GripperCommand": "float64 position\nfloat64 max_effort",
    # As ROS hashes it, which takes a char for the uint8 that it is.
    "service_msgs/msg/ServiceEventInfo": (
        "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number"
    ),
}
_SERVICES: Final = {
    "std_srvs/srv/Trigger": ("", "bool success\nstring message"),
    "action_msgs/srv/CancelGoal": (
        "action_msgs/GoalInfo goal_info",
        "int8 return_code\naction_msgs/GoalInfo[] goals_canceling",
    ),
}
"""Request and response of each service."""
_ACTIONS: Final = {
    "control_msgs/action/GripperCommand": (
        "control_msgs/GripperCommand command",
        "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal",
        "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal",
    ),
    "control_msgs/action/ParallelGripperCommand": (
        "sensor_msgs/JointState command",
        "sensor_msgs/JointState state\nbool stalled\nbool reached_goal",
        "sensor_msgs/JointState state",
    ),
}
"""Goal, result and feedback of each action."""


class BadMessage(ValueError):
    """Bytes that are no message of the type, or values that do not fit it."""


def hash_of(type_name: str) -> str:
    """Return the hash of a message or service type. Raises KeyError for a type that is not known."""
    hashed: str = _store().hash_rihs01(type_name)
    return hashed


def is_known(type_name: str) -> bool:
    """Return whether this is the name of a message type with a known definition."""
    return type_name in _store().fielddefs


def message(type_name: str, values: Mapping[str, Any]) -> Any:
    """Return a message with these fields: numbers, texts, mappings, sequences. What is left out is zero.

    Raises BadMessage.
    """
    try:
        return _message(type_name, values)
    except (TypeError, ValueError, AttributeError, OverflowError) as error:
        raise BadMessage(f"values that do not fit {type_name}: {error}") from error


def packed(type_name: str, filled: Any) -> bytes:
    """Return a message in CDR. Raises BadMessage."""
    try:
        return bytes(_store().serialize_cdr(filled, type_name))
    except (TypeError, ValueError, AttributeError, AssertionError, OverflowError, struct.error) as error:
        raise BadMessage(f"values that do not fit {type_name}: {error}") from error


def encode(type_name: str, values: Mapping[str, Any]) -> bytes:
    """Return a message with these fields in CDR, as `message` and `packed`. Raises BadMessage."""
    return packed(type_name, message(type_name, values))


def decode(type_name: str, data: bytes) -> Any:
    """Return the message, with its fields as attributes. Raises BadMessage."""
    from rosbags.serde import SerdeError

    if len(data) > MOST_BYTES:
        raise BadMessage(f"{len(data)} bytes are more than a {type_name} may have")
    try:
        return _store().deserialize_cdr(data, type_name)
    except (SerdeError, IndexError, AssertionError, MemoryError, OverflowError) as error:
        raise BadMessage(f"{len(data)} bytes that are no {type_name}: {error}") from error


@cache
def _store() -> Typestore:
    return typestore(_SERVICES, _ACTIONS)


def typestore(
    services: Mapping[str, tuple[str, str]], actions: Mapping[str, tuple[str, str, str]]
) -> Typestore:
    """Return the common interfaces with these services and actions, and all types that belong to them."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    for name in _MESSAGES:
        store.fielddefs.pop(name, None)
    store.register(_parsed(_MESSAGES))
    definitions: dict[str, str] = {}
    for name, (goal, result, feedback) in actions.items():
        definitions |= {f"{name}_Goal": goal, f"{name}_Result": result, f"{name}_Feedback": feedback}
        uuid = "unique_identifier_msgs/UUID goal_id"
        definitions[f"{name}_FeedbackMessage"] = f"{uuid}\n{name}_Feedback feedback"
        definitions[f"{name}_SendGoal_Request"] = f"{uuid}\n{name}_Goal goal"
        definitions[f"{name}_SendGoal_Response"] = "bool accepted\nbuiltin_interfaces/Time stamp"
        definitions[f"{name}_GetResult_Request"] = uuid
        definitions[f"{name}_GetResult_Response"] = f"int8 status\n{name}_Result result"
    for name, (request, response) in services.items():
        definitions |= {f"{name}_Request": request, f"{name}_Response": response}
    store.register(_parsed(definitions))
    for name in (*services, *(f"{name}_{part}" for name in actions for part in ("SendGoal", "GetResult"))):
        store.register(_service_type(name))
    return store


def _service_type(name: str) -> Typesdict:
    """Return the type that stands for a service where it is hashed: its request, its response and its event."""
    from rosbags.interfaces import Nodetype

    def named(type_name: str) -> Any:
        return Nodetype.NAME, type_name

    parts = [(part, f"{name}_{part.capitalize()}") for part in ("request", "response")]
    event: list[tuple[str, Any]] = [
        (part, (Nodetype.SEQUENCE, (named(type_name), 1))) for part, type_name in parts
    ]
    messages = [*parts, ("event", f"{name}_Event")]
    return {
        f"{name}_Event": ([], [("info", named("service_msgs/msg/ServiceEventInfo")), *event]),
        name: ([], [(f"{part}_message", named(type_name)) for part, type_name in messages]),
    }


def _parsed(definitions: Mapping[str, str]) -> Typesdict:
    """Return the definitions as rosbags holds them."""
    from rosbags.typesys import get_types_from_msg

    parsed: Typesdict = {}
    for name, definition in definitions.items():
        types = get_types_from_msg(definition, name)
        # rosbags puts `msg` into the name of a service's message, which is not in the name that ROS hashes.
        ((constants, fields),) = types.values()
        parsed[name] = (constants, fields)
    return parsed


def _message(type_name: str, values: Mapping[str, Any]) -> Any:
    """Return a message of rosbags with these fields."""
    store = _store()
    fields = dict(store.fielddefs[type_name][1])
    if unknown := set(values) - set(fields):
        raise ValueError(f"there is no field {', '.join(sorted(unknown))}")
    return store.types[type_name](
        **{name: _value(kind, about, values.get(name)) for name, (kind, about) in fields.items()}
    )


def _value(kind: Any, about: Any, value: Any) -> Any:
    """Return the value of a field as rosbags takes it; None stands for zero."""
    from rosbags.interfaces import Nodetype

    if kind == Nodetype.NAME:
        return _message(about, value or {})
    if kind == Nodetype.BASE:
        name = about[0]
        if name in ("string", "wstring"):
            return "" if value is None else str(value)
        return (
            (0.0 if name.startswith("float") else False if name == "bool" else 0) if value is None else value
        )
    (inner_kind, inner), length = about
    if inner_kind == Nodetype.BASE and inner[0] not in ("string", "wstring"):
        dtype = {"octet": "uint8", "char": "uint8"}.get(inner[0], inner[0])
        return np.asarray(np.zeros(length * (kind == Nodetype.ARRAY)) if value is None else value, dtype)
    return [_value(inner_kind, inner, item) for item in value or ()]
