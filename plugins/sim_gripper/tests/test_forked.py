"""Large batches in forked processes: the results of threads, whatever happens to a process.

Every test runs a script, since a process with other threads, as that of pytest may be, is not forked.
"""

import json
import os
import signal
import subprocess
import sys

import pytest

from graspsense.plugin_api import create
from graspsense_sim_gripper.batch import forked
from graspsense_sim_gripper.batch.threads import job_of
from graspsense_sim_gripper.config import SimConfig

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks"),
]

PRELUDE = """
import json, os, signal, sys, threading
from collections import namedtuple
from graspsense.plugin_api import CompiledExtraction, create
from graspsense_sim_gripper.backend import SimBackend
from graspsense_sim_gripper.batch import threads
from graspsense_sim_gripper.batch.threads import grasps, job_of
from graspsense_sim_gripper.config import SimConfig

law, features = create("controller", "hybrid"), create("feature-set", "chitta")
names = ["block", "can:full_open", "egg", "odwalla_worn:full_closed", "none"]
N = 230
scenes = [names[k % len(names)] for k in range(N)]
forked = []

class Counted(threads.ForkedProcess):
    def __init__(self, *arguments):
        super().__init__(*arguments)
        forked.append(self._process.pid)

threads.ForkedProcess = Counted

def batch(extract=features.extract, *, workers=2, worth=200, sensor="pads"):
    threads.WORTH_FORKING = worth
    options = {"extract": extract, "workers": workers}
    job = job_of(SimConfig(sensor=sensor), law, options, features=features)
    return [
        (one.outcome.value, one.reason, repr(one.extracted), repr(one.state), repr(one.report(threads.kinds_in(scene))))
        for one, scene in zip(grasps(job, scenes, range(N), True, options), scenes)
    ]
"""


def said_by(script):
    """Return what a script prints, as JSON."""
    done = subprocess.run([sys.executable, "-c", PRELUDE + script], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return json.loads(done.stdout)


@pytest.fixture(scope="module", autouse=True)
def _compiled():
    pytest.importorskip("numba", reason="the compiled loop needs the extra `fast`")


@pytest.mark.parametrize("sensor", ["pads", "ideal"])
def test_forked_processes_give_the_results_of_threads(sensor):
    found = said_by(
        f"""
in_threads = batch(worth=10 * N, sensor="{sensor}")
before = list(forked)
in_processes = batch(sensor="{sensor}")
print(json.dumps([before, len(forked), in_threads == in_processes, len(set(in_processes)) > N // 2]))
"""
    )
    assert found == [[], 2, True, True]


def test_a_process_that_is_killed_leaves_its_grasps_to_this_one():
    assert said_by(
        """
whole = batch(worth=10 * N)
answer = Counted.answer
def answer_once(self, begin):
    told = answer(self, begin)
    os.kill(self._process.pid, signal.SIGKILL)
    return told
Counted.answer = answer_once
print(json.dumps([batch() == whole, len(forked)]))
"""
    ) == [True, 2]


def test_what_fails_in_a_process_is_run_here():
    assert said_by(
        """
whole = batch(worth=10 * N)
def failing(grasps):
    raise ValueError("not a number")
threads.answer_of = failing
print(json.dumps([batch() == whole, len(forked)]))
"""
    ) == [True, 2]


def test_without_a_further_process_threads_run_the_grasps():
    assert said_by(
        """
import os
whole, real = batch(worth=10 * N), os.fork
def refused():
    raise BlockingIOError(11, "Resource temporarily unavailable")
os.fork = refused
none = batch() == whole and forked == []
left = [1]
os.fork = lambda: real() if left and left.pop() else refused()
print(json.dumps([none, batch() == whole, len(forked)]))
"""
    ) == [True, True, 1]


def test_a_named_tuple_that_is_measured_comes_back_as_one():
    assert said_by(
        """
from graspsense_sim_gripper.batch.forked import results
Found = namedtuple("Found", "largest_n last")
def largest(params, ticks):
    most = 0.0
    for force in ticks.force_left_n:
        most = max(most, force)
    return Found(most, float(len(ticks.t_s)))
class Largest:
    def __call__(self, trace):
        return largest((), trace)
    def compiled_extraction(self):
        return CompiledExtraction(largest, (), lambda found: (type(found).__name__, found.largest_n))
found = batch(Largest())
print(json.dumps([len(forked), found[0][2][:9], found == batch(Largest(), worth=10 * N)]))
"""
    ) == [2, "('Found',", True]


def test_a_process_with_other_threads_is_not_forked():
    assert (
        said_by(
            """
threading.Thread(target=threading.Event().wait, daemon=True).start()
batch()
print(json.dumps(len(forked)))
"""
        )
        == 0
    )


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGINT])
def test_no_process_outlives_the_one_that_forked_it(sent):
    script = """
N = 10**6
scenes = [names[k % len(names)] for k in range(N)]
def told(done, of):
    if len(forked) == 2 and done > 0:
        print("running", flush=True)
options = {"extract": features.extract, "workers": 2, "progress": told}
try:
    for _ in grasps(job_of(SimConfig(), law, options, features=features), scenes, range(N), True, options):
        pass
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    with subprocess.Popen(
        [sys.executable, "-c", PRELUDE + script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as running:
        assert running.stdout.readline() == "running\n"
        if sent == signal.SIGINT:
            os.killpg(running.pid, sent)  # as a terminal does
        else:
            running.send_signal(sent)
        # Both ends of file come when the last process that holds the pipes has ended.
        told, errors = running.stdout.read(), running.stderr.read()
    assert errors == ""
    assert ("interrupted" in told) == (sent == signal.SIGINT)


def test_traces_and_what_python_code_extracts_stay_in_one_process():
    law, features = create("controller", "hybrid"), create("feature-set", "chitta")

    def may_be_sent(**options):
        return forked.can_be_sent(job_of(SimConfig(), law, options))

    assert may_be_sent()
    assert may_be_sent(extract=features.extract)
    assert not may_be_sent(extract=features.extract, traces=True)
    assert not may_be_sent(extract=lambda trace: trace.t_s[-1])
