"""Experiments from a file: what it means, what is kept, what is done again."""

import errno
import json
import os
import re
import shutil
from importlib.resources import files
from pathlib import Path

import pytest
import wayward
from cases import every_case
from commands import answered, graspsense, printed, refused
from hypothesis import given
from hypothesis import strategies as st

from graspsense.core.components.registry import IsolatedPlugins
from graspsense.core.values.errors import ConfigError, UnknownName
from graspsense.evaluation.over_seeds import OverSeeds, mean_difference
from graspsense.experiment_api import ExperimentEntry
from graspsense.experiments.executors.executor import Serial
from graspsense.experiments.experiment_file import read_experiment, shipped
from graspsense.experiments.page import write_page
from graspsense.experiments.results import Results
from graspsense.experiments.run import run_experiment
from graspsense.experiments.summary import summarise
from graspsense.experiments.task import Made, Task, TaskResult
from graspsense.experiments.timing import TimeLeft
from graspsense.plugin_api import hookimpl
from graspsense.store.store import Store

EXPERIMENT = """
title = "Near ones"
question = "How many neighbours?"
seeds = 2
classifiers = ["c45", { type = "knn", name = "near" }]

[sweep]
"judge.folds" = [2, 3]

[data]
source = "mine.csv"
label = "what"

[judge]
controls = false
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "mine.csv").write_text(wayward.CSV)
    path = tmp_path / "mine.toml"
    path.write_text(EXPERIMENT)
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a complete run, beside the file of the experiment; and what the command answered."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "mine.csv").write_text(wayward.CSV)
    (folder / "mine.toml").write_text(EXPERIMENT)
    command = ("experiment", folder / "mine.toml", "--out", folder / "out", "--executor", "serial")
    return folder / "out", graspsense(*command, "--json")


def results_in(folder):
    """Return what came of each task, without where and when."""
    results = {}
    for path in (Path(folder) / "results").glob("*.json"):
        done = json.loads(path.read_text())
        results[path.name] = done["result"]
    return results


def test_an_experiment_is_a_file_and_ends_in_a_page(whole):
    folder, done = whole
    answer = done.json

    assert done.returncode == 0
    assert answer["complete"]
    assert answer["tasks"] == 4
    assert {(condition["case"], condition["classifier"]) for condition in answer["conditions"]} == {
        (case, learner) for case in ("folds 2", "folds 3") for learner in ("c45", "near")
    }
    page = (folder / "report.html").read_text()
    assert "How many neighbours?" in page
    assert "recorded grasps" in page
    assert len(results_in(folder)) == 4


@pytest.mark.slow
def test_what_lies_beside_the_results_gives_the_same_again(whole, tmp_path):
    folder, _ = whole
    assert "mine.toml" not in (folder / "experiment.toml").read_text(), (
        "nothing but what was written is needed"
    )
    again = read_experiment(str(folder / "experiment.toml"))
    run_experiment(again, Results(tmp_path / "again"), Serial)

    assert results_in(tmp_path / "again") == results_in(folder)


@pytest.mark.slow
def test_what_is_shipped_resolves_to_itself(tmp_path):
    for name in shipped():
        planned = read_experiment(name, ["seeds=2"])
        results = Results(tmp_path / name.replace("/", "_"))
        with results.alone():
            results.begin(planned, "")

        again = read_experiment(str(results.folder / "experiment.toml"))

        assert [task.key for task in again.tasks()] == [task.key for task in planned.tasks()], name


def test_every_experiment_file_of_the_package_is_declared():
    folder = files("graspsense.experiments").joinpath("shipped")
    declared = {name for name, resource in shipped().items() if resource.distribution == "graspsense"}
    assert {file.name for file in folder.iterdir()} == {f"{name}.toml" for name in declared}


@pytest.mark.parametrize("asked", ["paper", "table_2", "mine.toml"])
def test_an_experiment_of_a_distribution_that_is_missing_says_what_to_install(asked, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text('title = "x"\nkind = "grasp"')
    with IsolatedPlugins(), pytest.raises(UnknownName, match=r'graspsense-paper:\n.*"graspsense\[paper\]"'):
        read_experiment(asked)


def test_two_plugins_may_ship_an_experiment_of_one_name():
    class Study:
        GRASPSENSE_API = (2, 0)

        @hookimpl
        def graspsense_experiments(self):
            yield ExperimentEntry("probing_force", "graspsense:experiments/shipped/probing_force.toml")

    with IsolatedPlugins(Study()):
        assert {"graspsense/probing_force", "graspsense-test/probing_force"} <= shipped().keys()
        with pytest.raises(UnknownName, match="graspsense and graspsense-test"):
            read_experiment("probing_force")


def test_resume_does_what_is_missing_and_nothing_else(whole, tmp_path):
    shutil.copytree(whole[0], tmp_path / "out")
    planned, results = read_experiment(str(whole[0].parent / "mine.toml")), Results(tmp_path / "out")
    kept = results_in(results.folder)
    stamps = {path.name: path.stat().st_mtime_ns for path in (results.folder / "results").glob("*.json")}
    lost, broken = sorted(kept)[:2]
    (results.folder / "results" / lost).unlink()
    (results.folder / "results" / broken).write_text('{"key": "cut o')

    with pytest.raises(ConfigError, match="resume=True"):
        run_experiment(planned, results, Serial)
    account = run_experiment(planned, results, Serial, resume=True)

    assert (account.kept, account.done, account.complete) == (2, 2, True)
    assert results_in(results.folder) == kept
    for path in (results.folder / "results").glob("*.json"):
        assert (path.stat().st_mtime_ns == stamps[path.name]) is (path.name not in (lost, broken))


class Interrupted(Results):
    """Results whose keeping is interrupted just after the disk has the second one, as Ctrl-C may be."""

    def add(self, done):
        super().add(done)
        if len(list((self.folder / "results").glob("*.json"))) == 2:
            raise KeyboardInterrupt


def test_a_result_that_the_disk_has_counts_as_done_whenever_the_run_was_interrupted(file, tmp_path):
    account = run_experiment(read_experiment(str(file)), Interrupted(tmp_path / "out"), Serial)

    assert (account.done, account.missing, account.stopped) == (2, 2, "interrupted")


@pytest.mark.slow
@pytest.mark.parametrize("executor", ["serial", "processes"])
def test_a_full_disk_ends_a_run_with_an_account_and_what_is_done_stays(file, tmp_path, mounted, executor):
    command = ("experiment", file, "--executor", executor, "--workers", 1)
    graspsense(*command, "--out", tmp_path / "whole")
    files = len(list((tmp_path / "whole").rglob("*"))) + 2
    # Two of the four results, and no page: a disk that has run out of files is as full as one out of bytes.
    out = mounted(f"size=4m,nr_inodes={files - 3}") / "out"

    code, told, err = graspsense(*command, "--out", out)
    assert code == 1
    assert "4 tasks: 2 done now, 2 not done" in told
    assert "stopped: " in told
    assert "--resume" in told
    assert re.search(rf"page +none: {out / 'report.html'} .*: {os.strerror(errno.ENOSPC)}", told)
    assert "Traceback" not in told + err
    kept = results_in(out)
    assert len(kept) == 2
    assert not list(out.rglob("*.part"))

    code, told, err = graspsense(*command, "--out", out, "--resume")
    assert (code, told) == (2, "")
    assert os.strerror(errno.ENOSPC) in err
    assert results_in(out) == kept

    mounted(f"size=4m,nr_inodes={files}", remount=True)
    assert "2 done now, 2 kept" in printed(*command, "--out", out, "--resume")
    assert results_in(out) == results_in(tmp_path / "whole")


@pytest.mark.slow
def test_a_task_that_fails_is_a_result_with_a_reason(file, tmp_path):
    file.write_text(EXPERIMENT.replace('"judge.folds" = [2, 3]', '"judge.targets" = [["both"], ["state"]]'))
    code, out, _ = graspsense("experiment", file, "--out", tmp_path / "out", "--executor", "serial")

    assert code == 1
    assert "4 tasks: 2 done now, 2 failed" in out
    assert "failed 2 times: label 'a' in" in out
    assert "2 tasks failed" in (tmp_path / "out" / "report.html").read_text()


def test_one_run_at_a_time_writes_to_a_folder(file, tmp_path):
    with Results(tmp_path / "out").alone(), pytest.raises(ConfigError, match="another run"):
        run_experiment(read_experiment(str(file)), Results(tmp_path / "out"), Serial)


@every_case(
    ("text", "said"),
    [
        ('title = "x"\nsedes = 2', "mine.toml:2: sedes: .*'seeds'"),
        ('title = "x"\nseeds = 0', r"mine.toml:2: seeds: 0 .*1"),
        ('title = "x"\nseeds = 1000000', r"mine.toml:2: seeds: 1000000 .*10000;"),
        ('title = "x"\nparts = ["mine.toml"]', r"itself: mine\.toml > mine\.toml"),
        ('title = "x"\n[gripper]\ntype = "pr2"', "graspsense-pr2-gripper/pr2 "),
        (
            'title = "x"\n[data]\nobjects = ["can:full_open", "can:empty_open"]\ntotal = 7',
            "mine.toml.*: judge.folds: 10 folds of 7 trials",
        ),
        ('title = "x"\nkind = "juggle"', r"'juggle'. Known: "),
        ('title = "x"\nkind = "early"\n[test]\ninstances = 3', r"mine.toml:3: test: .*'early'"),
        ('title = "x"\n[sweep]\n"controler.x" = [1]', r"mine.toml:3: sweep.controler.x: .*'controller'"),
        ('title = "x"\n[sweep]\n"run.seed" = 3', r"mine.toml:3: sweep.run.seed: "),
        ('title = "x"\n[sweep]\n"controller.probing_forse_n" = [1.0]', "'probing_force_n'"),
        ('title = "x"\nclassifiers = ["c46"]', r"mine.toml:2: .*'c46'"),
        ('title = "x"\nclassifiers = ["c45", "c45"]', r"mine.toml:2: .*'c45'"),
        ('title = "x"\n[data]\ninstances = 0', r"mine.toml:3: data.instances: 0 instances"),
        ('title = "x"\n[judge]\nfolds = 1', r"mine.toml:3: judge.folds"),
        ('title = "x"\npipelines = ["nosuch"]', r"'nosuch'"),
        ("seeds = 2", r"'title'"),
    ],
)
def test_mistakes_in_a_file(tmp_path, text, said):
    path = tmp_path / "mine.toml"
    path.write_text(text)

    with pytest.raises(ConfigError, match=said):
        read_experiment(str(path))


def test_identified_scenes_of_an_experiment_bring_their_fingertips(tmp_path):
    scene = 'width_m = 0.05\n[identified]\nlabel = "{0}"\n[identified.gripper]\npad_stiffness_n_m = {1}\n'
    (tmp_path / "cup.toml").write_text(scene.format("cup", 8000.0))
    (tmp_path / "mug.toml").write_text(scene.format("mug", 8000.0))
    (tmp_path / "other.toml").write_text(scene.format("mug", 9000.0))
    path = tmp_path / "one.toml"
    source = f"identified:{tmp_path}/cup.toml,{tmp_path}/mug.toml"
    text = f'title = "t"\nquestion = "q"\nseeds = 1\n[data]\nsource = "{source}"\ninstances = 3\n[judge]\nfolds = 2\n'
    path.write_text(text)
    (case,) = read_experiment(str(path)).cases
    assert case.settings.gripper.config.pad_stiffness_n_m == 8000.0
    # What the file says itself holds: it may be what the experiment varies.
    path.write_text(f"{text}[sweep]\n'gripper.pad_stiffness_n_m' = [2000.0, 4000.0]\n")
    stiff = [loaded.settings.gripper.config.pad_stiffness_n_m for loaded in read_experiment(str(path)).cases]
    assert stiff == [2000.0, 4000.0]
    path.write_text(f'{text}[test]\nsource = "identified:{tmp_path}/other.toml"\n')
    with pytest.raises(ConfigError, match="different fingertips"):
        read_experiment(str(path))


def test_options_are_laid_over_the_file(file):
    with pytest.raises(ConfigError, match=r"judge\.folds.*: 1000 folds of 40 trials"):
        read_experiment(str(file), ['sweep={"judge.folds"=[1000]}'])
    planned = read_experiment(str(file), ["seeds=[7]", "data.only=a", "controller.probing_force_n=17"])

    assert planned.seeds == (7,)
    assert planned.cases[0].data.only == "a"
    assert planned.cases[0].settings.values["controller"]["probing_force_n"] == 17.0


def test_cases_are_every_combination_and_judge_by_the_same_folds(tmp_path):
    path = tmp_path / "many.toml"
    path.write_text(
        'title = "x"\nclassifiers = ["knn"]\n[sweep]\n"controller.probing_force_n" = [17.0, 20.0]\n'
        '"gripper.noise_counts" = [0.0, 15.0]\n"classifier.neighbours" = [1, 3, 5]\n'
        '[[variants]]\nname = "few"\ndata.trials = 1\n[[variants]]\nname = "many"\ndata.trials = 2\n'
    )
    planned = read_experiment(str(path))

    assert len(planned.cases) == 8
    names = [case.name for case in planned.cases]
    assert names[0] == "few, probing force 17 N, noise 0 counts"
    assert len(set(names)) == 8
    # The classifiers at all points of the sweep over their keys are in one task, on the same trials.
    assert [learner.name for learner in planned.cases[0].learners] == [
        f"knn, neighbours {k}" for k in (1, 3, 5)
    ]
    assert {case.data.trials for case in planned.cases} == {1, 2}


def test_a_key_is_the_hash_of_what_the_result_follows_from():
    task = Task(kind="recognise", params={"a": 1.0, "b": [2, float("inf")]}, seed=0, name="one")

    assert Task.from_text(task.to_text()) == task
    assert (
        task.key == Task(kind="recognise", params={"b": [2, float("inf")], "a": 1.0}, seed=0, name="two").key
    )
    assert task.key != Task(kind="recognise", params={"a": 1.0, "b": [2, 3.0]}, seed=0).key
    assert task.key != Task(kind="recognise", params=task.params, seed=1).key


@given(st.integers(0, 400))
def test_no_part_of_a_result_is_taken_for_one(end):
    text = TaskResult(key="k", name="n", result={"rate": 0.5}, made=Made(seconds=1.5)).to_text()

    assert TaskResult.from_text(text).made.seconds == 1.5
    with pytest.raises(ValueError):
        TaskResult.from_text(text[: end % len(text)])
    with pytest.raises(ValueError, match="sha256"):  # edited, or damaged on the disk, it is valid JSON
        TaskResult.from_text(text.replace("0.5", "0.6"))


def test_rates_over_seeds():
    """By hand: s = 0.0645497, and Student's t at 97.5 % with 3 degrees of freedom is 3.182446."""
    rate = OverSeeds((0.8, 0.9, 0.85, 0.95), 10_000)

    assert rate.mean == pytest.approx(0.875)
    assert rate.interval == pytest.approx((0.772287, 0.977713), abs=1e-5)
    assert rate.prediction == pytest.approx((0.645328, 1.0), abs=1e-5)


