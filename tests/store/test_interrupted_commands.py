"""Commands that are killed, run out of disk, or meet an error at a write; stores that were copied at a loss of power.

No finished trial is lost, every file is whole or as it was, and each loop says how often it harmed something: one that
harmed nothing fails. GRASPSENSE_KILLS is the number of kills of each command.
"""

import os
import random
import shutil
import signal
import subprocess
import sys
import time

import pytest
from attrs import evolve
from forked_commands import Commands
from grippers import bottle, squeezing
from kept import BENCH, begun, keep, write_recording
from repository import TESTS
from test_kills import recovered

from graspsense.core.components.registry import installed
from graspsense.core.learn.model_file import load_model
from graspsense.store.recover import recover_store
from graspsense.store.store import Store
from graspsense.store.verify import verify_store

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="needs Linux, to kill at a moment"),
]

KILLS = int(os.environ.get("GRASPSENSE_KILLS", "12"))
FULL_DISKS = 11
INJECTED = {"run": 1, "import": 10, "export": 4, "train": 4, "change": 1, "recover": 10}
"""The fewest writes of each command, each of which fails once, without those of SQLite and of the writer process."""
POWER_LOSSES = 12
TRIALS = 8
BARE = ("-o", "classifier.type=none")
COLUMNS = ("--time", "t", "--gap", "g", "--force", "f", "--force", "f", "--label", "can")


def filled(folder):
    """Make a store with trials of two labels, of a gripper that is not simulated."""
    with Store.open(folder) as store:
        for k in range(TRIALS):
            label, values = (
                ("can:full_open", (0.066, 5.5 + 0.1 * k)),
                ("can:empty_open", (0.05, 1.0 + 0.1 * k)),
            )
            name, measured = (label, values)[k % 2]
            keep(store, name, values=measured, device=REAL, ticks=60, grasp=k)
    return folder


REAL = evolve(BENCH, simulated=False)


class Lab:
    """A folder with a store and with the inputs and outputs of the commands, and what must be true of it."""

    def __init__(self, folder, commands=None):
        self.folder, self.commands = folder, commands
        folder.mkdir(parents=True, exist_ok=True)
        self.store = filled(folder / "trials")
        self.finished = self.made = 0

    def command(self, kind):
        """Return the words of a command that writes, made ready to run once more."""
        out = self.folder / "out"
        out.mkdir(exist_ok=True)
        self.made += 1
        if kind == "run":
            quick = ("--label", "block", "-o", "gripper.rate_hz=250")
            return ["run", "--save", self.store, "--changed", *quick, *BARE]
        if kind == "import":
            # Another grasp each time: none is imported twice.
            rows = (f"{k / 100},{squeezing(k / 100)},{bottle(k / 100)[0]}" for k in range(220))
            text = "\n".join(["t,g,f", *rows, f"2.3,0.054,{8 + self.made / 1000}"])
            (self.folder / "grasp.csv").write_text(text)
            return ["import", self.folder / "grasp.csv", *COLUMNS, "--save", self.store, *BARE]
        if kind == "export":
            for name in ("table.csv", "whole.csv"):
                (out / name).unlink(missing_ok=True)
            if self.commands is not None:
                assert self.commands.run("export", self.store, "--to", out / "whole.csv").code == 0
            return ["export", self.store, "--to", out / "table.csv"]
        if kind == "train":
            return ["train", f"store:{self.store}", "--out", out / "model.json", "--overwrite"]
        if kind == "change":
            # A killed change was made or was not: the next one is always another label than the present one.
            with Store.read(self.store) as store:
                present = store.trial(1).summary.label
            label = "can:half_open" if present == "can:full_open" else "can:full_open"
            refs = (f"{self.store}#1", f"{self.store}#3")
            return ["trials", "relabel", *refs, "--label", label, "--why", "so"]
        assert kind == "recover"
        with Store.open(self.store) as store:
            name = store.new_recording("2026-11-21T10:30:15.123+00:00")
        write_recording(name, 200, begun(device=REAL), finish=False)._out.close()
        return ["recover", self.store]

    def check(self, kind, done):
        """Nothing that was finished is lost, nothing is half, and nobody was shown a traceback."""
        assert done.killed or done.code in (0, 1, 2, 5), done.said
        assert "Traceback" not in done.said, done.said
        recoveries = recovered(self.store)
        assert [summary for summary in recoveries if summary.what == "failed"] == []
        verified = verify_store(self.store)
        assert verified.problems == ()
        assert verified.unfinished == ()
        with Store.read(self.store) as store:
            assert {summary.id for summary in store.page(limit=10_000, set_aside=None)} >= set(
                range(1, TRIALS + 1)
            )
            complete = sum(summary.complete for summary in store.page(limit=10_000))
            labels = {store.trial(number).summary.label for number in (1, 3)}
        assert len(labels) == 1, "both or neither were relabelled"
        if kind in ("run", "import") and not done.killed and done.code == 0:
            self.finished += 1
        if kind in ("run", "import"):
            assert complete >= TRIALS + self.finished
        self.check_outputs()

    def check_outputs(self):
        out = self.folder / "out"
        if (out / "table.csv").exists():
            assert (out / "table.csv").read_bytes() == (out / "whole.csv").read_bytes()
        if (out / "model.json").exists():
            load_model(str(out / "model.json"), installed())
        names = {path.name for path in out.iterdir() if not path.name.endswith(".part")}
        assert names <= {"table.csv", "whole.csv", "model.json"}


