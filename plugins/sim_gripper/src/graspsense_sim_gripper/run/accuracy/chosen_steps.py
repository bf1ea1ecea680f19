"""With which steps the grasps of an object are integrated, and why."""

from __future__ import annotations

from typing import Any, Final

from attrs import asdict, field, frozen

from graspsense_sim_gripper.run.accuracy.levels import Level, balance_rtol
from graspsense_sim_gripper.scene.terms.term import switched_off
from graspsense_sim_gripper.solve.scheme import PlantParams, Steps

QUANTITIES: Final = ("peak", "trace", "features")
"""What the accuracy is guaranteed for."""
FORCE_MARGIN: Final = 1.5
"""Steps without control of their error are valid for peak forces up to the expected force times this factor."""


@frozen
class StepDecision:
    """A decision on the steps of a grasp, and the number that it follows from, as a row of a report."""

    subject: str
    decision: str
    what: str
    """The meaning of `number`."""
    number: float


@frozen(kw_only=True)
class Verification:
    """A trial grasp in the chosen steps, compared with a trial grasp in finer ones."""

    error: float
    """The largest relative error of all quantities, as `error.deviation` defines it."""
    quantity: str
    """The quantity with the largest error."""
    grasps: int
    """Number of trial grasps that were compared until a level was accepted."""
    features: tuple[str, ...] = ()
    """The features of the pipeline that no level gives to the accuracy; `("features",)` if trial grasps have none."""


@frozen(kw_only=True)
class ChosenSteps:
    """The steps of the grasps of an object for an accuracy. All instances of the object share them."""

    accuracy: float
    """The accuracy that was asked for (`gripper.accuracy`)."""
    force_n: float
    """The peak force that is expected, or the largest of the trial grasps."""
    steps: Steps
    decisions: tuple[StepDecision, ...]
    """How the steps are controlled, and what they may not resolve."""
    frequency: float
    """The natural frequency of the stiffest contact times the tick."""
    unresolved: tuple[str, ...]
    """Those of `QUANTITIES` that the steps cannot resolve, so that no trial grasp can verify them."""
    left_out: tuple[int, ...]
    """The places of terms that oscillate so fast that no steps resolve them. They are switched off."""
    oscillates: bool
    """Whether a term has a state that oscillates, or a state without declared rates."""
    level: Level
    """The tolerances with which the steps were proposed."""
    verification: Verification | None = None
    """The result of the trial grasps; None if there was none."""
    not_verified: tuple[str, ...] = field(init=False)
    """Those of `QUANTITIES`, or the features of the pipeline, whose accuracy no trial grasp has verified.

    There are none for a reference. The peak force of a contact that bounces within a tick is right in any case.
    """

    @not_verified.default
    def _not_verified(self) -> tuple[str, ...]:
        if self.verification is not None:
            return self.verification.features
        if self.steps.settle > 0.0 and self.unresolved != QUANTITIES:
            return ()
        return self.unresolved or QUANTITIES

    @property
    def max_force_n(self) -> float:
        """The largest peak force (N) for which the steps are valid if their error is not controlled."""
        return FORCE_MARGIN * self.force_n

    def valid_for(self, peak_n: float) -> bool:
        """Return whether the steps are valid for a grasp with this peak force (N).

        Steps whose error is controlled are valid for every force.
        """
        return self.level.plain == 0 or peak_n <= self.max_force_n

    def applied_to(self, plant: PlantParams) -> PlantParams:
        """Return the plant of an instance with these steps."""
        terms = switched_off(plant.object.terms, self.left_out) if self.left_out else plant.object.terms
        model = plant.object._replace(terms=terms, overshoots=1 if self.oscillates else 0)
        if self.steps.settle == 0.0:
            model = model._replace(balance_rtol=balance_rtol(self.level.step_tol))
        return PlantParams(plant.drive, model, self.steps)

    def as_values(self) -> dict[str, Any]:
        """Return the choice as a dictionary of plain values, for a report."""
        return {
            "accuracy": self.accuracy,
            "level": self.level._asdict(),
            "expected_force_n": self.force_n,
            "verified": None if self.verification is None else asdict(self.verification),
            "decisions": [asdict(decision) for decision in self.decisions],
        }
