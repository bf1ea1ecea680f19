"""What recording adds to a control tick: 1 kHz in real time, every tick with a new cell image, 61 numbers a tick.

    python benchmarks/recording.py [--json] [--rounds 10] [--seconds 4] [--short]

Runs with and without a recorder alternate, in an order drawn anew each round. The command is applied before the sinks,
so the time until then is given as well. The intervals are of the difference of the two p99 over resampled rounds.
"""

from __future__ import annotations

import argparse
import random
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from paced import Paced, tell

from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.experiments.versions import measured_on
from graspsense.plugin_api import Frame, Pads, Reading, create
from graspsense.recording.layout import TICK_FIELDS, pads_topic
from graspsense.recording.recorder import Recorder
from graspsense.recording.recording_info import RecordingInfo

GOAL_US = 20.0
CELLS = 22


class WithCells(Paced):
    """Every tick has a new image of the cells."""

    def reading(self, frame: Frame) -> Reading:
        cells = tuple(float((self.k * 7 + i) % 4096) for i in range(CELLS))
        return Reading(frame, Pads(frame.t_s, self.k + 1, cells, cells))


def one_run(ticks: int, path: Path | None) -> tuple[list[float], list[float], RecordingInfo | None]:
    gripper = WithCells(ticks)
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
    ticks = round(given.seconds * Paced.rate_hz)
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
        **measured_on(),
        "rate_hz": Paced.rate_hz,
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
    tell(result, given.json)


if __name__ == "__main__":
    main()
