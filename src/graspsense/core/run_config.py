"""The settings of a grasp that belong to no component."""

from __future__ import annotations

from math import inf

from attrs import field, frozen
from attrs.validators import ge, gt, instance_of, lt


@frozen(kw_only=True)
class RunConfig:
    """The `[run]` table: what holds for a grasp whatever the components are."""

    seed: int = field(default=0, validator=[instance_of(int), ge(0)])
    """Decides everything drawn at random."""
    hold_s: float = field(default=0.25, validator=ge(0.0))
    """How long a steady grasp is held before the fingers open."""
    opening_timeout_s: float = field(default=5.0, validator=[gt(0.0), lt(inf)])
    """Opening, taring and releasing each take at most this long."""
    frame_timeout_s: float = field(default=0.1, validator=gt(0.0))
    """No frame for this long on a device clock: the device is lost."""
    grasp_timeout_s: float = field(default=300.0, validator=[gt(0.0), lt(inf)])
    """Longest approach, squeeze and hold together: the end of a controller that never gives up by itself."""
    late_periods: float = field(default=5.0, validator=gt(0.0))
    """A frame older than this many periods counts as late."""
    first_effort_n: float = field(default=12.0, validator=gt(0.0))
    """Most effort on a real gripper until a contact has once been seen; above its breakaway, below a squeeze."""
    first_speed_m_s: float = field(default=0.015, validator=gt(0.0))
    """Most speed on a real gripper until a contact has once been seen."""
