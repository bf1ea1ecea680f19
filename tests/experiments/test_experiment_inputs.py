"""Results are of the content of their inputs: what was replaced since is computed again, and nothing else."""

import os
from functools import partial
from html import escape

import numpy as np
import pytest
import wayward
from attrs import evolve
from cases import every_case
from kept import keep

from graspsense.core.components.caller import command_line
from graspsense.core.components.registry import IsolatedPlugins, installed
from graspsense.core.values.errors import ConfigError
from graspsense.experiments.answer import answer
from graspsense.experiments.comparison import compare_experiments
from graspsense.experiments.executors.executor import Serial
from graspsense.experiments.executors.processes import Processes
from graspsense.experiments.experiment_file import _located, read_experiment
from graspsense.experiments.page import write_page
from graspsense.experiments.results import Results
from graspsense.experiments.run import run_experiment
from graspsense.experiments.summary import summarise
from graspsense.experiments.task import TaskResult, run_task
from graspsense.plugin_api import hookimpl
from graspsense.sources import input_content
from graspsense.sources.input_content import contents_of
from graspsense.store.changes import restore, set_aside
from graspsense.store.store import Store

EXPERIMENT = """
title = "a"
question = "b?"
classifiers = ["knn"]
[data]
source = "{source}"
{label}
[judge]
controls = false
folds = 2
grasps = 0
"""


def experiment(folder, source, label='label = "what"', more=""):
    path = folder / "e.toml"
    path.write_text(EXPERIMENT.format(source=source, label=label) + more)
    return str(path)


def rate_of(planned, results):
    (condition,) = summarise(planned, results).conditions
    return condition.rate.mean, condition.by_seed[0].rate.n


def table(path, seed, separation):
    rng = np.random.default_rng(seed)
    lines = [f"{'ab'[i % 2]},{rng.normal(separation * (i % 2)):.6f}" for i in range(40)]
    path.write_text("what,w [m]\n" + "\n".join(lines) + "\n")


@pytest.mark.slow
def test_a_replaced_table_is_evaluated_anew_and_it_is_said(tmp_path):
    table(tmp_path / "t.csv", 1, 50.0)
    file, results = experiment(tmp_path, "t.csv"), Results(tmp_path / "out")
    run_experiment(read_experiment(file), results, Serial)
    assert rate_of(read_experiment(file), results) == (1.0, 40)

    table(tmp_path / "t.csv", 2, 0.0)
    assert rate_of(results.experiment(), results) == (1.0, 40)  # a page is that of what there was
    account = run_experiment(read_experiment(file), results, Serial, resume=True)
    assert (account.kept, account.done) == (0, 1)
    assert any("t.csv" in note for note in account.notes)
    assert rate_of(read_experiment(file), results)[0] < 0.9
    again = run_experiment(read_experiment(file), results, Serial, resume=True)
    assert (again.kept, again.done, again.notes) == (1, 0, ())


@pytest.mark.slow
def test_results_keep_their_task_where_data_move_and_are_shown_where_data_are_not(tmp_path, monkeypatch):
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    table(here / "t.csv", 1, 50.0)
    run_experiment(read_experiment(experiment(here, "t.csv")), Results(here / "out"), Serial)
    here.rename(there)
    results = Results(there / "out")
    assert rate_of(results.experiment(), results) == (1.0, 40)
    account = run_experiment(read_experiment(str(there / "e.toml")), results, Serial, resume=True)
    assert (account.kept, account.done) == (1, 0)
    (there / "t.csv").unlink()
    assert rate_of(results.experiment(), results) == (1.0, 40)

    table(there / "u.csv", 2, 50.0)
    monkeypatch.chdir(there)
    options = read_experiment("e.toml", ["data.source=u.csv"])
    assert options.cases[0].data.source == str(there / "u.csv")


def test_a_result_says_the_same_whatever_runs_its_task(tmp_path):
    table(tmp_path / "t.csv", 1, 3.0)
    (task,) = read_experiment(experiment(tmp_path, "t.csv", more="", label='label = "what"')).tasks()
    task = evolve(task, params={**task.params, "judge": {**task.params["judge"], "controls": True}})
    alone = TaskResult.from_text(run_task(task.to_text())).result
    with command_line():
        assert TaskResult.from_text(run_task(task.to_text())).result == alone
    assert "instance=COLUMN" in str(alone)


