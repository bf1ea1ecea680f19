"""Many grasps at once: the same for any number of workers, whoever runs them, with the user's settings."""

import io
import math
import os
import signal
import subprocess
import sys
import tracemalloc
import warnings
from collections import Counter
from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
import pytest
from attrs import evolve, fields
from batches import run_many
from cases import every_case
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.components.run_config import RunConfig
from graspsense.core.drivers import grasp_process
from graspsense.core.grasp.runner import run_grasp
from graspsense.core.values.errors import UnknownName
from graspsense.gripper_api import Outcome
from graspsense.plugin_api import (
    APPROACH,
    EFFORT,
    RUNNING,
    STEADY,
    Command,
    Controller,
    ControllerEntry,
    Trace,
    create,
    hookimpl,
)
from graspsense.simulator_api import CompiledExtraction, NotHandedOver
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run import buffers
from graspsense_sim_gripper.run.backend import SimBackend
from graspsense_sim_gripper.run.batch import threads
from graspsense_sim_gripper.run.batch.job import Job, grasp_plain
from graspsense_sim_gripper.run.batch.scenes import Scenes, draw_numbers
from graspsense_sim_gripper.run.batch.threads import SLICE, slices_of
from graspsense_sim_gripper.run.batch.worker import PlainProcess
from graspsense_sim_gripper.run.compiled import loop_code
from graspsense_sim_gripper.run.model_report import model_report
from graspsense_sim_gripper.scene.library import catalogue, kinds_in, shipped_scenes

HYBRID = create("controller", "hybrid")
FEATURES = create("feature-set", "chitta")
SCENES = ["block", "can:empty_open", "toy", "none"]


class Found(NamedTuple):
    largest_n: float
    ticks: float


def largest(params, ticks):
    return Found(ticks.force_left_n.max(), float(len(ticks.t_s)))


class Largest:
    """Extracts two numbers of a trace in a form that can be compiled."""

    def compiled_extraction(self):
        return CompiledExtraction(largest, (), lambda measured: (type(measured).__name__, *measured))


def bits(trace):
    columns = (getattr(trace, f.name) for f in fields(Trace) if f.name not in ("units", "signals", "events"))
    return repr(trace.events), *(np.ascontiguousarray(column).tobytes() for column in columns)


def many(scenes, seeds=None, config=None, law=HYBRID, **options):
    """Run grasps of these scenes, by default with the seeds from 0 on, the default config and the hybrid law."""
    seeds = range(len(scenes)) if seeds is None else seeds
    return run_many(config or SimConfig(), law, scenes, seeds, **options)


def types_of_states(grasp):
    return [type(state) for state in grasp.state.contact.left.states]


def mixed(n):
    return [SCENES[k % len(SCENES)] for k in range(n)], range(100, 100 + n)


@given(total=st.integers(0, 3000), workers=st.integers(1, 64))
def test_slices_hold_every_grasp_once_in_order_and_leave_no_worker_idle(total, workers):
    slices = slices_of(total, workers)
    assert [k for part in slices for k in part] == list(range(total))
    assert all(1 <= len(part) <= SLICE for part in slices)
    assert len(slices) >= min(2 * workers, total / 2)


def slow_compiled(test):
    """Mark a test of the compiled loop, which takes seconds to compile."""
    needed = pytest.mark.skipif(find_spec("numba") is None, reason="the compiled loop needs the extra `fast`")
    return pytest.mark.slow(needed(test))


@slow_compiled
def test_the_number_of_workers_decides_nothing_to_the_bit():
    scenes, seeds = mixed(3 * SLICE + 1)
    with_1, with_2, with_5 = (
        many(scenes, seeds, compiled=True, workers=w, extract=FEATURES.extract) for w in (1, 2, 5)
    )
    for a, b, c in zip(with_1, with_2, with_5, strict=True):
        assert bits(a.trace) == bits(b.trace) == bits(c.trace)
        assert a.extracted == b.extracted == c.extracted or any(np.isnan(a.extracted.values))
        assert a.state == b.state == c.state
    # What stands in the common composition for terms that an object lacks changes no bit, and is not handed back.
    odd = ["odwalla:full_open", "egg", "none"]
    for a, b in zip(many(odd, compiled=False), many(odd, compiled=True), strict=True):
        np.testing.assert_allclose(b.trace.force_left_n, a.trace.force_left_n, rtol=1e-9, atol=1e-12)
        assert types_of_states(b) == types_of_states(a)


