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
from typing import TYPE_CHECKING, Final, Literal

from attrs import frozen

from graspsense.plugin_api import (
    APPROACH,
    CONTACT_FORCE_N,
    HOLD,
    REST_SPEED_M_S,
    REST_WINDOW_S,
    Channel,
    Feature,
    Features,
    FeatureSet,
    first_rest,
    missing,
    setting,
)

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from graspsense.plugin_api import Trace

NAMES: Final = ("p_first", "p_steady", "f_steady", "delta_t", "dp_dt", "df_dt")
AT_REST: Final = NAMES[1:]
RATES: Final = NAMES[4:]


@frozen(kw_only=True)
class ChittaConfig:
    """The force to use, and the thresholds of contact and rest."""

    force: Literal["mean", "left", "right", "min", "sum"] = setting(
        default="mean",
        meaning="The force f from those of the two pads: their mean, one of them, the smaller, or their sum.",
    )
    contact_force_n: float = setting(
        default=CONTACT_FORCE_N,
        unit="N",
        above=0.0,
        plausible=(0.01, 20.0),
        meaning="tau_1 of the paper: the force on each pad from which on it touches the object; that of the controller "
        "unless it is given here.",
        follows="controller.contact_force_n",
    )
    rest_speed_m_s: float = setting(
        default=REST_SPEED_M_S,
        unit="m/s",
        above=0.0,
        plausible=(1e-7, 0.05),
        meaning="tau_2 of the paper, below which the speed must stay throughout the window; that of the controller "
        "unless it is given here.",
        follows="controller.rest_speed_m_s",
    )
    rest_window_s: float = setting(
        default=REST_WINDOW_S,
        unit="s",
        above=0.0,
        plausible=(0.001, 5.0),
        meaning="Time for which the speed must stay below rest_speed_m_s; that of the controller unless it is given "
        "here.",
        follows="controller.rest_window_s",
    )


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
        units = self._units(trace)
        first = self._first(trace)
        if first is None:
            reasons = missing(NAMES, self._why_no_contact(trace))
            return Features(names=NAMES, values=(math.nan,) * 6, units=units, reasons=reasons)
        p_first = float(trace.gap_m[first])
        rest = self._rest(trace, first)
        if rest is None:
            felt = float(trace.t_s[-1] - trace.t_s[first])
            why = f"not at rest within the {felt:.3g} {trace.units['t']} after contact"
            values = (p_first, *(math.nan,) * 5)
            return Features(names=NAMES, values=values, units=units, reasons=missing(AT_REST, why))

        steady, shown = rest
        p_steady = float(trace.gap_m[steady])
        f_first, f_steady = self._force(trace, first), self._force(trace, shown)
        delta_t = float(trace.t_s[steady] - trace.t_s[first])
        reasons = {}
        rates = (math.nan, math.nan)
        if delta_t > 0.0:
            rates = ((p_steady - p_first) / delta_t, (f_steady - f_first) / delta_t)
        else:
            reasons = missing(
                RATES, "delta_t is zero: at rest from the first contact on, so there is no rate"
            )
        if not math.isfinite(f_steady):
            f_steady, rates = math.nan, (rates[0], math.nan)
            reasons |= missing(("f_steady", "df_dt"), "the pads gave no number when the fingers were at rest")
        values = (p_first, p_steady, f_steady, delta_t, *rates)
        return Features(names=NAMES, values=values, units=units, reasons=reasons)

    def _units(self, trace: Trace) -> tuple[str, ...]:
        t, gap, force = trace.units["t"], trace.units["gap"], trace.units["force_left"]
        return (gap, gap, force, t, f"{gap}/{t}", f"{force}/{t}")

    def _force(self, trace: Trace, tick: int) -> float:
        left, right = float(trace.force_left_n[tick]), float(trace.force_right_n[tick])
        choice = self.config.force
        if choice == "left":
            return left
        if choice == "right":
            return right
        if choice == "min":
            return math.nan if left != left or right != right else min(left, right)
        return (left + right) * (0.5 if choice == "mean" else 1.0)

    def _first(self, trace: Trace) -> int | None:
        tau_1 = self.config.contact_force_n
        touch = (trace.force_left_n >= tau_1) & (trace.force_right_n >= tau_1)
        touch &= _closing(trace) & (trace.gap_m == trace.gap_m)
        return int(touch.argmax()) if touch.any() else None

    def _rest(self, trace: Trace, first: int) -> tuple[int, int] | None:
        """Return the tick at which rest begins and the one at which its window ends, or None."""
        config = self.config
        phase = trace.phase[first:]
        released = phase > HOLD
        end = first + (int(released.argmax()) if released.any() else len(phase))
        # A controller can wait for more than rest, such as a force. The rest in its hold phase is then the one meant.
        held = phase == HOLD
        found = first_rest(
            trace.t_s[first:end],
            trace.gap_m[first:end],
            held if held.any() else ~held,
            config.rest_speed_m_s,
            config.rest_window_s,
        )
        return None if found is None else (first + found[0], first + found[1])

    def _why_no_contact(self, trace: Trace) -> str:
        if len(trace) == 0:
            return "the trace is empty"
        tau_1 = self.config.contact_force_n
        left, right = trace.force_left_n >= tau_1, trace.force_right_n >= tau_1
        closing = _closing(trace)
        if bool((left & right & ~closing).any()):
            return f"the pads felt {tau_1:g} N at the same time only when the grasp had ended"
        felt = [side for side, on in (("left", left), ("right", right)) if bool((on & closing).any())]
        if len(felt) == 2:
            return f"the pads never felt {tau_1:g} N at the same time"
        if felt:
            return f"only the {felt[0]} pad felt {tau_1:g} N"
        return f"no pad felt {tau_1:g} N"


def _closing(trace: Trace) -> NDArray[np.bool_]:
    """Return a mask of the ticks from the approach to the end of the hold."""
    return (trace.phase >= APPROACH) & (trace.phase <= HOLD)
