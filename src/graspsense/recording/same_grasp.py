"""Which recordings are of the same grasp: equal curves, or one of them the part that a damaged file had left."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from typing import Final

from graspsense.core.values.signals import Reading

_CURVE: Final = struct.Struct("<5d")
_SHORTEST_PART: Final = 10
"""Different frames that a part must have: before the fingers move, all grasps are alike."""


def curve_bytes(readings: Iterable[Reading]) -> bytes:
    """Return the curves of a grasp without its times, as bytes that are equal for equal curves."""
    frames = (reading.frame for reading in readings)
    return b"".join(
        _CURVE.pack(frame.gap_m, frame.velocity_m_s, frame.effort_n, frame.force_left_n, frame.force_right_n)
        for frame in frames
    )


def grasp_numbers(curves: Sequence[bytes]) -> list[int]:
    """Return a number for each of these curves (`curve_bytes`), equal for those of the same grasp.

    It is the place of the longest curve of the grasp.
    """
    numbers = list(range(len(curves)))
    longest: dict[bytes, list[int]] = {}
    for i in sorted(numbers, key=lambda i: -len(curves[i])):
        curve = curves[i]
        alike = longest.setdefault(curve[: _CURVE.size], [])
        whole = next((k for k in alike if curves[k].startswith(curve)), None)
        if whole is not None and (len(curves[whole]) == len(curve) or _is_part(curve)):
            numbers[i] = whole
        else:
            alike.append(i)
    return numbers


def _is_part(curve: bytes) -> bool:
    return len({curve[k : k + _CURVE.size] for k in range(0, len(curve), _CURVE.size)}) >= _SHORTEST_PART
