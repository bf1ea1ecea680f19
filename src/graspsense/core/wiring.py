"""Checks from their declarations that components fit together, before a gripper is opened."""

from __future__ import annotations

from collections.abc import Iterator

from graspsense.core.config import SelectedComponent, Settings
from graspsense.core.entries import Channel, ControllerEntry, FeatureSetEntry, SensorBackendEntry
from graspsense.core.errors import WiringError
from graspsense.core.plugins import Component


def check(settings: Settings) -> None:
    """Check channels, units, rates and command kinds.

    Raises WiringError that lists every mismatch, with both components, what one provides and what the other requires.
    """
    gripper = settings.gripper.component
    misfits = [
        *_channel_misfits(gripper, settings.controller.component),
        *_channel_misfits(gripper, settings.features.component),
        *_command_misfits(gripper, settings.controller),
    ]
    if misfits:
        head = (
            "the components do not fit together" if len(misfits) > 1 else "two components do not fit together"
        )
        raise WiringError("\n".join([f"{head}:", *(f"  {one}" for one in misfits)]))


def _channel_misfits(gripper: Component, user: Component) -> Iterator[str]:
    assert isinstance(gripper.entry, SensorBackendEntry)
    assert isinstance(user.entry, ControllerEntry | FeatureSetEntry)
    given = {channel.name: channel for channel in gripper.entry.channels}
    for wanted in user.entry.requires:
        needs = f"{_named(user)} needs the channel {_described(wanted)}"
        have = given.get(wanted.name)
        if have is None:
            lacks = f"which {_named(gripper)} does not have (it has: {', '.join(given) or 'none'})"
            yield f"{needs}, {lacks}. {_choose(gripper, user)}"
        elif have.unit != wanted.unit:
            yield f"{needs}, but {_named(gripper)} gives it in {have.unit}. {_choose(gripper, user)}"
        elif have.rate_hz < wanted.rate_hz:
            rate = f"at {have.rate_hz:g} Hz" if have.rate_hz else "at no promised rate"
            yield f"{needs}, but {_named(gripper)} gives it {rate}. {_choose(gripper, user)}"


def _command_misfits(gripper: Component, chosen: SelectedComponent) -> Iterator[str]:
    controller = chosen.component
    assert isinstance(gripper.entry, SensorBackendEntry)
    assert isinstance(controller.entry, ControllerEntry)
    sent = (chosen.config.sends,) if controller.entry.alternatives else controller.entry.commands
    for kind in sent:
        if kind not in gripper.entry.accepts:
            kinds = ", ".join(gripper.entry.accepts) or "none"
            yield (
                f"{_named(controller)} commands {kind}, which {_named(gripper)} does not take "
                f"(it takes: {kinds}). {_choose(gripper, controller)}"
            )


def _named(component: Component) -> str:
    return f"{component.table} {component.qualified}"


def _described(channel: Channel) -> str:
    rate = f" at {channel.rate_hz:g} Hz or more" if channel.rate_hz else ""
    return f"{channel.name!r} in {channel.unit}{rate}"


def _choose(gripper: Component, user: Component) -> str:
    return f"Choose another {gripper.table}.type or {user.table}.type (graspsense plugins list)"
