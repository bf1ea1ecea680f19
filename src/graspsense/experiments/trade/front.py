"""The Pareto front of cost and rate."""

from __future__ import annotations

from collections.abc import Sequence


def front(costs: Sequence[float], rates: Sequence[float], *, cheap_is_low: bool = True) -> list[bool]:
    """Return whether each case is on the Pareto front.

    A case is not on the front if another one is at least as cheap and at least as good, and better in one of the two.
    """
    if not cheap_is_low:
        costs = [-cost for cost in costs]
    on_front = []
    for cost, rate in zip(costs, rates, strict=True):
        beaten = any(
            other <= cost and better >= rate and (other < cost or better > rate)
            for other, better in zip(costs, rates, strict=True)
        )
        on_front.append(not beaten)
    return on_front