@slow_compiled
def test_what_is_drawn_may_keep_a_column_of_the_trace():
    scenes, seeds = mixed(SLICE)
    kept = many(scenes, seeds, compiled=True, extract=lambda trace: trace.gap_m, traces=False)
    whole = many(scenes, seeds, compiled=True)

    for grasp, other in zip(kept, whole, strict=True):
        assert grasp.extracted.tobytes() == other.trace.gap_m.tobytes()


@slow_compiled
def test_features_without_traces_are_those_of_the_traces():
    scenes, seeds = ["odwalla:full_open", "egg", "none", "block"] * 3, range(12)
    built = []

    def from_traces(trace):
        built.append(trace)
        return FEATURES.extract(trace)

    settings = ({}, {"run": RunConfig(grasp_timeout_s=0.4)}, {"run": RunConfig(hold_s=0.0)})
    for options in settings:
        compiled, traced = (
            many(scenes, seeds, compiled=True, extract=how, traces=False, **options)
            for how in (FEATURES.extract, from_traces)
        )
        for grasp, other in zip(compiled, traced, strict=True):
            assert repr(grasp.extracted.values) == repr(other.extracted.values)
            assert grasp.extracted.reasons == other.extracted.reasons
            assert (grasp.outcome, grasp.reason) == (other.outcome, other.reason)
            assert grasp.report() == other.report()
            # These features do not read the release, which is then not simulated where the object was held.
            held = grasp.outcome == Outcome.STEADY and options is not settings[2]
            assert (grasp.state != other.state) == held
            assert not held or grasp.state.motion.gap_m < other.state.motion.gap_m
    assert len(built) == 36


@slow_compiled
@pytest.mark.parametrize("sensor", ["pads", "ideal"])
def test_grasps_that_compiled_code_draws_are_those_of_their_setups(sensor, monkeypatch):
    """Of each object, one that breaks, one beyond its law, and with more images or ticks than buffers hold at first."""
    names = [*sorted(catalogue()), "odwalla:full_open#3", BREAKS, "none"]
    options = {"traces": False, "compiled": True, "extract": FEATURES.extract}

    def told(workers):
        done = many(names, config=SimConfig(sensor=sensor), workers=workers, **options)
        for grasp, name in zip(done, names, strict=True):
            of_state = model_report(grasp.state, kinds_in(name))
            assert {key: grasp.report()[key] for key in of_state} == of_state
        return [(g.outcome, g.reason, repr(g.extracted), repr(g.state), g.report()) for g in done]

    drawn = told(1)
    assert told(3) == drawn
    for name, size in (("IMAGES", 48), ("IMAGES", 100), ("TICKS", 700)):
        monkeypatch.setattr(buffers, name, size)
        assert told(1) == drawn
    assert any(report["broken"] for *_, report in drawn)


