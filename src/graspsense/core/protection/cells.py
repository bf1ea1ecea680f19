"""Whether the cells of a fingertip answer: cells that stand still, and fingertips without a signal.

Raw counts have noise. A cell that keeps its value, while cells have noise in free air, does not measure any more. How
many images that takes follows from the noise: the probability of a false alarm is below one in 10^9 for a cell.
"""

from __future__ import annotations

from math import ceil, log
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.faults import Fault
from graspsense.core.signals import Pads

FALSE_ALARM: Final = 1e-9
"""The probability that a sound cell stands still for long enough to be called frozen."""
NOISY_SHARE: Final = 0.3
"""Share of images in which half of the cells must change in free air; below it the cells have no noise to judge by."""
FREE_IMAGES: Final = 3
"""Changes of the image in free air by which the noise of the cells is first judged."""
FEWEST_IMAGES: Final = 6
MOST_FROZEN_SHARE: Final = 0.25
"""Share of the cells of a fingertip that may stand still; with more of them its force means nothing."""
NAMED: Final = 6
"""Cells that a message names."""


class Fingertip:
    """The cell images of one fingertip: how often each cell changes in free air, and since when it stands still."""

    def __init__(self, side: str) -> None:
        self.side = side
        self._cells: NDArray[np.float64] = np.empty(0)
        self._changes: NDArray[np.int64] = np.empty(0, np.int64)
        self._still: NDArray[np.int64] = np.empty(0, np.int64)
        self._free_images = self._blank_images = 0
        self._has_pattern = False
        self.activity = 0.0
        """The largest share of the images in free air in which the median cell had changed."""

    def see(self, cells: tuple[float, ...], free: bool) -> None:
        """Take a new image; `free`: nothing touches the fingertip."""
        image = np.asarray(cells, float)
        if image.shape != self._cells.shape:
            self._changes = np.zeros(image.shape, np.int64)
            self._still = np.zeros(image.shape, np.int64)
        else:
            changed = image != self._cells
            self._still = np.where(changed, 0, self._still + 1)
            if free:
                self._free_images += 1
                self._changes += changed
                if self._free_images >= FREE_IMAGES:
                    share = float(np.median(self._changes)) / self._free_images
                    self.activity = max(self.activity, share)
        self._cells = image
        blank = image.size > 1 and bool(np.all(image == image[0]))
        self._has_pattern = self._has_pattern or not blank
        self._blank_images = self._blank_images + 1 if blank and self._has_pattern else 0

    def fault(self, activity: float) -> Fault | None:
        """Return the fault that the last images show, given the activity of sound cells."""
        if self._blank_images >= 2:
            return Fault(
                f"{self.side} fingertip without signal",
                f"all its cells read {self._cells[0]:g}: check its cable",
                ends=True,
            )
        if activity < NOISY_SHARE:
            return None
        images = FEWEST_IMAGES
        if activity < 1.0:
            images = max(FEWEST_IMAGES, ceil(log(FALSE_ALARM) / log(1.0 - activity)))
        frozen = np.flatnonzero(self._still >= images)
        if not len(frozen):
            return None
        names = ", ".join(str(number) for number in frozen[:NAMED]) + (", ..." if len(frozen) > NAMED else "")
        found = f"{len(frozen)} of {len(self._cells)} cells stand still ({names})"
        if len(frozen) > MOST_FROZEN_SHARE * len(self._cells):
            return Fault(f"{self.side} fingertip stuck", f"{found}: check its cable", ends=True)
        return Fault(f"{self.side} fingertip with frozen cells", f"{found}, so its force is too small")


class Fingertips:
    """Both fingertips of a gripper with cells."""

    def __init__(self) -> None:
        self._tips = (Fingertip("left"), Fingertip("right"))
        self._counter = 0

    def see(self, pads: Pads, free: bool) -> list[Fault]:
        """Take the image of this tick, if it is new, and return the faults that it shows."""
        if pads.counter == self._counter or not pads.counter:
            return []
        self._counter = pads.counter
        left, right = self._tips
        left.see(pads.left, free)
        right.see(pads.right, free)
        return self.faults()

    def faults(self) -> list[Fault]:
        """Return the faults that the last images show."""
        # A fingertip that stands still from the beginning is judged by the noise of the other one.
        activity = max(tip.activity for tip in self._tips)
        return [fault for tip in self._tips if (fault := tip.fault(activity)) is not None]
