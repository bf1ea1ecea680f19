"""The reduced model of an object: which terms it keeps, with which steps it is integrated, and why."""

from __future__ import annotations

import math
from typing import Any, Final

from attrs import asdict, field, frozen

from graspsense_sim_gripper.reduction.levels import Level
from graspsense_sim_gripper.stepping.scheme import Steps
from graspsense_sim_gripper.terms.term import WorkingPoint

KEPT: Final = "kept"
DROPPED: Final = "dropped"
QUANTITIES: Final = ("peak", "trace", "features")
"""What the accuracy is guaranteed for."""
FORCE_MARGIN: Final = 1.5
"""A reduction is valid for peak forces up to the expected force times this factor."""


@frozen(kw_only=True)
class TermDecision:
    """What a reduction does with a term, the pads, the steps or the contact, as a row of a report."""

    term: str
    """The kind of the term, or `pads`, `steps` or `contact`."""
    decision: str
    """`kept`, `dropped` or a limit for a term; a scheme for the steps; for the contact whether its peak is resolved."""
    what: str
    """The meaning of `number`."""
    number: float
    """A dimensionless number that characterises the term, such as its rate times the duration of the grasp."""
    error: float
    """Relative error of the force that this decision alone may cause."""


@frozen(kw_only=True)
class Verification:
    """A trial grasp in the reduced model, compared with a trial grasp in the full model with finer steps."""

    error: float
    """The largest relative error of all quantities, as `error.deviation` defines it."""
    quantity: str
    """The quantity with the largest error."""
    grasps: int
    """Number of trial grasps that were compared until a level was accepted."""
    features: tuple[str, ...] = ()
    """The features of the pipeline that no level gives to the accuracy; `("features",)` if trial grasps have none."""


@frozen(kw_only=True)
class Reduction:
    """The reduced model of an object for an accuracy. All instances of the object share it."""

    accuracy: float
    """The accuracy that was asked for (`gripper.accuracy`)."""
    treatment: tuple[str, ...]
    """For each term `kept`, `dropped` or the name of its limit. The last entry is that of the pads."""
    point: WorkingPoint
    """The compression, speed, duration and force for which the model was selected."""
    steps: Steps
    decisions: tuple[TermDecision, ...]
    """Those of the pads, if they are simplified, and of each term."""
    scheme: TermDecision
    """The scheme that integrates the model, and the damping rate times the tick."""
    contact: TermDecision
    """Whether the steps resolve the peak force of a contact as stiff as this one."""
    error: float
    """Largest relative change of the force on the probe paths through all simplifications together."""
    oscillates: bool
    """Whether a kept term has a state that oscillates, or a state without declared rates."""
    level: Level
    """The tolerances with which it was proposed."""
    verification: Verification | None = None
    """The result of the trial grasps; None if there was none."""
    not_verified: tuple[str, ...] = field(init=False)
    """Those of `QUANTITIES`, or the features of the pipeline, whose accuracy no trial grasp has verified.

    There are none for a reference. A term that was dropped as too fast is missing in the trial grasps too. The peak
    force of a contact that bounces within a tick is right without such a term.
    """

    @not_verified.default
    def _not_verified(self) -> tuple[str, ...]:
        too_fast = any(math.isinf(one.error) for one in self.decisions)
        if self.verification is not None and not too_fast:
            return self.verification.features
        if self.steps.settle > 0.0:
            return ()
        return QUANTITIES[1:] if math.isinf(self.contact.error) and not too_fast else QUANTITIES

    @property
    def max_force_n(self) -> float:
        """The largest peak force (N) for which the reduction is valid."""
        return FORCE_MARGIN * self.point.force_n

    def valid_for(self, peak_n: float) -> bool:
        """Return whether the reduction is valid for a grasp with this peak force (N).

        A reduction without error keeps every term. It is valid for every force if the error of its steps is controlled.
        """
        return peak_n <= self.max_force_n or (self.error == 0.0 and self.level.plain == 0)

    def as_values(self) -> dict[str, Any]:
        """Return the reduction as a dictionary of plain values, for a report."""
        return {
            "accuracy": self.accuracy,
            "level": self.level._asdict(),
            "error": self.error,
            "expected_force_n": self.point.force_n,
            "expected_speed_m_s": self.point.speed_m_s,
            "verified": None if self.verification is None else asdict(self.verification),
            "decisions": [asdict(decision) for decision in (*self.decisions, self.scheme, self.contact)],
        }