def test_two_tables_that_are_exchanged_are_another_task(tmp_path):
    for seed, name in enumerate(("a", "b")):
        (tmp_path / name).mkdir()
        table(tmp_path / name / "t.csv", seed, 50.0)
    file = experiment(tmp_path, "a/t.csv", more='[test]\nsource = "b/t.csv"\nlabel = "what"\n')
    (task,) = read_experiment(file).tasks()
    (exchanged,) = read_experiment(
        file, [f'{key}.source="{tmp_path / name}/t.csv"' for key, name in (("data", "b"), ("test", "a"))]
    ).tasks()
    assert task.key != exchanged.key


def test_results_of_other_versions_are_told_and_those_of_an_older_form_computed_again(tmp_path):
    table(tmp_path / "t.csv", 1, 50.0)
    planned = read_experiment(experiment(tmp_path, "t.csv"), ["seeds=2"])
    results = Results(tmp_path / "out")
    run_experiment(planned, results, Serial)
    assert summarise(planned, results).other_versions == {}
    done, _ = results.read(planned.tasks()[0])
    results.add(evolve(done, made=evolve(done.made, versions={**done.made.versions, "numpy": "0.9"})))
    run_experiment(planned, results, Serial, resume=True)
    summary = summarise(planned, results)
    ((how, number),) = summary.other_versions.items()
    assert "numpy" in how
    assert "0.9" in how
    assert number == 1
    assert how in summary.as_json()["other_versions"]
    assert escape(how) in write_page(summary, results).read_text()
    results.add(evolve(done, result={key: value for key, value in done.result.items() if key != "simulated"}))
    assert len(summarise(planned, results).unreadable) == 1
    account = run_experiment(planned, results, Serial, resume=True)
    assert (account.kept, account.done) == (1, 1)
    assert rate_of(planned, results) == (1.0, 40)


@pytest.mark.slow
def test_a_comparison_names_the_inputs_whose_content_differs(tmp_path):
    file = experiment(tmp_path, "t.csv")
    for seed, name in enumerate(("a", "b", "c")):
        table(tmp_path / "t.csv", min(seed, 1), 50.0)
        run_experiment(read_experiment(file), Results(tmp_path / name), Serial)
    (other,) = compare_experiments([str(tmp_path / "a"), str(tmp_path / "b")]).settings
    assert str(tmp_path / "t.csv") in other.key
    assert compare_experiments([str(tmp_path / "b"), str(tmp_path / "c")]).settings == ()


def grasps(store, numbers):
    for k in numbers:
        label = ("can:full_open", "can:empty_open")[k % 2]
        keep(store, label, values=(0.06 + 0.00013 * k, 5.0 + k % 2), grasp=k, ticks=9)


@every_case("name", ["x,y.csv", "a,b/t.csv", "12:30/t.csv"])
def test_a_table_whose_path_has_a_comma_or_a_colon_counts(tmp_path, name):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text("1")
    located = _located({"data": {"source": name}}, tmp_path)
    assert located["data"]["source"] == str(tmp_path / name)
    assert_counts(tmp_path / name, located)


def test_a_file_that_is_replaced_with_the_same_size_and_time_counts_in_the_same_process(tmp_path):
    file = tmp_path / "t.csv"
    file.write_text("1")
    state, known = file.stat(), contents_of([str(file)])
    file.write_text("2")
    os.utime(file, ns=(state.st_atime_ns, state.st_mtime_ns))
    assert contents_of([str(file)]) != known


def test_a_store_that_grew_or_was_corrected_is_another_input(tmp_path):
    with Store.open(tmp_path / "s") as store:
        grasps(store, range(12))
        file, results = experiment(tmp_path, "store:s", label=""), Results(tmp_path / "out")
        run_experiment(read_experiment(file), results, Serial)
        assert rate_of(read_experiment(file), results)[1] == 12

        grasps(store, range(12, 24))
        account = run_experiment(read_experiment(file), results, Serial, resume=True)
        assert (account.kept, account.done) == (0, 1)
        assert rate_of(read_experiment(file), results)[1] == 24

        set_aside(store, [3], "slipped")
        assert run_experiment(read_experiment(file), results, Serial, resume=True).done == 1
        assert rate_of(read_experiment(file), results)[1] == 23
        restore(store, [3], "")
        set_aside(store, [3], "slipped, as the film shows")
        assert run_experiment(read_experiment(file), results, Serial, resume=True).kept == 1

        names = [f"store:{tmp_path}/s", f"store:{tmp_path}/s#3"]  # the store, and one of its trials
        recording = next(store.recordings.glob("*.mcap"))
        for change in (
            lambda: recording.write_bytes(recording.read_bytes()[:-9]),
            recording.unlink,
            lambda: store._connection.execute("DELETE FROM detail WHERE trial = 5"),
        ):
            known = contents_of(names)
            change()
            assert all(contents_of(names)[name] != known[name] for name in names)


