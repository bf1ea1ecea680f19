"""The settings of a grasp that do not belong to a component."""

from __future__ import annotations

from math import inf

from attrs import field, frozen
from attrs.validators import ge, gt, instance_of, lt


@frozen(kw_only=True)
class RunConfig:
    """The `[run]` table: settings that apply to a grasp with any components."""

    seed: int = field(default=0, validator=[instance_of(int), ge(0)])
    """Determines everything that is drawn at random."""
    hold_s: float = field(default=0.25, validator=ge(0.0))
    """Time for which a steady grasp is held before the fingers open."""
    opening_timeout_s: float = field(default=5.0, validator=[gt(0.0), lt(inf)])
    """Longest duration of opening, of taring, and of releasing."""
    frame_timeout_s: float = field(default=0.1, validator=gt(0.0))
    """Time without a frame after which the device counts as lost; at least three periods of the gripper."""
    grasp_timeout_s: float = field(default=300.0, validator=[gt(0.0), lt(inf)])
    """Longest duration of approach, squeeze and hold together, after which the grasp is ended."""
    late_periods: float = field(default=5.0, validator=gt(0.0))
    """A frame older than this many periods counts as late."""
    first_effort_n: float = field(default=12.0, validator=gt(0.0))
    """Limit of the effort on a real gripper before the first contact; above its breakaway effort, below a squeeze."""
    first_speed_m_s: float = field(default=0.015, validator=gt(0.0))
    """Limit of the speed on a real gripper before the first contact."""
