"""The levels of reduction that are tried in turn, from the largest tolerances to the smallest."""

from __future__ import annotations

import math
from typing import Final, Literal, NamedTuple

from graspsense_sim_gripper.stepping.scheme import Steps

STEP_SHARE: Final = 0.34
"""The error of a step is this share of the accuracy to the power of 1.5: many steps then add up to a part of it."""
GROWTH_ACCURACY: Final = 0.1
"""Accuracy from which on steps grow twofold after a contact."""


class Level(NamedTuple):
    """The tolerances of one level of reduction."""

    model_tol: float
    """Relative change of the force that leaving out terms may cause; 0: every term is kept."""
    step_tol: float
    """The accuracy for which the steps are chosen."""
    min_steps: int = 1
    """Steps of a tick at the least."""


class LevelScale(NamedTuple):
    """A level in relation to the accuracy that is asked for."""

    model: float
    """`model_tol` is the accuracy times this."""
    steps: float = 1.0
    """`step_tol` is the accuracy divided by this."""
    min_steps: int = 1

    def at(self, accuracy: float) -> Level:
        """Return the level for this accuracy."""
        return Level(self.model * accuracy, accuracy / self.steps, self.min_steps)


FULL_SCALES: Final = (LevelScale(0.0), LevelScale(0.0, 10.0, 4), LevelScale(0.0, 100.0, 32))
"""Every term, with finer and finer steps."""
UNVERIFIED: Final = LevelScale(0.05)
"""The level without a trial grasp."""
SPREAD_SCALES: Final = (LevelScale(0.3), UNVERIFIED, *FULL_SCALES)
"""Where instances differ from the object of the trial grasps, the two largest tolerances are left out: a level that
only just suffices for the nominal object need not suffice for others."""
SCENE_SCALES: Final = (LevelScale(10.0), LevelScale(3.0), *SPREAD_SCALES)
REFERENCE_SCALES: Final = {
    1.0: LevelScale(0.0, 30.0, 2),
    10.0: LevelScale(0.0, 100.0, 8),
    100.0: LevelScale(0.0, 1000.0, 32),
}
"""The scale of the grasp that a trial grasp is compared with, by the `steps` of its own scale."""


def scales_for(fidelity: Literal["scene", "full", "reference"], spread: bool) -> tuple[LevelScale, ...]:
    """Return the scales to try, in order."""
    if fidelity != "scene":
        return FULL_SCALES
    return SPREAD_SCALES if spread else SCENE_SCALES


def step_tolerance(accuracy: float) -> float:
    """Return the relative error that a step may have, so that many of them add up to a part of the accuracy."""
    return float((STEP_SHARE * accuracy) ** 1.5)


def step_growth(accuracy: float) -> float:
    """Return the factor by which steps may grow after a contact: 2 from 10 % on, and less for a better accuracy."""
    return 1.0 + min(1.0, math.sqrt(accuracy / GROWTH_ACCURACY))


def steps_for(level: Level, scheme: int, dt_s: float) -> Steps:
    """Return the step control of a level."""
    longest_s = dt_s / level.min_steps if level.min_steps > 1 else math.inf
    return Steps(step_tolerance(level.step_tol), scheme, longest_s, growth=step_growth(level.step_tol))
