"""The delay of the sensor: by how much the force lags behind the gap beyond what the settings say.

A force that lags is lower than that of the object while the fingers close, and keeps rising after they have stopped.
A damper makes it higher and falls at once. For a spring of stiffness k, a lag of T at constant speed is the same as a
damper of -k T, or as another width: where the speed does not change, no recording tells them apart. Where it does, each
candidate is fitted with the lag as a further parameter, common to all squeezes, since they have one sensor.

A lag is first found with all candidates, and may be one that only the terms of another choice need. So the terms are
chosen anew with it, and it is used in place of that of the settings only if these show just this lag.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import frozen

from graspsense.simulator_api import IdentifiedParameter, Undetermined
from graspsense_identify.choose import LEAST_GAIN, Choice
from graspsense_identify.fit import LEAST_ERROR, Fitted, in_threads, information, linear_covariance
from graspsense_identify.interval import NORMAL, identified
from graspsense_identify.parts import has_objects, parts_of
from graspsense_identify.prepare import MAX_LAG_S
from graspsense_identify.refuse import shows_memory

EVIDENCE: Final = 5.0
"""The logarithm of the Bayes factor (Schwarz's approximation) from which on a lag is taken for real."""
WIDEST_S: Final = 0.02
"""A delay whose interval is wider is not determined."""
PATH_ERROR_S: Final = 5e-4
"""Standard deviation of a lag that the finite number of nodes of a path causes, with ideal sensors."""


@frozen(kw_only=True)
class Delay:
    """The delay of the sensor: that which is used, and what the recordings show of it."""

    settings_s: float
    """That of the settings."""
    used_s: float
    """That with which the object was identified."""
    shown_s: float = math.nan
    """That with which the chosen terms fit best; NaN where the motion cannot show any."""
    low_s: float = math.nan
    high_s: float = math.nan
    """The 90 % interval of that."""
    basis: str = ""

    @property
    def parameters(self) -> list[IdentifiedParameter]:
        """The delay that is used, with an interval that holds it and what the recordings show; nothing without that."""
        if math.isnan(self.shown_s):
            return []
        interval = min(self.low_s, self.used_s), max(self.high_s, self.used_s)
        source = "recordings" if self.used_s != self.settings_s else "settings"
        return [identified("delay_s", self.used_s, interval, f"{self.basis}; of the {source}")]

    @property
    def error_s(self) -> float:
        """How far the delay that is used is from that of the recordings, where these exclude it; else 0."""
        if math.isnan(self.shown_s) or self.low_s <= self.used_s <= self.high_s:
            return 0.0
        return abs(self.used_s - self.shown_s)

    @property
    def undetermined(self) -> list[Undetermined]:
        """What stays open of it."""
        if math.isnan(self.shown_s):
            reason = "the fingers close at one speed and do not hold: a lag moves the contact, or looks like a damper"
        elif self.high_s - self.low_s > WIDEST_S:
            low, high = 1e3 * self.low_s, 1e3 * self.high_s
            reason = f"its 90 % interval is {low:.3g} to {high:.3g} ms: a lag looks like a damper, or a wider object"
        elif self.error_s > 0.0:
            reason = (
                f"the recordings rather show {1e3 * self.shown_s:.3g} ms, but other terms fit as well without"
            )
        else:
            return []
        return [
            Undetermined(
                what="delay of the sensor",
                reason=f"{reason}; {1e3 * self.used_s:.3g} ms are used",
                remedy="close at a changing speed, hold and open, from before the contact, or measure the force at a "
                "higher rate",
            )
        ]


def lag_of(choice: Choice) -> float:
    """Return by how much the force lags beyond the settings (s); 0 where the recordings show no lag.

    Common values that do not hold for all objects fit badly, and a lag may mimic that: no lag is taken from these.
    """
    return 0.0 if _values_vary(choice.fitted) else lag_beyond_settings(choice.refined)


def _values_vary(fitted: Fitted) -> bool:
    """Return whether common values fit worse than noise would make them, by fits to each squeeze by itself."""
    if not has_objects(fitted.squeezes):
        return False
    alone = in_threads(lambda i: fitted.part([i]).refitted(), range(len(fitted.squeezes)))
    rms = float(np.sqrt(np.mean(np.concatenate([own.residuals for own in alone]) ** 2)))
    n, values = len(fitted.residuals), len(fitted.values)
    # Beside common values, each squeeze but one has a factor on the stiffness.
    common = information(fitted.rms, values + len(alone) - 1, n)
    return information(rms, values * len(alone), n) <= common - EVIDENCE


def lag_beyond_settings(refined: Sequence[Fitted]) -> float:
    """Return the lag (s) without which none of these candidates fits as well; 0 if there is none.

    `refined`: fits with the times as they are.
    """
    if not shows_memory(refined[0].squeezes):
        return 0.0
    lagging = in_threads(lambda fitted: fitted.refitted(has_lag=True), refined)
    best = min(lagging, key=lambda fitted: fitted.information)
    own = refined[lagging.index(best)]
    gained = best.information <= min(fitted.information for fitted in refined) - EVIDENCE
    better = best.error <= (1.0 - LEAST_GAIN) * own.error
    is_real = gained and better and abs(best.lag_s) <= 0.98 * MAX_LAG_S
    return best.lag_s if is_real else 0.0


def delay_of(fitted: Fitted, settings_s: float, lag_s: float) -> Delay:
    """Return the delay of the sensor.

    `fitted`: the chosen fit, to squeezes whose force lags by `lag_s`.
    """
    used_s = settings_s + lag_s
    if not shows_memory(fitted.squeezes):
        return Delay(settings_s=settings_s, used_s=used_s)
    lagging = fitted.refitted(has_lag=True)
    again = parts_of(lagging, has_lag=True)
    lags = np.array([[part.fitted.lag_s] for part in again.parts])
    scattered = again.factor * math.sqrt(float(again.covariance(lags)[0, 0]))
    # Where the motion does not show a lag, the fits stay where they begin and do not scatter.
    random = max(scattered, NORMAL * math.sqrt(linear_covariance(lagging, LEAST_ERROR)[-1, -1]))
    half = math.hypot(random, NORMAL * PATH_ERROR_S)
    shown = used_s + lagging.lag_s
    return Delay(
        settings_s=settings_s,
        used_s=used_s,
        shown_s=shown,
        low_s=shown - half,
        high_s=shown + half,
        basis=again.basis,
    )
