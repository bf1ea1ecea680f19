"""A component with its config, made of plain values that are checked as strictly as those of a file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from textwrap import indent
from typing import Any

from attrs import frozen

from graspsense.core.components.caller import option
from graspsense.core.components.entries import Role
from graspsense.core.components.registry import Component, installed
from graspsense.core.components.strict import (
    InvalidValue,
    ValidationFailed,
    implausible_values,
    plain,
    structured,
)
from graspsense.core.settings.layers import dotted
from graspsense.core.values.errors import ConfigError, PluginUnavailable, UnknownName


class ImplausibleSettings(ConfigError):
    """Settings are allowed, but outside of their plausible ranges; `resolve(..., force=True)` accepts them."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.add_note(f"Check the unit. If the value is meant, add {option('force', python='force=True')}")


@frozen(eq=False)
class SelectedComponent:
    """A component that a pipeline selects, with its config."""

    component: Component
    config: Any

    def create(self) -> Any:
        """Return the component built from its config. Raises PluginUnavailable."""
        return self.component.create(self.config)

    @cached_property
    def declared(self) -> Any:
        """Its entry with all that its class declares under this config. Raises PluginUnavailable.

        It is found once: the channels of a replay are those of its recording, which is read for them.
        """
        return self.component.declared(self.config)


def build(component: Component, values: Mapping[str, Any], *, force: bool = True) -> Any:
    """Return the config of a component from plain values; without `force` they must be in their plausible ranges.

    Raises ConfigError that lists all errors, of which ImplausibleSettings is one, and PluginUnavailable.
    """

    def listed(problems: Iterable[InvalidValue]) -> str:
        return listed_errors(
            [f"{dotted((component.table, *each.path))}: {each.words()}" for each in problems]
        )

    try:
        config: Any = structured(values, component.config_class(), component.qualified)
    except ValidationFailed as misfit:
        raise ConfigError(listed(misfit.problems)) from None
    if not force and (doubts := implausible_values(config)):
        raise ImplausibleSettings(listed(doubts))
    return config


def create(role: Role, name: str, /, **config: Any) -> Any:
    """Return a component by role and name. Its config is checked as strictly as one from a file.

    Raises UnknownName, PluginUnavailable, ConfigError.

    >>> create("controller", "hybrid", closing_speed_m_s=0.01).config.closing_speed_m_s
    0.01
    """
    return select_component(role, name, **config).create()


def select_component(role: Role, name: str, **config: Any) -> SelectedComponent:
    """Return a component by role and name with its config, without constructing it. Raises like `create`."""
    component = installed().find(role, name)
    return SelectedComponent(component, build(component, config))


def recipe_of(role: Role, part: Any) -> tuple[str, dict[str, Any]]:
    """Return the name and the plain values from which `create` makes an equal component.

    Raises UnknownName if no plugin declares its class, ConfigError if plain values cannot represent its config.
    """
    cls = type(part)
    for component in installed().components(role):
        # A component of another package is not imported for the comparison.
        if component.entry.target.split(":")[0].split(".")[0] != cls.__module__.split(".")[0]:
            continue
        try:
            same = component.component_class() is cls
        except PluginUnavailable:
            same = False
        if same:
            values = {key: value for key, value in plain(part.config).items() if value is not None}
            if plain(build(component, values)) != plain(part.config):
                raise ConfigError(f"{component.qualified}: its settings are not all plain values")
            return component.qualified, values
    raise UnknownName(f"{cls.__module__}.{cls.__qualname__} is not a {role} that a plugin declares")


def listed_errors(complaints: Sequence[str]) -> str:
    """Return the errors in settings as one text, with their number where there are several."""
    if len(complaints) == 1:
        return complaints[0]
    return "\n".join(
        [f"{len(complaints)} errors in the settings:", *(indent(complaint, "  ") for complaint in complaints)]
    )
