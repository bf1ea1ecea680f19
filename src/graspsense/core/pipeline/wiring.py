"""Checks from their declarations that components fit together, before a gripper is opened."""

from __future__ import annotations

from collections.abc import Iterator

from graspsense.core.components.channels import declared_shape
from graspsense.core.components.config import SelectedComponent, Settings, select_component
from graspsense.core.components.registry import Component, installed
from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.errors import GraspsenseError, WiringError


def check(settings: Settings) -> None:
    """Check channels, units, rates and command kinds.

    Raises WiringError that lists every mismatch, with both components, what one provides and what the other requires,
    and PluginUnavailable if a component does not declare what it provides or requires.
    """
    misfits = [*_misfits(settings.gripper, settings.controller, settings.features)]
    if misfits:
        head = (
            "the components do not fit together" if len(misfits) > 1 else "two components do not fit together"
        )
        raise WiringError(
            "\n".join([f"{head}:", *(f"  {one}" for one in misfits), f"  {_fitting(settings)}"])
        )


def _fitting(settings: Settings) -> str:
    """Return which installed grippers offer what the controller and the features need, with their default settings."""
    users = (settings.controller, settings.features)
    fitting = [
        gripper.qualified
        for gripper in installed().components("sensor-backend")
        if gripper.qualified != settings.gripper.component.qualified and _offers(gripper, users)
    ]
    needed = " and ".join(_named(user.component) for user in users)
    if not fitting:
        return f"No other installed gripper offers what {needed} need"
    return f"Installed grippers that offer what {needed} need: {', '.join(sorted(fitting))}"


def _offers(gripper: Component, users: tuple[SelectedComponent, SelectedComponent]) -> bool:
    try:
        chosen = select_component("sensor-backend", gripper.qualified)
        return not [*_misfits(chosen, *users)]
    except GraspsenseError:
        return False  # it cannot be told without its driver or its settings


def _misfits(
    gripper: SelectedComponent, controller: SelectedComponent, features: SelectedComponent
) -> Iterator[str]:
    yield from _channel_misfits(gripper, controller)
    yield from _channel_misfits(gripper, features)
    yield from _command_misfits(gripper, controller)


def _channel_misfits(gripper: SelectedComponent, user: SelectedComponent) -> Iterator[str]:
    given: dict[str, Channel] = {channel.name: channel for channel in gripper.declared.channels}
    provider, choose = _named(gripper.component), _choose(gripper.component, user.component)
    if gripper.component.channels_vary():
        choose += f", or other settings of [{gripper.component.table}]: its channels depend on them"
    for wanted in user.declared.requires:
        needs = f"{_named(user.component)} needs the channel {_described(wanted)}"
        have = given.get(wanted.name)
        if have is None:
            lacks = f"which {provider} does not have{_settings_hint(gripper)} (it has: {', '.join(given) or 'none'})"
            yield f"{needs}, {lacks}. {choose}"
        elif have.unit != wanted.unit:
            yield f"{needs}, but {provider} gives it in {have.unit}. {choose}"
        elif isinstance(wanted, TactileArray | FastChannel) and not _fits(wanted, have):
            yield f"{needs} as {_layout(wanted)}, but {provider} gives it as {_layout(have)}. {choose}"
        elif have.rate_hz < wanted.rate_hz:
            rate = f"at {have.rate_hz:g} Hz" if have.rate_hz else "at no promised rate"
            yield f"{needs}, but {provider} gives it {rate}. {choose}"


def _fits(wanted: Channel, have: Channel) -> bool:
    """Return whether a channel has the kind and the shape that is wanted, so that the same code reads it."""
    return type(have) is type(wanted) and declared_shape(have) == declared_shape(wanted)


def _layout(channel: Channel) -> str:
    if isinstance(channel, TactileArray):
        return f"an array of {channel.cells} cells"
    if isinstance(channel, FastChannel):
        return f"{channel.samples} samples a tick of {', '.join(channel.axes)}"
    return "one number a tick"


def _settings_hint(gripper: SelectedComponent) -> str:
    return " with these settings" if gripper.component.channels_vary() else ""


def _command_misfits(gripper: SelectedComponent, controller: SelectedComponent) -> Iterator[str]:
    law, accepted = controller.declared, gripper.declared.accepts
    sent = (controller.config.sends,) if law.alternatives else law.commands
    for kind in sent:
        if kind not in accepted:
            kinds = ", ".join(accepted) or "none"
            yield (
                f"{_named(controller.component)} commands {kind}, which {_named(gripper.component)} does not take "
                f"(it takes: {kinds}). {_choose(gripper.component, controller.component)}"
            )


def _named(component: Component) -> str:
    return f"{component.table} {component.qualified}"


def _described(channel: Channel) -> str:
    rate = f" at {channel.rate_hz:g} Hz or more" if channel.rate_hz else ""
    return f"{channel.name!r} in {channel.unit}{rate}"


def _choose(gripper: Component, user: Component) -> str:
    return f"Choose another {gripper.table}.type or {user.table}.type (graspsense plugins list)"