KINDS = tuple(INJECTED)


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    lab = Lab(tmp_path_factory.mktemp("warm"))
    commands = Commands(*(lab.command(kind) for kind in KINDS))
    yield commands
    commands.close()


@pytest.mark.parametrize("kind", KINDS)
def test_a_command_that_is_killed_at_a_random_moment(commands, tmp_path, kind):
    rng = random.Random(kind)
    lab = Lab(tmp_path, commands)
    done = commands.run(*lab.command(kind))
    assert done.code == 0, done.said
    lab.check(kind, done)
    killed = 0
    for _ in range(10 * KILLS):
        last = commands.run(*lab.command(kind), kill_after_s=rng.uniform(0.0, done.seconds))
        lab.check(kind, last)
        killed += last.killed
        if killed == KILLS:
            break
    assert killed == KILLS
    # And what was killed can be done again.
    last = commands.run(*lab.command(kind))
    assert last.code == 0, last.said
    lab.check(kind, last)
    assert [path for path in (tmp_path / "out").iterdir() if path.name.endswith(".part")] == []


def refused_by_the_disk(lab, run):
    """Run commands in turn, until the disk has refused enough of them; `run` runs one and returns how it ended."""
    refused = 0
    for k in range(10 * FULL_DISKS):
        kind = KINDS[k % len(KINDS)]
        done = run(lab.command(kind))
        lab.check(kind, done)
        refused += done.code != 0
        if refused == FULL_DISKS:
            break
    assert refused == FULL_DISKS


def test_a_disk_that_is_full_wherever_it_becomes_so(commands, tmp_path):
    """No file may become longer than so many bytes, which every user can have: what the disk says is the same."""
    rng = random.Random(2)
    refused_by_the_disk(
        Lab(tmp_path, commands),
        lambda words: commands.run(*words, longest_file=int(10 ** rng.uniform(0.0, 5.0))),
    )


def test_a_real_disk_that_is_full(commands, tmp_path, mounted):
    rng = random.Random(3)
    lab = Lab(mounted("size=8m") / "lab", commands)

    def on_a_full_disk(words):
        filler = lab.folder / "filler"
        free = shutil.disk_usage(lab.folder).free
        filler.write_bytes(bytes(max(0, free - int(10 ** rng.uniform(0.0, 5.5)))))
        done = commands.run(*words)
        filler.unlink()
        return done

    refused_by_the_disk(lab, on_a_full_disk)


@pytest.mark.parametrize("kind", KINDS)
def test_an_error_of_the_disk_at_each_write(commands, tmp_path, kind):
    lab = Lab(tmp_path, commands)
    injected = 0
    k = 0
    while True:
        k += 1
        done = commands.run(*lab.command(kind), folder=tmp_path, fail_at=k)
        lab.check(kind, done)
        if done.writes < k:
            break
        injected += 1
    assert injected >= INJECTED[kind]
    assert done.code == 0, done.said


WRITES = """
import sys
from pathlib import Path
from kept import keep
from graspsense.store.store import Store

folder = Path(sys.argv[1])
with Store.open(folder) as store:
    while True:
        number = keep(store, ticks=40)
        wal = folder / "store.sqlite-wal"
        print(number, wal.stat().st_size, flush=True)
"""


def test_a_store_as_the_disk_has_it_after_a_loss_of_power(tmp_path):
    """The program is stopped at a moment and its folder copied; what was not synced since is cut off at random.

    SQLite's log begins anew after 224 trials; about 300 are written. While a copy is checked, the program stands still.
    """
    rng = random.Random(4)
    program = [sys.executable, "-c", WRITES, str(tmp_path / "trials")]
    environ = {**os.environ, "PYTHONPATH": str(TESTS)}
    copies = cut = 0
    announced = synced = 0
    with subprocess.Popen(program, stdout=subprocess.PIPE, text=True, env=environ) as process:
        try:
            while copies < POWER_LOSSES:
                for _ in range(rng.randrange(1, 50)):
                    announced, synced = map(int, process.stdout.readline().split())
                time.sleep(rng.uniform(0.0, 0.02))
                process.send_signal(signal.SIGSTOP)
                os.waitid(os.P_PID, process.pid, os.WSTOPPED)
                copy = tmp_path / f"copy{copies}"
                shutil.copytree(tmp_path / "trials", copy)
                cut += cut_what_was_not_synced(copy, synced, rng)
                check_copy(copy, announced)
                copies += 1
                process.send_signal(signal.SIGCONT)
        finally:
            process.kill()
    assert copies == POWER_LOSSES
    assert cut >= 1, "some were copied in the middle of a trial"
    assert announced >= POWER_LOSSES


def cut_what_was_not_synced(copy, synced, rng):
    """Cut the log of the database and the unfinished recordings; return whether there was something to cut."""
    cut = False
    (copy / "store.sqlite-shm").unlink(missing_ok=True)
    log = copy / "store.sqlite-wal"
    longer = [(log, synced)] if log.exists() and log.stat().st_size > synced else []
    for path, least in (*longer, *((path, 0) for path in copy.glob("recordings/*.part"))):
        size = path.stat().st_size
        os.truncate(path, rng.randint(min(least, size), size))
        cut = True
    return cut


def check_copy(copy, announced):
    with Store.open(copy) as store:
        recoveries = recover_store(store)
        assert [summary for summary in recoveries if summary.what == "failed"] == []
        assert {summary.id for summary in store.page(limit=10_000) if summary.complete} >= set(
            range(1, announced + 1)
        )
    verified = verify_store(copy)
    assert (verified.problems, verified.unfinished) == ((), ())
