"""The result of a task of kind `grasp`: how each grasp went."""

from __future__ import annotations

from collections.abc import Mapping

from attrs import field, frozen

from graspsense.experiment_api import GraspCurve, Summary


@frozen(kw_only=True)
class GraspRow:
    """How one grasp went. A quantity is None if it is not defined, for example without contact.

    `contact_s` is the time of contact of both pads from the start of the approach; `lead_s` how long one pad touched
    before the other; `speed_m_s` the closing speed shortly before contact; `closed_m` how far the fingers closed;
    `effort_at_contact_n` and `max_effort_n` the commanded effort at contact, and its maximum from then on;
    `left_counts` and `right_counts` the increase of the summed pad cells from the start to the end of the squeeze.
    """

    label: str
    outcome: str
    contact_s: float | None = None
    lead_s: float | None = None
    speed_m_s: float | None = None
    closed_m: float | None = None
    effort_at_contact_n: float | None = None
    max_effort_n: float | None = None
    left_counts: float | None = None
    right_counts: float | None = None
    measured_peak_force_n: float | None = None
    """The largest reported mean of the two pad forces."""
    true_peak_force_n: float = 0.0
    """The peak force in the model, which the pads may miss."""
    broken: bool = False
    """Whether the model of the object broke."""
    features: Mapping[str, float | None] = field(factory=dict)


@frozen(kw_only=True)
class GraspResult:
    """The result of a task of kind `grasp`."""

    source: str
    simulated: bool
    rows: tuple[GraspRow, ...]
    grasps: tuple[GraspCurve, ...] = ()


def grasp_results(summary: Summary) -> list[tuple[str, int, GraspResult]]:
    """Return case, seed and result of every task of kind `grasp`."""
    return [
        (case, seed, result)
        for (case, seed), result in summary.results.items()
        if isinstance(result, GraspResult)
    ]
