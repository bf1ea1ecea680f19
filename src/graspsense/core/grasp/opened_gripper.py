"""Opening a gripper, describing it with what its class and the controller declare, and how long it may take."""

from __future__ import annotations

from typing import Any, Final

from attrs import evolve

from graspsense.core.components.roles import Controller, SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.values.channel import Channel
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ComponentFailed, DeviceLost, GraspsenseError, named, place_of
from graspsense.core.values.fingers import fingers_in_words, fingers_of
from graspsense.core.values.mounting import Mounting


def opened_gripper(backend: SensorBackend[Any], seed: int) -> DeviceInfo:
    """Open the gripper. An exception that is not ours names its class."""
    name = f"{type(backend).__module__}.{type(backend).__qualname__}"
    try:
        info = backend.open(seed)
    except GraspsenseError:
        raise
    except SystemExit as error:
        raise DeviceLost(f"`open` of the gripper {name} raised {named(error)}{place_of(error)}") from error
    except Exception as error:
        error.add_note(f"`open` of the gripper {name} was running")
        raise
    if not isinstance(info, DeviceInfo):
        raise ComponentFailed(
            f"`open` of the gripper {name} returned {info!r}: return graspsense.plugin_api.DeviceInfo"
        )
    return info


def described(
    info: DeviceInfo, backend: SensorBackend[Any], controller: Controller[Any], run: RunConfig
) -> DeviceInfo:
    """Return the open gripper with its channels, its mounting, and notes on its commands and its fingers."""
    channels = info.channels or _declared(backend)
    fingers = fingers_in_words(fingers_of(channels))
    further = (*_becoming(backend, controller), *([fingers] if fingers else []))
    return evolve(
        info,
        channels=channels,
        notes=(*info.notes, *(note for note in further if note not in info.notes)),
        mounting={**info.mounting, **{name: Mounting.parse(text) for name, text in run.mounting.items()}},
    )


def _becoming(backend: SensorBackend[Any], controller: Controller[Any]) -> tuple[str, ...]:
    """Return sentences on what the controller becomes with a gripper that closes by itself."""
    sends = getattr(controller.config, "sends", None)
    sent = (
        (sends,) if sends is not None else getattr(type(controller), "commands", tuple(backend.closes_itself))
    )
    becomes = type(controller).becomes
    notes = []
    for kind in filter(backend.closes_itself.__contains__, sent):
        notes.append(f"the gripper closes by itself: a {kind} becomes {backend.closes_itself[kind]}")
        if kind in becomes:
            notes.append(f"as a {kind}, the controller sends {becomes[kind]}")
    if notes and backend.command_delay_s:
        notes.append(
            f"the gripper acts on a command up to {backend.command_delay_s * 1e3:g} ms after it is sent"
        )
    return tuple(notes)


def _declared(backend: SensorBackend[Any]) -> tuple[Channel, ...]:
    """Return the channels of an open gripper; none where the class does not declare them."""
    try:
        return tuple(backend.channels)
    except NotImplementedError:
        return ()


FRAME_PERIODS: Final = 3.0
"""How many of its own periods a gripper may take for a frame, if that is longer than `run.frame_timeout_s`."""


def frame_timeout_s(run: RunConfig, info: DeviceInfo) -> float:
    """Return how long to wait for a frame: `run.frame_timeout_s`, or three periods of a gripper that is slower."""
    return max(run.frame_timeout_s, FRAME_PERIODS / info.rate_hz)


def no_frame(run: RunConfig, info: DeviceInfo) -> str:
    """Return the message for a gripper that gave no frame for that long."""
    return (
        f"no frame from {info.name} for {frame_timeout_s(run, info) * 1e3:.0f} ms, although it declares "
        f"{info.rate_hz:g} Hz: check its cable and power, then `graspsense devices`. run.frame_timeout_s sets how long "
        "to wait"
    )


def seconds_at_most(run: RunConfig) -> float:
    """Return the longest time (s) of a grasp with opening, taring and release."""
    return run.grasp_timeout_s + 3.0 * run.opening_timeout_s


def overdue(run: RunConfig) -> str:
    """Return the reason given for a grasp that took longer."""
    return (
        f"no end after {seconds_at_most(run):g} s of ticks: the controller did not end the grasp "
        "(run.grasp_timeout_s)"
    )
