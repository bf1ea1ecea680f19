"""What recording adds to a control tick in real time: cell images at 1 kHz, and two cameras at 100 Hz.

    python benchmarks/recording.py [--rounds 10] [--seconds 4] [--short]

The fingers of a made gripper close on nothing. At 1 kHz every tick has a new image of 2 x 22 cells, which is 61 numbers
a tick with the others; at 100 Hz there are two cameras of 240 x 320 x 3 at 30 Hz. Runs with and without a recorder
alternate, in an order drawn anew each round. A tick is from the moment the gripper's read returns to the moment it is
called again: the law, the guard, the trace, and the recorder. The command is applied before the recorder takes the
tick, so the time until then is given as well. The interval is of the difference of the two 99th percentiles over
resampled rounds.
"""

from __future__ import annotations

import random
import tempfile
import time
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from arguments import parser_of

from graspsense.core.components.channels import cells_of
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.errors import RecordingEnded
from graspsense.experiments.versions import where_measured
from graspsense.gripper_api import no_signals
from graspsense.plugin_api import (
    EFFORT,
    NO_PADS,
    Command,
    DeviceInfo,
    Frame,
    Image,
    Pads,
    Reading,
    SensorBackend,
    TactileArray,
    create,
    signal_type,
)
from graspsense.recording.recorder import Recorder
from graspsense.recording.recording_info import RecordingInfo
from graspsense.report.found_table import markdown_table

CELLS, IMAGE_HZ, PICTURES = 22, 30.0, 16


class Paced(SensorBackend[Any]):
    """A gripper on the machine's clock, with how long each tick took, and how long until its command."""

    rate_hz = 1000.0
    speed_m_s = 0.005

    def __init__(self, seconds: float) -> None:
        super().__init__(None)
        self.ticks, self.k = round(seconds * self.rate_hz), -1
        self.took: list[float] = []
        self.until_command: list[float] = []

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
        if self.k >= 0:
            self.took.append(time.perf_counter() - self.given)
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
        """Return the frame with a new image of the cells."""
        cells = tuple(float((self.k * 7 + i) % 4096) for i in range(CELLS))
        return Reading(frame, Pads(frame.t_s, self.k + 1, cells, cells))

    def apply(self, command: Command) -> None:
        if len(self.until_command) <= self.k:
            self.until_command.append(time.perf_counter() - self.given)

    def tare(self, images: Sequence[Pads]) -> None:
        pass

    def close(self) -> None:
        pass


class WithCameras(Paced):
    """Two cameras behind soft pads: a slow change of brightness, a dent, and noise."""

    rate_hz = 100.0
    speed_m_s = 0.001
    channels = tuple(
        TactileArray(
            name, "counts", IMAGE_HZ, finger=name, rows=240, columns=320, components=3, dtype="uint8"
        )
        for name in ("left", "right")
    )

    def __init__(self, seconds: float) -> None:
        super().__init__(seconds)
        self.images, self.signals, self.pictures = 0, no_signals(self.channels), []
        y, x = np.mgrid[0:240, 0:320]
        rng = np.random.default_rng(1)
        for k in range(PICTURES):
            dent = 60.0 * np.exp(-(((x - 160) / 60.0) ** 2) - ((y - 100 - 2 * k) / 45.0) ** 2)
            light = np.stack([90 + 0.2 * x, 110 + 0.2 * y, 150 - 0.1 * x], axis=-1) + dent[..., np.newaxis]
            noisy = np.rint(light + rng.normal(0.0, 1.5, light.shape))
            self.pictures.append(np.clip(noisy, 0, 255).astype(np.uint8))

    def reading(self, frame: Frame) -> Reading:
        if frame.t_s * IMAGE_HZ >= self.images:
            self.images += 1
            # Every image is an array of its own, as that of a driver.
            pictures = (self.pictures[(self.images + i) % PICTURES].copy() for i in range(2))
            new = (
                Image(frame.t_s, self.images, cells_of(*pair))
                for pair in zip(self.channels, pictures, strict=True)
            )
            self.signals = signal_type(self.channels)(*new)
        return Reading(frame, NO_PADS, self.signals)


def grasped(gripper: Paced, path: Path | None) -> RecordingInfo | None:
    """Run a grasp, and return what was recorded in the file, if any."""
    recorder = None if path is None else Recorder(path)
    if recorder is not None:
        recorder.wait_ready()
    controller = create("controller", "hybrid", move_timeout_s=60.0)
    run_grasp(gripper, controller, RunConfig(), sinks=[] if recorder is None else [recorder])
    return None if recorder is None else recorder.finish()


def us(runs: Sequence[Sequence[float]], share: float) -> float:
    return 1e6 * float(np.quantile(np.concatenate(runs), share))


def row(name: str, runs: dict[bool, list[list[float]]]) -> list[str]:
    """Return the times without and with a recorder, and how much longer the 99th percentile is, with its interval."""
    rng, rounds = np.random.default_rng(1), len(runs[True])

    def added(chosen: Sequence[int]) -> float:
        with_recorder, without = (us([runs[recorded][i] for i in chosen], 0.99) for recorded in (True, False))
        return with_recorder - without

    low, high = np.quantile([added(rng.integers(rounds, size=rounds)) for _ in range(1000)], [0.025, 0.975])
    quantiles = [f"{us(runs[recorded], share):.1f}" for share in (0.5, 0.99) for recorded in (False, True)]
    return [name, *quantiles, f"{added(range(rounds)):.1f} ({low:.1f} to {high:.1f})"]


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=4.0)
    given = parser.parse_args()
    if given.short:
        given.rounds, given.seconds = 1, 0.5
    rows, counts, order = [], [], random.Random(1)
    for name, kind in (("cells, 1 kHz", Paced), ("cameras, 100 Hz", WithCameras)):
        took: dict[bool, list[list[float]]] = {False: [], True: []}
        until_command: dict[bool, list[list[float]]] = {False: [], True: []}
        infos = []
        with tempfile.TemporaryDirectory() as folder:
            for k in range(given.rounds):
                for recorded in order.sample([False, True], 2):
                    gripper = kind(given.seconds)
                    infos.append(grasped(gripper, Path(folder, f"{k}.mcap") if recorded else None))
                    took[recorded].append(gripper.took)
                    until_command[recorded].append(gripper.until_command)
        rows += [row(f"{name}: whole tick", took), row(f"{name}: until the command", until_command)]
        written = [info for info in infos if info is not None]
        ticks, deferred, dropped = (
            sum(getattr(i, n) for i in written) for n in ("ticks", "deferred", "dropped")
        )
        size = sum(info.size for info in written) / (given.rounds * given.seconds) / 1e6
        counts.append(
            f"{name}: of {ticks} ticks {deferred} deferred and {dropped} dropped; {size:.2f} MB a second"
        )
    heads = ("time in µs", "median", "recorded", "99th percentile", "recorded", "longer by, 95 %")
    print("\n".join((*markdown_table(heads, rows), "", *counts, where_measured())))


if __name__ == "__main__":
    main()
