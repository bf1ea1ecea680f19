"""Experiments on one machine and on many, and everything that can go wrong there, with whole processes."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
import wayward
from attrs import frozen

from graspsense.core.values.errors import ConfigError
from graspsense.experiments.executors import dask

pytestmark = pytest.mark.slow

EXPERIMENT = """
title = "Going wrong"
seeds = 2
classifiers = ["wayward"]

{variants}

[data]
source = "trials.csv"
label = "what"

[judge]
folds = 2
controls = false
grasps = 0
"""
PROGRAM = (sys.executable, "-c", "from graspsense.cli.main import main; main()")


@frozen
class Lab:
    """A folder with the experiment, and the environment in which the plugin is found."""

    folder: Path
    environ: dict[str, str]

    def write(self, *hows):
        """Write an experiment with these cases, of which none has been told anything yet."""
        for told in (self.folder / "plugin").glob("marks.*"):
            told.unlink()
        variants = "\n".join(f'[[variants]]\nname = "{how}"\nclassifier.how = "{how}"' for how in hows)
        (self.folder / "trials.csv").write_text(wayward.CSV)
        (self.folder / "it.toml").write_text(EXPERIMENT.format(variants=variants))

    def start(self, out, *arguments):
        return subprocess.Popen(
            [*PROGRAM, "experiment", "it.toml", "--out", out, "--json", *arguments],
            cwd=self.folder,
            env=self.environ,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def run(self, out, *arguments, ends=0):
        """Run the experiment, which ends with this code, and return what it says as JSON and on standard error."""
        process = self.start(out, *arguments)
        stdout, stderr = process.communicate(timeout=300)
        assert process.returncode == ends, stderr
        return json.loads(stdout) if stdout else {}, stderr

    def results(self, out):
        """Return the result of each task in a folder by its name, None where it failed."""
        tasks = {}
        for path in (self.folder / out / "results").glob("*.json"):
            done = json.loads(path.read_text())
            tasks[done["name"]] = done["result"]
        return tasks

    def until(self, condition, process):
        """Wait until something is there; fail where the process has ended before."""
        while not condition():
            assert process.poll() is None, process.communicate()
            time.sleep(0.02)

    def waiting(self):
        """Return how many tasks are being done and wait to be told to go on."""
        return len(list((self.folder / "plugin" / "marks").glob("waits-*")))

    def tell(self, word):
        (self.folder / "plugin" / f"marks.{word}").touch()


@pytest.fixture
def lab(tmp_path):
    return Lab(tmp_path, wayward.install(tmp_path / "plugin"))


@pytest.mark.parametrize("how", ["SIGKILL", "SIGINT", pytest.param("SIGTERM", marks=pytest.mark.long)])
def test_a_run_that_is_ended_goes_on_where_it_was(lab, how):
    lab.write("fine", "waits")
    process = lab.start("out", "--executor", "processes", "--workers", "2")
    lab.until(lambda: len(lab.results("out")) >= 1 and lab.waiting() >= 1, process)
    process.send_signal(getattr(signal, how))
    process.wait(300)
    if how == "SIGKILL":
        lab.tell("go")  # a worker whose run is gone ends with its task
    stdout, _ = process.communicate(timeout=300)
    if how != "SIGKILL":
        assert process.returncode == 130
        summary = json.loads(stdout)
        assert summary["stopped"] == "interrupted"
        assert 1 <= summary["done"] < 4
    results = lab.results("out")
    lab.tell("go")
    summary, _ = lab.run("out", "--executor", "serial", "--resume")
    assert summary["kept"] == len(results) < 4
    assert summary["complete"]
    if how == "SIGKILL":
        lab.run("undisturbed", "--executor", "serial")
        assert lab.results("out") == lab.results("undisturbed")


@contextmanager
def scheduled(lab):
    """Start a real scheduler as a process of its own; yield it, its address, and what starts a worker of it."""
    pytest.importorskip("distributed", reason="Dask is not installed")
    started = []

    def start(*arguments, **environ):
        process = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]],
            # A task that ended its worker comes back at once: trying it again is ours.
            env={**lab.environ, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0", **environ},
            cwd=lab.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        started.append(process)
        return process

    note = lab.folder / "scheduler.json"
    options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file"]
    scheduler = start("dask_scheduler", *options, str(note))
    lab.until(lambda: note.exists() and note.read_text().endswith("}"), scheduler)
    address = json.loads(note.read_text())["address"]

    def worker(**environ):
        return start(
            "dask_worker", address, "--nthreads", "1", "--no-dashboard", "--death-timeout", "60", **environ
        )

    try:
        yield scheduler, address, worker
    finally:
        for process in started:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.wait(300)


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A folder with a plugin, and a scheduler with its address and two workers, which take seconds to start."""
    folder = tmp_path_factory.mktemp("cluster")
    lab = Lab(folder, wayward.install(folder / "plugin"))
    with scheduled(lab) as (scheduler, address, worker):
        worker(), worker()
        yield lab, scheduler, address


