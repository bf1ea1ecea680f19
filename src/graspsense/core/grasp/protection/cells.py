"""Whether the cells of a fingertip answer: cells that stand still, and fingertips without a signal.

Raw counts have noise. A cell that changed in most images of free air, and then keeps its value, does not measure any
more. How many images that takes follows from how often the cell changed: a sound cell is hardly ever called frozen.
"""

from __future__ import annotations

from math import log
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Pads

FALSE_ALARM: Final = 1e-9
"""The probability that a cell with the estimated noise stands still for long enough to be called frozen."""
NOISY_SHARE: Final = 0.3
"""Share of the images of free air in which a cell must have changed; below it the cell has no noise to judge by."""
DOUBT: Final = 2.0
"""Images that are added to those that were seen, in which the cell did not change: few images prove little."""
MOST_NOISY: Final = 0.97
"""The largest share that is trusted."""
FEWEST_IMAGES: Final = 6
"""Images for which a cell of this noise stands still before it is called frozen."""
PATTERNED: Final = 5
"""Images with a pattern after which a fingertip whose cells all read the same has no signal."""
MOST_FROZEN_SHARE: Final = 0.25
"""Share of the cells of a fingertip that may stop; with more of them its force means nothing."""
NAMED: Final = 6
"""Cells that a message names."""
MOST_CELLS: Final = 2000
"""Cells of a fingertip that are watched; of a larger array every n-th one."""


def watched(cells: tuple[float, ...]) -> NDArray[np.float64]:
    """Return the cells of a fingertip that are watched, at most 4000."""
    return np.asarray(cells[:: max(1, len(cells) // MOST_CELLS)], float)


class Fingertip:
    """The cell images of one fingertip: how often each cell changes in free air, and since when it stands still."""

    def __init__(self, side: str) -> None:
        self.side = side
        self._cells: NDArray[np.float64] = np.empty(0)
        self._changes: NDArray[np.int64] = np.empty(0, np.int64)
        self._images = 0
        """Images of free air."""
        self._free: NDArray[np.int64] = np.empty(0, np.int64)
        """Images of free air of each cell, up to its last change."""
        self._still: NDArray[np.int64] = np.empty(0, np.int64)
        self._patterned = self._blank_images = 0

    def see(self, image: NDArray[np.float64], free: bool) -> None:
        """Take a new image; `free`: nothing touches the fingertip."""
        if image.shape != self._cells.shape:
            self._changes, self._free, self._still = np.zeros((3, *image.shape), np.int64)
            self._images = 0
        else:
            # By their bits, since a cell that stays NaN has not changed.
            changed = image.view(np.int64) != self._cells.view(np.int64)
            self._still += 1
            self._still[changed] = 0
            if free:
                self._images += 1
                self._changes += changed
                self._free[changed] = self._images
        self._cells = image
        blank = image.size > 1 and image.max() == image.min()
        self._patterned = self._patterned if blank else self._patterned + 1
        self._blank_images = self._blank_images + 1 if blank else 0

    @property
    def noise(self) -> NDArray[np.float64]:
        """The share of the images in free air in which each cell changed, before it stood still; rather too small."""
        return np.minimum(self._changes / (self._free + DOUBT), MOST_NOISY)

    def fault(self, other: Fingertip) -> Fault | None:
        """Return the fault that the last images show; `other` is the fingertip that has the same kind of cells."""
        if not self._cells.size:
            return None
        if self._blank_images >= 2 and self._patterned >= PATTERNED:
            return Fault(
                f"{self.side} fingertip without signal",
                f"all its cells read {self._cells[0]:g}: check its cable",
                ends=True,
            )
        # Most images end here.
        if self._still.max() < FEWEST_IMAGES:
            return None
        stopped = np.flatnonzero(frozen(self.noise, self._still) & ~self._saturated())
        names = ", ".join(str(number) for number in stopped[:NAMED]) + (
            ", ..." if len(stopped) > NAMED else ""
        )
        if len(stopped) > MOST_FROZEN_SHARE * len(self._cells):
            stuck = f"{len(stopped)} of {len(self._cells)} cells stand still ({names})"
            return Fault(f"{self.side} fingertip stuck", f"{stuck}: check its cable", ends=True)
        never = self._changes == 0
        if never.all() and other.noise.size and frozen(np.median(other.noise), self._still).all():
            return Fault(
                f"{self.side} fingertip stuck",
                "none of its cells has ever changed, while those of the other fingertip do: check its cable",
                ends=True,
            )
        return self._partly(stopped, never)

    def _partly(self, stopped: NDArray[np.int64], never: NDArray[np.bool_]) -> Fault | None:
        """Return the warning for some cells that stand still."""
        usual = np.median(self.noise)
        silent = np.flatnonzero(never & frozen(usual, self._still))
        cells = np.union1d(stopped, silent)
        if not len(cells):
            return None
        names = ", ".join(str(number) for number in cells[:NAMED]) + (", ..." if len(cells) > NAMED else "")
        return Fault(
            f"{self.side} fingertip with frozen cells",
            f"{len(cells)} of {len(self._cells)} cells stand still ({names}), so its force can be too small",
        )

    def _saturated(self) -> NDArray[np.bool_]:
        """Return which cells share the largest value of the image: pressed ones that are at the end of their range."""
        largest = self._cells == np.nanmax(self._cells, initial=-np.inf)
        return largest if largest.sum() > 1 else np.zeros_like(largest)


def frozen(noise: NDArray[np.float64] | np.float64, still: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which cells stand still for longer than their noise explains."""
    with np.errstate(divide="ignore"):
        return (noise >= NOISY_SHARE) & (still * np.log1p(-noise) <= log(FALSE_ALARM))


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
        left.see(watched(pads.left), free)
        right.see(watched(pads.right), free)
        return self.faults()

    def faults(self) -> list[Fault]:
        """Return the faults that the last images show."""
        left, right = self._tips
        faults = (left.fault(right), right.fault(left))
        return [fault for fault in faults if fault is not None]
