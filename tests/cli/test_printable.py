"""No text of data acts on a terminal: labels, notes and names of files are printed without what would."""

import ast
import json
import os
import re
import shutil
from pathlib import Path

import pytest
from attrs import evolve
from commands import graspsense, printed, python
from hypothesis import given
from hypothesis import strategies as st
from kept import BENCH, keep

from graspsense import Prediction, cli
from graspsense.cli.terminal import echo, echo_as_it_is, echo_entry, echo_table, talk, warn
from graspsense.core.values.printable import in_one_line, printable
from graspsense.store.changes import relabel, set_aside
from graspsense.store.store import Store
from graspsense.testing_api import a_trial

HOSTILE = "can\x1b]0;owned\x07\x1b[2J\x9b31m\u202egnp.\u2066\x7f\u2028\r:full"
"""Sets the title, clears the screen, colours by a C1 code, and turns the direction of writing."""
FORGED = "can\n  9  2026-11-26  block  steady  \x1b[32mforged"


def acts(text):
    """Return the characters that act on a terminal, apart from line feeds."""
    kinds = "[\x00-\x09\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
    return re.findall(kinds, text)


@pytest.mark.slow
@given(st.text())
def test_nothing_that_acts_is_printed_and_the_rest_stays(text):
    assert acts(printable(text)) == []
    assert "\n" not in in_one_line(text)
    if not acts(text):
        kept = [c for c in text if c not in "\u200b\ufeff" and not "\u2060" <= c <= "\u206f"]
        assert [c for c in printable(text) if c in set(kept)] != [] or not kept
    assert printable(printable(text)) == printable(text)


@given(st.text())
def test_json_stays_the_same_json(text):
    written = json.dumps({text: [text]}, ensure_ascii=False)
    assert json.loads(printable(written)) == {text: [text]}
    assert acts(printable(written)) == []


@pytest.mark.parametrize("stream", ["terminal", "pipe"])
def test_whatever_prints_a_text_prints_it_harmlessly(capsys, monkeypatch, stream):
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "60")
    if stream == "terminal":
        from graspsense.cli import terminal

        monkeypatch.setattr(terminal, "terminal_width", lambda stream: 60)
    for text in (HOSTILE, FORGED):
        echo(text)
        echo_entry(text, text)
        talk(text)
        warn(text)
        echo_as_it_is(text)
        echo_table(("LABEL", text), [(text, "1"), (text * 9, "2.0")])
    out, err = capsys.readouterr()
    assert acts(out + err) == []
    assert "\\u001b" in out


@pytest.mark.slow
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_what_the_encoding_of_the_output_lacks_is_escaped(tmp_path, encoding):
    path = tmp_path / "größe カップ 🥤.csv"
    path.write_text("t,gap\n0,1\n1,2\n")
    command = ["import", path, "--check"]

    assert ".csv" in printed(*command, encoding=encoding)
    (told,) = json.loads(printed(*command, "--json", encoding=encoding))
    assert told["path"] == str(path)


def test_a_process_of_its_own_escapes_what_the_encoding_lacks(tmp_path):
    environ = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = python("-m", "graspsense", "verify", tmp_path / "größe", env=environ, encoding="ascii")
    assert "gr\\xf6\\xdfe" in done.stdout + done.stderr


