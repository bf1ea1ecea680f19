"""How well the identified object predicts a recording of which nothing was used.

The object is fitted to the other recordings. The one that is held out has only a width of its own, which is where the
object stands between the fingers: a sensor of 24 Hz shows it to some 0.4 mm. Its stiffness is the mean of the others.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from graspsense_identify.choose import MAX_FOLDS
from graspsense_identify.fit import Fitted, held_out_rms
from graspsense_identify.threads import in_threads

CONFIRMS: Final = 0.1
"""A held-out squeeze that is predicted to this share of its peak confirms the object, and so does one that is predicted
as closely as the squeezes are alike (`repeatability`)."""


def held_out_errors(fitted: Fitted) -> tuple[float, ...]:
    """Return the rms error over the peak of each squeeze, predicted from others; nothing for a single squeeze."""
    n = len(fitted.squeezes)
    folds = min(n, MAX_FOLDS)
    if n < 2:
        return ()
    of_folds = in_threads(lambda k: _of_fold(fitted, range(k, n, folds)), range(folds))
    errors = {i: error for fold in of_folds for i, error in fold.items()}
    return tuple(errors[i] for i in range(n))


def _of_fold(fitted: Fitted, held_out: range) -> dict[int, float]:
    squeezes = fitted.squeezes
    train = fitted.part([i for i in range(len(squeezes)) if i not in held_out]).refitted()
    beyond_m = float(np.mean(np.array(train.widths_m) - [squeeze.width_m for squeeze in train.squeezes]))
    return {
        i: held_out_rms(train, squeezes[i], squeezes[i].width_m + beyond_m, own_stiffness=False)
        for i in held_out
    }