def assert_counts(path, params):
    """Assert that these settings have another input once a file has another content, which a comment is not."""
    contents, text, is_toml = contents_of(params), path.read_text(), path.suffix == ".toml"
    path.write_text(text + "# why\n" * is_toml)
    assert contents_of(params) == contents
    path.write_text(text + ("further = 1\n" if is_toml else " "))
    assert contents_of(params) != contents


@pytest.mark.parametrize(
    "name",
    ["{}/cup.toml", "{}/cup.toml#2", "identified:{}/cup.toml,{}/mug.toml", "icub:{}", "mcap:{}/cup.toml"],
)
def test_files_and_folders_are_known_by_their_content(tmp_path, name):
    (tmp_path / "mug.toml").write_text("")
    (tmp_path / "cup.toml").write_text("width_m = 0.06\n")
    name = name.format(tmp_path, tmp_path)
    assert contents_of({"data": {"named": {"cup": name}}}).keys() == {name, "graspsense"}
    assert_counts(tmp_path / "cup.toml", {"data": {"named": {"cup": name}}})


def test_a_folder_that_a_link_leads_to_counts_and_a_link_in_a_circle_ends(tmp_path):
    data, elsewhere = tmp_path / "data", tmp_path / "elsewhere"
    data.mkdir()
    elsewhere.mkdir()
    (data / "day1").symlink_to(elsewhere)
    (data / "all").symlink_to(data)
    (elsewhere / "jar.csv").write_text("1")
    assert_counts(elsewhere / "jar.csv", [f"icub:{data}"])


def test_files_that_a_file_names_count(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "gripper.toml").write_text('model = "gripper.xml"\n')
    (tmp_path / "gripper.xml").write_text(
        "<mujoco><compiler meshdir='meshes'/><include file=\"part.xml\"/></mujoco>"
    )
    (tmp_path / "part.xml").write_text('<mujoco><mesh file="pad.stl"/><include file="gripper.xml"/></mujoco>')
    mesh = tmp_path / "meshes" / "pad.stl"
    mesh.write_text("1")
    for part in (mesh, tmp_path / "part.xml", tmp_path / "gripper.xml"):
        assert_counts(part, {"gripper": {"file": str(tmp_path / "gripper.toml")}})


@every_case("name", [r'"\u0067ripper.xml"', '"""gripper.xml"""', '"~/gripper.xml"'])
def test_a_name_counts_in_whatever_form_a_file_has_it(tmp_path, monkeypatch, name):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "gripper.toml").write_text(f"model = {name}\n")
    (tmp_path / "gripper.xml").write_text('<mujoco><mesh file="pad &amp; tip.stl"/></mujoco>')
    (tmp_path / "pad & tip.stl").write_text("1")
    for part in ("gripper.xml", "pad & tip.stl"):
        assert_counts(tmp_path / part, {"gripper": {"file": str(tmp_path / "gripper.toml")}})


def test_a_model_in_an_installed_package_counts(tmp_path, monkeypatch):
    models = tmp_path / "lab_models" / "grippers"
    models.mkdir(parents=True)
    (tmp_path / "lab_models" / "__init__.py").write_text("raise AssertionError('imported')")
    (models / "jaw.xml").write_text("<mujoco/>")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "gripper.toml").write_text('model = "package:lab_models:grippers/jaw.xml"\n')
    assert_counts(models / "jaw.xml", {"gripper": {"file": str(tmp_path / "gripper.toml")}})


