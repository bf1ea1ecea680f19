"""SIGKILL at random moments: of a recorder together with its writer, and of `graspsense collect`.

Six kills each, or as many as GRASPSENSE_KILLS says; with GRASPSENSE_KILLS_REPORT a file gets what was found.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from paced_recorder import PROGRESS
from repository import TESTS

from graspsense.recording.reader import read_recorded
from graspsense.store.recover import recover_store
from graspsense.store.store import Store
from graspsense.store.verify import verify_store

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/cmdline").exists(), reason="needs /proc, to see a writer end"),
]

KILLS = int(os.environ.get("GRASPSENSE_KILLS", "6"))
MOST_MISSING_S = 0.1
TICKS = 400


def report(name, **figures):
    path = os.environ.get("GRASPSENSE_KILLS_REPORT")
    if path:
        with Path(path).open("a") as file:
            file.write(json.dumps({"test": name, "kills": KILLS, **figures}) + "\n")


def at_work(folder):
    """Return the processes that were started for this folder: writers, and what is about to become one."""
    folders = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(OSError):
            if str(folder).encode() in path.read_bytes():
                folders.append(path.parent.name)
    return folders


def recovered(folder):
    """Return what `recover` says of each file, once no writer that outlived its program is at work any more."""
    until = time.monotonic() + 60.0
    # A process has no command line for a moment while it becomes another program: one look can miss it.
    looks = 0
    while looks < 3:
        looks = 0 if at_work(folder) else looks + 1
        assert time.monotonic() < until, "a writer outlived its program by a minute"
        time.sleep(0.02)
    with Store.open(folder) as store:
        return recover_store(store)


def kill(*pids):
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def until_tick(progress, number, process):
    """Wait until the program has handed over so many ticks, over all trials; return the process of its writer."""
    trial = tick = writer = 0
    # A look in the middle of its writing may find a trial and no process yet.
    while not writer or (trial - 1) * TICKS + tick < number:
        assert process.poll() is None, "it ended by itself"
        time.sleep(0.002)
        data = progress.read_bytes() if progress.exists() else b""
        if len(data) == PROGRESS.size:
            trial, tick, writer = PROGRESS.unpack(data)
    return writer


def check(folder, announced):
    """Every announced trial is there and counts, every file opens, and SQLite and all hashes are well."""
    recoveries = recovered(folder)
    assert [recovery for recovery in recoveries if recovery.what == "failed"] == []
    with Store.read(folder) as store:
        there = {
            recovery.instance or recovery.label for recovery in store.page(limit=10_000) if recovery.complete
        }
        assert announced <= there
    verified = verify_store(folder)
    assert verified.problems == ()
    assert verified.unfinished == ()
    return recoveries


def test_a_recorder_killed_with_its_writer_loses_at_most_100_ms_of_the_running_trial(tmp_path):
    """Both processes at once: the worst case. Killed alone, the writer would still write all it was given.

    Every third is killed at a moment instead of at a tick: between two trials too, or while one is being kept.
    """
    rng = random.Random(9)
    missing = []
    for k in range(KILLS):
        folder, progress = tmp_path / f"{k}", tmp_path / f"{k}.progress"
        program = [sys.executable, TESTS / "paced_recorder.py", folder, progress, f"{TICKS / 1000}"]
        with subprocess.Popen(program, stdout=subprocess.PIPE, text=True) as process:
            writer = until_tick(progress, rng.randrange(2 * TICKS), process)
            if k % 3 == 2:
                time.sleep(rng.uniform(0.0, 0.6))
                _, _, writer = PROGRESS.unpack(progress.read_bytes())
            kill(*rng.sample([process.pid, writer], 2))
            printed = process.stdout.read()
        trial, last, writer_now = PROGRESS.unpack(progress.read_bytes())
        announced = {f"can#{line.split()[1]}" for line in printed.splitlines()}
        recoveries = check(folder, announced)
        if f"can#{trial}" in announced or writer_now != writer:
            continue  # nothing was running, or a new writer had begun between the look and the kill
        with Store.read(folder) as store:
            running = [summary for summary in store.page(limit=1000) if summary.instance == f"can#{trial}"]
            ticks = len(read_recorded(store.recording_path(running[0].recording))) if running else 0
        if ticks == 0:
            assert [summary.what for summary in recoveries] in ([], ["empty"])
        missing.append((last + 1 - ticks) / 1000.0)
    report("recorder", running=len(missing), most_missing_s=max(missing), missing_s=sorted(missing))
    assert len(missing) >= KILLS // 3
    assert max(missing) <= MOST_MISSING_S


def is_kept(line):
    """Whether this line says that a trial is kept."""
    return line.startswith("trial ") and " steady" in line


def test_a_killed_collect_loses_no_trial_and_goes_on(tmp_path):
    """One store all along: killed again and again, some time after its first, second or third trial or before any."""
    rng = random.Random(10)
    folder, each = tmp_path / "trials", 20 * KILLS
    command = [sys.executable, "-m", "graspsense", "collect", "--save", str(folder), "--each", str(each)]
    command += ["--labels", "can:full_open,block", "-o", "classifier.type=none"]
    announced, recovered_trials = 0, 0
    for _ in range(KILLS):
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as process:
            process.stdin.write("\n" * 2 * each)
            process.stdin.flush()
            said, wanted = [], rng.randrange(4)
            while sum(map(is_kept, said)) < wanted or not any("next:" in summary for summary in said):
                said.append(process.stderr.readline())
                assert said[-1], "collect ended by itself"
            time.sleep(rng.uniform(0.0, 0.3))
            kill(process.pid)
            said += process.stderr.readlines()
        announced += sum(map(is_kept, said))
        recoveries = check(folder, set())
        recovered_trials += sum(summary.what in ("added", "recovered") for summary in recoveries)
        with Store.read(folder) as store:
            assert sum(store.counts("collect").values()) >= announced
    report("collect", announced=announced, recovered=recovered_trials)
    assert announced > 0
    with Store.read(folder) as store:
        numbers = [summary.id for summary in store.page(set_aside=None, limit=10_000)]
        assert numbers == sorted(set(numbers), reverse=True)
        for summary in store.page(limit=10_000):
            trial = store.trial(summary.id)
            assert len(read_recorded(trial.recording)) == trial.recorder["ticks"]
