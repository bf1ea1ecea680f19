"""What two cameras of 240 x 320 x 3 at 30 Hz add to a control tick of 100 Hz, and what their recording takes.

    python benchmarks/images.py [--json] [--seconds 4] [--longer 20] [--rounds 5] [--short]

Runs with and without the cameras alternate; both are recorded. The memory is what the process has at the end of a
longer grasp beside what it has at the end of a short one, without the pages of files, which the system takes back.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from paced import Paced, tell

from graspsense.core.components.channels import cells_of
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.device import DeviceInfo
from graspsense.experiments.versions import measured_on
from graspsense.gripper_api import no_signals
from graspsense.plugin_api import NO_PADS, Frame, Image, Reading, TactileArray, create, signal_type
from graspsense.recording.layout import DEVICE, START
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorder import Recorder
from graspsense.recording.recording_info import RecordingInfo
from graspsense.recording.trial_record import TrialRecord

IMAGE_HZ = 30.0
GOAL_TICK_MS = 1.0
GOAL_OPEN_S = 1.0
POOL = 16


CAMERAS = tuple(
    TactileArray(
        f"camera_{side}", "counts", IMAGE_HZ, finger=side, rows=240, columns=320, components=3, dtype="uint8"
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


class WithCameras(Paced):
    """The channels are those of the cameras, at 100 Hz, or none."""

    rate_hz = 100.0
    speed_m_s = 0.001

    def __init__(self, ticks: int, channels: tuple[TactileArray, ...]) -> None:
        super().__init__(ticks, channels)
        self.images, self.pool, self.signals = 0, pictures(), no_signals(channels)

    @property
    def channels(self) -> tuple[TactileArray, ...]:
        return self.config

    def reading(self, frame: Frame) -> Reading:
        if self.channels and frame.t_s * IMAGE_HZ >= self.images:
            self.images += 1
            # Every image is an array of its own, as that of a driver.
            new = [
                Image(frame.t_s, self.images, cells_of(channel, self.pool[(self.images + i) % POOL].copy()))
                for i, channel in enumerate(self.channels)
            ]
            self.signals = signal_type(self.channels)(*new)
        return Reading(frame, NO_PADS, self.signals)


def one_run(
    seconds: float, path: Path, channels: tuple[TactileArray, ...]
) -> tuple[list[float], RecordingInfo]:
    gripper = WithCameras(round(seconds * WithCameras.rate_hz), channels)
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


def memory_mb(seconds: float) -> float:
    """Return the memory of a process that recorded so long a grasp, at the end of the grasp."""
    command = [sys.executable, __file__, "--memory", str(seconds)]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def print_memory(seconds: float) -> None:
    with tempfile.TemporaryDirectory() as folder:
        one_run(seconds, Path(folder) / "g.mcap", CAMERAS)
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
    parser.add_argument("--memory", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--short", action="store_true", help="least work, only to show that it runs")
    given = parser.parse_args()
    if given.memory:
        print_memory(given.memory)
        return
    if given.short:
        given.rounds, given.seconds, given.longer = 1, 0.5, 1.0
    took: dict[bool, list[float]] = {False: [], True: []}
    with tempfile.TemporaryDirectory() as folder:
        for k in range(given.rounds):
            for with_cameras in (True, False):
                path = Path(folder) / f"{k}-{with_cameras}.mcap"
                run, written = one_run(given.seconds, path, CAMERAS if with_cameras else ())
                took[with_cameras] += run
                if with_cameras:
                    done = written
        began = time.perf_counter()
        trace = read_recorded(Path(folder) / "0-True.mcap").trace()
        opened_s = time.perf_counter() - began
        images = len(trace.signals["camera_left"].t_s) + len(trace.signals["camera_right"].t_s)
    short_mb, long_mb = memory_mb(given.seconds), memory_mb(given.longer)
    mean_ms = {case: 1e3 * float(np.mean(values)) for case, values in took.items()}
    result = {
        **measured_on(),
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
    tell(result, given.json)


if __name__ == "__main__":
    main()