def test_seeds_that_agree_are_no_certainty():
    low, high = OverSeeds((1.0, 1.0, 1.0), 50).interval

    assert high == 1.0
    assert low == pytest.approx(0.9750, abs=1e-4)  # Wilson's of 150 of 150
    same = mean_difference((0.9, 0.9), (0.8, 0.8), 50)
    value, (low, high) = same.value, same.interval
    assert value == pytest.approx(0.1)
    assert low < value < high
    assert mean_difference((0.9, 0.5), (0.1, 0.9), 50).interval == (-1.0, 1.0)  # no rates differ by more
    # One seed has the interval of its trials.
    assert OverSeeds((0.5,), 20).interval == pytest.approx((0.2993, 0.7007), abs=1e-4)


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=8), st.integers(1, 500))
def test_intervals_hold_the_mean_and_a_further_seed_is_less_sure(rates, n):
    rate = OverSeeds(tuple(rates), n)
    (low, high), (below, above) = rate.interval, rate.prediction

    assert 0.0 <= below <= low + 1e-12 <= high + 2e-12 <= above + 3e-12 <= 1.0 + 4e-12
    if len(rates) > 1:
        assert low - 1e-9 <= rate.mean + 0.5 / n
        assert rate.mean - 0.5 / n <= high + 1e-9


