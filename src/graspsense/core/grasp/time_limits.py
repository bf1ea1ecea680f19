"""How long a gripper may take for a frame, and a grasp in all, and what is said if it takes longer."""

from __future__ import annotations

from typing import Final

from graspsense.core.components.run_config import RunConfig
from graspsense.core.values.device import DeviceInfo

FRAME_PERIODS: Final = 3.0
"""How many of its own periods a gripper may take for a frame, if that is longer than `run.frame_timeout_s`."""


def frame_timeout_s(run: RunConfig, info: DeviceInfo) -> float:
    """Return how long to wait for a frame: `run.frame_timeout_s`, or three periods of a gripper that is slower."""
    return max(run.frame_timeout_s, FRAME_PERIODS / info.rate_hz)


def no_frame(run: RunConfig, info: DeviceInfo) -> str:
    """Return the message for a gripper that gave no frame for that long."""
    return (
        f"no frame from {info.name} for {frame_timeout_s(run, info) * 1e3:.0f} ms, although it declares "
        f"{info.rate_hz:g} Hz: check its cable and power, then `graspsense devices`. run.frame_timeout_s sets how long "
        "to wait"
    )


def seconds_at_most(run: RunConfig) -> float:
    """Return the longest time (s) of a grasp with opening, taring and release."""
    return run.grasp_timeout_s + 3.0 * run.opening_timeout_s


def overdue(run: RunConfig) -> str:
    """Return the reason given for a grasp that took longer."""
    return (
        f"no end after {seconds_at_most(run):g} s of ticks: the controller did not end the grasp "
        "(run.grasp_timeout_s)"
    )
