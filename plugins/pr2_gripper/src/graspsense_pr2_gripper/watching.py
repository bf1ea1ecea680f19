"""Measurements of a link without motion: rate, loss, delay, and round trip."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Final, NamedTuple

from attrs import asdict

from graspsense_pr2_gripper.link import Link
from graspsense_pr2_gripper.protocol import OutputReport, encode_output

TRIPS: Final = 50
TRIP_S: Final = 0.5
"""Time after which an echo counts as missing."""
MISSES: Final = 3
"""Number of missing echoes after which no further one is awaited."""
FIRST_COUNTER: Final = 0x8000
"""First counter of the commands, far from those that a driver starts with."""


class Watched(NamedTuple):
    """Measurements of a link. Delays are relative to the fastest report, whose own delay cannot be measured.

    `in_use` means that another program commands the device. Nothing is sent then, and no round trip is measured.
    """

    reports: int
    rate_hz: float
    lost: int
    corrupt: int
    delays_s: Sequence[float]
    trips_s: Sequence[float]
    in_use: bool
    counts: dict[str, int]


def watch_link(link: Link, seconds: float) -> Watched:
    """Receive reports for `seconds`, then measure the round trip of commands that release. Raises DeviceLost."""
    began = time.monotonic()
    arrivals: list[tuple[float, float]] = []
    echoes: set[int] = set()
    while time.monotonic() - began < seconds:
        arrival = link.next(TRIP_S)
        if arrival is None:
            continue
        arrivals.append((arrival.host_s, arrival.host_s - arrival.report.time_us * 1e-6))
        echoes.add(arrival.report.echo)
    took_s = time.monotonic() - began
    fastest_s = min((offset for _, offset in arrivals), default=0.0)
    counts = asdict(link.stream.counts)
    in_use = len(echoes) > 1
    return Watched(
        reports=counts["reports"],
        rate_hz=counts["reports"] / took_s,
        lost=counts["lost"],
        corrupt=counts["corrupt"],
        delays_s=sorted(offset - fastest_s for _, offset in arrivals),
        trips_s=() if in_use or not arrivals else sorted(_trips(link)),
        in_use=in_use,
        counts=counts,
    )


def share_of(values: Sequence[float], share: float) -> float:
    """Return this quantile of sorted values, NaN if there are none."""
    return values[min(int(len(values) * share), len(values) - 1)] if values else float("nan")


def _trips(link: Link) -> list[float]:
    trips: list[float] = []
    for trip in range(TRIPS):
        counter = FIRST_COUNTER + trip
        sent = time.monotonic()
        link.send(encode_output(OutputReport(counter=counter)))
        while time.monotonic() - sent < TRIP_S:
            arrival = link.next(TRIP_S)
            if arrival is not None and arrival.report.echo == counter:
                trips.append(arrival.host_s - sent)
                break
        if trip - len(trips) >= MISSES:
            break
    return trips