def test_time_left_says_no_more_than_is_known():
    left = TimeLeft(total=10, workers=2, clock=lambda: 0.0)
    assert "not known" in left.words
    for seconds in (9.0, 8.0, 2.0):  # the first of each worker compiles
        left.add(seconds)
    assert left.bounds_s is None
    left.add(2.0)
    assert left.bounds_s == (6.0, 6.0)  # six tasks of 2 s, two at once
    assert left.words == "about 6 s left"
    left.add(8.0)
    low, high = left.bounds_s
    assert low < 10.0 < high


@pytest.mark.parametrize("name", ["../../escaped", "a/b", "", "nul\\u0000", "n" * 300, "plain ü"])
def test_pipelines_of_any_name_stay_in_the_folder_and_are_found_again(file, tmp_path, name):
    pipelines = f'title = "Odd"\nseeds = 1\npipelines = [{{ name = "{name}", pipeline = "default" }}]\n'
    odd = file.with_name(os.fsdecode(b"a\xff\nb.toml"))
    odd.write_text(pipelines + EXPERIMENT[EXPERIMENT.index("[data]") :])
    known = set(tmp_path.rglob("*"))
    results = Results(tmp_path / "deep" / "er" / "out")
    run_experiment(read_experiment(str(odd)), results, Serial, command=str(odd))
    written = set(tmp_path.rglob("*")) - known
    assert all(path.is_relative_to(results.folder) or path in results.folder.parents for path in written)
    assert len(summarise(results.experiment(), results).results) == 1


