"""The trend of the acceleration, which a macro-step tells the next one: it raises the order from three to four."""

from __future__ import annotations

from typing import Final, NamedTuple


class Trend(NamedTuple):
    """The derivatives of the motor's acceleration at the beginning of a macro-step."""

    known: int
    """0: they are not known, because no macro-step under the same effort ends here."""
    first_rev_s3: float
    second_rev_s4: float


UNKNOWN: Final = Trend(0, 0.0, 0.0)


class TrendChange(NamedTuple):
    """The change of the acceleration (rev/s2) up to the middle of a step, as its trend says."""

    linear: float
    """The part that is proportional to the time; it is twice as large at the end of the step."""
    square: float
    """The part that is proportional to the square of the time; it is four times as large at the end."""


class StepErrors(NamedTuple):
    """The errors of a macro-step, in speed (rev/s) and angle (rev)."""

    speed: float
    angle: float


def change_to_middle(trend: Trend, h: float) -> TrendChange:
    """Return the change in the first half of a step of `h`; none if the trend is not known."""
    _, slope, curvature = trend
    return TrendChange(0.5 * h * slope, 0.125 * h * h * curvature)


def speed_for_end(
    trend: Trend, change: TrendChange, speed: float, rate: float, middle: float, h: float
) -> float:
    """Return the speed at which the forces at the end of the step are evaluated.

    `rate`, `middle`: the accelerations at its beginning and half-way. With a trend it is the integral of the parabola
    that has both, and the slope of the trend; without one it is that of Kutta's scheme of third order.
    """
    if trend.known == 0:
        return speed + h * (2.0 * middle - rate)
    return speed + h * (4.0 * middle - rate - change.linear) / 3.0


def errors(trend: Trend, change: TrendChange, rates: tuple[float, float, float], h: float) -> StepErrors:
    """Return the errors of a step with these accelerations at its beginning, half-way and at its end.

    They are the differences of its quadratures to those of the accelerations that the trend predicts, which are
    proportional to h^4; without a trend to the midpoint rule, which are proportional to h^3.
    """
    rate, middle, end = rates
    if trend.known == 0:
        return StepErrors(h * abs(rate - 2.0 * middle + end) / 6.0, h * h * abs(middle - rate) / 6.0)
    off = abs(middle - (rate + change.linear + change.square))
    off_end = abs(end - (rate + 2.0 * change.linear + 4.0 * change.square))
    return StepErrors(h * (4.0 * off + off_end) / 6.0, h * h * off / 3.0)


def trend_at_end(rates: tuple[float, float, float], h: float) -> Trend:
    """Return the derivatives at the end of a step of the parabola through its three accelerations."""
    rate, middle, end = rates
    return Trend(1, (rate - 4.0 * middle + 3.0 * end) / h, 4.0 * (rate - 2.0 * middle + end) / (h * h))
