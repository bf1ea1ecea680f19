"""Trials that are much closer to a few others than to all the rest: copies with other digits, or grasps of one object.

Rounded, shifted or noisy copies have no equal features, so that `graspsense.core.learn.copies` does not find them. What
gives them away is their number: of trials drawn independently, with features that all follow one number, a fifth are
five times closer to one trial than to the next one, and fewer if there are more numbers to follow.
"""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.components.caller import option
from graspsense.core.values.errors import counted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.learn.labelled import Labelled

_CLOSER: Final = 0.2
"""Ratio of two distances below which a trial is much closer to some trials than to the next one."""
_BY_CHANCE: Final = 1e-6
_MOST_OTHERS: Final = 4
"""Largest number of trials that each trial may be close to."""
_FEWEST_OF_LABEL: Final = 3
"""A label with fewer trials than this times those that are close is a group of its own."""
_MOST_TRIALS: Final = 2000
_MOST_FEATURES: Final = 32
_ROUNDING: Final = 1e-7
"""Distances, in standard deviations, below which the difference of two squares is not known."""


def note_on_near_copies(labelled: Labelled) -> str:
    """Return a note on trials that are much closer to some others than to the rest; empty if there are few.

    Trials of one named instance may be close.
    """
    values = _scaled(labelled.table.values)
    if not 2 * _MOST_OTHERS < len(labelled) <= _MOST_TRIALS or values.shape[1] < 2:
        return ""
    squares = (values**2).sum(axis=1)
    apart = np.sqrt(np.maximum(squares[:, np.newaxis] + squares - 2.0 * values @ values.T, 0.0))
    np.fill_diagonal(apart, np.inf)
    if labelled.instances is not None:
        instances = np.unique(np.array(labelled.instances), return_inverse=True)[1]
        apart[instances[:, np.newaxis] == instances] = np.inf
    of_label = Counter(labelled.labels)
    trials_of_label = np.array([of_label[label] for label in labelled.labels])
    nearest = np.sort(np.partition(apart, _MOST_OTHERS, axis=1)[:, : _MOST_OTHERS + 1], axis=1)
    for others in range(1, _MOST_OTHERS + 1):
        near, next_one = nearest[:, others - 1], nearest[:, others]
        judged = (near > _ROUNDING) & np.isfinite(next_one)
        judged &= trials_of_label > _FEWEST_OF_LABEL * (others + 1)
        close = int((judged & (near < _CLOSER * next_one)).sum())
        if close and _tail(close, int(judged.sum()), _CLOSER) < _BY_CHANCE:
            whom = "another trial" if others == 1 else f"{others} other trials"
            named = "of several instances" if labelled.instances is not None else "of one object"
            return (
                f"{counted(close, 'trial is', 'trials are')} more than five times closer to {whom} than to the next "
                f"one, as copies with other digits and grasps {named} are. They count: leave copies out, and name the "
                f"objects ({option('instance', 'COLUMN')})"
            )
    return ""


def _scaled(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the features without missing values, those with the most different ones, by their standard deviation."""
    whole = values[:, ~np.isnan(values).any(axis=0)]
    finest = np.argsort([-len(np.unique(column)) for column in whole.T], kind="stable")[:_MOST_FEATURES]
    whole = whole[:, finest] - whole[:, finest].mean(axis=0)
    spread = whole.std(axis=0)
    scaled: NDArray[np.float64] = whole[:, spread > 0.0] / spread[spread > 0.0]
    return scaled


def _tail(successes: int, n: int, share: float) -> float:
    """Return the probability of at least so many successes of `n`, each with the probability `share`."""
    from scipy.special import bdtrc

    return float(bdtrc(successes - 1, n, share))
