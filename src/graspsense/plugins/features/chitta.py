"""The six features of Table I (Chitta, Piccoli and Sturm, ICRA 2010), with corrections of the equations.

| feature | meaning | unit |
|---|---|---|
| p_first | gap at first contact of both fingers (equation 1) | m |
| p_steady | gap when the fingers have come to rest (equation 2) | m |
| f_steady | fingertip force when the fingers have come to rest | N |
| delta_t | time from first contact to rest | s |
| dp_dt | (p_steady - p_first) / delta_t | m/s |
| df_dt | (f_steady - f_first) / delta_t | N/s |
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

from attrs import frozen

from graspsense.gripper_api import NO_GAP, RestCourse, follow_rest, gap_resolution, window_of_rest
from graspsense.plugin_api import (
    APPROACH,
    HOLD,
    Channel,
    Feature,
    Features,
    FeatureSet,
    RestState,
    at_rest,
    both_touch,
    missing,
    setting,
)
from graspsense.plugins.features.contact_threshold import RestThresholds
from graspsense.simulator_api import CompiledFeatures, TickColumns, listed_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from graspsense.plugin_api import Trace

NAMES: Final = ("p_first", "p_steady", "f_steady", "delta_t", "dp_dt", "df_dt")
AT_REST: Final = NAMES[1:]
RATES: Final = NAMES[4:]


@frozen(kw_only=True)
class ChittaConfig(RestThresholds):
    """The force to use, and the thresholds of contact and rest."""

    force: Literal["mean", "left", "right", "min", "sum"] = setting(
        default="mean",
        meaning="The force f from those of the two pads: their mean, one of them, the smaller, or their sum.",
    )


FORCES: Final = ("mean", "left", "right", "min", "sum")
"""The choices of `ChittaConfig.force`; a number stands for each in compiled code."""

FAR_APART_S: Final = 0.02
"""Samples that are further apart can miss the contact."""
MISSED: Final = 0.5
"""Share of the force at rest from which on the first force of a contact does not tell when it began."""

HOLE: Final = 5.0
"""A time between samples of so many usual ones is a hole, in which no rest is seen, or a clock that was set."""

NO_TICKS: Final = 0.0
NO_PAD: Final = 1.0
LEFT_ONLY: Final = 2.0
RIGHT_ONLY: Final = 3.0
NEVER_BOTH: Final = 4.0
BOTH_TOO_LATE: Final = 5.0
CONTACT: Final = 6.0
REST: Final = 7.0
"""How far a grasp came (`Measured.reached`); up to BOTH_TOO_LATE without a contact of both pads."""
_WHY_NO_CONTACT: Final = {
    NO_TICKS: "the trace is empty",
    NO_PAD: "no finger felt {} while the fingers closed",
    LEFT_ONLY: "only the left pad felt {} while the fingers closed",
    RIGHT_ONLY: "only the right pad felt {} while the fingers closed",
    NEVER_BOTH: "the pads never felt {} at the same time while the fingers closed",
    BOTH_TOO_LATE: "the pads felt {} at the same time only when the grasp had ended",
}


class ChittaParams(NamedTuple):
    """The settings as numbers."""

    force: int
    contact_force_n: float
    rest_speed_m_s: float
    rest_window_s: float
    in_seconds: int
    """0 where time is counted in frames: the window of a rest is then that of the settings."""


class Measured(NamedTuple):
    """The numbers that the features follow from; those that a grasp did not come to are NaN."""

    reached: float
    p_first: float
    after_contact: float
    """Time from the contact to the release, or to the end of a trace without one."""
    p_steady: float = math.nan
    delta_t: float = math.nan
    f_first: float = math.nan
    f_steady: float = math.nan
    window_s: float = 0.0
    """The window in which a rest shows, given the resolution of the gap."""
    blind_s: float = 0.0
    """The time between samples in which the contact was missed, or a rest was not seen; 0 if both were."""


def pad_force(choice: int, left_n: float, right_n: float) -> float:
    """Return the force of `FORCES[choice]`, given those of both pads."""
    if choice == 1:
        return left_n
    if choice == 2:
        return right_n
    if choice == 3:
        return math.nan if left_n != left_n or right_n != right_n else min(left_n, right_n)
    return (left_n + right_n) * (0.5 if choice == 0 else 1.0)


def blind_time(before_s: float, contact_s: float, f_first: float, f_steady: float) -> float:
    """Return the time between the last sample without contact and the first with it, if the contact was missed.

    It was missed if the samples are far apart and the force is already a large part of that at rest.
    """
    step_s = contact_s - before_s
    return step_s if step_s > FAR_APART_S and f_first >= MISSED * f_steady else 0.0


def hole_within(t_s: NDArray[np.float64], since: int, shown: int) -> float:
    """Return the longest time between the samples from `since` to `shown`, 0 if it is no hole among all until then."""
    longest = 0.0
    for i in range(since + 1, shown + 1):
        longest = max(longest, t_s[i] - t_s[i - 1])
    usual = (t_s[shown] - t_s[0] - longest) / max(shown - 1, 1)
    return longest if longest > HOLE * usual else 0.0


def reached_without_contact(params: ChittaParams, ticks: TickColumns) -> float:
    """Return how far a grasp came in which both pads never touched before the release; it can be compiled."""
    phase, left, right, tau_1 = ticks.phase, ticks.force_left_n, ticks.force_right_n, params.contact_force_n
    if len(phase) == 0:
        return NO_TICKS
    felt_left, felt_right, too_late, held = False, False, False, False
    for i in range(len(phase)):
        if APPROACH <= phase[i] <= HOLD:
            felt_left = felt_left or left[i] >= tau_1
            felt_right = felt_right or right[i] >= tau_1
            held = held or phase[i] == HOLD
        else:
            too_late = too_late or both_touch(left[i], right[i], tau_1)
    if too_late and not held:
        return BOTH_TOO_LATE
    if felt_left and felt_right:
        return NEVER_BOTH
    if felt_left:
        return LEFT_ONLY
    return RIGHT_ONLY if felt_right else NO_PAD


def without_rest(
    reached: float, p_first: float, after_contact: float, window_s: float, blind_s: float
) -> Measured:
    """Return what is measured of a grasp in which no rest shows."""
    return Measured(
        reached=reached,
        p_first=p_first,
        after_contact=after_contact,
        p_steady=math.nan,
        delta_t=math.nan,
        f_first=math.nan,
        f_steady=math.nan,
        window_s=window_s,
        blind_s=blind_s,
    )


def measure(params: ChittaParams, ticks: TickColumns) -> Measured:
    """Return what `ChittaFeatures` measures, from the columns of a grasp; it can be compiled."""
    phase, left, right, gap, t = ticks.phase, ticks.force_left_n, ticks.force_right_n, ticks.gap_m, ticks.t_s
    n, tau_1, contact = len(phase), params.contact_force_n, 0
    while contact < n and not (
        both_touch(left[contact], right[contact], tau_1)
        and APPROACH <= phase[contact] <= HOLD
        and gap[contact] == gap[contact]
    ):
        contact += 1
    if contact == n:
        return without_rest(reached_without_contact(params, ticks), math.nan, math.nan, 0.0, 0.0)
    end, holds = contact, False
    while end < n and phase[end] <= HOLD:
        holds = holds or phase[end] == HOLD
        end += 1
    p_first, after_contact = gap[contact], t[end - 1] - t[contact]
    window_s = params.rest_window_s
    if params.in_seconds == 1:
        window_s = window_of_rest(
            gap_resolution(t[:end], gap[:end], contact), params.rest_speed_m_s, window_s
        )
    since, unseen_s, nan = contact, 0.0, math.nan
    course = RestCourse(
        since_t_s=t[contact], gap_m=gap[contact], left_since_t_s=nan, left_gap_m=nan, left_t_s=nan
    )
    for i in range(contact, end):
        if i > contact:
            before_s = course.since_t_s
            course = follow_rest(course, t[i], gap[i], params.rest_speed_m_s, window_s)
            if course.since_t_s != before_s:
                since = i
                while t[since] > course.since_t_s:
                    since -= 1
        still = RestState(course.since_t_s, course.gap_m)
        # A controller can wait for more than rest, such as a force. The rest in its hold phase is then the one meant.
        shows = phase[i] == HOLD or not holds
        let_go = gap[i] > p_first + params.rest_speed_m_s * window_s and left[i] < tau_1 and right[i] < tau_1
        if shows and not let_go and gap[since] == gap[since] and at_rest(still, t[i], window_s):
            hole_s = hole_within(t, since, i) if params.in_seconds == 1 else 0.0
            if hole_s > 0.0 and not at_rest(still, t[i] - hole_s, window_s):
                unseen_s = hole_s
                continue
            f_first = pad_force(params.force, left[contact], right[contact])
            f_steady = pad_force(params.force, left[i], right[i])
            delta_t = t[since] - t[contact]
            blind_s = blind_time(t[contact - 1] if contact else t[contact], t[contact], f_first, f_steady)
            return Measured(
                reached=REST,
                p_first=p_first,
                after_contact=after_contact,
                p_steady=gap[since],
                delta_t=delta_t,
                f_first=f_first,
                f_steady=f_steady,
                window_s=window_s,
                blind_s=blind_s,
            )
    return without_rest(CONTACT, p_first, after_contact, window_s, unseen_s)


class ChittaFeatures(FeatureSet[ChittaConfig]):
    """Extracts the six features of Table I."""

    requires = (Channel("gap", "m"), Channel("force_left", "N"), Channel("force_right", "N"))
    features = (
        Feature("p_first", "m", "gap at the first contact of both fingers", width=True),
        Feature("p_steady", "m", "gap when the fingers have come to rest"),
        Feature("f_steady", "N", "force on the pads when the fingers have come to rest"),
        Feature("delta_t", "s", "time from the first contact to rest"),
        Feature("dp_dt", "m/s", "mean rate of the gap from the first contact to rest"),
        Feature("df_dt", "N/s", "mean rate of the pad force from the first contact to rest"),
    )

    def extract(self, trace: Trace) -> Features:
        """Return the six features.

        Before contact, all are missing; between contact and rest, all but p_first. If rest begins in the sample of the
        contact, the two rates are missing, because delta_t is zero. The force is taken at the end of the window that
        shows the rest, because at its beginning the last cell image can be from before the rest.
        """
        if trace.units.get("gap") == NO_GAP:
            return self.undefined("no gap was recorded", trace.units)
        params = self._params(in_seconds=trace.units["t"] == "s")
        return self._features(measure(params, listed_columns(trace)), trace.units)

    def _features(self, measured: Any, units_of: Mapping[str, str]) -> Features:
        """Return the features that follow from what was measured; `units_of` are those of the trace."""
        reached, p_first, after_contact, p_steady, delta_t, f_first, f_steady, window_s, blind_s = measured
        t = units_of["t"]
        if reached < CONTACT:
            why = _WHY_NO_CONTACT[reached].format(f"{self.config.contact_force_n:g} N")
            return self.undefined(why, units_of)
        if reached == CONTACT:
            why = f"not at rest within the {after_contact:.3g} {t} after contact"
            if blind_s > 0.0:
                why = (
                    f"rest not resolved: the gap stays for the {blind_s:.2g} {t} between two samples, and moves before "
                    "and after it: is a part of the recording missing, or was the clock set?"
                )
            elif window_s > self.config.rest_window_s:
                why = (
                    f"rest not resolved: the gap is so coarse, or measured so rarely, that a rest shows after "
                    f"{window_s:.3g} {t}, and there is none within the {after_contact:.3g} {t} after contact"
                )
            return self.result({"p_first": p_first}, missing(AT_REST, why), units_of)
        reasons = {}
        rates = (math.nan, math.nan)
        if blind_s > 0.0 and t == "s":
            why = f"contact not resolved: it is within the {blind_s:.2g} s between two samples, in which the force rose"
            delta_t, reasons = math.nan, missing(("delta_t", *RATES), why)
        elif delta_t > 0.0:
            rates = ((p_steady - p_first) / delta_t, (f_steady - f_first) / delta_t)
        else:
            reasons = missing(
                RATES, "delta_t is zero: at rest from the first contact on, so there is no rate"
            )
        if not math.isfinite(f_steady):
            f_steady, rates = math.nan, (rates[0], math.nan)
            reasons |= missing(("f_steady", "df_dt"), "the pads gave no number when the fingers were at rest")
        values = (p_first, p_steady, f_steady, delta_t, *rates)
        return Features(names=NAMES, values=values, units=self.units_in(units_of), reasons=reasons)

    def _params(self, in_seconds: bool = True) -> ChittaParams:
        config = self.config
        return ChittaParams(
            force=FORCES.index(config.force),
            contact_force_n=float(config.contact_force_n),
            rest_speed_m_s=float(config.rest_speed_m_s),
            rest_window_s=float(config.rest_window_s),
            in_seconds=int(in_seconds),
        )

    compiled = CompiledFeatures(measure, _params, _features, reads_release=False)
