"""One control tick of the PR2 driver, alone, with predictions, and with each sink. No hardware.

    python benchmarks/control.py [--grasps N] [--short]

The tick is what the runner does from the moment a report's bytes are in the process to the moment the command's are
handed to the wire: decode, count, convert, the hybrid controller's step, the guard, encode. A *pass* of the loop has
also what follows the command: recording it, and the checks for faults. The reports are those of an emulated grasp,
recorded first and played back, so that neither the emulated board nor the simulator is in the figure. The reports are
played back twice more by the clock, without and with the predictions of the default model at its checkpoints, in turn:
*paced* is the time from when a report is due to its command, in the squeeze, and *predicting* the same in the ticks
during which the thread beside the loop computes. Further times they are played back with each of the sinks: a live page
(*live*) and Foxglove (*foxglove*) that a viewer receives, a file of Rerun (*rerun*), an observer of a plugin
(*observer*). Within each grasp the sink takes every other block of ticks, so that ticks with and without it meet the
same machine. The last table says how much more the 99th percentile of the tick is in the blocks that it takes, with a
95 % interval over pairs of blocks, from when the report is in the process (*working*) and from when it is due (*due*);
*handed over* is what the runner spends on the sink after the command of a tick.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from arguments import parser_of
from attrs import evolve

from graspsense.core.components.registry import installed
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.grasp.sinks import Sink
from graspsense.core.pipeline.anytime import Anytime, anytime_of
from graspsense.core.pipeline.pipeline import model_for
from graspsense.core.settings.resolved import resolve
from graspsense.experiments.versions import where_measured
from graspsense.live.feeds import FILE_TIMEOUT_S, LiveFeed
from graspsense.plugin_api import SQUEEZE, DeviceInfo, create
from graspsense.report.found_table import markdown_table
from graspsense_pr2_gripper import backend as driver
from graspsense_pr2_gripper import emulation, opening
from graspsense_pr2_gripper.backend import Pr2Backend
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.faults import Wire
from graspsense_pr2_gripper.link import LockStepLink
from graspsense_pr2_gripper.protocol import decode_identity
from graspsense_pr2_gripper.transports.interface import Transport, TransportGone

SCHEDULERS = {os.SCHED_FIFO: "real-time (fifo)", os.SCHED_RR: "real-time (round robin)"}
BLOCK, SETTLING = 100, 10
"""Ticks of a block, and how many at its beginning are left out."""
EMULATED = Pr2Config(transport="emulated", calibration="none")


class Recorded(Wire):
    """A wire that keeps what the board sent."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.sent: list[bytes] = []
        recordings.append(self)

    def step(self) -> list[bytes]:
        reports = super().step()
        self.sent += reports
        return reports


recordings: list[Recorded] = []


class Playback(Transport):
    """Hands over recorded reports, and notes when it did and when a command came back.

    With `period_s` each report is handed over when it is due, and the time of a tick counts from there.
    """

    def __init__(self, reports: Sequence[bytes], feature: bytes, period_s: float = 0.0) -> None:
        self._reports, self._feature, self._next = reports, feature, 0
        self._period_ns = round(period_s * 1e9)
        self._due_ns = self._read_ns = self._there_ns = 0
        self.ticks_ns: list[int] = []
        self.working_ns: list[int] = []
        """The same from when the report was handed over."""
        self.passes_ns: list[int] = []
        """The times from when a report was handed over until the next one was asked for."""

    def read(self, timeout_s: float) -> bytes:
        if timeout_s == 0.0:  # nothing else waits
            return b""
        if self._there_ns:
            self.passes_ns.append(time.perf_counter_ns() - self._there_ns)
        if self._next == len(self._reports):
            raise TransportGone("the recording is over")
        self._next += 1
        data = self._reports[self._next - 1]
        self._read_ns = self._there_ns = time.perf_counter_ns()
        if self._period_ns:
            # A report that is late delays the ones after it, as on the wire of a board that waits for its command.
            self._due_ns = max(self._due_ns + self._period_ns, self._read_ns - self._period_ns)
            time.sleep(max(self._due_ns - self._read_ns, 0) * 1e-9)
            self._read_ns, self._there_ns = self._due_ns, time.perf_counter_ns()
        return data

    def write(self, report: bytes) -> None:
        if self._read_ns:
            now = time.perf_counter_ns()
            self.ticks_ns.append(now - self._read_ns)
            self.working_ns.append(now - self._there_ns)
            self._read_ns = 0

    def feature(self, report_id: int) -> bytes:
        return self._feature

    def close(self) -> None:
        pass


class RealTime(Pr2Backend):
    """Says that its clock does not wait, so that predictions are computed beside the loop as with a real gripper."""

    def open(self, seed: int) -> DeviceInfo:
        return evolve(super().open(seed), clock="device")


