"""A gripper on the machine's clock whose fingers close on nothing, for benchmarks of a control tick.

A tick is from the moment the gripper's read returns to the moment it is called again: the law, the guard, the trace,
and the sinks.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from math import inf
from typing import Any

from graspsense.core.values.errors import RecordingEnded
from graspsense.plugin_api import EFFORT, Command, DeviceInfo, Frame, Pads, Reading, SensorBackend


class Paced(SensorBackend[Any]):
    """The gripper, with how long each tick took, and how long until its command."""

    rate_hz = 1000.0
    speed_m_s = 0.005

    def __init__(self, ticks: int, config: Any = None) -> None:
        super().__init__(config)
        self.ticks, self.k = ticks, -1
        self.took: list[float] = []
        self.until_command: list[float] = []
        self.began = self.given = 0.0

    def open(self, seed: int) -> DeviceInfo:
        self.began = time.perf_counter()
        return DeviceInfo(
            name="paced",
            clock="device",
            rate_hz=self.rate_hz,
            effort_limit_n=100.0,
            speed_limit_m_s=0.2,
            opening=None,
            relaxed=Command(EFFORT, 0.0, inf, inf),
        )

    def read(self, timeout_s: float) -> Reading:
        now = time.perf_counter()
        if self.k >= 0:
            self.took.append(now - self.given)
        self.k += 1
        if self.k == self.ticks:
            raise RecordingEnded
        t, speed = self.k / self.rate_hz, self.speed_m_s
        touch_n = 0.1 * (self.k % 5)
        frame = Frame(t, 1 / self.rate_hz, 0.08 - speed * t, -speed, 10.0, touch_n, 0.0, 0.0, 0.0, 0)
        reading = self.reading(frame)
        while (left := self.began + t - time.perf_counter()) > 0:
            time.sleep(left)
        self.given = time.perf_counter()
        return reading

    def reading(self, frame: Frame) -> Reading:
        """Return the frame with what else is measured in its tick."""
        raise NotImplementedError

    def apply(self, command: Command) -> None:
        if len(self.until_command) <= self.k:
            self.until_command.append(time.perf_counter() - self.given)

    def tare(self, images: Sequence[Pads]) -> None:
        pass

    def close(self) -> None:
        pass


def tell(result: Mapping[str, Any], as_json: bool) -> None:
    """Print the figures of a benchmark."""
    if as_json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key:<34}{value if not isinstance(value, float) else round(value, 3)}")
