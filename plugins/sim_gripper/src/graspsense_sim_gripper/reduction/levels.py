"""The levels of reduction, in the order in which they are tried: a step per tick, then from large to small tolerances.

Source: the table of levels in docs/numerics.md, section "Model reduction".
"""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

from graspsense_sim_gripper.dynamics.contact import BALANCE_RTOL
from graspsense_sim_gripper.stepping.scheme import BOGACKI_SHAMPINE, VERLET, Steps

STEP_SHARE: Final = 0.34
"""The tolerance of a step is (0.34 accuracy)^1.5, so that the accumulated error of many steps is proportional to the
accuracy, and smaller."""
MACRO_SHARE: Final = 1e-3
"""The tolerance of a macro-step, relative to the accuracy. Near rest the gap changes so slowly that a small error moves
the detected time of rest by many ticks, so it has to be this small. With this share, the median error of the
catalogue at an accuracy of 1 % is not larger than that of fixed steps of 1 ms (benchmarks/default_batches.py)."""
GROWTH_ACCURACY: Final = 0.1
"""From this accuracy upwards, a step in contact may be twice as long as the one before."""
PLAIN_GROWTH: Final = 2.0
"""Largest ratio of the short steps after a contact, up to a step per tick."""
BALANCE_SHARE: Final = 5e-7
"""The tolerance of the balance of forces, relative to the accuracy of the steps."""
MAX_BALANCE_RTOL: Final = 5e-9
"""With a larger one, a search that has ended could not be told from one that has not converged."""
BY_SCENE: Final = -1
"""The scheme follows from the scene, and its steps from their error."""


class Level(NamedTuple):
    """The tolerances of one level of reduction, and its steps."""

    model_tol: float
    """Largest relative change of the force that simplifications may cause; 0: every term is kept."""
    step_tol: float
    """The accuracy for which the steps are selected; `step_tolerance` of it is the tolerance of one step."""
    min_steps: int = 1
    """Smallest number of steps per tick."""
    scheme: int = BY_SCENE
    """The scheme of the steps, or BY_SCENE."""
    plain: int = 0
    """1: each tick is one step but for events, and no error is estimated."""
    macro: int = 0
    """1: where the effort does not change, a step may last several ticks, and its error is then estimated."""


class LevelScale(NamedTuple):
    """A level relative to the requested accuracy."""

    model: float
    """`model_tol` over the accuracy."""
    refinement: float = 1.0
    """The accuracy over `step_tol`: how much more exact the steps are than what is asked for."""
    min_steps: int = 1
    """As in `Level`, like the next two."""
    scheme: int = BY_SCENE
    plain: int = 0
    macro: int = 0

    def at(self, accuracy: float) -> Level:
        """Return the level for this accuracy."""
        step_tol = accuracy / self.refinement
        return Level(self.model * accuracy, step_tol, self.min_steps, self.scheme, self.plain, self.macro)


FULL_SCALES: Final = (LevelScale(0.0), LevelScale(0.0, 10.0, 4), LevelScale(0.0, 100.0, 32))
"""All terms, with smaller and smaller steps."""
PLAIN_SCALES: Final = (
    LevelScale(0.0, scheme=VERLET, plain=1, macro=1),
    LevelScale(0.0, scheme=VERLET, plain=1),
    LevelScale(0.0, scheme=BOGACKI_SHAMPINE, plain=1),
)
"""All terms, with a step per tick and, where the effort is constant, over several ticks: they cost least. Where trial
grasps show that they suffice, nothing is gained by a simpler model or by steps per tick whose error is controlled. With
spread, several instances are grasped to show it."""
THIRD_ORDER: Final = LevelScale(0.0, scheme=BOGACKI_SHAMPINE)
"""All terms, with steps of third order whose error is controlled."""
HIGH_ACCURACY: Final = 3e-3
"""Down from this accuracy, steps of third order cost less than those of second order."""
UNVERIFIED: Final = LevelScale(0.05)
"""The level of a model that no trial grasp verifies."""
SPREAD_SCALES: Final = (LevelScale(0.3), UNVERIFIED, *FULL_SCALES)
"""The levels with spread whose steps follow from their error. The two with the largest tolerances are left out: their
trial grasps use the nominal object, and a level that is just accurate enough for it may be too coarse for another
instance."""
SCENE_SCALES: Final = (LevelScale(10.0), LevelScale(3.0), *SPREAD_SCALES)
"""The levels without spread."""
REFERENCE_SCALES: Final = {
    1.0: LevelScale(0.0, 30.0, 2),
    10.0: LevelScale(0.0, 100.0, 8),
    100.0: LevelScale(0.0, 1000.0, 32),
}
"""The scale of the full model that a candidate is compared with, by the `refinement` of the candidate's own scale."""


def scales_for(
    fidelity: Literal["scene", "full", "reference", "fixed"], spread: bool, accuracy: float, explicit: bool
) -> tuple[LevelScale, ...]:
    """Return the scales to try, in order. `spread`: whether instances differ from the nominal object.

    `explicit`: whether explicit schemes suit the scene: it is not stiff.
    """
    own: tuple[LevelScale, ...] = FULL_SCALES
    if fidelity == "scene":
        own = SPREAD_SCALES if spread else SCENE_SCALES
    if not explicit:
        return own
    return (*PLAIN_SCALES, *((THIRD_ORDER,) if accuracy <= HIGH_ACCURACY else ()), *own)


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


def steps_for(level: Level, scheme: int, dt_s: float) -> Steps:
    """Return the step control of a level with this scheme, for ticks of `dt_s` seconds."""
    if level.plain == 1:
        macro_tolerance = MACRO_SHARE * level.step_tol if level.macro == 1 else 0.0
        return Steps(math.inf, scheme, dt_s, growth=PLAIN_GROWTH, macro_tolerance=macro_tolerance)
    longest_s = dt_s / level.min_steps if level.min_steps > 1 else math.inf
    tolerance = step_tolerance(level.step_tol)
    if scheme == BOGACKI_SHAMPINE:
        # The estimate is that of the second-order formula; the accumulated error of the third-order one is like it.
        tolerance = STEP_SHARE * level.step_tol
    return Steps(tolerance, scheme, longest_s, growth=step_growth(level.step_tol))