@pytest.mark.slow
@every_case(
    "content",
    ["[]", "3", '{"inputs": 3}', '{"git": "x", "versions": 4}', '{"git": {"graspsense": 3}, "inputs": [1]}'],
)
def test_any_json_instead_of_provenance_or_of_a_result_is_told_in_words(whole, tmp_path, content):
    results = Results(tmp_path / "out")
    shutil.copytree(whole[0], results.folder)
    planned = results.experiment()
    (results.folder / "provenance.json").write_text(content)
    assert results.provenance() == {}
    task = planned.tasks()[0]
    path = results.path(task.key)
    path.unlink()
    os.mkfifo(path)  # opening it would wait without end
    assert "pipe" in results.read(task)[1]
    path.unlink()
    path.write_text(content)
    assert "damaged" in results.read(task)[1]
    write_page(summarise(planned, results), results)
    account = run_experiment(planned, results, Serial, resume=True)
    assert (account.kept, account.done) == (3, 1)


def test_train_here_test_there(file, tmp_path):
    other = wayward.CSV.replace("a,", "b,", 5)
    (tmp_path / "other.csv").write_text(other)
    file.write_text(
        EXPERIMENT.replace(
            '[sweep]\n"judge.folds" = [2, 3]\n', '[test]\nsource = "other.csv"\nlabel = "what"\n'
        )
    )
    planned, results = read_experiment(str(file), ["seeds=1"]), Results(tmp_path / "out")
    run_experiment(planned, results, Serial)
    condition = next(c for c in summarise(planned, results).conditions if c.classifier == "c45")

    assert condition.protocol == "other_trials"
    assert condition.confusion.n == 40
    assert sum(condition.confusion.counts[0]) == 15  # five labels were changed from a to b


