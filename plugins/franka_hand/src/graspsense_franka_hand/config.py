"""Settings of a Franka Hand: its address, its calibration, and the emulation."""

from __future__ import annotations

from math import inf
from typing import Any, Literal

from attrs import frozen

from graspsense.plugin_api import NAMES_INPUT, setting

EMULATED = "emulated"


@frozen(kw_only=True)
class FrankaFaults:
    """Faults of the emulated hand, by default none. Times are counted from its start."""

    unplug_at_s: float = setting(
        default=inf, unit="s", minimum=0.0, meaning="Time at which the cable is pulled; inf: never."
    )
    mood: Literal["well", "silent", "damaged", "late", "old"] = setting(
        default="well",
        meaning="silent: no state and no reply. damaged: states are cut, replies are wrong. late: all comes after "
        "late_s. old: it speaks another version of the protocol.",
    )
    mood_at_s: float = setting(default=0.0, unit="s", minimum=0.0, meaning="Time from which on mood acts.")
    late_s: float = setting(
        default=0.3,
        unit="s",
        above=0.0,
        plausible=(1e-4, 10.0),
        meaning="Time by which a state or a reply is late.",
    )

    def mood_at(self, now_s: float) -> str:
        """Return the mood at this time."""
        return self.mood if now_s >= self.mood_at_s else "well"


@frozen(kw_only=True)
class FrankaConfig:
    """A Franka Hand. The keys from `body` on are for `host = "emulated"` only."""

    host: str = setting(
        default="172.16.0.2",
        meaning="Address of the robot's control; or emulated, a hand in software.",
    )
    calibration: str = setting(
        default="",
        effect=NAMES_INPUT,
        meaning="Folder of calibrations; empty: that of the user; none: run without.",
    )
    body: str = setting(
        default="sim",
        meaning="Emulated only: a backend with a virtual clock that takes an effort, as the fingers.",
    )
    body_config: dict[str, Any] = setting(
        factory=dict,
        meaning="Emulated only: settings of that backend, as in its table [gripper].",
    )
    object: str | None = setting(
        default=None,
        effect=NAMES_INPUT,
        meaning="Emulated only: the object between the fingers; not set: the default of body.",
    )
    faults: FrankaFaults = setting(factory=FrankaFaults, meaning="Emulated only: faults of the hand.")

    def __attrs_post_init__(self) -> None:
        if self.host == EMULATED:
            return
        defaults = FrankaConfig(host=EMULATED)
        for key in ("object", "body", "body_config", "faults"):
            if getattr(self, key) != getattr(defaults, key):
                raise ValueError(
                    f"{key} is for the emulated hand, but host is {self.host!r}: leave it out, or set gripper.host to "
                    "emulated"
                )
