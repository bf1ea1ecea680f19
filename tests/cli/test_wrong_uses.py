"""What a user is told who types something else than what is meant: the words of each error lead to the right ones."""

import re
import warnings

import numpy as np
import pytest
from attrs import fields
from cases import every_case
from commands import graspsense, refused
from hypothesis import given
from hypothesis import strategies as st
from kept import keep
from repository import ROOT

from graspsense import evaluate, load_pipeline, load_trials
from graspsense.core.compiling import compile_notice
from graspsense.core.components.firstparty import EXAMPLES
from graspsense.core.components.strict import ValidationFailed, nearest_path, structured
from graspsense.core.learn.labelled import Labelled
from graspsense.core.settings.layers import KINDS, toml_kind
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.signals import Outcome
from graspsense.experiments.experiment import Experiment
from graspsense.plugins.features.curve import CurveFeatures
from graspsense.sources.manifest.description import Manifest
from graspsense.store.opening import as_source, store_folder
from graspsense.store.store import Store

FILES = {
    "pipe.toml": 'extends = "default"\n[controller]\nprobing_force_n = 15.0\n',
    "scene.toml": 'width_m = 0.06\n[[terms]]\ntype = "elastic"\nk1_n_m = 2000.0\n',
    "ex.toml": 'title = "x"\n[sweep]\n"controller.probing_force_n" = [17.0]\n',
    "table.csv": "what,a\nx,1\ny,2\n",
    "man.toml": 'files = "{label}.csv"\ntime = "t"\ngap = "g"\n',
    "bare.toml": "width_m = 0.06\n",
}


@pytest.fixture
def run(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)

    return graspsense


@pytest.mark.slow
@every_case(
    ("typed", "meant"),
    [
        ("run -o probing_force_n=17", "'controller.probing_force_n'"),
        ("run -o controler.probing_forc_n=17", "'controller.probing_force_n'"),
        ("run --gripper pr2 -o gripper.drop=0.2", "'gripper.faults.drop'"),
        ("run -o gripper.transport=emulated", 'gripper.type = "pr2"'),
        ("evaluate simulated -o probing_force_n=17", "'controller.probing_force_n'"),
        ("experiment ex.toml -o trials=2 --dry-run", "'data.trials'"),
        ("evaluate ~nobody-of-this-name/t.csv --label what", "~nobody-of-this-name/t.csv"),
        ("predict ~nobody-of-this-name/m.json table.csv", "~nobody-of-this-name/m.json"),
        ("experiment ex.toml -o probing_force_n=17 --dry-run", "'controller.probing_force_n'"),
        ("run -o controller.probing_force_n 17", "-o controller.probing_force_n=17"),
        ("run -o controller.probing_force_n = 17", "-o controller.probing_force_n=17"),
        ("import a.csv --check -o run.seed 17", "-o run.seed=17"),
        ("run can:empty_open", "--object can:empty_open"),
        ("run scene.toml", "--object scene.toml"),
        ("run --object bare.toml", "[[terms]]"),
        ("run pipe.toml", "--pipeline pipe.toml"),
        ("run pr2", "--gripper pr2"),
        ("run defalt", "--pipeline default"),
        ("run --live-address nowhere.invalid", "nowhere.invalid: "),
        ("run --picture p.bmp", "end in .png"),
        ("run --video v.avi", "end in .mp4"),
        ("run --picture missing/p.png", "no folder missing"),
        ("experiment ex.toml --out table.csv --dry-run", "table.csv is no folder"),
        ("import . --check", "--suggest FILE.toml"),
        ("collect can:empty_open", "--labels can:empty_open"),
        ("run --pipeline scene.toml", "run --object scene.toml"),
        ("run --pipeline ex.toml", "experiment ex.toml"),
        ("config validate man.toml", "import man.toml --check"),
        ("evaluate man.toml", "manifest:"),
        ("predict simulated default", "predict default simulated"),
        ("run -o features.type=grasp-curve", "pip install -e ./examples/grasp_curve"),
        ("evaluate table.csv", "--label COLUMN"),
        ("evaluate table.csv --label what -o features.type=curve", "[classifier]"),
        ("evaluate simulated --objects ,", "--objects ','"),
        ("run --changed", "--save DIR"),
        ("run --save=", "'--save'"),
        ("evaluate table.csv --label what --tolerance 0.1", "--events"),
        ("evaluate manifest:man.toml --events --png x.png", "--png"),
        ("run --gripper SIM", "'sim'"),
        ("run --seed -5", "of at least 0, found -5"),
        ("run -o controller.probing_force_n=inf", "a finite number, found inf"),
        ("evaluate simulated --report table.csv", "it is no folder"),
        ("experiment ex.toml -o judge.targets=[] --dry-run", "targets"),
        ("evaluate simulatd", "'simulated'"),
        ("experiment ex.toml -o controller.nope=1 --dry-run", "-o controller.nope=1:"),
        ("experiment ex.toml -o data.objects=[] --dry-run", "-o data.objects=[]: an empty list"),
        ("experiment ex.toml -o controller.probing_force_n=18 --dry-run", "sweep.controller.probing_force_n"),
        ("experiment ex.toml -o run.seed=3 --dry-run", "-o run.seed=3: "),
        ("compare table.csv --label what --classifiers c45,graspsense-c45/c45", "are the same"),
        ("evaluate table.csv --label what --order nope", "(the order)"),
        ("predict default table.csv --features a", "--features"),
        ("export . --to nowhere:x", "lerobot:FOLDER"),
        ("report . --out table.csv", "it is no folder"),
        ("replay icub:nope", "FOLDER/full_vitamin_water_1.txt"),
        ("evaluate nothere.csv", "no file"),
    ],
)
def test_the_right_words_are_told(run, typed, meant):
    assert meant in refused(*typed.split())


