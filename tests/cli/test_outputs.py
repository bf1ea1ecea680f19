"""Files that commands write: none replaces what was not meant, and none that cannot be read is left out in silence."""

import json
import os
import shutil

import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense, printed, refused

from graspsense.experiments.results import Results


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "mine.csv"
    rows = [f"{'ab'[k % 2]},{k % 2 + 0.1 * (7 * k % 5)},{3 * k % 7}.5\n" for k in range(24)]
    path.write_text("kind,width,force\n" + "".join(rows))
    return path


EVALUATE = ("--label", "kind", "--folds", "2", "--classifier", "knn")
TRAIN = ("--label", "kind", "--classifier", "knn")


def test_no_file_is_replaced_unless_told(table, tmp_path):
    kept, model = tmp_path / "kept.csv", tmp_path / "m.json"
    kept.write_text("precious")
    evaluate = ("evaluate", table, *EVALUATE, "--keep", kept)
    train = ("train", table, *TRAIN, "--out", model)
    for command in (evaluate, (*train, "--keep", kept)):
        told = refused(*command)
        assert f"{kept} " in told
        assert "--overwrite" in told
        assert kept.read_text() == "precious"
    printed(*evaluate, "--overwrite")
    assert kept.read_text().startswith("label,")
    printed(*train)
    knn = model.read_bytes()
    tree = ("--classifier", "tree")
    refused(*train, *tree)
    assert model.read_bytes() == knn
    printed(*train, *tree, "--overwrite")
    assert model.read_bytes() != knn


@pytest.mark.parametrize("command", ["evaluate", "train"])
def test_no_command_replaces_its_own_source(table, tmp_path, command, monkeypatch):
    original = table.read_text()
    monkeypatch.chdir(tmp_path)
    more = EVALUATE if command == "evaluate" else (*TRAIN, "--out", tmp_path / "m.json")
    (tmp_path / "link.csv").symlink_to(table)
    for name in (table, "mine.csv", tmp_path / "sub" / ".." / "mine.csv", "link.csv"):
        (tmp_path / "sub").mkdir(exist_ok=True)
        assert "what is read" in refused(command, table, *more, "--keep", name, "--overwrite")
    assert table.read_text() == original
    assert not (tmp_path / "m.json").exists()


def test_two_outputs_are_two_files(table, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "the same file" in refused(
        "train", table, *TRAIN, "--out", "m.json", "--keep", tmp_path / "m.json"
    )
    assert not (tmp_path / "m.json").exists()
    assert graspsense("train", table, *TRAIN, "--out", "m.json", "--keep", "k.csv").returncode == 0
    assert json.loads((tmp_path / "m.json").read_text())["format"]


@every_case(("option", "name"), [("--keep", "pipe.json"), ("--out", "pipe.json"), ("--keep", "/dev/full")])
def test_a_pipe_or_a_device_is_not_replaced(table, tmp_path, option, name):
    os.mkfifo(tmp_path / "pipe.json")
    outputs = {"--out": tmp_path / "m.json", "--keep": tmp_path / "k.csv", option: tmp_path / name}
    more = [word for pair in outputs.items() for word in pair]
    assert "a device" in refused("train", table, *TRAIN, *more, "--overwrite")
    assert (tmp_path / "pipe.json").is_fifo()


@every_case(
    ("name", "says"),
    [
        *((name, "end in .png") for name in (".", "..", "/", "sub", "grasp.svg")),
        ("pipe.png", "a device"),
        ("no_such_folder/grasp.png", "folder no_such_folder"),
    ],
)
def test_a_picture_that_is_no_file_is_refused_before_the_grasp(tmp_path, monkeypatch, name, says):
    pytest.importorskip("matplotlib", reason="drawing needs the extra `plot`")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    os.mkfifo(tmp_path / "pipe.png")
    err = refused("run", "--plot", name)
    assert says in err
    assert "approach" not in err


def test_a_matrix_is_drawn_into_pictures_only(table):
    original = table.read_text()
    assert ".png" in refused("evaluate", table, *EVALUATE, "--png", table)
    assert table.read_text() == original


@pytest.fixture
def experiment(table, tmp_path):
    """Return the folder of an experiment, one of whose results is damaged and one of which is on a disk that fails."""
    (tmp_path / "mine.toml").write_text(
        'title = "mine"\nseeds = [0, 1, 2, 3]\n[judge]\nfolds = 2\n[data]\n'
        f'source = "{table}"\nlabel = "kind"\n'
    )
    printed("experiment", tmp_path / "mine.toml", "--executor", "serial", "--out", tmp_path / "out")
    shutil.copytree(tmp_path / "out", tmp_path / "whole")
    result, other, *_ = sorted((tmp_path / "out" / "results").glob("*.json"))
    result.write_text("{")
    other.unlink()
    other.mkdir()
    return tmp_path / "out"


@pytest.mark.slow
def test_a_result_that_cannot_be_read_is_told(experiment, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result, other, *_ = sorted((experiment / "results").glob("*.json"))
    done = graspsense("report", experiment)
    assert done.returncode == 0
    said = done.stdout + done.stderr
    assert "2 results" in said
    assert result.name in said
    assert other.name in said
    assert "2 results" in (experiment / "report.html").read_text()
    said = printed("experiment", "compare", experiment, tmp_path / "whole")
    assert "2 results" in " ".join(said.split())
    assert "2 results" in (tmp_path / "comparison.html").read_text()


def test_a_missing_result_is_no_unreadable_one(experiment):
    results = Results(experiment)
    tasks = {task.key: task for task in results.experiment().tasks()}
    assert results.read(evolve(next(iter(tasks.values())), seed=99)) == (None, "")
    assert "damaged" in results.read(tasks[sorted(experiment.glob("results/*.json"))[0].stem])[1]
