"""The conditions that Romano et al. build events of: contact, slip, side impact, placing."""

from __future__ import annotations

from typing import Final, NamedTuple

from graspsense_romano.signals import PadSignal, Signals

EVENTS: Final = (
    "left contact",
    "right contact",
    "both in contact",
    "slip",
    "place",
    "side impact",
    "acceleration",
    "no acceleration is measured: placing is told by force alone",
    "force limit reached",
)
"""The events that every law of this package tells, in the order of their bits."""

SIDE_OR_SHOCK, SLIP_AND_SHOCK, ANY, SLIP_ALONE, SHOCK_ALONE = range(5)
"""What counts as placing, with the numbers of the published trigger conditions."""

GREATEST_DISTURBANCE_N = 0.2
CONTACT_BELOW_LIGHTEST_N = 0.25
PLACE_LOW_BAND_N = 0.2


class EventThresholds(NamedTuple):
    """The thresholds of the events, by the names of their settings, in SI units."""

    lightest_n: float
    contact_high_n: float
    slip_share: float
    slip_least_n: float
    slip_low_n: float
    place_share: float
    side_n: float
    acceleration_m_s2: float
    place_by: int


class TouchConditions(NamedTuple):
    """Which conditions hold in this tick (0 or 1)."""

    left: int
    right: int
    slip: int
    place_slip: int
    side: int
    shock: int


NOTHING: Final = TouchConditions(left=0, right=0, slip=0, place_slip=0, side=0, shock=0)


def touches(params: EventThresholds, pad: PadSignal) -> bool:
    """Return whether a pad touches: its force is large enough, or changes fast enough."""
    return (
        abs(pad.high_n) > params.contact_high_n or pad.force_n > params.lightest_n - CONTACT_BELOW_LIGHTEST_N
    )


def slips(pad: PadSignal, share: float, least_n: float, low_n: float) -> bool:
    """Return whether the force of a pad is disturbed, by a share of it, while its low band is quiet."""
    disturbance = min(max(share * abs(pad.force_n), least_n), GREATEST_DISTURBANCE_N)
    return abs(pad.high_n) > disturbance and abs(pad.low.y1) < low_n


def conditions(params: EventThresholds, signals: Signals) -> TouchConditions:
    """Return the conditions that these signals meet."""
    left, right = signals.left, signals.right
    share, least_n, low_n = params.slip_share, params.slip_least_n, params.slip_low_n
    slip = slips(left, share, least_n, low_n) or slips(right, share, least_n, low_n)
    share = params.place_share
    place = slips(left, share, least_n, PLACE_LOW_BAND_N) or slips(right, share, least_n, PLACE_LOW_BAND_N)
    side = signals.edge_left.high_n > params.side_n or signals.edge_right.high_n > params.side_n
    return TouchConditions(
        left=int(touches(params, left)),
        right=int(touches(params, right)),
        slip=int(slip),
        place_slip=int(place),
        side=int(side),
        shock=int(signals.acceleration.norm_m_s2 > params.acceleration_m_s2),
    )


def placed(params: EventThresholds, now: TouchConditions, measured: int) -> bool:
    """Return whether the thing is put down. Without an acceleration (`measured` is 0) a slip stands for it."""
    shock = now.shock if measured == 1 else now.place_slip
    if params.place_by == SLIP_AND_SHOCK:
        return now.place_slip == 1 and shock == 1
    if params.place_by == SLIP_ALONE:
        return now.place_slip == 1
    if params.place_by == SHOCK_ALONE:
        return shock == 1
    return now.side == 1 or shock == 1 or (params.place_by == ANY and now.place_slip == 1)


def begun(earlier: TouchConditions, now: TouchConditions) -> int:
    """Return the bits of the events that begin in this tick."""
    bits = 0
    if now.left > earlier.left:
        bits |= 1
    if now.right > earlier.right:
        bits |= 2
    if now.left + now.right == 2 and earlier.left + earlier.right < 2:
        bits |= 4
    if now.slip > earlier.slip:
        bits |= 8
    if now.side > earlier.side:
        bits |= 32
    if now.shock > earlier.shock:
        bits |= 64
    return bits
