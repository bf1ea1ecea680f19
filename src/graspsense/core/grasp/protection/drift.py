"""Drift of the zero while the fingers approach: a force that no contact explains.

A contact raises the force of a pad within a short travel, and on the cells that face the object. Drift raises or lowers
it slowly, and on all cells of a fingertip alike. A force below zero is never a contact.
"""

from __future__ import annotations

from collections import deque
from math import nan, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.grasp.protection.cells import watched
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Reading

SAMPLES: Final = 3
"""Samples of the force that are averaged."""
SAMPLE_S: Final = 0.04
"""Time between samples of a gripper without cell images."""
WARNS: Final = 0.25
ENDS: Final = 0.4
"""Shares of the contact force from which on drift is told, and ends the grasp."""
LOW: Final = 0.15
"""Share of the contact force below which a pad counts as free."""
TRAVEL_M: Final = 0.003
"""Travel from free to a share of the contact force that is too long for a contact."""
SIGMAS: Final = 6.0
"""The drift must exceed this many standard deviations of the averaged force."""
FEWEST_CELLS: Final = 4
"""Cells of a fingertip from which on a rise of all of them alike tells drift from a contact."""
UNIFORM: Final = 0.3
"""Share of the median change of the cells that a tenth of them may not reach under a contact."""


class PadDrift:
    """Watches one pad in free air for a force that rises or falls slowly."""

    def __init__(self, side: str, contact_force_n: float) -> None:
        self._side, self._contact_n = side, contact_force_n
        self._forces: deque[float] = deque(maxlen=SAMPLES)
        self._images: deque[NDArray[np.float64]] = deque(maxlen=SAMPLES)
        self._start: NDArray[np.float64] | None = None
        self._squares = 0.0
        self._differences = 0
        self._low_gap_m = nan

    def see(self, force_n: float, gap_m: float, cells: tuple[float, ...]) -> Fault | None:
        """Take a sample of the approach, with a new image (empty: no cells), and return drift that it shows."""
        if force_n != force_n:
            return None
        if self._forces:
            self._squares += (force_n - self._forces[-1]) ** 2
            self._differences += 1
        self._forces.append(force_n)
        if cells:
            image = watched(cells)
            if self._images and image.shape != self._images[-1].shape:
                self._images.clear()
                self._start = None
            self._images.append(image)
        if len(self._forces) < SAMPLES:
            return None
        if self._start is None and len(self._images) == SAMPLES:
            self._start = np.mean(self._images, axis=0)
        mean_n = sum(self._forces) / SAMPLES
        if self._low_gap_m != self._low_gap_m or mean_n < LOW * self._contact_n:
            self._low_gap_m = gap_m
        noise_n = SIGMAS * sqrt(self._squares / (2.0 * self._differences) / SAMPLES)
        if abs(mean_n) < max(WARNS * self._contact_n, noise_n):
            return None
        if mean_n > 0.0 and not (self._low_gap_m - gap_m >= TRAVEL_M and self._on_all_cells()):
            return None
        return Fault(
            f"{self._side} pad drifts",
            f"its force in free air is {mean_n:+.2f} N: its zero does not hold; let the fingertip warm up, and tare "
            "again",
            ends=abs(mean_n) >= max(ENDS * self._contact_n, noise_n),
        )

    def _on_all_cells(self) -> bool:
        """Return whether nearly all cells have risen alike; without several cells, a slow contact looks the same."""
        if self._start is None or self._start.size < FEWEST_CELLS or len(self._images) < SAMPLES:
            return False
        change = np.mean(self._images, axis=0) - self._start
        return bool(np.quantile(change, 0.1) >= UNIFORM * np.median(change) > 0.0)


class Drift:
    """Watches both pads while the fingers approach and neither of them feels a contact."""

    def __init__(self, contact_force_n: float) -> None:
        self._pads = (PadDrift("left", contact_force_n), PadDrift("right", contact_force_n))
        self._counter = 0
        self._t_s = nan

    def see(self, reading: Reading) -> list[Fault]:
        """Take a reading of the approach and return the drift that it shows."""
        frame, image, _ = reading
        if image.counter:
            if image.counter == self._counter:
                return []
            self._counter = image.counter
        elif frame.t_s - self._t_s < SAMPLE_S:
            return []
        self._t_s = frame.t_s
        left, right = self._pads
        faults = (
            left.see(frame.force_left_n, frame.gap_m, image.left if image.counter else ()),
            right.see(frame.force_right_n, frame.gap_m, image.right if image.counter else ()),
        )
        return [fault for fault in faults if fault is not None]
