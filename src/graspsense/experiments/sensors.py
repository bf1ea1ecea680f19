"""The sensors of a simulated gripper: those of its settings, or ideal ones, as its class declares them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from attrs import evolve

from graspsense.core.components.roles import BatchBackend
from graspsense.core.settings.selected import SelectedComponent


def with_ideal_sensors(gripper: SelectedComponent) -> SelectedComponent:
    """Return this gripper with ideal sensors; unchanged if its class declares none (`BatchBackend.ideal_sensors`)."""
    return SelectedComponent(gripper.component, evolve(gripper.config, **_ideal(gripper)))


def sensors_of(gripper: SelectedComponent) -> str:
    """Return which sensors its settings choose, as `pads` or `ideal`; empty if there is no choice."""
    return ", ".join(str(getattr(gripper.config, key)) for key in _ideal(gripper))


def _ideal(gripper: SelectedComponent) -> Mapping[str, Any]:
    backend = gripper.component.component_class()
    return backend.ideal_sensors if issubclass(backend, BatchBackend) else {}
