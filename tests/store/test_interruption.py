"""Ctrl-C, SIGTERM and SIGHUP: the gripper lets go, no further squeeze begins, and nothing aborted counts."""

import json
import os
import pty
import shlex
import signal
import subprocess
import sys

import pytest
from attrs import evolve
from commands import graspsense, printed
from grippers import Scripted, bottle, settings_with, squeezing

from graspsense import GraspInterrupted, load_pipeline
from graspsense.core.components.registry import installed
from graspsense.core.components.run_config import RunConfig
from graspsense.core.grasp.runner import run_uninterrupted
from graspsense.core.pipeline.pipeline import grasp_with
from graspsense.core.values.signals import Outcome
from graspsense.plugins.controllers.hybrid import HybridConfig, HybridController
from graspsense.store.changes import relabel
from graspsense.store.collecting import Collection, Wanted
from graspsense.store.store import Store

ENDS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]
IN_THE_SQUEEZE = 1200
COLUMNS = shlex.split("--time t --gap gap --force force --label jar:full -o classifier.type=none")


class Signalled(Scripted):
    """A gripper during whose squeeze a signal arrives; it counts the grasps that begin."""

    begun = 0
    number = signal.SIGINT
    at_release = False
    commanded = ()

    def __init__(self):
        super().__init__(squeezing, bottle)

    def open(self, seed):
        type(self).begun += 1
        return super().open(seed)

    def read(self, timeout_s):
        if self.k == IN_THE_SQUEEZE and not self.at_release:
            signal.raise_signal(self.number)
        return super().read(timeout_s)

    def close(self):
        if self.at_release:
            signal.raise_signal(self.number)
        type(self).commanded = self.commands
        super().close()


@pytest.fixture
def signalled():
    """Return settings of a gripper that is interrupted, and the class of this gripper."""

    class Gripper(Signalled):
        pass

    return settings_with(Gripper), Gripper


@pytest.fixture(autouse=True)
def listening():
    """Handle SIGTERM and SIGHUP as the command line does, whatever the tests were started with."""
    handlers = {end: signal.signal(end, signal.default_int_handler) for end in ENDS}
    yield
    for number, handler in handlers.items():
        signal.signal(number, handler)


def collection_of(store, settings, answers):
    return Collection(
        store=store,
        wanted=Wanted(words=("jar:full",), each=9),
        plugins=installed(),
        settings_for=lambda word, seed: settings,
        ask=lambda question: next(answers),
        say=lambda text: None,
    )


@pytest.mark.parametrize(
    "number", [ENDS[0], *(pytest.param(end, marks=pytest.mark.slow) for end in ENDS[1:])]
)
def test_a_signal_in_a_squeeze_stops_the_collection_with_the_grasp_stored_as_aborted(
    signalled, tmp_path, number
):
    settings, gripper = signalled
    gripper.number = number
    with Store.open(tmp_path / "t") as store:
        with pytest.raises(KeyboardInterrupt):
            collection_of(store, settings, iter([""] * 9)).run()
        (only,) = store.page()
        assert (only.outcome, only.complete) == ("aborted", True)
        assert len(store.counts("collect")) == 0
    assert gripper.begun == 1
    assert gripper.commanded[-1].value == 0.0
    assert any(command.value == -20.0 for command in gripper.commanded[IN_THE_SQUEEZE:])


def test_a_signal_while_the_gripper_is_let_go_stores_the_finished_grasp_and_stops(signalled, tmp_path):
    settings, gripper = signalled
    gripper.at_release = True
    with Store.open(tmp_path / "t") as store:
        collection = collection_of(store, settings, iter([""] * 9))
        with pytest.raises(KeyboardInterrupt):
            collection.run()
        assert store.counts("collect") == {("jar:full", None): 1}
        assert list(collection.collected.values()) == ["jar:full"]
        assert list(store.recordings.glob("*.part")) == []
    assert gripper.begun == 1


