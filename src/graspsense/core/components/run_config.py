"""The settings of a grasp that do not belong to a component."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any

from attrs import Attribute, frozen

from graspsense.core.components.setting import CHANGES_NO_RESULT, setting
from graspsense.core.values.mounting import Mounting


def _are_mountings(_config: object, _attribute: Attribute[Any], values: Mapping[str, str]) -> None:
    for name, text in values.items():
        try:
            Mounting.parse(text)
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from None


@frozen(kw_only=True)
class RunConfig:
    """The `[run]` table: settings that apply to a grasp with any components."""

    seed: int = setting(default=0, minimum=0, meaning="Determines everything that is drawn at random.")
    hold_s: float = setting(
        default=0.25,
        unit="s",
        minimum=0.0,
        maximum=inf,
        plausible=(0.0, 3600.0),
        meaning="Time for which a steady grasp is held before the fingers open.",
    )
    opening_timeout_s: float = setting(
        default=5.0,
        unit="s",
        above=0.0,
        plausible=(0.05, 120.0),
        meaning="Longest duration of opening, of taring, and of releasing.",
    )
    frame_timeout_s: float = setting(
        default=0.1,
        unit="s",
        above=0.0,
        maximum=inf,
        plausible=(0.001, 10.0),
        meaning="Time without a frame after which the device counts as lost; at least three periods of the gripper.",
    )
    grasp_timeout_s: float = setting(
        default=300.0,
        unit="s",
        above=0.0,
        plausible=(0.1, 3600.0),
        meaning="Longest duration of approach, squeeze and hold together, after which the grasp is ended.",
    )
    late_periods: float = setting(
        default=5.0,
        above=0.0,
        maximum=inf,
        meaning="A frame older than this many periods counts as late.",
    )
    first_effort_n: float = setting(
        default=12.0,
        unit="N",
        above=0.0,
        maximum=inf,
        plausible=(0.1, 100.0),
        meaning="Limit of the effort on a real gripper before the first contact; above its breakaway effort, below a "
        "squeeze.",
    )
    first_speed_m_s: float = setting(
        default=0.015,
        unit="m/s",
        above=0.0,
        maximum=inf,
        plausible=(1e-4, 0.1),
        meaning="Limit of the speed on a real gripper before the first contact.",
    )
    effort_ceiling_n: float | None = setting(
        default=None,
        unit="N",
        above=0.0,
        plausible=(0.1, 200.0),
        meaning="Greatest effort with which the fingers close on anything that can be hurt, whatever the controller "
        "commands; not set: a quarter above the force that it asks for (20 N where it asks for none), plus the "
        "friction of the drive, in the approach at least first_effort_n.",
    )
    stop_when_sure: bool = setting(
        default=False,
        meaning="Whether the squeeze ends as soon as the prediction set has one label; needs a model with checkpoints "
        "(graspsense train --checkpoints).",
    )
    mounting: Mapping[str, str] = setting(
        factory=dict,
        validator=_are_mountings,
        effect=CHANGES_NO_RESULT,
        meaning='Where frames of the gripper are, kept with each trial: `tool = "tool0 of arm.urdf"`, '
        '`thumb = "0 20 95 mm, 0 0 90 deg in tool"`.',
    )
