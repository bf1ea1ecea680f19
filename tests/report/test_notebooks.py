"""What notebooks and interpreters show of values, and that two modules are enough for what the documentation shows."""

import re
import sys

import pytest
from attrs import evolve
from cases import every_case
from repository import ROOT
from test_report import Reader, evaluated

from graspsense import Features, Prediction, load_pipeline, load_trials
from graspsense.core.components.moved_names import SPECIAL
from graspsense.core.values.errors import PluginUnavailable
from graspsense.evaluation.intervals import RecognitionRate
from graspsense.evaluation.results import Measurement
from graspsense.testing_api import a_trial, squeeze, with_channels

PAGES = [*ROOT.glob("docs/**/*.md"), ROOT / "README.md", *ROOT.glob("examples/*/README.md")]
SOURCES = [*ROOT.glob("examples/**/*.py"), *ROOT.glob("src/graspsense/scaffold/templates/**/*.py.txt")]


def shown(value):
    """Return the text of what a notebook shows; its tags are balanced, and it has no colours for text of its own."""
    html = value._repr_html_()
    reader = Reader(html)
    assert not reader.all("script") + reader.all("link") + reader.all("img")
    assert not re.search(r"background|[^-]color:", html)
    return " ".join(reader.words)


EVALUATION = evolve(
    evaluated(75, None),
    source="simulated <grasps>",
    classifier="c45",
    protocol="stratified_4_fold",
    headline=RecognitionRate(15, 20),
    controls={"width_only": Measurement("the width alone", reason="there is no width")},
    warnings=("the order alone reveals the label",),
)


def test_a_trial_shows_outcome_curve_features_and_prediction():
    prediction = Prediction(
        label="cup:<full>",
        probabilities={"cup:<full>": 0.98, "cup:empty": 0.02, "can": 0.001},
        because=("force 7 N > 5 N",),
        warnings=("few trials",),
        calibrated=True,
    )
    trial = evolve(a_trial(), prediction=prediction)
    elsewhere = evolve(prediction, calibrated=False, no_certainty="another force")

    text = shown(trial)

    for part in (trial.outcome.words, "force, N", "hold", "predicted: cup:<full>", "98 %", "force 7 N > 5 N"):
        assert part in text
    assert "warning: few trials" in text
    assert " can " not in text
    assert "&lt;full&gt;" in trial._repr_html_()
    assert repr(trial).startswith("<Trial: steady, ")
    assert repr(trial).endswith("predicted cup:<full>>")
    assert repr(prediction) == "<Prediction: cup:<full>, about 98 %>"
    vague = shown(evolve(trial, prediction=evolve(prediction, certainty_interval=(0.79, 0.99))))
    assert vague.count("98 % (79 to 99 %)") == 2  # beside the label, and among the classes
    unmeasured = shown(evolve(trial, prediction=elsewhere))
    assert "98 %" not in unmeasured
    assert "no certainty: another force" in unmeasured


def test_a_trace_shows_a_curve_also_without_forces_and_without_ticks():
    whole = squeeze()
    assert re.fullmatch(r"<Trace: \d+ ticks, [\d.]+ s, forces to [\d.]+ N, gap .* mm to .* mm>", repr(whole))
    blind = with_channels(whole, {"gap"})
    for trace in (whole, blind, with_channels(whole, set()), whole.until(-1.0)):
        svgs = re.findall(r"<svg.*?</svg>", trace._repr_html_(), re.DOTALL)
        assert bool(svgs) == bool(len(trace))
        assert "nan" not in "".join(svgs)
        assert trace.words in shown(trace)
    assert "forces" not in repr(blind)
    assert repr(whole.until(-1.0)) == "<Trace: no ticks>"


def test_features_show_units_for_people_and_reasons():
    features = Features(
        names=("p_first", "ratio", "hysteresis"),
        values=(0.0578, 0.5, float("nan")),
        units=("m", "1", "1"),
        reasons={"hysteresis": "no <release>"},
    )

    assert repr(features) == "<Features: p_first 57.8 mm, ratio 0.5, hysteresis missing>"
    assert "no <release>" in shown(features)
    assert "is missing" in shown(features)


def test_trials_are_counted_in_a_line():
    trials = load_trials(str(ROOT / "samples" / "features.csv"), label="object")
    assert repr(trials).startswith("<Labelled: 40 trials of 4 labels with 6 features, from ")