def test_a_signal_while_a_trial_is_saved_loses_nothing(signalled, tmp_path):
    settings, gripper = signalled
    gripper.number = signal.SIGWINCH  # ignored: this grasp ends by itself

    class Interrupting(Store):
        def add(self, *arguments, **named):
            signal.raise_signal(signal.SIGINT)
            return super().add(*arguments, **named)

    with Interrupting.open(tmp_path / "t") as store:
        with pytest.raises(KeyboardInterrupt):
            collection_of(store, settings, iter([""] * 9)).run()
        assert store.counts("collect") == {("jar:full", None): 1}
    assert gripper.begun == 1


@pytest.mark.slow
def test_a_repeated_trial_keeps_the_label_of_the_session_whatever_became_of_the_first(signalled, tmp_path):
    settings, gripper = signalled
    gripper.number = signal.SIGWINCH  # ignored: these grasps end by themselves
    with Store.open(tmp_path / "t") as store:
        collection = collection_of(store, settings, iter(["", "r", "q"]))
        show, collection.show = collection.show, lambda word, trial: relabel_first()

        def relabel_first():
            collection.show = show
            relabel(store, [1], {"label": "cup:empty"}, "by another operator")

        collection.run()
        assert [(summary.id, summary.label, summary.set_aside) for summary in store.page(set_aside=None)] == [
            (2, "jar:full", None),
            (1, "cup:empty", "repeated by the operator"),
        ]


def test_an_interrupted_grasp_raises_so_that_a_loop_over_grasps_ends_and_keeps_its_trial(signalled):
    settings, gripper = signalled
    pipeline = evolve(load_pipeline(options=["classifier.type=none"]), settings=settings)
    with pytest.raises(GraspInterrupted) as ended:
        pipeline.grasp()
    assert gripper.begun == 1
    assert ended.value.trial.outcome is Outcome.ABORTED
    assert len(ended.value.trial.trace) > 900
    with pytest.raises(KeyboardInterrupt):
        grasp_with(settings, installed())
    # A grasp of many raises after the release.
    interrupted = Signalled()
    with pytest.raises(KeyboardInterrupt):
        run_uninterrupted(interrupted, HybridController(HybridConfig()), RunConfig())
    assert interrupted.closed == 1
    assert interrupted.commands[-1].value == 0.0