def test_trials_of_few_objects_to_test_on_have_no_interval_and_those_learned_from_are_said(file, tmp_path):
    header, *lines = wayward.CSV.splitlines()
    # Forty trials of four objects tell less than forty objects would; two of the four are learned from.
    for name, offset in (("mine.csv", 0), ("other.csv", 2)):
        rows = [f"{line},bottle {offset + k % 4}" for k, line in enumerate(lines)]
        shifted = [row.replace(".", f".{offset}", 1) for row in rows]
        (tmp_path / name).write_text("\n".join([f"{header},bottle", *shifted]) + "\n")
    other = '[test]\nsource = "other.csv"\nlabel = "what"\ninstance = "bottle"\n'
    file.write_text(
        EXPERIMENT.replace('[sweep]\n"judge.folds" = [2, 3]\n', other).replace(
            "[data]\n", '[data]\ninstance = "bottle"\n'
        )
    )
    command = ("experiment", file, "--out", tmp_path / "out", "--executor", "serial")
    condition = answered(*command, "-o", "seeds=1")["conditions"][0]

    assert condition["n"] == 40
    assert condition["interval"] is None
    assert any("2 of 4 instances" in note for note in condition["notes"])
    assert "2 of 4 instances" in (tmp_path / "out" / "report.html").read_text()