@given(st.text("abcdef_.", min_size=1, max_size=30), st.lists(st.text("abcdef_.", min_size=1), min_size=1))
def test_the_nearest_path_is_one_that_there_is_and_a_known_path_is_its_own(nearest, known):
    assert nearest_path(nearest, known) in ("", *known)
    assert nearest_path(known[0], known).rpartition(".")[2] == known[0].rpartition(".")[2]


@every_case(
    ("typed", "allowed"),
    [
        ("hold --seconds 0", r"--seconds 0\.0: .* 0, .* 3500"),
        ("evaluate simulated --folds x", "--folds 'x': .*whole number.* 2"),
        ("run --seed 1.5", r"--seed '1\.5': .*whole number"),
        ("calibrate tare --images 1", "--images 1: .*whole number.* 2 .* 1000"),
        ("calibrate friction --narrowest nan", "--narrowest nan: .* 0.002 to 0.08"),
    ],
)
def test_a_number_that_an_option_does_not_take_is_answered_with_those_it_takes(run, typed, allowed):
    assert re.search(allowed, " ".join(refused(*typed.split()).split()))


def test_a_kind_of_file_is_recognised_by_keys_that_it_has():
    assert KINDS["experiment"].marks <= {field.name for field in fields(Experiment)}
    assert KINDS["manifest"].marks <= {field.name for field in fields(Manifest)}
    assert toml_kind({"features": {}}, "pipeline") == "pipeline"
    assert toml_kind({"nonsense": 1}, "scene") == "scene"


def test_every_component_of_an_example_is_known_by_its_folder():
    for example in EXAMPLES:
        folder = ROOT / example.hint.rpartition("-e ")[2]
        declared = next(folder.glob("src/*/plugin.py")).read_text()
        assert all(f'name="{name}"' in declared for names in example.names.values() for name in names)
        assert f'name = "{example.distribution}"' in (folder / "pyproject.toml").read_text()


def test_a_value_of_several_types_is_asked_for_in_words():
    with pytest.raises(ValidationFailed) as refused:
        structured({"title": "x", "seeds": "a"}, Experiment, "an experiment")
    (problem,) = refused.value.problems
    assert "or a list" in problem.words()