def interrupting(monkeypatch, after):
    """Let Ctrl-C arrive in the replay of the recording number `after`."""
    from graspsense.sources.recordings.replay import ReplayBackend as Replay

    begun = []
    read, opened = Replay.read, Replay.open

    def reading(self, timeout_s):
        if len(begun) == after:
            signal.raise_signal(signal.SIGINT)
        return read(self, timeout_s)

    def opening(self, seed):
        begun.append(seed)
        return opened(self, seed)

    monkeypatch.setattr(Replay, "read", reading)
    monkeypatch.setattr(Replay, "open", opening)
    return begun


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Return the folder of a store with three trials, beside the CSV files from which they were imported."""
    folder = tmp_path_factory.mktemp("recordings")
    for k in (1, 2, 3):
        rows = [f"{t},{squeezing(t)},{k * bottle(t)[0]}" for t in (0.01 * i for i in range(220))]
        (folder / f"{k}.csv").write_text("\n".join(["t,gap,force", *rows]) + "\n")
        printed("import", folder / f"{k}.csv", *COLUMNS, "--save", folder / "t")
    return folder / "t"


@pytest.mark.parametrize("after", [3, 4])
def test_ctrl_c_in_an_import_stores_no_aborted_grasp_and_is_told(recordings, tmp_path, monkeypatch, after):
    """Each recording is tried before it is imported: the second one is opened for the third and fourth time."""
    begun = interrupting(monkeypatch, after=after)
    files = [str(recordings.parent / f"{k}.csv") for k in (1, 2)]
    importing = [graspsense("import", file, *COLUMNS, "--save", tmp_path / "i") for file in files]
    assert [done.returncode for done in importing] == [0, 130]
    assert len(begun) == after
    with Store.read(tmp_path / "i") as store:
        assert [summary.outcome for summary in store.page()] == ["steady"]
    assert "interrupted" in importing[1].stderr


def test_ctrl_c_in_features_writes_no_table_of_aborted_grasps(recordings, tmp_path, monkeypatch):
    begun = interrupting(monkeypatch, after=2)
    out = tmp_path / "features.csv"
    options = ("-o", "controller.contact_force_n=0.1", "--keep", str(out))
    assert graspsense("features", f"store:{recordings}", *options).returncode == 130
    assert len(begun) == 2
    assert not out.exists()


def collecting(folder, labels, *options, stream=subprocess.PIPE, **more):
    """Start a collection as a process of its own, with its input, output and errors on this stream."""
    words = f"-m graspsense collect --labels {labels} --each 9 -o classifier.type=none --save".split()
    command = [sys.executable, *words, str(folder), *options]
    return subprocess.Popen(command, stdin=stream, stdout=stream, stderr=stream, **more)


LONG = ("-o", "gripper.rate_hz=30000")
"""So many ticks a second make a grasp long enough to be interrupted."""


@pytest.mark.slow
def test_a_process_that_collects_with_piped_answers_stops_at_the_first_signal(tmp_path):
    process = collecting(tmp_path / "t", "block,toy", "--json", *LONG, text=True)
    process.stdin.write("\n" * 20)
    process.stdin.flush()
    line = ""
    while "next: " not in line:
        line = process.stderr.readline()
        assert line, "it ended by itself"
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=300)
    assert process.returncode == 130, err
    assert "next: " not in err
    assert err.splitlines()[-1] == "interrupted"
    result = json.loads(out)
    assert sum(result["counts"].values()) == 0
    with Store.open(tmp_path / "t") as store:
        assert {summary.outcome for summary in store.page()} <= {"aborted"}
        assert result["trials"] == [summary.id for summary in store.page()]


def operator(folder, labels):
    process = collecting(folder, labels, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"})

    def answer(key, until):
        """Give an answer and return the lines up to one with this text."""
        process.stdin.write(f"{key}\n")
        process.stdin.flush()
        lines = []
        while not any(until in line for line in lines):
            lines.append(process.stderr.readline())
            assert lines[-1], "it ended by itself"
        return "".join(lines)

    return process, answer


@pytest.mark.slow
def test_two_operators_on_a_store_undo_and_repeat_only_what_each_has_grasped(tmp_path):
    folder = tmp_path / "t"
    Store.open(folder).close()
    block_operator, says_first = operator(folder, "block")
    toy_operator, says_second = operator(folder, "toy")
    says_first("", "trial 1, block")
    says_second("", "trial 2, toy")
    says_second("", "trial 3, toy")

    assert "trial 1, block" in says_first("u", "set aside")
    assert "to undo" in says_first("u", "no trial")
    assert "to undo" in says_first("r", "no trial")
    retaken = says_second("r", "trial 4, toy")
    assert "trial 3, toy: set aside" in retaken
    for process in (block_operator, toy_operator):
        _, err = process.communicate("q\n", timeout=300)
        assert process.returncode == 0, err
    with Store.read(folder) as store:
        kept = {
            summary.id: (summary.label, summary.set_aside is None) for summary in store.page(set_aside=None)
        }
    assert kept == {1: ("block", False), 2: ("toy", True), 3: ("toy", False), 4: ("toy", True)}


@pytest.mark.slow
def test_a_terminal_that_goes_ends_the_collection_though_nothing_can_be_printed(tmp_path):
    master, slave = pty.openpty()
    process = collecting(tmp_path / "t", "block,toy", *LONG, stream=slave, start_new_session=True)
    os.close(slave)
    said = b""
    while b"next: " not in said:
        said += os.read(master, 4096)
    os.write(master, b"\n")
    os.close(master)
    process.send_signal(signal.SIGHUP)
    assert process.wait(timeout=300) == 130
    with Store.open(tmp_path / "t") as store:
        assert {summary.outcome for summary in store.page()} <= {"aborted"}
