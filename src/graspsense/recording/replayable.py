"""A recorded grasp as a backend would have given it: the readings, and what their numbers mean."""

from __future__ import annotations

from collections.abc import Mapping

from attrs import field, frozen

from graspsense.core.roles import Reading


@frozen(kw_only=True, eq=False)
class Recording:
    """One recorded grasp.

    `units` names the units that are not SI, `notes` says in words what a reader of the result has to know.
    `rate_hz` is the number of frames in one unit of time.
    """

    name: str
    readings: tuple[Reading, ...]
    rate_hz: float
    units: Mapping[str, str] = field(factory=dict)
    notes: tuple[str, ...] = ()
