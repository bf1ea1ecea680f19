"""What recording adds to a control tick: 1 kHz in real time, every tick with a new cell image, 61 numbers a tick.

    python benchmarks/recording.py [--json] [--rounds 10] [--seconds 4] [--short]

Runs with and without a recorder alternate, in an order drawn anew each round. A tick is from the moment the
gripper's read returns to the moment it is called again: the law, the guard, the trace, and the sinks. The command is
applied before the sinks, so the time until then is given as well. The intervals are of the difference of the two p99
over resampled rounds.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import random
import tempfile
import time
from collections.abc import Mapping, Sequence
from datetime import date
from importlib.metadata import version
from math import inf
from pathlib import Path

import numpy as np

from graspsense.core.components.roles import SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import RecordingEnded
from graspsense.core.values.signals import EFFORT, Command, Frame, Pads, Reading
from graspsense.plugin_api import create
from graspsense.recording.layout import TICK_FIELDS, pads_topic
from graspsense.recording.recorder import Recorder
from graspsense.recording.recording_info import RecordingInfo

RATE_HZ = 1000.0
GOAL_US = 20.0
CELLS = 22


class Paced(SensorBackend[None]):
    """Fingers that close on nothing, on a clock of 1 ms, and how long each tick took."""

    def __init__(self, ticks: int) -> None:
        super().__init__(None)
        self.ticks, self.k, self.took, self.until_command = ticks, -1, [], []
        self.began = self.given = 0.0

    def open(self, seed: int) -> DeviceInfo:
        self.began = time.perf_counter()
        return DeviceInfo(
            name="paced",
            clock="device",
            rate_hz=RATE_HZ,
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
        t = self.k / RATE_HZ
        cells = tuple(float((self.k * 7 + i) % 4096) for i in range(CELLS))
        frame = Frame(t, 1 / RATE_HZ, 0.08 - 0.005 * t, -0.005, 10.0, 0.1 * (self.k % 5), 0.0, 0.0, 0.0, 0)
        reading = Reading(frame, Pads(t, self.k + 1, cells, cells))
        while (left := self.began + t - time.perf_counter()) > 0:
            time.sleep(left)
        self.given = time.perf_counter()
        return reading

    def apply(self, command: Command) -> None:
        if len(self.until_command) <= self.k:
            self.until_command.append(time.perf_counter() - self.given)

    def tare(self, images: Sequence[Pads]) -> None:
        pass

    def close(self) -> None:
        pass


def one_run(ticks: int, path: Path | None) -> tuple[list[float], list[float], RecordingInfo | None]:
    gripper = Paced(ticks)
    controller = create("controller", "hybrid")
    recorder = None
    if path is not None:
        recorder = Recorder(path)
        recorder.wait_ready()
    run_grasp(gripper, controller, RunConfig(), sinks=[] if recorder is None else [recorder])
    done = None if recorder is None else recorder.finish()
    return gripper.took, gripper.until_command, done


def p99_us(runs: Sequence[Sequence[float]]) -> float:
    return float(np.percentile(np.concatenate([np.asarray(run) for run in runs]), 99) * 1e6)


def added(
    took: Mapping[bool, Sequence[Sequence[float]]], generator: np.random.Generator
) -> tuple[float, list[float]]:
    """Return the difference of the p99 with and without a recorder (us), and its interval."""
    rounds = len(took[True])
    differences = []
    for _ in range(1000):
        which = generator.integers(rounds, size=rounds)
        differences.append(p99_us([took[True][i] for i in which]) - p99_us([took[False][i] for i in which]))
    return p99_us(took[True]) - p99_us(took[False]), [
        float(v) for v in np.percentile(differences, [2.5, 97.5])
    ]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    if given.short:
        given.rounds, given.seconds = 1, 1.0
    ticks = round(given.seconds * RATE_HZ)
    took: dict[bool, list[list[float]]] = {False: [], True: []}
    until_command: dict[bool, list[list[float]]] = {False: [], True: []}
    written: list[RecordingInfo] = []
    rng = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        for k in range(given.rounds):
            for recorded in rng.sample([False, True], 2):
                run, commanded, done = one_run(ticks, Path(folder) / f"{k}.mcap" if recorded else None)
                took[recorded].append(run)
                until_command[recorded].append(commanded)
                written += [done] if done else []
    generator = np.random.default_rng(1)
    added_us, interval = added(took, generator)
    added_to_command_us, to_command_interval = added(until_command, generator)
    result = {
        "date": date.today().isoformat(),
        "machine": f"{platform.processor() or platform.machine()}, {platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "mcap": version("mcap"),
        "load_average": round(os.getloadavg()[0], 2),
        "rate_hz": RATE_HZ,
        "channels": len(TICK_FIELDS) + len(pads_topic(CELLS).fields),
        "rounds": given.rounds,
        "ticks": given.rounds * ticks,
        "p50_us_without": float(np.median(np.concatenate(took[False])) * 1e6),
        "p50_us_with": float(np.median(np.concatenate(took[True])) * 1e6),
        "p99_us_without": p99_us(took[False]),
        "p99_us_with": p99_us(took[True]),
        "added_p99_us": added_us,
        "added_p99_us_interval": interval,
        "p99_us_to_command_without": p99_us(until_command[False]),
        "p99_us_to_command_with": p99_us(until_command[True]),
        "added_p99_us_to_command": added_to_command_us,
        "added_p99_us_to_command_interval": to_command_interval,
        "goal_us": GOAL_US,
        "recorded_ticks": sum(info.ticks for info in written),
        "deferred": sum(info.deferred for info in written),
        "dropped": sum(info.dropped for info in written),
        "bytes_per_second": sum(info.size for info in written) / (given.rounds * given.seconds),
    }
    if given.json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key:<34}{value if not isinstance(value, float) else round(value, 2)}")


if __name__ == "__main__":
    main()
