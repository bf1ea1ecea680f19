"""What a loop of the gripper's own does to the six features, beside a loop of the effort at 1 kHz. Simulated.

    python benchmarks/own_loop.py [--objects toy block] [--seeds 10] [--short]

The same individuals are grasped by the default controller. In the first column it commands efforts. In the others the
simulated body stands behind the interface of a gripper that closes by itself: it takes a target, a speed and a force,
closes on its own at 1 kHz, and answers at the rate of the column. Each entry is the mean over the seeds, its standard
deviation, and in brackets the number of grasps that have the feature, if not all.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from math import inf, isnan
from statistics import mean, stdev
from typing import Any

from attrs import evolve

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.experiments.versions import where_measured
from graspsense.plugin_api import (
    EFFORT,
    POSITION,
    Command,
    DeviceInfo,
    Pads,
    Reading,
    SensorBackend,
    create,
)
from graspsense.plugins.controllers.velocity import VelocityConfig, closing_effort, velocity_loop

BODY_HZ = 1000.0
RATES_HZ = (10.0, 100.0, 1000.0)
FRICTION_N = 7.0
"""What the own loop adds to the force that it is sent, so that this force reaches the fingers."""
NEAR_S = 0.02
"""The own loop slows down over the way of this time at its speed."""


class OwnLoop(SensorBackend[Any]):
    """A simulated gripper that takes efforts, as one that closes by itself to a target and answers at a lower rate."""

    accepts = ("position",)
    closes_itself = {"position": "the target, with its speed and force"}  # noqa: RUF012

    def __init__(self, body: SensorBackend[Any], rate_hz: float) -> None:
        super().__init__(body.config)
        self._body, self._rate_hz, self._ticks = body, rate_hz, round(BODY_HZ / rate_hz)
        self._loop = velocity_loop(VelocityConfig())

    @property
    def channels(self) -> Any:
        """Those of the body, at no higher rate than that of the answers."""
        return tuple(
            evolve(channel, rate_hz=min(channel.rate_hz, self._rate_hz)) for channel in self._body.channels
        )

    def open(self, seed: int) -> DeviceInfo:
        """Open the body."""
        self._integral_n, self._last, self._command = 0.0, None, None
        return evolve(self._body.open(seed), rate_hz=self._rate_hz, channels=self.channels)

    def read(self, timeout_s: float) -> Reading | None:
        """Let the body close on its own until the next answer."""
        for _ in range(1 if self._last is None else self._ticks):
            if self._last is not None:
                self._body.apply(self._effort(self._last))
            self._last = self._body.read(timeout_s)
        frame = self._last.frame
        return self._last._replace(frame=frame._replace(dt_s=1.0 / self._rate_hz))

    def apply(self, command: Command) -> None:
        """Take a target; the effort of opening and relaxing is that of the body."""
        self._command = command

    def tare(self, images: Sequence[Pads]) -> None:
        """Tare the body."""
        self._body.tare(images)

    def close(self) -> None:
        """Close the body."""
        self._body.close()

    def _effort(self, reading: Reading) -> Command:
        kind, target_m, force_n, speed_m_s = self._command
        if kind != POSITION:
            return self._command
        frame = reading.frame
        way_m = frame.gap_m - target_m
        speed = min(max(way_m / NEAR_S, -speed_m_s), speed_m_s)
        loop = self._loop._replace(closing_speed_m_s=speed)
        effort, integral = closing_effort(loop, self._integral_n, frame.velocity_m_s, 1.0 / BODY_HZ)
        most_n = force_n + FRICTION_N
        if abs(effort) < most_n:
            self._integral_n = integral
        return Command(EFFORT, min(max(effort, -most_n), most_n), inf, inf)


def features(name: str, seeds: range, rate_hz: float | None) -> list[dict[str, float]]:
    """Return the features of the grasps of this object: by the effort loop, or by an own loop of this rate."""
    controller = create("controller", "hybrid", sends="effort" if rate_hz is None else "position")
    extract = create("feature-set", "chitta").extract
    grasps = []
    for seed in seeds:
        body = create("sensor-backend", "sim", object=name)
        gripper = body if rate_hz is None else OwnLoop(body, rate_hz)
        grasp = run_grasp(gripper, controller, RunConfig(seed=seed))
        result = extract(grasp.trace)
        grasps.append(dict(zip(result.names, result.values, strict=True)))
    return grasps


def entry(values: Sequence[float]) -> str:
    """Return mean and standard deviation of the values that there are."""
    known = [value for value in values if not isnan(value)]
    if not known:
        return "missing"
    spread = f" ± {stdev(known):.2g}" if len(known) > 1 else ""
    few = f" ({len(known)} of {len(values)})" if len(known) < len(values) else ""
    return f"{mean(known):.4g}{spread}{few}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--objects", nargs="+", default=["block", "toy"])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    if given.short:
        given.seeds, given.objects = 2, given.objects[:1]
    columns = (None, *reversed(RATES_HZ))
    print(f"{given.seeds} grasps each; {where_measured()}.\n")
    heads = ("effort loop", *(f"own loop, {rate_hz:g} Hz" for rate_hz in reversed(RATES_HZ)))
    print(f"| object | feature | {' | '.join(heads)} |\n|{'---|' * (2 + len(heads))}")
    for name in given.objects:
        by_column = [features(name, range(1, 1 + given.seeds), rate_hz) for rate_hz in columns]
        for feature in by_column[0][0]:
            entries = (entry([grasp[feature] for grasp in grasps]) for grasps in by_column)
            print(f"| {name} | `{feature}` | {' | '.join(entries)} |")


if __name__ == "__main__":
    main()