@every_case(
    "source",
    [
        *("s", "s/store.sqlite", "store:s", "manifest:m.toml", "identified:m.toml,n.toml", "t.parquet"),
        *("~/t.parquet", "identified:~/m.toml,n.toml", "store:~/s"),
    ],
)
def test_paths_are_relative_to_the_folder_of_the_file_wherever_it_is_read(tmp_path, monkeypatch, source):
    with Store.open(tmp_path / "s") as store:
        grasps(store, range(4))
    for name in ("m.toml", "n.toml", "t.parquet"):
        (tmp_path / name).write_text("")
    monkeypatch.chdir(tmp_path.parent)
    monkeypatch.setenv("HOME", str(tmp_path))
    located = _located({"data": {"source": source}}, tmp_path)["data"]["source"]
    assert located.count(str(tmp_path)) == 1 + source.count(",")
    assert "~" not in located


def test_files_that_a_manifest_describes_count_wherever_they_are(tmp_path):
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    manifest = tmp_path / "here" / "m.toml"
    manifest.write_text(
        'folder = "../there"\nfiles = "{label}.csv"\ntime = "t [s]"\ngap = "gap [m]"\nforce = "F [N]"\n'
    )
    there = tmp_path / "there"
    (there / "can.csv").write_text("t,gap,F\n0,0.1,0\n")
    assert_counts(there / "can.csv", [f"manifest:{manifest}"])
    known = contents_of([f"manifest:{manifest}"])
    (there / "can.csv").rename(there / "jar.csv")  # a label is in the name
    assert contents_of([f"manifest:{manifest}"]) != known
    (there / "jar.csv").rename(there / "can.csv")
    manifest.write_text(
        manifest.read_text() + 'beside = "labels.csv"\nvalues = { mass = "mass_{label}.txt" }\n'
    )
    for name in ("labels.csv", "mass_can.txt"):
        (there / name).write_text("1\n")
        assert_counts(there / name, [f"manifest:{manifest}"])


@every_case("beside", ["can.csv.json", "can-pads.csv", "can-camera.csv.npz"])
def test_what_was_exported_beside_a_grasp_counts(tmp_path, beside):
    for name in ("can.csv", "can.csv.json", beside):
        (tmp_path / name).write_text("1\n")
    assert_counts(tmp_path / beside, {"recording": f"csv:{tmp_path / 'can.csv'}"})


