"""How far the times of two channels of a grasp can be apart, where devices with clocks of their own measure them."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from graspsense.core.values.trace import Trace

FRAME: Final = "frame"
"""The source of every channel that no other one names."""
CHANNELS_OF: Final = "_channels"
OF_IMAGES: Final = ("force_left", "force_right", "edge_left", "edge_right")
"""Channels of the frame that can come from the last image, which is older than the frame."""


def apart_s(trace: Trace, report: Mapping[str, Any], channel: str, other: str) -> float:
    """Return by how much (s) the times of these channels can be apart at most; inf where the gripper does not tell.

    A source that `report` names by `NAME_channels` has its `NAME_uncertainty_s`. A number that comes from an image has
    the time of its frame, and is as old as the image. The shortest delay of a device cannot be told from an offset of
    its clock, and is not in it.
    """
    sources = [_source(report, name) for name in (channel, other)]
    ages_s = [_age_s(trace, name) for name in (channel, other)]
    if sources[0] == sources[1]:
        return 0.0 if ages_s[0] == ages_s[1] else max(ages_s)
    return sum(float(report.get(f"{source}_uncertainty_s", inf)) for source in sources) + sum(ages_s)


def _source(report: Mapping[str, Any], channel: str) -> str:
    for key, channels in report.items():
        if key.endswith(CHANNELS_OF) and channel in str(channels).split():
            return key.removesuffix(CHANNELS_OF)
    return FRAME


def _age_s(trace: Trace, channel: str) -> float:
    """Return how old the image of this number is at most in a frame; 0 for what is measured with the frame.

    A number that does not change more often than there are images comes from them.
    """
    if channel not in OF_IMAGES or not len(trace.pad_t_s):
        return 0.0
    values = getattr(trace, f"{channel}_n")
    if int((values[1:] != values[:-1]).sum()) > len(trace.pad_t_s):
        return 0.0
    ages = [
        float(end_s - begin_s)
        for begin_s, end_s in zip(trace.pad_t_s, [*trace.pad_t_s[1:], trace.t_s[-1]], strict=True)
    ]
    return max(0.0, *ages)
