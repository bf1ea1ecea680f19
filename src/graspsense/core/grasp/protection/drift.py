"""Forces that no contact explains while the fingers approach: drift of the zero, noise, and edges that feel something.

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
STEP_SHARE: Final = 0.6
"""Share of a force from which on a single step has made it: the pad pushes an object, or its zero has jumped, which the
end of the release shows."""
SIGMAS: Final = 6.0
"""The drift must exceed this many standard deviations of the averaged force."""
NOISY: Final = 0.2
NOISY_EDGE: Final = 0.1
"""Shares of the contact force from which on the standard deviation of a pad or an edge is told."""
FEWEST_DIFFERENCES: Final = 10
"""Samples after which the standard deviation is known well enough."""
FEWEST_CELLS: Final = 4
"""Cells of a fingertip from which on a rise of all of them alike tells drift from a contact."""
UNIFORM: Final = 0.3
"""Share of the median change of the cells that a tenth of them may not reach under a contact."""


class Noise:
    """The standard deviation of a force in free air, from the differences of its samples.

    The two largest differences are left out: they can be those of a thing that the fingertip brushes.
    """

    def __init__(self) -> None:
        self._last_n = nan
        self._squares = 0.0
        self._largest = [0.0, 0.0]
        self._differences = 0

    def add(self, force_n: float) -> None:
        """Take a sample (N); one that is no number is left out."""
        square = (force_n - self._last_n) ** 2
        if square == square:
            self._squares += square
            self._differences += 1
            self._largest = sorted((square, *self._largest))[1:]
        self._last_n = force_n

    def deviation_n(self, robust: bool = False) -> float:
        """Return the standard deviation (N), 0 before the second sample; `robust`: without the largest differences."""
        squares, differences = self._squares, self._differences
        if robust:
            squares, differences = squares - sum(self._largest), differences - len(self._largest)
        return sqrt(max(squares, 0.0) / (2.0 * max(differences, 1)))

    def fault(self, name: str, allowed_n: float) -> Fault | None:
        """Return the fault of a sensor that scatters by more than this (N)."""
        deviation_n = self.deviation_n(robust=True)
        if self._differences < FEWEST_DIFFERENCES or not deviation_n > allowed_n:
            return None
        return Fault(
            f"{name} noisy",
            f"its force scatters by {deviation_n:.2f} N in free air, and {allowed_n:.2f} N are allowed, so it can feel "
            "a contact where there is none; check its cable and its shielding",
        )


class PadDrift:
    """Watches one pad in free air for a force that rises or falls slowly."""

    def __init__(self, side: str, contact_force_n: float) -> None:
        self._side, self._contact_n = side, contact_force_n
        self._forces: deque[float] = deque(maxlen=SAMPLES)
        self._images: deque[NDArray[np.float64]] = deque(maxlen=SAMPLES)
        self._start: NDArray[np.float64] | None = None
        self._noise = Noise()
        self._low_gap_m = nan
        self._step_n = 0.0

    def see(self, force_n: float, gap_m: float, cells: tuple[float, ...]) -> Fault | None:
        """Take a sample of the approach, with a new image (empty: no cells), and return drift that it shows."""
        if force_n != force_n:
            return None
        self._noise.add(force_n)
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
        earlier_n, *later_n = self._forces
        self._step_n = max(self._step_n, min(later_n) - earlier_n)
        if self._low_gap_m != self._low_gap_m or mean_n < LOW * self._contact_n:
            self._low_gap_m = gap_m
        noise_n = SIGMAS * self._noise.deviation_n() / sqrt(SAMPLES)
        if abs(mean_n) < max(WARNS * self._contact_n, noise_n):
            return self._noise.fault(f"{self._side} pad", NOISY * self._contact_n)
        slow = self._low_gap_m - gap_m >= TRAVEL_M and self._step_n < STEP_SHARE * mean_n
        if mean_n > 0.0 and not (slow and self.on_all_cells()):
            return None
        return Fault(
            f"{self._side} pad drifts",
            f"its force in free air is {mean_n:+.2f} N: its zero does not hold; let the fingertip warm up, and tare "
            "again",
            ends=abs(mean_n) >= max(ENDS * self._contact_n, noise_n),
        )

    def on_all_cells(self) -> bool | None:
        """Return whether nearly all cells have risen alike; None without several cells, or a rise."""
        if self._start is None or self._start.size < FEWEST_CELLS or len(self._images) < SAMPLES:
            return None
        change = np.mean(self._images, axis=0) - self._start
        if sum(self._forces) < SAMPLES * WARNS * self._contact_n:
            return None
        return bool(np.quantile(change, 0.1) >= UNIFORM * np.median(change) > 0.0)


class Drift:
    """Watches both fingertips while the fingers approach and neither pad feels a contact."""

    def __init__(self, contact_force_n: float) -> None:
        self._contact_n = contact_force_n
        self._pads = {side: PadDrift(side, contact_force_n) for side in ("left", "right")}
        self._edges = {side: Noise() for side in ("left", "right")}
        self._counter = 0
        self._t_s = nan

    def see(self, reading: Reading) -> list[Fault]:
        """Take a reading of the approach and return the faults that it shows."""
        frame, image, _ = reading
        if image.counter:
            if image.counter == self._counter:
                return []
            self._counter = image.counter
        elif frame.t_s - self._t_s < SAMPLE_S:
            return []
        self._t_s = frame.t_s
        faults = []
        for side, force_n, edge_n, cells in (
            ("left", frame.force_left_n, frame.edge_left_n, image.left),
            ("right", frame.force_right_n, frame.edge_right_n, image.right),
        ):
            faults.append(self._pads[side].see(force_n, frame.gap_m, cells if image.counter else ()))
            self._edges[side].add(edge_n)
            faults.append(self._edges[side].fault(f"{side} edge", NOISY_EDGE * self._contact_n))
        return [fault for fault in faults if fault is not None]

    def on_some_cells(self) -> bool:
        """Return whether the forces of both pads rose on some of their cells only, as a contact lets them."""
        return all(pad.on_all_cells() is False for pad in self._pads.values())

    def side_impact(self, reading: Reading) -> str:
        """Return in words what the edges felt in the reading that ended the approach."""
        self.see(reading)
        frame = reading.frame
        edges = {"left": frame.edge_left_n, "right": frame.edge_right_n}
        side = max(edges, key=lambda name: edges[name])
        words = f"the {side} edge felt {edges[side]:.2f} N"
        if self._pads[side].on_all_cells():
            return f"{words}, and all cells of this fingertip rose alike, unlike a contact: its zero moved; tare again"
        return (
            f"{words}, and scattered by {self._edges[side].deviation_n():.2f} N before: look at what it touches, or at "
            f"the cells and the cable of the {side} fingertip"
        )
