"""Which of several cases nothing beats: none is both cheaper and better."""

from __future__ import annotations

from collections.abc import Sequence


def front(costs: Sequence[float], rates: Sequence[float], *, cheap_is_low: bool = True) -> list[bool]:
    """Return for each case whether it lies on the Pareto front.

    A case is off it where another one is at least as cheap and at least as good, and better in one of the two.
    """
    if not cheap_is_low:
        costs = [-one for one in costs]
    found = []
    for cost, rate in zip(costs, rates, strict=True):
        beaten = any(
            other <= cost and better >= rate and (other < cost or better > rate)
            for other, better in zip(costs, rates, strict=True)
        )
        found.append(not beaten)
    return found