@pytest.mark.parametrize("executor", ["processes", "dask"])
def test_whatever_a_task_does_the_others_are_kept(executor, request):
    if executor == "processes":
        lab = request.getfixturevalue("lab")
    else:
        lab, _, address = request.getfixturevalue("cluster")
        executor = f"dask:{address}"
    lab.write("fine", "kills", "kills once", "raises", "prints", "exits")
    how = ("-o", "seeds=1", "--workers", "2", "--executor")
    summary, _ = lab.run("out", *how, executor, ends=1)

    assert summary["stopped"] is None
    assert summary["missing"] == 0
    results = lab.results("out")
    kept = {name: result for name, result in results.items() if result is not None}
    assert len(results) == 6
    assert kept.keys() == {f"{case}, seed 0" for case in ("fine", "kills once", "prints")}
    reasons = {failure["task"]: failure["reason"] for failure in summary["failed"]}
    assert "Unpicklable" in reasons["raises, seed 0"]
    assert re.fullmatch(r"SystemExit: 3 in plugin/wayward\.py:[0-9]+", reasons["exits, seed 0"])
    assert "its worker" in reasons["kills, seed 0"]

    lab.tell("tamed")
    summary, _ = lab.run("out", *how, "serial", "--resume")
    assert (summary["kept"], summary["done"], summary["complete"]) == (3, 3, True)
    assert kept.items() <= lab.results("out").items()


def test_a_cluster_of_two_workers_gives_what_one_process_gives(cluster):
    lab, _, address = cluster
    lab.write("fine")
    (lab.folder / "it.toml").write_text(
        EXPERIMENT.format(variants="").replace('["wayward"]', '["c45"]').replace("seeds = 2", "seeds = 3")
    )
    lab.run("dask", "--executor", f"dask:{address}")
    lab.run("serial", "--executor", "serial")

    assert len(lab.results("dask")) == 3
    assert lab.results("dask") == lab.results("serial")


def test_a_scheduler_that_is_stopped_ends_the_run_with_an_account(cluster):
    """The last test with it."""
    lab, scheduler, address = cluster
    lab.write("fine", "waits")
    process = lab.start("stopped", "--executor", f"dask:{address}")
    lab.until(lambda: len(lab.results("stopped")) >= 1 and lab.waiting() >= 1, process)
    os.killpg(scheduler.pid, signal.SIGKILL)
    stdout, stderr = process.communicate(timeout=300)

    assert process.returncode == 1, stderr
    summary = json.loads(stdout)
    assert "scheduler" in summary["stopped"]
    assert summary["done"] >= 1
    lab.tell("go")
    summary, _ = lab.run("stopped", "--executor", "serial", "--resume")
    assert summary["kept"] >= 1
    assert summary["complete"]


def test_workers_with_other_versions_are_refused(lab):
    lab.write("fine")
    with scheduled(lab) as (_, address, worker):
        worker(PYTHONPATH="")
        _, stderr = lab.run("out", "--executor", f"dask:{address}", ends=2)

    assert re.search(r"wayward: 0\.3\+[0-9a-f]{8} here, not installed", stderr)


def test_no_scheduler_there(monkeypatch):
    pytest.importorskip("distributed", reason="Dask is not installed")
    monkeypatch.setattr(dask, "CONNECTING_S", 0.5)
    with pytest.raises(ConfigError, match=r"tcp://127\.0\.0\.1:1 within 0\.5 s"):
        dask.DaskCluster("tcp://127.0.0.1:1")
