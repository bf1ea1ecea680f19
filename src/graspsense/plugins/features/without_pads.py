"""The features of Table I that need no force, with contact detected from the effort, for grippers without pads."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import evolve, frozen

from graspsense.plugin_api import Channel, Feature, Features, FeatureSet, create, setting

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.plugin_api import Trace

START_M: Final = 1e-3
"""Travel before which the fingers are only set in motion."""


@frozen(kw_only=True)
class WithoutPadsConfig:
    """Thresholds of contact and rest."""

    contact_effort_n: float = setting(
        default=10.5,
        unit="N",
        above=0.0,
        plausible=(0.1, 235.0),
        meaning="Effort at contact, above that for moving the fingers freely.",
    )
    rest_speed_m_s: float = setting(
        default=2.5e-3,
        unit="m/s",
        above=0.0,
        plausible=(1e-6, 0.05),
        meaning="Speed below which the fingers are at rest, if throughout the window. The gap has steps of 0.37 mm, so "
        "that a slower motion does not show within 0.15 s.",
    )
    rest_window_s: float = setting(
        default=0.15,
        unit="s",
        above=0.0,
        plausible=(0.01, 5.0),
        meaning="Time for which the fingers must stay below the rest speed.",
    )


class WithoutPads(FeatureSet[WithoutPadsConfig]):
    """Four of the six features of Table I; f_steady and df_dt need a force, which the gripper does not measure."""

    requires = (Channel("gap", "m"), Channel("effort", "N"))
    features = (
        Feature("p_first", "m", "gap at contact", width=True),
        Feature("p_steady", "m", "gap when the fingers have come to rest"),
        Feature("delta_t", "s", "time from contact to rest"),
        Feature("dp_dt", "m/s", "mean rate of the gap from contact to rest"),
    )

    def extract(self, trace: Trace) -> Features:
        """Return the four features; in the reasons, the force of a pad stands for the effort."""
        config = self.config
        effort_n = _without_start(trace.gap_m, trace.effort_n, config.contact_effort_n)
        six = create(
            "feature-set",
            "graspsense/chitta",
            contact_force_n=config.contact_effort_n,
            rest_speed_m_s=config.rest_speed_m_s,
            rest_window_s=config.rest_window_s,
        ).extract(evolve(trace, force_left_n=effort_n, force_right_n=effort_n))
        names = [feature.name for feature in self.features]
        return self.result(
            {name: six[name] for name in names},
            {name: six.reasons[name] for name in names if name in six.reasons},
        )


def _without_start(
    gap_m: NDArray[np.float64], effort_n: NDArray[np.float64], contact_n: float
) -> NDArray[np.float64]:
    """Return the effort without that which sets the fingers in motion, which can be as large as at contact.

    It is above the threshold before the fingers have moved, and falls below it while they move on.
    """
    above = np.flatnonzero(effort_n >= contact_n)
    if len(above) == 0 or gap_m[above[0]] < gap_m[0] - START_M:
        return effort_n
    below = np.flatnonzero(effort_n[above[0] :] < contact_n)
    if len(below) == 0:
        return effort_n
    end = above[0] + below[0]
    return np.concatenate([np.minimum(effort_n[:end], 0.0), effort_n[end:]])