class InTurn:
    """A sink that passes on every other block of ticks, and notes which ticks and how long that takes."""

    def __init__(self, inner: Sink, wire: Playback, *, begins: bool) -> None:
        self._inner, self._wire, self._taken, self.begins = inner, wire, 0, begins
        self.us: list[float] = []
        self.blocks: list[range] = []
        """The ticks after each whole block's first ones; the sink takes every other block."""

    def take(self, *tick: Any) -> None:
        self._taken += 1
        # The sink's work for tick k is done before tick k + 1.
        ticks = len(self._wire.ticks_ns)
        if self._taken % BLOCK == 0:
            self.blocks.append(range(ticks - BLOCK + SETTLING, ticks))
        if (self._taken // BLOCK % 2 == 0) is self.begins:
            began = time.perf_counter_ns()
            self._inner.take(*tick)
            self.us.append((time.perf_counter_ns() - began) / 1e3)


VIEWER = """
import json, sys
from websockets.sync.client import connect
with connect(sys.argv[1], max_size=None, subprotocols=sys.argv[2:] or None) as viewer:
    print("connected", flush=True)
    for said in viewer:
        for channel in json.loads(said).get("channels", ()) if sys.argv[2:] and isinstance(said, str) else ():
            wanted = [{"id": channel["id"], "channelId": channel["id"]}]
            viewer.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
"""


class Watched:
    """Passes every tick on to the predictions, and notes in which ticks of a squeeze one is computed."""

    def __init__(self, inner: Anytime | None, wire: Playback) -> None:
        self._inner, self._wire = inner, wire
        self.squeeze: list[int] = []
        self.predicting: list[int] = []

    def begin(self, recorder: Any, info: Any, tell: Any) -> None:
        if self._inner is not None:
            self._inner.begin(recorder, info, tell)

    def watch(self, frame: Any, phase: int) -> str:
        computing = self._inner is not None and self._inner.computing
        reason = "" if self._inner is None else self._inner.watch(frame, phase)
        if phase >= SQUEEZE:
            tick = len(self._wire.ticks_ns) - 1
            self.squeeze.append(tick)
            if computing:
                self.predicting.append(tick)
        return reason


def recorded() -> tuple[Sequence[bytes], bytes]:
    """Return the reports of an emulated grasp, and the description of the board."""
    emulation.Wire = Recorded  # type: ignore[misc]
    # With the limits of a real gripper, so that its efforts answer the commands when it is played back.
    run_grasp(RealTime(EMULATED), create("controller", "hybrid"), RunConfig())
    emulation.Wire = Wire  # type: ignore[misc]
    return recordings[0].sent, recordings[0].firmware.feature()


def played(
    wire: Playback, feature: bytes, watcher: Watched | None = None, sinks: Sequence[Sink] = ()
) -> None:
    """Run a grasp on recorded reports."""
    identity = decode_identity(feature)
    link = LockStepLink(wire, 1.0 / identity.report_rate_hz)
    driver.open_board = lambda *_: opening.Opened(link, identity, None)  # type: ignore[assignment]
    law = create("controller", "hybrid")
    grasp = run_grasp(RealTime(EMULATED), law, RunConfig(), watcher=watcher, sinks=sinks)
    driver.open_board = opening.open_board
    assert grasp.outcome.words == "steady", grasp.reason


def ticks_us(grasps: int, sent: Sequence[bytes], feature: bytes) -> dict[str, list[float]]:
    """Return the times of the ticks, and of whole passes of the loop."""
    times_us: dict[str, list[float]] = {"tick": [], "pass": []}
    for _ in range(grasps):
        wire = Playback(sent, feature)
        played(wire, feature)
        times_us["tick"] += [ns / 1e3 for ns in wire.ticks_ns]
        times_us["pass"] += [ns / 1e3 for ns in wire.passes_ns]
    return times_us


def paced_us(grasps: int, sent: Sequence[bytes], feature: bytes) -> dict[str, list[float]]:
    """Return the times of the ticks of a squeeze, in turn without and with predictions at checkpoints."""
    settings = resolve("default")
    model = model_for(settings, installed())
    period_s = 1.0 / decode_identity(feature).report_rate_hz
    times_us: dict[str, list[float]] = {"paced": [], "paced with predictions": [], "predicting": []}
    for _ in range(grasps):
        for predicts in (False, True):
            wire = Playback(sent, feature, period_s)
            anytime = anytime_of(model, settings.features.create(), settings) if predicts else None
            watched = Watched(anytime, wire)
            try:
                played(wire, feature, watched)
            finally:
                if anytime is not None:
                    anytime.end()
            us = [ns / 1e3 for ns in wire.ticks_ns]
            times_us["paced with predictions" if predicts else "paced"] += [us[k] for k in watched.squeeze]
            times_us["predicting"] += [us[k] for k in watched.predicting]
    return times_us


def observe(batches: Iterable[Any]) -> None:
    """Take everything, as an observer of a plugin."""
    for _ in batches:
        pass


@contextmanager
def watched_feeds(folder: Path) -> Iterator[dict[str, LiveFeed]]:
    """Start each sink, with a viewer where it has one."""
    os.environ["PYTHONPATH"] = str(Path(__file__).parent)
    feeds = {
        "live": LiveFeed("graspsense.live.page_process", ["127.0.0.1", "0"]),
        "foxglove": LiveFeed("graspsense.live.foxglove_process", ["0"]),
        "rerun": LiveFeed("graspsense.live.rerun_process", [str(folder / "grasps.rrd")], FILE_TIMEOUT_S),
        "observer": LiveFeed("graspsense.live.observer_process", ["control:observe"]),
    }
    frames = feeds["live"].answer["address"].replace("http", "ws", 1) + "frames"
    viewers = [[frames], [feeds["foxglove"].answer["address"], "foxglove.sdk.v1"]]
    commands = [[sys.executable, "-c", VIEWER, *viewer] for viewer in viewers]
    watching = [subprocess.Popen(command, stdout=subprocess.PIPE) for command in commands]
    for viewer in watching:
        assert viewer.stdout is not None
        viewer.stdout.readline()  # it is connected
    yield feeds
    for name, feed in feeds.items():
        assert (error := feed.close()) == "", error
        assert not feed.dropped, name
    for viewer in watching:
        assert viewer.stdout is not None
        viewer.stdout.close()
        assert viewer.wait() == 0


def watched_us(
    grasps: int, sent: Sequence[bytes], feature: bytes
) -> tuple[list[list[str]], dict[str, list[float]]]:
    """Return what each sink adds to the ticks, as rows of a table, and the times that the runner spends on it (us)."""
    period_s = 1.0 / decode_identity(feature).report_rate_hz
    pairs: dict[str, list[tuple[list[float], list[float]]]] = {}
    spent: dict[str, list[float]] = {}
    with TemporaryDirectory() as folder, watched_feeds(Path(folder)) as feeds:
        for grasp in range(grasps):
            for name, feed in feeds.items():
                wire = Playback(sent, feature, period_s)
                sink = InTurn(feed, wire, begins=grasp % 2 == 1)
                played(wire, feature, sinks=[sink])
                for since, ns in {"working": wire.working_ns, "due": wire.ticks_ns}.items():
                    blocks = [[ns[k] / 1e3 for k in block] for block in sink.blocks]
                    without, taken = (blocks[k::2] for k in (sink.begins, not sink.begins))
                    pairs.setdefault(f"{name}, {since}", []).extend(zip(without, taken, strict=False))
                spent.setdefault(f"{name}, handed over", []).extend(sink.us)
    rows = []
    for name, blocks in pairs.items():
        added_us, (low_us, high_us) = added_p99(blocks)
        p99 = (f"{np.quantile(np.concatenate([pair[k] for pair in blocks]), 0.99):.1f}" for k in (0, 1))
        rows.append([name, *p99, f"{added_us:.1f} ({low_us:.1f} to {high_us:.1f})"])
    return rows, spent


def added_p99(pairs: Sequence[tuple[Sequence[float], Sequence[float]]]) -> tuple[float, list[float]]:
    """Return how much greater the p99 of the second ones is (us), and its 95 % interval over pairs."""

    def added(chosen: Iterable[int]) -> float:
        without, with_sink = (np.concatenate([pairs[k][i] for k in chosen]) for i in (0, 1))
        return float(np.quantile(with_sink, 0.99) - np.quantile(without, 0.99))

    generator = np.random.default_rng(1)
    draws = [added(generator.integers(len(pairs), size=len(pairs)).tolist()) for _ in range(1000)]
    return added(range(len(pairs))), [float(end) for end in np.quantile(draws, [0.025, 0.975])]


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--grasps", type=int, default=5, help="how often the grasp is played back")
    asked = parser.parse_args()
    if asked.short:
        asked.grasps = 1
    sent, feature = recorded()
    times_us = ticks_us(asked.grasps, sent, feature) | paced_us(asked.grasps, sent, feature)
    added, spent = watched_us(asked.grasps, sent, feature)
    quantiles = (0.5, 0.99, 0.999, 1.0)
    rows = [
        [name, str(len(us)), *(f"{np.quantile(us, share):.1f}" for share in quantiles)]
        for name, us in (times_us | spent).items()
        if us
    ]
    scheduler = SCHEDULERS.get(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK, "other")
    print(f"{where_measured()}, scheduler {scheduler}\n")
    print("\n".join(markdown_table(("time in µs", "number", "median", "99 %", "99.9 %", "most"), rows)))
    print("\n".join(("", *markdown_table(("sink", "99 % without", "with", "added, 95 %"), added))))


if __name__ == "__main__":
    main()