@pytest.fixture
def store(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        for k in range(12):
            label = ("can:full_open", "can:empty_open")[k % 2]
            keep(store, label, values=(0.066 + 0.001 * (k % 3), 5.0 + k % 2 + 0.01 * k), grasp=k)
    return tmp_path / "trials"


def test_a_store_may_be_named_in_every_way(store):
    for named in (str(store), f"store:{store}", f"{store}/store.sqlite"):
        assert store_folder(named) == str(store)
        assert as_source(named) == f"store:{store}"
        assert len(load_trials(named)) == 12
    assert f"write {store}" in refused("trials", "list", f"{store}#1")
    store = store.rename(f"{store}#2")
    for number in ("", "#3"):
        assert as_source(f"{store}{number}") == f"store:{store}{number}"
    for named in ("", "store:"):  # as of a variable of a shell that is not set
        with pytest.raises(ConfigError, match="names no folder"):
            store_folder(named)
    assert store_folder("~nobody-of-this-name/trials") == "~nobody-of-this-name/trials"


def test_folds_and_a_class_are_refused_before_the_first_grasp(run, monkeypatch):
    monkeypatch.setattr("graspsense.sources.trial_source.simulated", lambda *_, **__: pytest.fail("grasped"))
    few = ("simulated", "--objects", "can:full_open,can:empty_open", "--instances", "1", "--trials", "1")
    for command in (("evaluate", *few), ("compare", *few)):
        assert "into 40 folds" in refused(*command, "--folds", "40")
        refused(*command, "--folds", "1")
        assert "Known: can." in refused(*command, "--folds", "2", "--only", "nope")


def test_options_in_python_are_a_list():
    for ask in (load_pipeline, resolve):
        for options in ("run.seed=3", {"run.seed": 3}, [("run.seed", 3)]):
            with pytest.raises(ConfigError, match=r"\['run\.seed=3'\]"):
                ask(options=options)


def test_an_error_in_python_names_arguments_and_not_options_of_commands(run):
    with pytest.raises(ConfigError) as refused:
        load_trials("table.csv")
    assert "label=COLUMN" in str(refused.value)
    assert "--" not in str(refused.value)


@every_case(
    "options",
    [
        ["nonsense"],
        ["controller.probing_forc_n=17"],
        ["controller.probing_force_n=much"],
        ["classifier.type=mlp", "classifier.model=none.json"],
        ["classifier.type=none", "run.stop_when_sure=true"],
    ],
)
def test_an_error_in_python_names_options_as_python_takes_them(options, run):
    with pytest.raises(ConfigError) as refused:
        load_pipeline(options=options).grasp()
    assert "-o " not in str(refused.value)
    assert "options=['" in str(refused.value)
    code, _, err = run("run", *(word for option in options for word in ("-o", option)))
    assert (code, "-o " in err, "options=[" in err) == (2, True, False)


def test_arguments_of_an_evaluation_that_are_something_else_are_refused():
    trials = some_trials([1.0, 2.0] * 6)
    for arguments in ((trials, "c45"), ("c45", "x.csv")):
        with pytest.raises(ConfigError, match="load_trials"):
            evaluate(*arguments)
    with pytest.raises(ConfigError, match="'state'"):
        evaluate("c45", trials, target="size")
    with pytest.raises(ConfigError, match="12 trials"):
        evaluate("c45", some_trials([np.nan] * 12), folds=2)
    evaluation = evaluate("c45", trials, folds=2, permutations=1)
    assert evaluation.classifier.startswith("graspsense-c45/c45 ")
    assert evaluation.headline.rate == 1.0


def some_trials(values):
    labels = tuple(("a", "b")[k % 2] for k in range(len(values)))
    table = FeatureTable(names=("f",), units=("N",), values=np.array(values, float).reshape(-1, 1))
    return Labelled(source="trials", table=table, labels=labels)


def test_a_long_compilation_is_told_and_a_short_one_is_not():
    told = []
    said = compile_notice._said
    compile_notice.tell_compiling(told.append)
    try:
        compile_notice.compiling_begins("stored_grasp", 60_000)
        compile_notice.compiling_begins("seed_state", 1_000)
    finally:
        compile_notice.tell_compiling(said)
    (line,) = told
    assert "compiling stored grasp" in line
    assert "33 s" in line


def test_a_warning_of_a_library_is_a_note_in_one_line(run, monkeypatch):
    from graspsense.cli import main as program

    def noisy(*_):
        warnings.warn_explicit("raw words\nadvice to programmers", UserWarning, "/x/sklearn/base.py", 7)
        raise ConfigError("then this")

    monkeypatch.setattr(program.cli, "make_context", noisy)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        err = refused("devices")
    assert "note: sklearn remarks: raw words" in err
    assert "base.py" not in err
    assert "advice" not in err


@pytest.mark.slow
def test_features_of_a_wrong_type_are_blamed_on_the_feature_set(monkeypatch):
    monkeypatch.setattr(CurveFeatures, "extract", lambda self, trace: {"peak": 1.0})
    grasp = load_pipeline(options=["features.type=curve", "classifier.type=none"]).grasp()
    assert grasp.outcome == Outcome.STEADY
    assert set(grasp.features.reasons.values()) == {
        "graspsense/curve failed: TypeError: extract returned dict: return graspsense.plugin_api.Features"
    }