def test_a_text_of_several_lines_looks_like_no_other_text_and_a_row_of_a_table_is_one_line(capsys):
    echo(f"  note {FORGED}")
    echo_entry("label", FORGED)
    echo("first\n  try: this\nfirst again")
    lines = capsys.readouterr().out.splitlines()
    assert lines[1].startswith("    9  2026")
    assert lines[3].startswith(" " * 12)
    assert lines[4:] == ["first", "  try: this", "  first again"]
    echo_table(("LABEL", "N"), [(FORGED, "1"), ("block", "2")])
    assert len(capsys.readouterr().out.splitlines()) == 3


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a store whose labels, reasons and gripper an attacker has chosen, as in a store from elsewhere."""
    folder = tmp_path_factory.mktemp("made") / "t"
    attacker = evolve(BENCH, name=HOSTILE)
    with Store.open(folder) as store:
        for label in (HOSTILE, FORGED):
            for value in (0.06, 0.07, 0.065):
                grasp = round(1e6 * value)
                keep(store, label, f"{label}#1", values=(value, 5.5), grasp=grasp, device=attacker)
        set_aside(store, [1], HOSTILE)
        relabel(store, [2], {"label": FORGED + "2"}, FORGED)
    return folder


@pytest.fixture
def store(made, tmp_path):
    """Return a copy of this store."""
    return shutil.copytree(made, tmp_path / "t")


COMMANDS = [
    ("trials", "list", "{}"),
    ("trials", "history", "{}"),
    ("trials", "aside", "{}#3", "--why", HOSTILE),
    ("replay", "{}#4"),
    ("verify", "{}"),
    ("recover", "{}"),
    ("export", "{}", "--to", "{}.csv"),
    ("trials", "list", f"{{}}{HOSTILE}"),
    ("run", "--object", HOSTILE),
    ("run", "-o", HOSTILE),
    ("config", "show", "-o", f"gripper.object={HOSTILE}"),
    ("import", f"{{}}{HOSTILE}.csv", "--label", HOSTILE, "--save", "{}"),
    (HOSTILE,),
    ("plugins", "show", HOSTILE),
]


LEARNING = [
    ("evaluate", "store:{}", "--folds", "2"),
    ("train", "store:{}", "--classifier", "knn", "--out", "{}.json"),
    ("features", "store:{}", "-o", "controller.contact_force_n=0.1"),
    ("report", "{}", "--folds", "2"),
]


@pytest.mark.parametrize(
    "command", [*COMMANDS, *(pytest.param(command, marks=pytest.mark.slow) for command in LEARNING)]
)
def test_no_command_prints_what_acts(store, command):
    code, out, err = graspsense(*[word.format(store) for word in command])
    assert acts(out + err) == []
    assert code in (0, 1, 2), err
    assert not any(line.startswith("  9  2026") for line in (out + err).splitlines())


@pytest.mark.parametrize(
    "command", [("trials", "list", "{}"), ("trials", "history", "{}"), ("predict", "{}.json", "store:{}")]
)
def test_json_has_the_text_as_it_is(store, command):
    if command[0] == "predict":
        printed("train", f"store:{store}", "--classifier", "knn", "--out", f"{store}.json")
    out = printed(*[word.format(store) for word in command], "--json")
    assert acts(out) == []
    assert repr(HOSTILE) in repr(json.loads(out))


def test_all_that_is_printed_passes_through_the_terminal_module():
    owners = {
        "terminal.py",
        "completion.py",
    }  # the script for the shell is a program, with its own tabulators
    for path in Path(cli.__file__).parent.glob("*.py"):
        if path.name in owners:
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            name = ast.unparse(node.func) if isinstance(node, ast.Call) else ""
            assert name not in ("print", "click.echo", "click.secho"), f"{path.name}:{node.lineno}"


def shown_as(label):
    """Return a trial whose prediction has this label."""
    return evolve(a_trial(), prediction=Prediction(label=label, probabilities={label: 0.9}, because=("x",)))


def test_what_an_interpreter_shows_of_a_trial_is_one_harmless_line():
    trial = shown_as(HOSTILE + "\n")
    trial = evolve(trial, run=evolve(trial.run, labels={"label": HOSTILE + "\n"}))
    features = evolve(
        trial.features,
        names=(FORGED, *trial.features.names[1:]),
        reasons={FORGED: "x", **trial.features.reasons},
    )
    for shown in map(repr, (trial, trial.prediction, features)):
        assert acts(shown) == []
        assert "\n" not in shown


MATHEMATICS = ["$x^2$", "$\\frac$", "a$b$c", "$", "\\$x$"]
"""Labels that matplotlib would typeset as formulas, or refuse."""


@pytest.mark.slow
def test_pictures_show_a_dollar_as_it_is(tmp_path):
    pytest.importorskip("matplotlib", reason="drawing needs the extra `plot`")
    from matplotlib.figure import Figure

    from graspsense.evaluation.results import Confusion
    from graspsense.report.confusion import confusion_png
    from graspsense.report.grasp_picture import grasp_png
    from graspsense.report.write import show_literally

    labels = tuple(MATHEMATICS)
    counts = tuple(tuple(3 * (i == k) for k in range(len(labels))) for i in range(len(labels)))
    confusion_png(Confusion(labels, counts), "$\\frac$", tmp_path / "matrix.png")
    grasp_png(shown_as(" ".join(MATHEMATICS)), tmp_path / "grasp.png")
    for name in ("matrix.png", "grasp.png"):
        assert (tmp_path / name).stat().st_size > 1000

    figure = Figure()
    axes = figure.add_subplot()
    axes.set_yscale("log")
    axes.plot([1, 2], [1, 100], label="$\\frac$")
    axes.legend()
    show_literally(figure)
    figure.canvas.draw()
    (text,) = axes.get_legend().get_texts()
    assert (text.get_text(), text.get_parse_math()) == ("$\\frac$", False)
    assert all(label.get_parse_math() for label in axes.yaxis.get_ticklabels())