def test_an_evaluation_shows_its_rate_warnings_and_controls():
    assert repr(EVALUATION) == (
        "<Evaluation: c45 on simulated <grasps>: 75.0 % (15 of 20; 95 %: 53.1 to 88.8 %), stratified_4_fold>"
    )
    text = shown(EVALUATION)
    for part in ("warning: the order alone", "width_only", "not measured", "there is no width", "75.0 %"):
        assert part in text


def test_a_plot_is_that_of_run_and_can_be_added_to(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")

    forces, gap = squeeze().plot()

    assert [line.get_label() for line in forces.lines] == ["left pad", "right pad"]
    assert forces.get_ylabel() == "force, N"
    assert gap.get_ylabel() == "gap, mm"
    assert gap.get_xlabel() == "time since contact, s"
    pyplot.close(forces.figure)


@pytest.mark.slow
def test_a_plot_and_a_notebook_show_arrays_at_their_moments_and_fast_channels(monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "Agg")
    pyplot = pytest.importorskip("matplotlib.pyplot")
    grasp = load_pipeline(options=["gripper.type=pr2", "gripper.transport=emulated"]).grasp(
        object="odwalla:full_open", seed=1
    )

    forces, _ = grasp.trace.plot()

    _, _, acceleration, left, right = forces.figure.axes[:5]
    assert acceleration.get_ylabel() == "acceleration"
    assert len(acceleration.lines) == 3
    for axes, name in ((left, "left fingertip"), (right, "right fingertip")):
        assert axes.get_title(loc="left") == f"{name}: change since before contact, by cell"
        assert [label.get_text() for label in axes.get_yticklabels()] == ["contact", "peak", "rest"]
        assert axes.images[0].get_array().shape == (3, 22)
    pyplot.close(forces.figure)
    for html in (grasp.trace._repr_html_(), grasp._repr_html_()):
        assert "Acceleration, in " in html
        assert "Change of each" in html
        assert {f">rest, {side}</text>" in html for side in ("left", "right")} == {True}


def test_a_plot_without_matplotlib_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)

    with pytest.raises(PluginUnavailable, match=r"matplotlib.*\"graspsense\[plot\]\""):
        squeeze().plot()


def imports_of_graspsense(text):
    return re.findall(r"^\s*(?:from (graspsense[\w.]*) import|import (graspsense[\w.]*))", text, re.MULTILINE)


@every_case("path", [*PAGES, *SOURCES])
def test_the_public_modules_are_enough_for_what_the_documentation_shows(path):
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        text = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
    used = {module or package for module, package in imports_of_graspsense(text)}

    assert used - {"graspsense", "graspsense.plugin_api", *(f"graspsense.{name}" for name in SPECIAL)} <= {
        name for name in used if name.split(".")[0] != "graspsense"
    }


@pytest.mark.slow
def test_a_notebook_of_what_the_page_shows_is_executed(tmp_path, monkeypatch):
    """A kernel executes the page on notebooks; each value is shown as HTML, and the plot as a picture."""
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.delenv("MPLBACKEND", raising=False)
    shown_alone = ["trial.trace", "trial.features", "trial.prediction"]
    pages = re.findall(
        r"```python\n(.*?)```", (ROOT / "docs/notebooks.md").read_text(encoding="utf-8"), re.DOTALL
    )
    cells = [*pages, *shown_alone, "repr(trial)"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])

    nbclient.NotebookClient(
        notebook, timeout=120, kernel_name="python3", resources={"metadata": {"path": tmp_path}}
    ).execute()

    data = [
        {kind: text for output in cell.outputs if "data" in output for kind, text in output.data.items()}
        for cell in notebook.cells
    ]
    by_cell = dict(zip(cells, data, strict=True))
    (trial,) = (by_cell[cell] for cell in pages if cell.endswith("trial\n"))
    (plot,) = (by_cell[cell] for cell in pages if ".plot()" in cell)
    (evaluation,) = (by_cell[cell] for cell in pages if cell.endswith("evaluation\n"))
    assert "<svg" in trial["text/html"]
    assert "predicted" in trial["text/html"]
    assert len(plot["image/png"]) > 10_000
    assert (tmp_path / "grasp.png").stat().st_size > 10_000
    assert "protocol or control" in evaluation["text/html"]
    assert evaluation["text/plain"].startswith("<Evaluation: ")
    for cell, word in zip(shown_alone, ("<svg", "p_first", "odwalla:full_open"), strict=True):
        assert word in by_cell[cell]["text/html"]
    assert "<Trial: steady, " in by_cell["repr(trial)"]["text/plain"]
