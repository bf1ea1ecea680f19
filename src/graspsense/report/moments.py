"""The moments of a grasp at which its tactile arrays are shown: contact, peak and rest."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import Floats, ImageTrace, Integers, Trace

PHASE_COLOURS: Final = {"approach": "#e9eff6", "squeeze": "#fbdcb4", "hold": "#c9e6cf"}
OTHER_PHASE: Final = "#f3f3f3"
"""Background colours of the phases of a grasp; each phase is also named."""
BEFORE_CONTACT_S: Final = 0.8
"""How much of the approach is shown where time is in seconds: the rest is motion through free air."""


def contact_time(trace: Trace) -> float | None:
    """Return when both pads touched, where the phase changes from approach to squeeze; None if they never did."""
    squeezed = np.flatnonzero(trace.phase == int(Phase.SQUEEZE))
    return float(trace.t_s[squeezed[0]]) if len(squeezed) else None


def shown_from(trace: Trace) -> int:
    """Return the first tick that is drawn: shortly before contact where there is one, else the first."""
    contact = contact_time(trace)
    if contact is None or trace.units["t"] != "s":
        return 0
    return int(np.searchsorted(trace.t_s, contact - BEFORE_CONTACT_S))


def phase_spans(t: Floats, phases: Integers) -> list[tuple[str, float, float]]:
    """Return the name of each phase in turn, with the times at which it begins and ends."""
    if len(t) == 0:
        return []
    starts = [0, *(np.flatnonzero(np.diff(phases)) + 1).tolist()]
    ends = [*starts[1:], len(t) - 1]
    return [
        (Phase(int(phases[start])).name.lower(), float(t[start]), float(t[end]))
        for start, end in zip(starts, ends, strict=True)
    ]


def moments(trace: Trace) -> dict[str, float]:
    """Return the times of contact, of the greatest pad force, and of rest or else of the end, as far as they exist."""
    closing = np.flatnonzero(trace.phase < int(Phase.RELEASE))
    if not len(closing):
        return {}
    times: dict[str, float] = {}
    contact = contact_time(trace)
    if contact is not None:
        times["contact"] = contact
    force = (trace.force_left_n[closing] + trace.force_right_n[closing]) / 2.0
    if not np.isnan(force).all():
        times["peak"] = float(trace.t_s[closing[int(np.nanargmax(force))]])
    held = np.flatnonzero(trace.phase == int(Phase.HOLD))
    times["rest" if len(held) else "end"] = float(trace.t_s[held[0] if len(held) else closing[-1]])
    return times


def images_at(
    images: ImageTrace, factor: float, times: Mapping[str, float]
) -> tuple[dict[str, Floats], bool]:
    """Return the change of each cell since shortly before contact, times `factor`, at each of these times (s).

    Where there is no image before contact, these are the values themselves, and the second result is False. Of a cell
    with several components it is their length.
    """
    last_free = (
        int(np.searchsorted(images.t_s, times["contact"], side="left")) - 1 if "contact" in times else -1
    )
    # The image shortly before contact can already show it, so the zero is one image earlier where there is one.
    zero = images.cells[max(last_free - 1, 0)].astype(np.float64) if last_free >= 0 else 0.0
    missing = np.full(images.cells.shape[1:], np.nan)
    values = {}
    for moment, t in times.items():
        cells = last_image(images, t)
        values[moment] = number_of_each(images, factor * ((missing if cells is None else cells) - zero))
    return values, last_free >= 0


def last_image(images: ImageTrace, t_s: float) -> NDArray[Any] | None:
    """Return the cells of the last image that is not later than `t_s`, or None."""
    k = int(np.searchsorted(images.t_s, t_s, side="right")) - 1
    return images.cells[k] if k >= 0 else None


def number_of_each(images: ImageTrace, cells: NDArray[Any]) -> Floats:
    """Return a number for each cell of one of these images, in a row: of several components it is their length."""
    # Floats have the shape (cells, components), and other types (rows, columns, components).
    several = images.cells.ndim == (3 if images.cells.dtype == np.float64 else 4)
    numbers: Floats = np.linalg.norm(cells, axis=-1) if several else cells
    return numbers.ravel()


def array_images(trace: Trace) -> dict[str, dict[str, ImageTrace]]:
    """Return the images of every tactile array that delivered one, by the names of the array and of its side.

    An array has one side without a name, but for the two fingertips of `pads`.
    """
    arrays = {}
    if len(trace.pad_t_s) and trace.pad_left.shape[1]:
        sides = {"left": trace.pad_left, "right": trace.pad_right}
        arrays["pads"] = {side: ImageTrace(t_s=trace.pad_t_s, cells=cells) for side, cells in sides.items()}
    for name, signal in trace.signals.items():
        if isinstance(signal, ImageTrace) and len(signal.t_s) and signal.cells[0].size:
            arrays[name] = {"": signal}
    return arrays
