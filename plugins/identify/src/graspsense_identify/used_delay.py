"""Which delay of the sensor is used: that of the settings, or that which the recordings show for the chosen terms.

A lag is first found with all candidates, and may be one that only the terms of another choice need. So the terms are
chosen anew with it, and it is used only if these show just this lag.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

from attrs import evolve

from graspsense_identify.choose import Choice
from graspsense_identify.delay import PATH_ERROR_S, Delay, Lag
from graspsense_identify.share import Shares

MAX_ROUNDS: Final = 3
"""How often the lag is corrected by that which the terms chosen with it show."""


class Timed(NamedTuple):
    """The shares of the cells, and the choice, for the squeezes at the times that a lag of the force gives them."""

    shares: Shares
    choice: Choice
    lag: Lag


def with_delay(
    timed: Callable[[Lag], Timed], lag_of: Callable[[Choice], Lag], delay: Callable[[Timed], Delay]
) -> tuple[Timed, Delay]:
    """Return the choice with the delay that is used.

    `timed` makes the choice with a lag, `lag_of` returns that which all candidates show, and `delay` what the chosen
    terms show. That of the settings is
    used where the interval of the chosen terms holds it, and where the lag does not settle.
    """
    recorded = timed(Lag())
    lag = lag_of(recorded.choice)
    for _ in range(MAX_ROUNDS):
        if lag.lag_s == 0.0:
            break
        corrected = timed(lag)
        shown = delay(corrected)
        if shown.low_s <= shown.settings_s <= shown.high_s:
            break
        if abs(shown.shown_s - shown.used_s) <= PATH_ERROR_S:
            return corrected, shown
        lag = evolve(lag, lag_s=shown.shown_s - shown.settings_s)
    return recorded, delay(recorded)
