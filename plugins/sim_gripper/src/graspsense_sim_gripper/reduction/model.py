"""The reduced model of an object: which terms it keeps, with which steps it is integrated, and why."""

from __future__ import annotations

from typing import Any, Final

from attrs import asdict, evolve, frozen

from graspsense_sim_gripper.reduction.levels import Level
from graspsense_sim_gripper.stepping.scheme import Steps
from graspsense_sim_gripper.terms.term import WorkingPoint

KEPT: Final = "kept"
DROPPED: Final = "dropped"
FORCE_MARGIN: Final = 1.5
"""A reduction is valid up to the expected force times this."""


@frozen(kw_only=True)
class TermDecision:
    """What became of a term: kept, a limit or dropped; the number that decided; the error that it may cause."""

    term: str
    decision: str
    what: str
    number: float
    error: float


@frozen(kw_only=True)
class Verification:
    """A trial grasp with the reduced model, compared with one with the full model and finer steps."""

    error: float
    quantity: str
    """The quantity with the largest error."""
    grasps: int
    """Number of trial grasps until a level was accepted."""


@frozen(kw_only=True)
class Reduction:
    """The model of an object at an accuracy. It holds for every instance of the object."""

    accuracy: float
    treatment: tuple[str, ...]
    """For each term `kept`, `dropped` or the name of its limit; the last entry is that of the pads."""
    point: WorkingPoint
    steps: Steps
    decisions: tuple[TermDecision, ...]
    scheme: TermDecision
    contact: TermDecision
    """Whether the peak force of a contact this stiff is resolved."""
    error: float
    """Relative error of the force that leaving out terms may cause."""
    oscillates: bool
    """Whether a term has a state that oscillates, or one whose rate it does not state."""
    level: Level
    verification: Verification | None = None
    """The result of the trial grasps; None where there was none."""

    @property
    def max_force_n(self) -> float:
        """The force up to which the reduction is valid."""
        return FORCE_MARGIN * self.point.force_n

    def valid_for(self, peak_n: float) -> bool:
        """Return whether the reduction is valid for a grasp with this peak force."""
        return peak_n <= self.max_force_n or self.error == 0.0

    def with_exact_discretisation(self) -> Reduction:
        """Return the same model where the exact discretisation of a linear scene replaces the steps."""
        what = "linear between changes of contact"
        scheme = TermDecision(term="steps", decision="exact discretisation", what=what, number=0.0, error=0.0)
        return evolve(self, scheme=scheme)

    def as_values(self) -> dict[str, Any]:
        """Return it as plain values, for a report."""
        return {
            "accuracy": self.accuracy,
            "level": self.level._asdict(),
            "error": self.error,
            "expected_force_n": self.point.force_n,
            "expected_speed_m_s": self.point.speed_m_s,
            "verified": None if self.verification is None else asdict(self.verification),
            "decisions": [asdict(decision) for decision in (*self.decisions, self.scheme, self.contact)],
        }