def test_what_casts_doubt_on_a_rate_is_said_on_the_screen(tmp_path):
    # Noise beside a column that rises with the lines, which come label by label.
    rows = [f"{'ab'[k // 30]},{k % 7},{k + (k % 5) ** 2 / 100}" for k in range(60)]
    (tmp_path / "mine.csv").write_text("\n".join(["what,x,hours", *rows]) + "\n")
    (tmp_path / "e.toml").write_text('title = "t"\n[data]\nsource = "mine.csv"\nlabel = "what"\n')
    command = ("experiment", tmp_path / "e.toml", "--out", tmp_path / "out", "--executor", "serial")
    assert "hours" in printed(*command, "-o", "seeds=1")


@pytest.mark.slow
def test_an_experiment_on_simulated_grasps_keeps_trials_curves_and_trees(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(
        'title = "x"\n[data]\nobjects = ["can:full_open", "can:empty_open"]\ntotal = 7\ninstances = 2\n'
        '[judge]\nfolds = 2\ncontrols = false\ngrasps = 1\n[gripper]\nsensor = "ideal"\nrate_hz = 250.0\n'
    )
    planned, results = read_experiment(str(path)), Results(tmp_path / "out")
    run_experiment(planned, results, Serial)
    result = summarise(planned, results).results["", 0]

    assert list(result.trials.labels) == ["can:full_open"] * 4 + ["can:empty_open"] * 3
    assert sorted(set(result.trials.instances)) == ["can#0", "can#1"]
    assert [curve.label for curve in result.grasps] == ["can:full_open", "can:empty_open"]
    grasp = result.grasps[0]
    at_contact = grasp.t_s.index(0.0)
    assert grasp.phase[at_contact - 1 : at_contact + 1] == ("approach", "squeeze")
    tree = result.classifiers[0].tree
    assert tree[0].parent is None
    assert sum(node.trials for node in tree if node.parent == 0) == 7


@every_case("option", ["data.source=t.csv", "gripper.rate_hz=250", 'classifiers=["knn"]'])
def test_what_an_experiment_of_parts_would_ignore_is_refused(option):
    with pytest.raises(ConfigError, match=re.escape(option)):
        read_experiment("trade_sensing", [option])


def test_recorded_trials_are_not_simulated_in_silence(tmp_path):
    """A trade-off of classifiers simulated its own trials, whatever its source. It is refused before it runs."""
    table = tmp_path / "t.csv"
    table.write_text("what,a\n" + "x,1\ny,2\n" * 5)
    with pytest.raises(ConfigError, match=r"data\.source=.*t\.csv.*: .*t\.csv"):
        read_experiment("trade_squeezes", [f'data.source="{table}"', 'data.label="what"', "seeds=1"])


def test_an_experiment_does_not_write_into_a_store(file, tmp_path):
    Store.open(tmp_path / "trials").close()
    err = refused("experiment", file, "--out", tmp_path / "trials", "--executor", "serial")
    assert "store of trials" in err
    assert not (tmp_path / "trials" / "report.html").exists()
    assert graspsense("experiment", file, "--out", tmp_path / "trials", "--dry-run")[::2] == (2, err)


COMPARED = """
title = "A sweep"
question = "Does it matter?"
seeds = {seeds}

[gripper]
sensor = "ideal"
rate_hz = 250.0

[controller]
probing_force_n = {force}

[data]
objects = ["can:full_open", "can:empty_open"]
instances = 2
trials = {trials}

[judge]
folds = 2
controls = false
grasps = 0
"""


def done(folder, name, text):
    """Run an experiment in this folder; return the folder of its results."""
    file = folder / f"{name}.toml"
    file.write_text(text)
    run_experiment(read_experiment(str(file)), Results(folder / name), Serial, command=f"run {name}")
    return folder / name


@pytest.fixture(scope="module")
def weak(tmp_path_factory):
    """An experiment on recorded trials."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "mine.csv").write_text(wayward.CSV)
    return judged(folder, "weak", 2)


@pytest.fixture(scope="module")
def strong(weak):
    """The same with another setting, beside it."""
    return judged(weak.parent, "strong", 3)


def judged(folder, name, folds):
    """Run an experiment on recorded trials in this folder; return the folder of its results."""
    text = EXPERIMENT.replace('[sweep]\n"judge.folds" = [2, 3]\n', "").replace("seeds = 2", "seeds = 1")
    return done(folder, name, text.replace("[judge]", f"[judge]\nfolds = {folds}"))


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """The folder of three experiments: two with another setting, and one of other trials and one more seed."""
    folder = tmp_path_factory.mktemp("compared")
    for name, force, trials, seeds in (("weak", 14.0, 2, 2), ("strong", 20.0, 2, 2), ("more", 14.0, 3, 3)):
        done(folder, name, COMPARED.format(force=force, trials=trials, seeds=seeds))
    return folder


@pytest.mark.slow
def test_experiments_are_compared_on_one_page(compared, tmp_path):
    page = tmp_path / "page.html"
    folders = [compared / name for name in ("weak", "strong", "more")]
    out = printed("experiment", "compare", *folders, "--out", page)
    answer = answered("experiment", "compare", *folders, "--out", page)
    settings = {row["key"]: [row[name] for name in ("weak", "strong", "more")] for row in answer["settings"]}
    assert settings == {
        "controller.probing_force_n": ["14", "20", "14"],
        "data.trials": ["2", "2", "3"],
        "experiment.seeds": ["0, 1", "0, 1", "0, 1, 2"],
    }
    paired, unpaired = answer["differences"]
    rates = {
        name: answer["experiments"][name]["conditions"][0]["rate"] for name in ("weak", "strong", "more")
    }
    assert paired["difference"] == pytest.approx(rates["strong"] - rates["weak"])
    assert unpaired["difference"] == pytest.approx(rates["more"] - rates["weak"])
    assert paired["how"] == "paired over 2 common seeds, corrected for 2 comparisons"
    assert unpaired["how"] == "unpaired: the trials differ, corrected for 2 comparisons"
    for row in answer["differences"]:
        assert row["interval"][0] <= row["difference"] <= row["interval"][1]
    text = page.read_text()
    assert "Settings that differ" in text
    for part in (answer["answer"], "probing_force_n", "unpaired: the trials differ"):
        assert part in text, part
        assert part in out, part
    assert "closing_speed_m_s" not in text


def test_each_case_is_compared_with_that_of_the_same_name(whole, tmp_path):
    folder, _ = whole
    planned = read_experiment(str(folder.parent / "mine.toml"), ["seeds=1"])
    run_experiment(planned, Results(tmp_path / "b"), Serial)
    answer = answered("experiment", "compare", folder, tmp_path / "b", "--out", tmp_path / "c.html")
    cases = [f"folds {folds}, {name}" for folds in (2, 3) for name in ("c45", "near")]
    assert [difference["case"] for difference in answer["differences"]] == cases
    for difference in answer["differences"]:
        assert difference["how"].startswith("unpaired: ")
        assert difference["verdict"] == "not shown to differ"


def test_what_cannot_be_compared_is_refused_in_one_line(weak, strong, tmp_path):
    page = tmp_path / "c.html"
    assert Results(weak).experiment().name == "weak"  # which is not in its file
    old, changed = tmp_path / "old", tmp_path / "changed"
    for copy in (old, changed):
        shutil.copytree(strong, copy)
    text = (old / "experiment.toml").read_text()
    (old / "experiment.toml").write_text(text.replace("[judge]", "[judge]\nno_such_key = 1"))
    (changed / "experiment.toml").write_text(text.replace("folds = 3", "folds = 4"))
    for arguments, reason in (
        ([weak], "give at least two experiments to compare"),
        (
            [weak, strong, weak / "experiment.toml"],
            "are the same experiment: name different ones",
        ),
        ([weak, tmp_path], "is not an experiment: there is no experiment.toml"),
        ([weak, tmp_path / "none"], "there is no "),
        ([weak, old], "no_such_key"),
        ([weak, changed], f"{changed} has results"),
        ([weak, changed], "run strong"),
    ):
        err = refused("experiment", "compare", *arguments, "--out", page)
        assert reason in err
        assert len(err.strip().splitlines()) == 1, err
        assert not page.exists()
    assert f"graspsense experiment {changed / 'experiment.toml'} --out FOLDER" in refused("report", changed)
