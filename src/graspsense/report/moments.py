"""The moments of a grasp at which its tactile arrays are shown: contact, peak and rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import ImageTrace
from graspsense.core.values.units import without_underscores
from graspsense.report.moments import contact_time

if TYPE_CHECKING:
    from graspsense.core.values.trace import Floats, Trace


def moments(trace: Trace) -> dict[str, float]:
    """Return the times of contact, of the greatest pad force, and of rest or else of the end, as far as they exist."""
    closing = np.flatnonzero(trace.phase < int(Phase.RELEASE))
    if not len(closing):
        return {}
    found: dict[str, float] = {}
    contact = contact_time(trace)
    if contact is not None:
        found["contact"] = contact
    force = (trace.force_left_n[closing] + trace.force_right_n[closing]) / 2.0
    if not np.isnan(force).all():
        found["peak"] = float(trace.t_s[closing[int(np.nanargmax(force))]])
    held = np.flatnonzero(trace.phase == int(Phase.HOLD))
    found["rest" if len(held) else "end"] = float(trace.t_s[held[0] if len(held) else closing[-1]])
    return found


@frozen
class ImagesAtMoments:
    """The images at the moments, and whether they are relative to the image before contact."""

    values: dict[str, Floats]
    relative: bool


def images_at(images: ImageTrace, factor: float, times: Mapping[str, float]) -> ImagesAtMoments:
    """Return the change of each cell since shortly before contact, times `factor`, at each of these times (s).

    Where there is no image before contact, these are the values themselves.
    """

    def last(t_s: float) -> int:
        return int(np.searchsorted(images.t_s, t_s, side="right")) - 1

    before = int(np.searchsorted(images.t_s, times["contact"], side="left")) - 1 if "contact" in times else -1
    # The image shortly before contact can already show it, so the zero is one image earlier where there is one.
    zero = images.cells[max(before - 1, 0)] if before >= 0 else np.zeros(images.cells.shape[1])
    missing = np.full(images.cells.shape[1], np.nan)
    values = {
        moment: factor * (images.cells[last(t)] - zero) if last(t) >= 0 else missing
        for moment, t in times.items()
    }
    return ImagesAtMoments(values, before >= 0)


def array_images(trace: Trace) -> dict[str, ImageTrace]:
    """Return the images of every tactile array that delivered one, by the name of the array and of its side."""
    arrays = {}
    if len(trace.pad_t_s) and trace.pad_left.shape[1]:
        arrays["left fingertip"] = ImageTrace(t_s=trace.pad_t_s, cells=trace.pad_left)
        arrays["right fingertip"] = ImageTrace(t_s=trace.pad_t_s, cells=trace.pad_right)
    for name, signal in trace.signals.items():
        if isinstance(signal, ImageTrace) and len(signal.t_s) and signal.cells.shape[1]:
            arrays[without_underscores(name)] = signal
    return arrays