BREAKS = """width_m = 0.04\nwidth_spread_m = 0.002\nstiffness_spread = 0.1
[[terms]]\ntype = "rigid"\nhertz_n_m15 = 2e6\ncrush_force_n = 4.0\nbroken_n_m = 3000.0
"""
INTERRUPTED = """
from graspsense.plugin_api import create
from graspsense_sim_gripper.run.batch.threads import grasps, job_of
from graspsense_sim_gripper.config import SimConfig

def told(done, of):
    if done > 0:
        print("running", flush=True)

law, features = create("controller", "hybrid"), create("feature-set", "chitta")
options = {"extract": features.extract, "workers": 2, "progress": told}
job = job_of(SimConfig(), law, options, features=features)
scenes = ["block"] * 10**6
try:
    for _ in grasps(job, scenes, range(len(scenes)), True, options):
        pass
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@slow_compiled
def test_a_batch_ends_when_it_is_interrupted():
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", INTERRUPTED], start_new_session=True, **pipes) as running:
        assert running.stdout.readline() == "running\n"
        os.killpg(running.pid, signal.SIGINT)
        said, errors = running.communicate()
    # The interrupt can come between the text and the end of a line that says "running".
    assert (said.endswith("interrupted\n"), errors) == (True, "")


@slow_compiled
def test_a_named_tuple_that_is_measured_comes_back_as_one():
    done = many(["block"] * 3, traces=False, compiled=True, extract=Largest())
    traced = many(["block"] * 3, compiled=True)
    for grasp, other in zip(done, traced, strict=True):
        assert grasp.extracted == ("Found", max(other.trace.force_left_n), float(len(other.trace.t_s)))


class Raising:
    """Extracts the number of events, in a form that raises where there are no ticks, or always, and in `result`."""

    def __init__(self, where):
        self.where = where

    def __call__(self, trace):
        return len(trace.events)

    def compiled_extraction(self):
        measure = {"no ticks": mean_n, "measure": raising}.get(self.where, largest)
        result = raising_result if self.where == "result" else lambda measured: measured
        return CompiledExtraction(measure, (), result)


def mean_n(params, ticks):
    return ticks.force_left_n.sum() / len(ticks.t_s)


def raising(params, ticks):
    if len(ticks.t_s) > 1:
        raise ValueError("no such ticks")
    return 0.0


def raising_result(measured):
    raise RuntimeError("not these numbers")


@slow_compiled
def test_a_compiled_form_that_raises_is_not_hidden_and_hides_no_events():

    def extracted(where):
        options = {"traces": False, "compiled": True, "extract": Raising(where)}
        return many(["block"], **options)[0].extracted

    (traced,) = many(["block"], compiled=True)
    assert extracted("no ticks") == pytest.approx(traced.trace.force_left_n.mean())
    assert extracted("measure") == len(traced.trace.events) > 0
    with pytest.raises(RuntimeError, match="not these numbers"):
        extracted("result")


@slow_compiled
def test_features_that_cannot_be_compiled_are_extracted_from_traces():

    class Uncompilable(type(FEATURES)):
        compiled = evolve(type(FEATURES).compiled, measure=lambda params, ticks: {}["a" + params])

    features = Uncompilable(FEATURES.config)
    with pytest.warns(UserWarning, match="from traces"):
        done = many(["egg"], [3], compiled=True, extract=features.extract, traces=False)
    plain = many(["egg"], [3], compiled=True, extract=FEATURES.extract)
    assert done[0].extracted == plain[0].extracted


@pytest.fixture
def apart(monkeypatch):
    """Let plain grasps run in other processes however few they are."""
    for name in ("WORTH_A_PROCESS", "WORTH_A_WORKER"):
        monkeypatch.setattr(threads, name, 1)


@pytest.mark.slow
@pytest.mark.usefixtures("apart")
@every_case("traces", [True, False])
def test_plain_grasps_in_processes_are_those_of_this_one_to_the_bit(traces):
    """Without traces no release is read, and held grasps end with their hold."""
    n = 8
    scenes, seeds = mixed(n)
    told = []

    def extract(trace):  # a closure, which no other process could be handed
        return len(told) >= 0, FEATURES.extract(trace)

    options = {"compiled": False, "extract": extract, "traces": traces}
    here = many(scenes, seeds, **options)
    apart = many(scenes, seeds, workers=2, progress=lambda *counts: told.append(counts), **options)
    for a, b in zip(apart, here, strict=True):
        assert repr((a.state, a.extracted)) == repr((b.state, b.extracted))
        assert not traces or bits(a.trace) == bits(b.trace)
    assert told[0] == (0, n)
    assert told[-1] == (n, n)


@pytest.mark.slow
def test_a_batch_takes_the_run_settings_as_the_runner_does():
    # Held twice as long as by default, which a batch once did not notice.
    run = RunConfig(seed=4, hold_s=0.5)
    config = SimConfig(object="toy", fidelity="fixed", open_gap_m=0.06)
    alone = run_grasp(SimBackend(config), HYBRID, run).trace
    among = many(["toy"], [4], config=config, run=run)[0].trace
    assert bits(alone) == bits(among)
    short = many(["toy"], [4], config=config)[0].trace
    assert alone.t_s[-1] - short.t_s[-1] == pytest.approx(0.25, abs=0.02)


@every_case(("step", "says"), [("endless", "grasp_timeout_s"), ("lost", "NaN")])
def test_a_law_that_never_ends_or_commands_no_number_is_ended_as_by_the_runner(step, says):
    law = {"endless": Endless, "lost": Lost}[step](HYBRID.config)
    run = RunConfig(seed=1, grasp_timeout_s=0.2, opening_timeout_s=0.2)
    alone = run_grasp(SimBackend(SimConfig(object="none")), law, run)
    among = many(["none"], [1], law=law, run=run)[0]
    assert among.outcome == alone.outcome == Outcome.ABORTED
    assert among.reason == alone.reason
    assert says in among.reason
    assert bits(alone.trace) == bits(among.trace)


@pytest.mark.usefixtures("apart")
def test_a_law_no_other_process_can_find_runs_here_and_the_warning_says_so():
    class Local(type(HYBRID)):
        step = staticmethod(endless)

    law, n = Local(HYBRID.config), 3
    run = RunConfig(grasp_timeout_s=0.01, opening_timeout_s=0.1)
    with pytest.warns(UserWarning, match="on one core"):
        done = many(["none"] * n, law=law, run=run, compiled=False, workers=2)
    assert [grasp.outcome for grasp in done] == [Outcome.ABORTED] * n


def plainly(job, scene, seed):
    return grasp_plain(job, Scenes(job).setup(scene, seed))


def job(controller=HYBRID, **more):
    given = {"config": SimConfig(), "run": RunConfig(), "extract": None, "traces": True, **more}
    return Job(controller=controller, **given)


@pytest.mark.slow
def test_odd_numbers_and_every_object_come_back_from_another_process_to_the_bit():
    run = RunConfig(hold_s=math.inf, grasp_timeout_s=0.01, opening_timeout_s=0.1)
    odd = job(config=SimConfig(pad_stiffness_n_m=math.inf, noise_counts=0.0, step_s=1e-4), run=run)
    names = [*catalogue(), *shipped_scenes(), "none"]
    with PlainProcess(Scenes(odd)) as process:
        apart = [process.run(name, seed) for seed, name in enumerate(names)]
    # Nothing is there: channels that were never felt are NaN, and so are the features drawn.
    assert {grasp.outcome for grasp in apart} == {Outcome.ABORTED}
    for name, seed, grasp in zip(names, range(len(names)), apart, strict=True):
        here = plainly(odd, name, seed)
        assert (grasp.outcome, grasp.reason) == (here.outcome, here.reason)
        assert repr(grasp.state) == repr(here.state)
        assert types_of_states(grasp) == types_of_states(here)
        assert bits(grasp.trace) == bits(here.trace)


@pytest.mark.usefixtures("apart")
def test_a_process_that_is_killed_leaves_its_grasps_to_this_one(monkeypatch):
    class Doomed(PlainProcess):
        def __enter__(self):
            process = super().__enter__()
            self._process.kill()
            return process

    monkeypatch.setattr(threads, "PlainProcess", Doomed)
    run, n = RunConfig(grasp_timeout_s=0.01, opening_timeout_s=0.1), 3
    with pytest.warns(UserWarning, match="on one core: .* has ended"):
        done = many(["none"] * n, run=run, compiled=False, workers=2)
    here = [plainly(job(run=run), "none", k) for k in range(n)]
    assert [bits(grasp.trace) for grasp in done] == [bits(grasp.trace) for grasp in here]


def test_an_answer_that_breaks_off_is_no_answer():
    with pytest.raises(EOFError):
        grasp_process._read_line(io.BytesIO(b'{"done": []'))
    with pytest.raises(EOFError):
        grasp_process._read(io.BytesIO(b"abc"), 4)


def test_what_is_not_all_in_names_and_values_is_not_handed_over():
    altered = create("controller", "hybrid")
    numbers = altered.params()
    altered.params = lambda: numbers._replace(ramp_s=numbers.ramp_s + 1.0)
    with pytest.raises(NotHandedOver, match="graspsense/hybrid"):
        PlainProcess(Scenes(job(altered)))
    with pytest.raises(NotHandedOver, match=r"test_batch\.Endless"):
        PlainProcess(Scenes(job(Endless(HYBRID.config))))


@pytest.mark.slow
def test_what_fails_in_another_process_is_said():
    class Here:
        GRASPSENSE_API = (2, 0)

        @staticmethod
        @hookimpl
        def graspsense_controllers():
            yield ControllerEntry(
                name="endless", summary="", requires=(), commands=("effort",), target=f"{__name__}:Endless",
                config="graspsense.plugins.controllers.hybrid:HybridConfig",
            )  # fmt: skip

    with IsolatedPlugins(Here), PlainProcess(Scenes(job(Endless(HYBRID.config)))) as process:
        for _ in range(2):
            with pytest.raises(NotHandedOver, match="'graspsense-test/endless'"):
                process.run("none", 0)
    with PlainProcess(Scenes(job())) as process, pytest.raises(NotHandedOver, match=r"UnknownName: .*'blok'"):
        process.run("blok", 0)


@pytest.mark.parametrize("numba", ["missing", "broken"])
def test_without_numba_the_plain_loop_runs_and_says_so(numba, monkeypatch, tmp_path):
    if numba == "missing":
        monkeypatch.setitem(sys.modules, "numba", None)
    else:
        (tmp_path / "numba.py").write_text("raise ImportError('Numba needs another numpy')")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "numba", raising=False)
    # What this process has compiled before it would use without numba as well.
    loop_code._compiled.cache_clear()
    monkeypatch.setattr(threads, "WORTH_COMPILING", 2)
    run = RunConfig(grasp_timeout_s=0.01, opening_timeout_s=0.1)
    with pytest.warns(UserWarning, match="plain Python.*numba"):
        done = many(["none"] * 2, [1, 2], run=run)
    assert len(done) == 2


def test_few_grasps_are_compiled_only_if_their_code_is_on_disk_or_others_came_before(monkeypatch):
    monkeypatch.setitem(sys.modules, "numba", None)  # a batch that would be compiled warns
    loop_code._compiled.cache_clear()
    monkeypatch.setattr(threads, "WORTH_LOADING", 2)
    monkeypatch.setattr(threads, "WORTH_COMPILING", 6)
    monkeypatch.setattr(threads, "_interpreted", Counter())

    def is_compiled(n, *, kept):
        monkeypatch.setattr(threads, "is_kept", lambda composition, step: kept)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            many(["none"] * n, config=SimConfig(open_gap_m=0.005))
        return any("numba" in str(warning.message) for warning in caught)

    assert not is_compiled(1, kept=True)
    assert is_compiled(2, kept=True)
    assert not is_compiled(2, kept=False)
    assert not is_compiled(2, kept=False)
    assert is_compiled(2, kept=False)


# The first one compiles, for half a minute where an earlier run has left nothing on disk.
@pytest.mark.slow
@pytest.mark.parametrize("kept", [True, False])
def test_drawing_and_measuring_are_compiled_for_many_grasps_or_if_their_code_is_on_disk(monkeypatch, kept):
    monkeypatch.setattr(threads, "WORTH_COMPILING", 1)
    monkeypatch.setattr(threads, "WORTH_COMPILING_DRAWING", 4)
    monkeypatch.setattr(threads, "WORTH_COMPILING_MEASURE", 4)
    monkeypatch.setattr(threads, "_interpreted_around", Counter())
    monkeypatch.setattr(threads, "is_drawing_kept", lambda: kept)
    monkeypatch.setattr(threads, "is_measure_kept", lambda form: kept)
    job = threads.job_of(SimConfig(), HYBRID, {"extract": create("feature-set", "chitta").extract})
    results = []
    for n, are_compiled in ((2, kept), (2, True)):
        batch = threads._Batch(job, ["none"] * n, range(n), 1, None)
        results.append([grasp.extracted for grasp in batch.grasps(None)])
        assert (batch.measure is not None, batch.drawing is not draw_numbers) == (are_compiled, are_compiled)
    assert results[0] == results[1]


@pytest.mark.slow
def test_room_is_made_on_the_way_without_beginning_again(monkeypatch):
    whole = many(["toy"], [3])[0]
    assert whole.model.chosen.steps.macro_tolerance > 0.0
    for ticks, images in ((100, 64), (700, buffers.IMAGES)):
        monkeypatch.setattr(buffers, "TICKS", ticks)
        monkeypatch.setattr(buffers, "IMAGES", images)
        parts = many(["toy"], [3])[0]
        assert bits(parts.trace) == bits(whole.trace)
        assert parts.state == whole.state


@pytest.mark.slow
def test_traces_are_kept_only_where_they_are_asked_for():
    backend = SimBackend(SimConfig(sensor="ideal"))
    run = RunConfig(grasp_timeout_s=0.5, opening_timeout_s=0.1)
    tracemalloc.start()
    done = backend.run_many(HYBRID, ["none"] * 40, range(40), run=run, extract=len)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert {grasp.trace for grasp in done} == {None}
    assert all(grasp.extracted > 400 for grasp in done)
    # Forty traces of half a second would be 2 MB.
    assert kept < 1e6


@every_case(
    ("scenes", "seeds", "options", "error", "says"),
    [
        (["block"], [2.7], {}, TypeError, "float"),
        (["block", "toy"], [1], {}, ValueError, "2 scenes and 1 seeds"),
        (["block"], [0], {"wokers": 2}, TypeError, r"no \['wokers'\]; it has .*'workers'"),
        (["block"] * 3 + ["blok"], range(4), {}, UnknownName, "'blok'"),
    ],
)
def test_wrong_use_is_refused_before_anything_runs(scenes, seeds, options, error, says):
    told = []
    with pytest.raises(error, match=says):
        SimBackend(SimConfig()).run_many(
            HYBRID, scenes, seeds, progress=lambda *done: told.append(done), **options
        )
    assert {done for done, _ in told} <= {0}


def endless(params, state, reading):
    return Command(EFFORT, 0.0, 1.0, 1.0), state


def lost(params, state, reading):
    return Command(EFFORT, float("nan"), 1.0, 1.0), state


class Endless(type(HYBRID)):
    step = staticmethod(endless)


class Lost(type(HYBRID)):
    step = staticmethod(lost)


SHELL = '[[terms]]\ntype = "elastic"\nk1_n_m = 2e3\nk3_n_m3 = '
SHELL_IN_SHELL = f"width_m = 0.08\n{SHELL}0.0\n{SHELL}1e9\n"
"""With a term twice, it has a loop of its own, which takes less time to compile than that of the whole catalogue."""


class PressParams(NamedTuple):
    effort_n: float


def press(params, state, reading):
    """Close with a constant effort for half a second."""
    begun_s = reading.frame.t_s if state.begun_s < 0.0 else state.begun_s
    outcome = STEADY if reading.frame.t_s - begun_s > 0.5 else RUNNING
    command = Command(EFFORT, 1.0 * params.effort_n, math.inf, math.inf)
    return command, PressState(APPROACH, outcome, begun_s)


class PressState(NamedTuple):
    phase: int = APPROACH
    outcome: int = RUNNING
    begun_s: float = -1.0


class Pressing(Controller[float]):
    step = staticmethod(press)
    init = staticmethod(PressState)

    def params(self):
        return PressParams(self.config)


@slow_compiled
def test_after_a_batch_with_a_whole_number_another_one_may_have_a_fraction():
    """Compiled code takes a number that was an integer at first for an integer."""
    config = SimConfig(sensor="ideal", fidelity="fixed")
    for effort_n in (4, 4.75):
        fast, plain = (
            many([SHELL_IN_SHELL], [1], config=config, law=Pressing(effort_n), compiled=compiled)[0]
            for compiled in (True, False)
        )
        assert plain.trace.command.max() == effort_n
        np.testing.assert_array_equal(fast.trace.command, plain.trace.command)
        assert fast.state == plain.state
