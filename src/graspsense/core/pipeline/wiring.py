"""Checks from their declarations that components fit together, before a gripper is opened."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any

from attrs import asdict

from graspsense.core.components.caller import option, set_option
from graspsense.core.components.channels import declared_dtype, declared_shape
from graspsense.core.components.entries import PipelineEntry
from graspsense.core.components.registry import Component, installed
from graspsense.core.components.roles import FeatureSet
from graspsense.core.settings.layers import read_toml
from graspsense.core.settings.resolved import Settings
from graspsense.core.settings.selected import SelectedComponent, select_component
from graspsense.core.values.channel import FLOATS, Channel, FastChannel, TactileArray
from graspsense.core.values.errors import GraspsenseError, PluginUnavailable, WiringError
from graspsense.core.values.fingers import FingerForce


def check(settings: Settings) -> None:
    """Check channels, units, rates, command kinds, and the least force, speed and step of the gripper.

    Raises WiringError that lists every mismatch, with both components, what one provides and what the other requires,
    and PluginUnavailable if a component does not declare what it provides or requires.
    """
    users = (settings.controller, settings.features)
    misfits = [misfit for user in users for misfit in _channel_misfits(settings.gripper, user)]
    misfits += _command_misfits(settings.gripper, settings.controller)
    if misfits:
        advice = [*_pipelines_of(settings), *_fitting(settings)]
        raise WiringError("\n  ".join(["the components do not fit together:", *misfits, *advice]))
    if too_small := [*_too_small(settings)]:
        raise WiringError("\n  ".join(["the gripper cannot do as little as is asked:", *too_small]))


def check_recording(
    channels: Iterable[Channel], source: str, *users: SelectedComponent | FeatureSet[Any]
) -> None:
    """Check that a recording with these channels has those that controller and features need.

    Raises WiringError that names each one that it lacks, and the arrays that it has with the options that choose them.
    """
    given = {channel.name: channel for channel in channels}
    misfits = [misfit for user in users for misfit in _misfits_of(user, given, "this recording")]
    if misfits:
        raise WiringError(f"{source}: {'; '.join(misfits)}")


def _too_small(settings: Settings) -> Iterator[str]:
    """Yield what the controller asks for, or a limit of the run allows, that is less than the gripper can do."""
    try:
        gripper, law, run = settings.gripper.create(), settings.controller.create(), settings.run
    except PluginUnavailable:
        return  # a driver that is missing is told where the gripper is opened
    least = (
        ("force", "N", gripper.least_force_n, law.gentlest_force_n(), 1.0),
        ("speed", "mm/s", gripper.least_speed_m_s, law.asked_speed_m_s(), 1e3),
        ("step", "mm", gripper.least_step_m, law.asked_step_m(), 1e3),
    )
    asks, cannot = _named(settings.controller.component), _named(settings.gripper.component)
    if gripper.closes_itself and "effort" in sent_kinds(settings.controller):
        yield f"{asks} commands an effort, which has no speed, and {cannot} closes by itself. Send one of its kinds"
    for what, unit, can, asked, factor in least:
        if asked is not None and not isinstance(asked, int | float):
            yield f"{asks} asks for a {what} of {asked!r}. Let its class return a number in SI units, or None"
        elif asked is not None and asked < can:
            yield (
                f"{asks} asks for a {what} of {asked * factor:g} {unit}, and the least {what} of {cannot} is "
                f"{can * factor:g} {unit}. Ask for at least that, or choose another gripper"
            )
    interval_s = law.asked_interval_s()
    if interval_s is not None and interval_s < gripper.command_delay_s:
        yield (
            f"{asks} waits {interval_s * 1e3:g} ms for a command to act, and {cannot} may take "
            f"{gripper.command_delay_s * 1e3:g} ms. Let it wait at least as long"
        )
    limits = (
        ("first_effort_n", "force", "N", run.first_effort_n, gripper.least_force_n),
        ("effort_ceiling_n", "force", "N", run.effort_ceiling_n, gripper.least_force_n),
        ("first_speed_m_s", "speed", "m/s", run.first_speed_m_s, gripper.least_speed_m_s),
    )
    for key, what, unit, limit, can in limits:
        if limit is not None and limit < can:
            yield (
                f"run.{key} is {limit:g} {unit}, and {cannot} cannot keep that limit: its least {what} is {can:g} "
                f"{unit}. If that is not too much for the object: {set_option(f'run.{key}={can:g}')}"
            )


def _pipelines_of(settings: Settings) -> Iterator[str]:
    """Yield how to choose an installed pipeline that is for this gripper, and of which no setting is used yet."""
    gripper, used = settings.gripper.component, " ".join(settings.origins.values())
    for pipeline in installed().resources(PipelineEntry):
        if f"pipeline {pipeline.qualified}:" in used:
            continue
        try:
            values = read_toml(pipeline.file(), pipeline.qualified, "pipeline").values
        except GraspsenseError:
            continue  # it is told where it is asked for
        if values.get("gripper", {}).get("type") in (gripper.name, gripper.qualified):
            yield f"A pipeline for this gripper is installed: {option('pipeline', pipeline.name)}"


def _fitting(settings: Settings) -> Iterator[str]:
    """Yield which installed components to choose instead of those that do not fit, with their default settings."""
    gripper, users = settings.gripper, (settings.controller, settings.features)
    needed = " and ".join(_named(user.component) for user in users)
    yield f"Choose a gripper for {needed}: {_others(gripper, lambda other: all(_fit(other, user) for user in users))}"
    for user in users:
        if not _fit(gripper, user):
            yield (
                f"Or choose {user.component.table}.type for {_named(gripper.component)}: "
                f"{_others(user, lambda other: _fit(gripper, other))}"
            )


def _others(chosen: SelectedComponent, fits: Callable[[SelectedComponent], bool]) -> str:
    role, names = chosen.component.role, []
    for component in installed().components(role):
        # It cannot be told without its driver or its settings.
        with suppress(GraspsenseError):
            if component.qualified != chosen.component.qualified and fits(
                select_component(role, component.qualified)
            ):
                names.append(component.qualified)
    return ", ".join(sorted(names)) or "none is installed"


def _fit(gripper: SelectedComponent, user: SelectedComponent) -> bool:
    """Return whether a gripper has the channels, and takes the commands; what a law sends can follow from it."""
    law = user.declared if user.component.role == "controller" else None
    taken = not law or _choices(gripper, user) or {*gripper.declared.accepts} >= {*law.commands}
    return bool(taken) and not [*_channel_misfits(gripper, user)]


def _choices(gripper: SelectedComponent, user: SelectedComponent) -> list[str]:
    """Return the kinds of command that this gripper takes, of those among which a law has a choice."""
    law = user.declared
    kinds = (*law.commands, *law.alternatives) if law.alternatives else ()
    return [kind for kind in kinds if kind in gripper.declared.accepts]


def _channel_misfits(gripper: SelectedComponent, user: SelectedComponent) -> Iterator[str]:
    given = {channel.name: channel for channel in gripper.declared.channels}
    hint = ""
    if gripper.component.channels_vary():
        hint = f" with these settings of [{gripper.component.table}]"
    yield from _misfits_of(user, given, _named(gripper.component), hint)


def _misfits_of(
    user: SelectedComponent | FeatureSet[Any], given: Mapping[str, Channel], provider: str, hint: str = ""
) -> Iterator[str]:
    if isinstance(user, FeatureSet):
        table, name = "features", f"features {type(user).__name__}"
        requires = getattr(user, "requires", ())  # a set whose entry declares them has none of its own
    else:
        table, name, requires = user.component.table, _named(user.component), user.declared.requires
    for wanted in requires:
        needs, have = f"{name} needs the channel {_described(wanted)}", given.get(wanted.name)
        arrays = _arrays(table, user.config, wanted, given)
        if have is None:
            yield f"{needs}, which {provider} does not have{hint} (it has: {', '.join(given) or 'none'}){arrays}"
        elif have.unit != wanted.unit:
            yield f"{needs}, but {provider} gives it in {have.unit}{arrays}"
        elif not _fits(wanted, have, table):
            yield f"{needs} as {_layout(wanted)}, but {provider} gives it as {_layout(have)}{arrays}"
        elif have.rate_hz < wanted.rate_hz:
            rate = f"at {have.rate_hz:g} Hz" if have.rate_hz else "at no promised rate"
            yield f"{needs}, but {provider} gives it {rate}"


def _arrays(table: str, config: Any, wanted: Channel, given: Mapping[str, Channel]) -> str:
    """Return the options that choose an array that there is, for a component whose settings name its array."""
    named = [
        key for key, value in asdict(config).items() if wanted.name in map(str.strip, str(value).split(","))
    ]
    words = ""
    for channel in given.values():
        if named and isinstance(channel, TactileArray):
            layout = {
                named[0]: channel.name, "unit": channel.unit, "rows": channel.rows or 1,
                "columns": channel.columns or channel.cells, "components": channel.components, "dtype": channel.dtype,
            }  # fmt: skip
            changed = [
                f"{table}.{key}={value}"
                for key, value in layout.items()
                if getattr(config, key, value) != value
            ]
            words += f". For its array {channel.name}: {set_option(*changed)}"
    return words


def _fits(wanted: Channel, have: Channel, table: str) -> bool:
    """Return whether a channel has the kind and the shape that is wanted, so that the same code reads it.

    Features read the samples of a fast channel, not how many come in a tick.
    """
    if wanted.name == "pads" and not isinstance(wanted, TactileArray):
        return True  # the images of fingertips of any size
    if type(have) is not type(wanted) and not (type(wanted) is Channel and isinstance(have, FingerForce)):
        return False
    if table == "features" and isinstance(wanted, FastChannel):
        return declared_shape(have)[1:] == declared_shape(wanted)[1:]
    return (declared_shape(have), declared_dtype(have)) == (declared_shape(wanted), declared_dtype(wanted))


def _layout(channel: Channel) -> str:
    if isinstance(channel, TactileArray):
        cells = " x ".join(map(str, channel.shape))
        return f"an array of {cells} {'cells' if channel.dtype == FLOATS else channel.dtype}"
    if isinstance(channel, FastChannel):
        return f"{channel.samples} samples a tick of {', '.join(channel.axes)}"
    return "one number a tick"


def sent_kinds(controller: SelectedComponent) -> tuple[str, ...]:
    """Return the kinds of command that a controller sends with its settings."""
    law = controller.declared
    kinds: tuple[str, ...] = (controller.config.sends,) if law.alternatives else law.commands
    return kinds


def _command_misfits(gripper: SelectedComponent, controller: SelectedComponent) -> Iterator[str]:
    accepted = gripper.declared.accepts
    for kind in sent_kinds(controller):
        if kind not in accepted:
            choices = _choices(gripper, controller)
            instead = f". Try -o controller.sends={choices[0]}" if choices else ""
            yield (
                f"{_named(controller.component)} commands {kind}, which {_named(gripper.component)} does not take "
                f"(it takes: {', '.join(accepted) or 'none'}){instead}"
            )


def _named(component: Component) -> str:
    return f"{component.table} {component.qualified}"


def _described(channel: Channel) -> str:
    rate = f" at {channel.rate_hz:g} Hz or more" if channel.rate_hz else ""
    return f"{channel.name!r} in {channel.unit}{rate}"
