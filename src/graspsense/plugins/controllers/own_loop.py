"""How a law squeezes with a gripper that closes by itself: it stops at the contact and raises the force in steps."""

from __future__ import annotations

from math import nan
from typing import Any, Final, NamedTuple

from attrs import frozen

from graspsense.plugin_api import setting

STEPS: Final = "the force of the approach, from the contact on raised in steps to the probing force"
"""What these laws send to a gripper that closes by itself, as `run` shows it."""


@frozen(kw_only=True, slots=False)
class OwnLoopConfig:
    """The forces that are sent with a target or a speed."""

    approach_force_n: float = setting(
        default=5.0,
        unit="N",
        above=0.0,
        plausible=(0.1, 200.0),
        meaning="For a gripper that closes by itself: force that moves the fingers to the contact, at most that asked.",
    )
    force_step_n: float = setting(
        default=5.0,
        unit="N",
        above=0.0,
        plausible=(0.01, 200.0),
        meaning="For a gripper that closes by itself: by how much the force rises in a step.",
    )
    step_time_s: float = setting(
        default=0.1,
        unit="s",
        above=0.0,
        plausible=(0.01, 5.0),
        meaning="For a gripper that closes by itself: time of a step, and for which the fingers stop at the contact.",
    )


class Raised(NamedTuple):
    """The force that is sent, since when, and the gap at which the fingers stop; NaN where they close on."""

    force_n: float
    since_t_s: float
    stop_gap_m: float


def approaching(params: Any) -> Raised:
    """Return what is sent until the contact."""
    return Raised(min(params.approach_force_n, params.probing_force_n), 0.0, nan)


def rises(now: Raised, most_n: float) -> bool:
    """Return whether the fingers still stop at the contact, or the force is still below `most_n`."""
    return now.force_n < most_n or now.stop_gap_m == now.stop_gap_m


def raised(params: Any, now: Raised, t_s: float, most_n: float) -> Raised:
    """Return what is sent in this tick of the squeeze: the same, or one step more, up to `most_n`."""
    if t_s - now.since_t_s >= params.step_time_s and rises(now, most_n):
        return Raised(min(now.force_n + params.force_step_n, most_n), t_s, nan)
    return now
