"""Features of a grasp whose forces nobody measured: what the width did, and when."""

from __future__ import annotations

import numpy as np
from attrs import frozen

from graspsense.gripper_api import MOVED_M, first_rest
from graspsense.plugin_api import Channel, Feature, Features, FeatureSet, Trace, setting


@frozen(kw_only=True)
class WidthAndTimeConfig:
    """Thresholds of rest."""

    rest_speed_m_s: float = setting(
        default=2e-3,
        unit="m/s",
        above=0.0,
        plausible=(1e-6, 0.05),
        meaning="At rest, the gap changes by less than this times the window, throughout it.",
    )
    rest_window_s: float = setting(
        default=0.2,
        unit="s",
        above=0.0,
        plausible=(0.01, 5.0),
        meaning="Time for which the fingers must stay below the rest speed; three states of a hand with 15 Hz.",
    )


class WidthAndTime(FeatureSet[WidthAndTimeConfig]):
    """Where the fingers first came to rest, where they rest under the force of the squeeze, and how long it took.

    f_steady and df_dt of Table I need a force, and are no part of it.
    """

    requires = (Channel("gap", "m"),)
    features = (
        Feature("p_first", "m", "gap at which the fingers first came to rest on something", width=True),
        Feature("p_steady", "m", "gap at which they rest when the squeeze ends"),
        Feature("squeezed", "m", "p_first - p_steady: how far the rising force pressed the object together"),
        Feature("delta_t", "s", "time from the first to the last rest"),
        Feature("approach_t", "s", "time from the beginning of the closing to the first rest"),
    )

    def extract(self, trace: Trace) -> Features:
        """Return the five features; those of the last rest are missing where the fingers did not come to it."""
        config = self.config
        times, gaps = trace.t_s[trace.closing], trace.gap_m[trace.closing]
        known = ~np.isnan(gaps)
        times, gaps = times[known], gaps[known]
        if len(gaps) == 0:
            return self.undefined("the grasp has no tick in which the fingers close", trace.units)
        rest_ticks = first_rest(
            times, gaps, gaps < gaps[0] - MOVED_M, config.rest_speed_m_s, config.rest_window_s
        )
        if rest_ticks is None:
            return self.undefined("the fingers did not come to rest on anything", trace.units)
        contact = rest_ticks[0]
        values = {"p_first": gaps[contact], "approach_t": times[contact] - times[0]}
        still = np.abs(gaps - gaps[-1]) <= config.rest_speed_m_s * config.rest_window_s
        last = len(gaps) - int(np.argmin(still[::-1])) if not still.all() else 0
        last = max(last, contact)
        if times[-1] - times[last] < config.rest_window_s * (1.0 - 1e-9):
            reason = "the fingers were not at rest when the squeeze ended"
            return self.result(
                values, dict.fromkeys(("p_steady", "squeezed", "delta_t"), reason), trace.units
            )
        values |= {
            "p_steady": gaps[-1],
            "squeezed": gaps[contact] - gaps[-1],
            "delta_t": times[last] - times[contact],
        }
        return self.result(values, None, trace.units)