def test_the_calibrations_of_a_gripper_count_with_and_without_their_setting(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    folder = tmp_path / "graspsense" / "calibration" / "S1"
    folder.mkdir(parents=True)
    (folder / "tare.json").write_text("1")
    for given in ("", str(folder.parent)):
        assert_counts(folder / "tare.json", {"gripper": {"calibration": given}})


LAW = """
import helper
from helpers.law import a
weights = [Path(__file__).parents[2] / "data" / "weights.txt", "near.txt", os.environ["LAB_WEIGHTS"]]
late = import_module("lab_late"), os.environ.get("lab_scale"), Path(__file__).parent / "../../data/more.txt"
"""


def test_the_code_of_a_plugin_counts_with_what_it_imports_and_names(tmp_path, monkeypatch):
    texts = dict.fromkeys(
        ["src/helpers/law.py", "src/near.txt", "data/weights.txt", "data/more.txt", "far.txt"], ""
    )
    texts |= {"src/my_plugin/law.py": LAW, "src/helper.py": "import lab_deep, attrs, lab_lost"}
    texts |= {"library/lab_late.py": "", "library/lab_deep/__init__.py": ""}
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.setenv("LAB_WEIGHTS", str(tmp_path / "far.txt"))
    for place in ("src", "library"):
        monkeypatch.syspath_prepend(tmp_path / place)

    def content(version="1.0"):
        input_content._hash_of_code.cache_clear()  # as in another process
        return input_content._hash_of_code(version, "my_plugin.law")

    known = [content()]
    (tmp_path / "src" / "other.py").write_text("a = 1")  # which nothing imports
    assert content() in known
    assert content("1.1") not in known
    for name, text in texts.items():
        (tmp_path / name).write_text(f"{text}\n# changed")
        assert content() not in known, name
        known.append(content())
    monkeypatch.setenv("lab_scale", "2")
    assert content() not in known
    for name in ("helper.py", "my_plugin/law.py"):
        developed = input_content.developed_code("my_plugin.law")
        (tmp_path / "src" / name).write_text("a = 333")
        assert input_content.developed_code("my_plugin.law") not in ("", developed)
    assert input_content.developed_code("attrs.anything") == ""


def test_the_components_of_a_task_are_inputs(tmp_path):
    table(tmp_path / "t.csv", 1, 1.0)
    planned = read_experiment(experiment(tmp_path, "t.csv"))
    assert planned.inputs.keys() >= {str(tmp_path / "t.csv"), "graspsense/knn", "graspsense"}
    (task,) = planned.tasks()
    for part, same in (("graspsense/knn", False), ("another/part", True)):
        (changed,) = evolve(planned, inputs={**planned.inputs, part: "other code"}).tasks()
        assert (changed.key == task.key) is same


def test_the_code_of_a_component_that_a_setting_names_is_an_input(monkeypatch):
    foreign = next(part for part in installed().components() if part.distribution != "graspsense")
    params = {"features": {"type": "graspsense/union", "sets": ["curve", foreign.name]}}
    contents = contents_of(params)
    monkeypatch.setattr(input_content, "_hash_of_code", lambda version, name: f"{version} {name} changed")
    assert contents[foreign.name] != contents_of(params)[foreign.name]


def test_the_code_of_a_kind_of_experiment_and_of_a_term_of_others_is_an_input(tmp_path, monkeypatch):
    import graspsense_paper.plugin
    import graspsense_sim_gripper.plugin

    class Terms:
        GRASPSENSE_API = (2, 0)
        __name__ = "lab_terms"

        @staticmethod
        @hookimpl(optionalhook=True)
        def graspsense_sim_terms():
            return []

    table(tmp_path / "t.csv", 1, 1.0)
    planned = read_experiment(experiment(tmp_path, "t.csv"))
    with IsolatedPlugins(graspsense_paper.plugin) as plugins:
        plugins.add(graspsense_sim_gripper.plugin, "graspsense-sim-gripper")
        plugins.add(Terms(), "lab-terms")
        (status,) = [status for status in plugins.statuses if status.distribution == "lab-terms"]
        known, contents = contents_of(["grasp", "sim"]), input_content._hash_of_code
        for changed, name in (("graspsense_paper.grasping", "grasp"), (status.module, "sim")):
            monkeypatch.setattr(
                input_content,
                "_hash_of_code",
                lambda version, file, changed=changed: (
                    "changed" if file == changed else contents(version, file)
                ),
            )
            assert contents_of(["grasp", "sim"])[name] != known[name]
        cases = tuple(evolve(case, kind="grasp") for case in planned.cases)
        assert "grasp" in evolve(planned, cases=cases).with_inputs().tasks()[0].params["inputs"]


@pytest.mark.parametrize(
    "executor",
    [
        pytest.param(Serial, id="serial"),
        pytest.param(partial(Processes, 2), id="processes", marks=pytest.mark.slow),
    ],
)
def test_a_table_that_is_replaced_while_the_experiment_runs_is_no_result_of_what_it_was_before(
    tmp_path, executor
):
    table(tmp_path / "t.csv", 1, 50.0)
    planned = read_experiment(experiment(tmp_path, "t.csv"), ["seeds=2"])
    results = Results(tmp_path / "out")
    table(tmp_path / "t.csv", 2, 0.0)
    account = run_experiment(planned, results, executor)
    assert ["t.csv" in failed.reason for failed in account.failed] == [True, True]
    table(tmp_path / "t.csv", 1, 50.0)
    again = run_experiment(planned, results, executor, resume=True)
    assert (again.kept, again.done, again.failed) == (0, 2, ())
    assert rate_of(planned, results) == (1.0, 40)


def test_what_is_no_file_is_no_input():
    assert contents_of({"a": "can:full_open", "b": ["", "a\nb = 1\n"], "c": 3, "d": None}).keys() == {
        "graspsense"
    }


@pytest.mark.slow
@every_case(
    ("sweep", "key"),
    [
        ('"controller.probing_force_n" = [17.0, 20.0]', "controller.probing_force_n"),
        ('"gripper.coulomb_n" = [1.0, 2.0]', "gripper.coulomb_n"),
        ('"features.type" = ["chitta", "curve"]', "features.type"),
        ('"run.hold_s" = [0.1, 0.2]', "run.hold_s"),
        ('"data.instances" = [2, 3]', "data.instances"),
        ('"data.checkpoints_s" = [[0.1], [0.2]]', "data.checkpoints_s"),
        ('"judge.folds" = [2, 3]\n[test]\nsource = "t.csv"\nlabel = "what"', "judge.folds"),
    ],
)
def test_a_sweep_without_effect_on_a_table_is_refused(tmp_path, sweep, key):
    (tmp_path / "t.csv").write_text(wayward.CSV)
    with pytest.raises(ConfigError, match=f"{key} .*t.csv"):
        read_experiment(experiment(tmp_path, "t.csv", more=f"[sweep]\n{sweep}\n"))


def test_pipelines_that_differ_in_nothing_that_a_table_depends_on_are_refused(tmp_path):
    (tmp_path / "t.csv").write_text(wayward.CSV)
    (tmp_path / "p.toml").write_text('extends = "default"\n[controller]\nprobing_force_n = 17.0\n')
    file = experiment(tmp_path, "t.csv")
    text = 'pipelines = ["default", "p.toml"]\n'
    (tmp_path / "e.toml").write_text(text + (tmp_path / "e.toml").read_text())
    with pytest.raises(ConfigError, match=r"pipeline .*t.csv"):
        read_experiment(file)


@pytest.mark.parametrize(
    ("sweep", "tasks"),
    [
        ('"judge.folds" = [2, 3]', 2),
        ('"data.columns" = [["p"], ["q"]]', 2),
        ('"classifier.neighbours" = [1, 3]', 1),  # of two classifiers
    ],
)
def test_a_sweep_that_a_table_depends_on_is_planned(tmp_path, sweep, tasks):
    table(tmp_path / "t.csv", 1, 1.0)
    text = (tmp_path / "t.csv").read_text().replace("w [m]", "p").splitlines()
    (tmp_path / "t.csv").write_text(
        "\n".join([f"{text[0]},q", *(f"{line},{k % 7}.5" for k, line in enumerate(text[1:]))])
    )
    planned = read_experiment(experiment(tmp_path, "t.csv", more=f"[sweep]\n{sweep}\n"))
    assert len({task.key for task in planned.tasks()}) == tasks


@pytest.mark.slow
@every_case(
    ("sweep", "alike"),
    [('"judge.grasps" = [0, 3]', [["grasps 0", "grasps 3"]]), ('"judge.folds" = [2, 3]', [])],
)
def test_a_sweep_that_changed_no_result_is_told(tmp_path, sweep, alike):
    table(tmp_path / "t.csv", 1, 1.0)
    planned = read_experiment(experiment(tmp_path, "t.csv", more=f"[sweep]\n{sweep}\n"))
    run_experiment(planned, Results(tmp_path / "out"), Serial)
    summary = summarise(planned, Results(tmp_path / "out"))
    assert summary.alike == alike
    assert ("changes nothing" in answer(summary)) is bool(alike)


def test_parts_that_have_a_case_in_common_do_not_say_that_nothing_has_an_effect(tmp_path):
    table(tmp_path / "t.csv", 1, 1.0)
    experiment(tmp_path, "t.csv")
    for name in "ab":
        (tmp_path / f"{name}.toml").write_text((tmp_path / "e.toml").read_text())
    (tmp_path / "both.toml").write_text('title = "x"\nparts = ["a.toml", "b.toml"]\n')
    planned = read_experiment(str(tmp_path / "both.toml"))
    run_experiment(planned, Results(tmp_path / "out"), Serial)
    assert summarise(planned, Results(tmp_path / "out")).alike == []


VARIANT = '[[variants]]\nname = "{}"\n[variants.controller]\nclosing_speed_m_s = {}\n'


@every_case(
    ("more", "told"),
    [
        (
            '[sweep]\n"controller.closing_speed_m_s" = [0.01, 0.01]\n',
            "2 cases are called 'closing speed 10 mm/s'",
        ),
        ('[sweep]\n"controller.closing_speed_m_s" = [0.01, 0.0100000001]\n', "2 cases are called"),
        (VARIANT.format("x", 0.01) + VARIANT.format("x", 0.02), "2 cases are called 'x'"),
        ('[sweep]\n"run.seed" = [1, 2]\n', "run.seed makes no difference.*`seeds`"),
    ],
)
def test_cases_whose_results_would_take_the_place_of_each_other_are_refused(tmp_path, more, told):
    (tmp_path / "e.toml").write_text(f'title = "Near"\nquestion = "So?"\n{more}')
    with pytest.raises(ConfigError, match=told):
        read_experiment(str(tmp_path / "e.toml"))
