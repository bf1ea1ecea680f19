"""The levels of step control, in the order in which they are tried: a step per tick, then smaller and smaller steps.

Source: the table of levels in docs/numerics.md, section "Choosing the steps".
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.plant.object_model import BALANCE_RTOL
from graspsense_sim_gripper.solve.scheme import Steps

STEP_SHARE: Final = 0.34
"""The tolerance of a step is (0.34 accuracy)^1.5, so that the accumulated error of many steps is proportional to the
accuracy, and smaller."""
MACRO_SHARE: Final = 1e-3
"""The tolerance of a macro-step, relative to the accuracy. Near rest the gap changes so slowly that a small error moves
the detected time of rest by many ticks, so it has to be this small. With this share, the median error of the
catalogue at an accuracy of 1 % is not larger than that of fixed steps of 1 ms."""
GROWTH_ACCURACY: Final = 0.1
"""From this accuracy upwards, a step in contact may be twice as long as the one before."""
PLAIN_GROWTH: Final = 2.0
"""Largest ratio of the short steps after a contact, up to a step per tick."""
BALANCE_SHARE: Final = 5e-7
"""The tolerance of the balance of forces, relative to the accuracy of the steps."""
MAX_BALANCE_RTOL: Final = 5e-9
"""With a larger one, a search that has ended could not be told from one that has not converged."""


class Level(NamedTuple):
    """How the steps of a grasp are controlled."""

    step_tol: float
    """The accuracy for which the steps are selected; `step_tolerance` of it is the tolerance of one step."""
    min_steps: int = 1
    """Smallest number of steps per tick once the object is touched."""
    plain: int = 0
    """1: each tick is one Verlet step but for events, and its error is not estimated. Where the effort does not change,
    a step may last several ticks, and its error is then estimated."""


class LevelScale(NamedTuple):
    """A level relative to the requested accuracy."""

    refinement: float = 1.0
    """The accuracy over `step_tol`: how much more exact the steps are than what is asked for."""
    min_steps: int = 1
    """As in `Level`, like the next one."""
    plain: int = 0

    def level(self, accuracy: float) -> Level:
        """Return the level for this accuracy."""
        return Level(accuracy / self.refinement, self.min_steps, self.plain)


PLAIN: Final = LevelScale(plain=1), LevelScale(10.0, plain=1)
"""A step per tick, and over several ticks: it costs least. The error of steps over several ticks, which moves the time
of rest, is a tenth in the second one."""
CONTROLLED: Final = (LevelScale(), LevelScale(10.0, 4), LevelScale(100.0, 32))
"""Smaller and smaller steps whose error is controlled."""
REFERENCE_SCALES: Final = {
    1.0: LevelScale(30.0, 2),
    10.0: LevelScale(100.0, 8),
    100.0: LevelScale(1000.0, 32),
}
"""The scale of the grasp that a candidate is compared with, by the `refinement` of the candidate's own scale."""


def step_tolerance(accuracy: float) -> float:
    """Return the largest relative error of one step for this accuracy.

    The error of a second-order step is proportional to h^3 and the accumulated error to h^2. The power of 1.5 therefore
    makes the accumulated error proportional to the accuracy.
    """
    return float((STEP_SHARE * accuracy) ** 1.5)


def balance_rtol(step_tol: float) -> float:
    """Return the relative tolerance of the balance of forces in a contact for this accuracy of the steps.

    The error that it causes is small beside that of the steps, and the search for the balance ends an evaluation of
    the forces earlier than at the tolerance of a reference.
    """
    return min(max(BALANCE_SHARE * step_tol, BALANCE_RTOL), MAX_BALANCE_RTOL)


def step_growth(accuracy: float) -> float:
    """Return the largest ratio of successive steps in contact: 2 from an accuracy of 10 % upwards, less below."""
    return 1.0 + min(1.0, math.sqrt(accuracy / GROWTH_ACCURACY))


def steps_for(level: Level, dt_s: float) -> Steps:
    """Return the step control of a level, for ticks of `dt_s` seconds."""
    if level.plain == 1:
        return Steps(math.inf, dt_s, growth=PLAIN_GROWTH, macro_tolerance=MACRO_SHARE * level.step_tol)
    # Without contact the motion is smooth, and long steps suffice.
    touched_s = dt_s / level.min_steps if level.min_steps > 1 else math.inf
    growth = step_growth(level.step_tol)
    return Steps(step_tolerance(level.step_tol), growth=growth, longest_touched_s=touched_s)
