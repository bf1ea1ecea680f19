"""What two cameras of 240 x 320 x 3 at 30 Hz add to a control tick of 100 Hz, and what their recording takes.

    python benchmarks/images.py [--json] [--seconds 4] [--longer 20] [--rounds 5] [--floats] [--short]

A tick is from the moment the gripper's read returns to the moment it is called again: the law, the guard, the trace,
and the recorder. Runs with and without the cameras alternate; both are recorded. The memory is what the process has at
the end of a longer grasp beside what it has at the end of a short one, without the pages of files, which the system
takes back. `--floats` declares the cells as Python floats, as every array was before images were numpy arrays.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from datetime import date
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from graspsense.core.components.channels import cells_of
from graspsense.core.components.roles import SensorBackend
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import RecordingEnded
from graspsense.gripper_api import no_signals
from graspsense.plugin_api import (
    EFFORT,
    NO_PADS,
    Command,
    Frame,
    Image,
    Pads,
    Reading,
    TactileArray,
    create,
    signal_type,
)
from graspsense.recording.layout import DEVICE, START
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorder import Recorder
from graspsense.recording.recording_info import RecordingInfo
from graspsense.recording.trial_record import TrialRecord

RATE_HZ = 100.0
IMAGE_HZ = 30.0
GOAL_TICK_MS = 1.0
GOAL_OPEN_S = 1.0
POOL = 16


def cameras(floats: bool) -> tuple[TactileArray, ...]:
    return tuple(
        TactileArray(
            f"camera_{side}",
            "counts",
            IMAGE_HZ,
            finger=side,
            rows=240,
            columns=320,
            components=3,
            dtype="float64" if floats else "uint8",
        )
        for side in ("left", "right")
    )


def pictures() -> list[Any]:
    """Pictures as a camera behind a soft pad has them: a slow change of brightness, a dent, and noise."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[0:240, 0:320]
    frames = []
    for k in range(POOL):
        dent = 60.0 * np.exp(-(((x - 160) / 60.0) ** 2) - ((y - 100 - 2 * k) / 45.0) ** 2)
        light = np.stack([90 + 0.2 * x, 110 + 0.2 * y, 150 - 0.1 * x], axis=-1) + dent[..., np.newaxis]
        frames.append(np.clip(np.rint(light + rng.normal(0.0, 1.5, light.shape)), 0, 255).astype(np.uint8))
    return frames


class Paced(SensorBackend[tuple[TactileArray, ...]]):
    """Fingers that close on nothing at 100 Hz, with cameras or without, and how long each tick took."""

    def __init__(self, ticks: int, channels: tuple[TactileArray, ...]) -> None:
        super().__init__(channels)
        self.ticks, self.k, self.images = ticks, -1, 0
        self.took: list[float] = []
        self.pool = pictures()
        self.signals = no_signals(channels)
        self.began = self.given = 0.0

    @property
    def channels(self) -> tuple[TactileArray, ...]:
        return self.config

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
        if self.channels and t * IMAGE_HZ >= self.images:
            self.images += 1
            # Every image is an array of its own, as that of a driver.
            new = [
                Image(t, self.images, cells_of(channel, self.pool[(self.images + i) % POOL].copy()))
                for i, channel in enumerate(self.channels)
            ]
            self.signals = signal_type(self.channels)(*new)
        frame = Frame(t, 1 / RATE_HZ, 0.08 - 0.001 * t, -0.001, 10.0, 0.1 * (self.k % 5), 0.0, 0.0, 0.0, 0)
        reading = Reading(frame, NO_PADS, self.signals)
        while (left := self.began + t - time.perf_counter()) > 0:
            time.sleep(left)
        self.given = time.perf_counter()
        return reading

    def apply(self, command: Command) -> None:
        pass

    def tare(self, images: Sequence[Pads]) -> None:
        pass

    def close(self) -> None:
        pass


