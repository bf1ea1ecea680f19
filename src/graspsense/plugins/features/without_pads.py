"""The features of Table I that need no force, with contact detected from the effort, for grippers without pads."""

from __future__ import annotations

from typing import Final

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense.plugin_api import (
    APPROACH,
    HOLD,
    Channel,
    Feature,
    Features,
    FeatureSet,
    Trace,
    create,
    setting,
)

START_M: Final = 1e-3
"""Travel before which the fingers are only set in motion."""
TRAVEL_M: Final = 3e-3
"""Travel from the contact on after which the effort must have shown that there is one."""
FLAT_SHARE: Final = 0.05
"""Share of its rise over the contact effort that the effort makes at least between two quarters of the travel."""
LIMIT_SHARE: Final = 0.85
"""Share of the largest effort of the approach from which on it cannot rise before the squeeze allows more."""
SLOWED_SHARE: Final = 0.7
"""Share of their speed before the contact below which the fingers have met a resistance."""


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
        meaning="At rest, the gap changes by less than this times the window, throughout it. The gap has steps "
        "of 0.37 mm, so that a slower motion does not show within 0.15 s.",
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
        reasons = {name: six.reasons[name] for name in names if name in six.reasons}
        if doubt := _doubt(trace, effort_n, config):
            # The rest of the hold does not depend on the contact.
            holds = bool((trace.phase == HOLD).any())
            reasons |= {name: doubt for name in names if not (holds and name == "p_steady")}
        return self.result({name: six[name] for name in names if name not in reasons}, reasons, trace.units)


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


def _doubt(trace: Trace, effort_n: NDArray[np.float64], config: WithoutPadsConfig) -> str:
    """Return why the effort does not tell the contact; empty if it does.

    The fingers moved on without a resistance: from a contact on the effort stays above the threshold and rises, or the
    fingers slow down. Or it comes too late: they had already stopped at the object.
    """
    contact_n = config.contact_effort_n
    contact = int(np.argmax(trace.closing & (effort_n >= contact_n))) if len(trace) else 0
    if len(trace) == 0 or not effort_n[contact] >= contact_n:
        return ""
    squeezed = np.flatnonzero(trace.phase > APPROACH)
    stop = int(squeezed[0]) if len(squeezed) else len(trace) - 1
    gaps = trace.gap_m[contact:]
    effort = f"contact not certain: the effort is {effort_n[contact]:.1f} N"
    where = f"{effort} at {gaps[0] * 1e3:.1f} mm"
    if not len(squeezed) and trace.gap_m[0] - np.min(gaps) < START_M:
        return f"{where}, and the fingers had not moved"
    eases = (trace.closing & (effort_n < contact_n))[contact:]
    eased_m = float(np.sum(np.maximum(-np.diff(gaps), 0.0)[eases[:-1]]))
    falls = np.flatnonzero(eases[: max(stop - contact, 0)])
    fallen_m = float(gaps[0] - gaps[falls[-1]]) if len(falls) else 0.0
    if max(eased_m, fallen_m) >= TRAVEL_M:
        moved = f"while the fingers move on by {max(eased_m, fallen_m) * 1e3:.1f} mm"
        return f"{where} and falls again, {moved}. Free fingers need less than features.contact_effort_n"
    if _is_flat(trace, effort_n, contact, stop, contact_n):
        return f"{where} and does not rise, while the fingers move on"
    window_gaps = trace.gap_m[: stop + 1][trace.t_s[: stop + 1] >= trace.t_s[stop] - config.rest_window_s]
    stopped = contact >= stop > 0 and len(squeezed)
    if not (stopped and np.ptp(window_gaps) <= config.rest_speed_m_s * config.rest_window_s):
        return ""
    return (
        f"{effort} only after the fingers had stopped at {trace.gap_m[stop] * 1e3:.1f} mm; it was at its limit from "
        f"the beginning, its scale is wrong, or features.contact_effort_n ({contact_n:g} N) is above the force of the "
        "approach"
    )


def _is_flat(trace: Trace, effort_n: NDArray[np.float64], contact: int, stop: int, contact_n: float) -> bool:
    """Return whether the effort stays the same over the first half of the way from the contact to the stop."""
    gaps, efforts, times = (values[contact : stop + 1] for values in (trace.gap_m, effort_n, trace.t_s))
    if len(gaps) == 0 or not gaps[0] - gaps[-1] >= TRAVEL_M:
        return False
    travels = gaps[0] - gaps
    quarter, half = (int(np.argmax(travels >= share * travels[-1])) for share in (0.25, 0.5))
    if not 0 < quarter < half:
        return False
    free_n, top_n = float(np.mean(efforts[:quarter])), float(np.max(efforts))
    if free_n >= LIMIT_SHARE * top_n and np.max(effort_n[stop:]) * LIMIT_SHARE >= top_n:
        # The effort is at the limit of the approach, and higher in the squeeze.
        return False
    earlier = trace.closing[:contact] & (trace.gap_m[:contact] <= gaps[0] + TRAVEL_M)
    begin = int(np.argmax(earlier)) if earlier.any() else contact
    if begin < contact and trace.gap_m[begin] - gaps[0] > START_M:
        usual_m_s = (trace.gap_m[begin] - gaps[0]) / (times[0] - trace.t_s[begin])
        if travels[half] < SLOWED_SHARE * usual_m_s * (times[half] - times[0]):
            return False
    rise_n = float(np.mean(efforts[quarter:half])) - free_n
    return rise_n <= FLAT_SHARE * (top_n - contact_n)