def one_run(
    seconds: float, path: Path, channels: tuple[TactileArray, ...]
) -> tuple[list[float], RecordingInfo]:
    gripper = Paced(round(seconds * RATE_HZ), channels)
    made_at = "2026-01-01T00:00:00+00:00"
    record = TrialRecord(made_at=made_at, origin="run", labels={}, settings={"gripper": {}}, provenance={})
    recorder = Recorder(path)

    def opened(device: DeviceInfo) -> None:
        recorder.metadata(DEVICE, record.with_device(device).section(DEVICE))
        recorder.wait_ready()

    recorder.metadata(START, record.section(START))
    run_grasp(
        gripper,
        create("controller", "hybrid", move_timeout_s=60.0),
        RunConfig(),
        sinks=[recorder],
        on_open=opened,
    )
    return gripper.took, recorder.finish()


def memory_mb(seconds: float, floats: bool) -> float:
    """Return the memory of a process that recorded so long a grasp, at the end of the grasp."""
    command = [sys.executable, __file__, "--memory", str(seconds), *(["--floats"] if floats else [])]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def print_memory(seconds: float, floats: bool) -> None:
    with tempfile.TemporaryDirectory() as folder:
        one_run(seconds, Path(folder) / "g.mcap", cameras(floats))
        lines = Path("/proc/self/status").read_text().splitlines()
    # The pages of mapped files are not counted.
    print(next(float(line.split()[1]) / 1024 for line in lines if line.startswith("RssAnon")))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--seconds", type=float, default=4.0)
    parser.add_argument("--longer", type=float, default=20.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--floats", action="store_true")
    parser.add_argument("--memory", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    if given.memory:
        print_memory(given.memory, given.floats)
        return
    if given.short:
        given.rounds, given.seconds, given.longer = 1, 0.5, 1.0
    took: dict[bool, list[float]] = {False: [], True: []}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(given.rounds):
            for with_cameras in (True, False):
                path = Path(folder) / f"{k}-{with_cameras}.mcap"
                run, written = one_run(given.seconds, path, cameras(given.floats) if with_cameras else ())
                took[with_cameras] += run
                if with_cameras:
                    done = written
        began = time.perf_counter()
        trace = read_recorded(Path(folder) / "0-True.mcap").trace()
        opened_s = time.perf_counter() - began
        images = len(trace.signals["camera_left"].t_s) + len(trace.signals["camera_right"].t_s)
    short_mb, long_mb = memory_mb(given.seconds, given.floats), memory_mb(given.longer, given.floats)
    mean_ms = {case: 1e3 * float(np.mean(values)) for case, values in took.items()}
    result = {
        "date": date.today().isoformat(),
        "machine": f"{platform.processor() or platform.machine()}, {platform.system()} {platform.release()}",
        "python": platform.python_version(),
        "load_average": round(os.getloadavg()[0], 2),
        "cells": "float64" if given.floats else "uint8",
        "ticks": len(took[True]),
        "mean_ms_without": mean_ms[False],
        "mean_ms_with": mean_ms[True],
        "added_mean_ms": mean_ms[True] - mean_ms[False],
        "p99_ms_without": 1e3 * float(np.percentile(took[False], 99)),
        "p99_ms_with": 1e3 * float(np.percentile(took[True], 99)),
        "goal_tick_ms": GOAL_TICK_MS,
        "images": images,
        "deferred": done.deferred,
        "dropped": done.dropped,
        "mb_recorded": done.size / 1e6,
        "opened_s": opened_s,
        "goal_opened_s": GOAL_OPEN_S,
        f"memory_mb_after_{given.seconds:g}_s": short_mb,
        f"memory_mb_after_{given.longer:g}_s": long_mb,
    }
    if given.json:
        print(json.dumps(result, indent=2))
        return
    for key, value in result.items():
        print(f"{key:<34}{value if not isinstance(value, float) else round(value, 3)}")


if __name__ == "__main__":
    main()
