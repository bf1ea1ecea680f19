"""The page: what a reader, a printer and a screen reader find on it, and what it never loads."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from html import escape
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path

import pytest
import wayward
from kept import keep

from graspsense.cli.main import main
from graspsense.evaluation.confusion import confusion
from graspsense.experiments.executors.serial import Serial
from graspsense.experiments.experiment import read_experiment
from graspsense.experiments.page import write_page
from graspsense.experiments.results import Results
from graspsense.experiments.run import run_experiment
from graspsense.experiments.summary import summarise
from graspsense.report.html import Page
from graspsense.report.matrix import confusion_table
from graspsense.report.store_page import store_page
from graspsense.report.svg import INKS, QUIET, AxisScale
from graspsense.store.store import Store

SIZES = {"desk": 1280, "phone": 390}
BROWSER = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
VOID = {"meta", "br", "hr", "img", "input", "link"}


class Reader(HTMLParser):
    """What is on a page: its elements with their attributes, its text, and whether every element is closed."""

    def __init__(self, text):
        super().__init__()
        self.elements, self.open, self.words = [], [], []
        self.feed(text)
        assert not self.open, f"never closed: {self.open}"

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] != ["style"]:
            self.words.append(data)

    def all(self, tag):
        return [attrs for name, attrs in self.elements if name == tag]

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


NASTY = '<script>alert("x")</script>'


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page of a sweep over simulated grasps, with every part that a page can have."""
    folder = tmp_path_factory.mktemp("experiment")
    (folder / "it.toml").write_text(
        f"title = 'How hard {NASTY}'\nquestion = \"Does it matter?\"\nseeds = 2\n"
        '[sweep]\n"controller.probing_force_n" = [17.0, 20.0]\n'
        '[data]\nobjects = ["can:full_open", "can:empty_open"]\ninstances = 2\ntrials = 1\n'
        "[judge]\nfolds = 2\ngrasps = 2\n"
    )
    planned, results = read_experiment(str(folder / "it.toml")), Results(folder / "out")
    run_experiment(planned, results, Serial)
    return write_page(summarise(planned, results), results).read_text()


def test_a_page_loads_nothing_and_runs_nothing(page):
    found = Reader(page)

    assert not found.all("script") + found.all("link") + found.all("img") + found.all("iframe")
    for _, attrs in found.elements:
        assert not {"src", "srcset", "data", "action"} & attrs.keys()
        assert not [name for name in attrs if name.startswith("on")]
        assert attrs.get("href", "#").startswith("#")
    assert "url(" not in page
    assert "@import" not in page
    assert NASTY not in page
    assert "How hard " + NASTY in found.text
    policy = next(one["content"] for one in found.all("meta") if "http-equiv" in one)
    assert policy.startswith("default-src 'none'")


def test_a_page_answers_first_and_says_what_it_rests_on(page):
    found = Reader(page)
    text = found.text

    assert (
        text.index("Does it matter?") < text.index("recognise the object") < text.index("Recognition rates")
    )
    assert re.search(
        r"in \d+\.\d % \(95 %: \d+\.\d to \d+\.\d\) of 4 simulated grasps per seed, over 2 seeds", text
    )
    assert "none was measured on real objects" in text
    for part in (
        "Controls",
        "shuffled labels",
        "most frequent label",
        "before contact",
        "Confusion matrix",
        "Decision tree",
        "One grasp, from the approach to rest",
        "Force and gap over time",
        "Features",
        "Provenance",
        "probing force 17 N",
        "gap at the first contact of both fingers",
        "commit",
        "ICRA 2010",
    ):
        assert part in text, part


def test_a_page_can_be_read_aloud(page):
    found = Reader(page)
    ids = [attrs["id"] for _, attrs in found.elements if "id" in attrs]
    levels = [int(tag[1]) for tag, _ in found.elements if re.fullmatch(r"h[1-6]", tag)]

    assert found.all("html")[0]["lang"] == "en"
    assert len(found.all("main")) == len(found.all("h1")) == 1
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    assert len(ids) == len(set(ids))
    assert {one["href"][1:] for one in found.all("a")} <= set(ids)
    pictures = found.all("svg")
    assert len(pictures) == 10
    for one in pictures:
        assert one["role"] == "img"
        assert len(one["aria-label"]) > 40
    for one in found.all("th"):
        assert one["scope"] in ("row", "col")
    for _, attrs in found.elements:
        if attrs.get("class") == "wide":
            assert (attrs["tabindex"], attrs["role"]) == ("0", "region")


def luminance(colour):
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    parts = [one / 12.92 if one <= 0.04045 else ((one + 0.055) / 1.055) ** 2.4 for one in parts]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


def contrast(one, other):
    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("ink", [*INKS, QUIET])
def test_inks_stand_out_from_white(ink):
    """4.5 to 1: what WCAG 2 asks of text (success criterion 1.4.3)."""
    assert contrast(ink, "#ffffff") >= 4.5


@pytest.mark.parametrize("share", [k / 40 for k in range(1, 41)])
def test_counts_stand_out_from_their_cells(share):
    true = ["a"] * 40 + ["b"]
    found = confusion_table(
        confusion(true, ["a"] * round(40 * share) + ["b"] * (41 - round(40 * share))), "x"
    )

    for ground, ink in re.findall(r"background:(#\w{6});color:(#\w+)", found):
        full = "#ffffff" if ink == "#fff" else ink
        assert contrast(ground, full) >= 4.5


def test_every_count_of_a_confusion_matrix_is_in_its_table():
    found = confusion_table(confusion(["a", "a", "b", "c"], ["a", "b", "b", "a"]), "x")

    assert re.findall(r"<td[^>]*>(\d+|·)</td>", found) == ["1", "1", "·", "·", "1", "·", "1", "·", "·"]
    assert re.findall(r'class="n">(\d+) %', found) == ["50", "100", "0"]


@pytest.mark.parametrize(("low", "high"), [(0.0, 1.0), (-3.0, 2000.0), (1e-6, 3e-6), (57.1, 57.2)])
def test_ticks_are_round_and_within(low, high):
    ticks = AxisScale(low, high, 0.0, 100.0).ticks()

    assert 2 <= len(ticks) <= 7
    assert low - 1e-9 <= ticks[0] <= ticks[-1] <= high + 1e-9 * max(1.0, abs(high))
    assert len({f"{one:.3g}" for one in (b - a for a, b in pairwise(ticks))}) == 1


def test_the_page_of_an_empty_answer():
    assert Reader(Page(kind="k", title="t", question="", answer="none").html()).text.startswith(
        "t – graspsense"
    )


def test_the_page_of_a_store(tmp_path, capsys):
    folder = tmp_path / "trials"
    with Store.open(folder) as store:
        for k in range(8):
            keep(
                store,
                ["can:full_open", "can:empty_open"][k % 2],
                values=(0.066 + 0.001 * (k % 3), 5.0 + k % 2),
            )
    with pytest.raises(SystemExit) as ended:
        main(
            ["report", str(folder), "--out", str(tmp_path / "page"), "--folds", "2", "--grasp", "3", "--json"]
        )
    found = Reader((tmp_path / "page" / "report.html").read_text())

    assert not ended.value.code
    assert json.loads(capsys.readouterr().out)["answer"].startswith(
        "c45 recognises the object and its state in "
    )
    assert "Trial 3: can:full_open, steady" in found.text
    assert "one line per grasp" in found.text
    assert "All trials" in found.text


def test_the_page_of_a_store_that_cannot_be_judged(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        keep(store, None)
    page = store_page(str(tmp_path / "trials"))

    assert page.answer.startswith("There are 1 grasps, but no recognition rate: ")
    assert "One grasp, from the approach to rest" in Reader(page.html()).text


def test_the_page_of_an_experiment_once_more(tmp_path, capsys):
    (tmp_path / "trials.csv").write_text(wayward.CSV)
    (tmp_path / "it.toml").write_text(
        'title = "x"\n[data]\nsource = "trials.csv"\nlabel = "what"\n[judge]\nfolds = 2\ncontrols = false\n'
    )
    results = Results(tmp_path / "out")
    run_experiment(read_experiment(str(tmp_path / "it.toml")), results, Serial)
    with pytest.raises(SystemExit):
        main(["report", str(results.folder)])

    assert "recorded grasps" in capsys.readouterr().out
    assert "recorded grasps" in Reader((results.folder / "report.html").read_text()).text


MEASURE = """
<pre id="measured"></pre>
<iframe id="page" width="WIDTH" height="900" style="border:0" srcdoc="PAGE"></iframe>
<script>AXE</script>
<script>
document.getElementById("page").addEventListener("load", async (event) => {
  const inside = event.target.contentDocument, root = inside.documentElement;
  const boxes = (what) => [...inside.querySelectorAll(what)].map((one) => {
    const box = one.getBoundingClientRect();
    return {left: box.left, right: box.right, top: box.top, width: box.width, height: box.height};
  });
  const texts = [...inside.querySelectorAll("svg text")].map((one) => {
    const text = one.getBoundingClientRect(), box = one.closest("svg").getBoundingClientRect();
    return {words: one.textContent, size: text.height,
            out: Math.max(box.left - text.left, text.right - box.right, box.top - text.top, text.bottom - box.bottom)};
  });
  const found = {
    across: root.scrollWidth, room: root.clientWidth, sections: boxes("section"), pictures: boxes("svg"),
    answer: boxes(".sentence")[0], texts: texts,
    font: parseFloat(inside.defaultView.getComputedStyle(inside.body).fontSize), violations: null,
  };
  if (window.AXE_SOURCE) {
    const script = inside.createElement("script");
    script.textContent = window.AXE_SOURCE;
    inside.head.appendChild(script);
    const ran = await inside.defaultView.axe.run(inside, {resultTypes: ["violations"]});
    found.violations = ran.violations.map((one) => [one.id, one.nodes.map((node) => node.html.slice(0, 120))]);
  }
  document.getElementById("measured").textContent = JSON.stringify(found);
});
</script>
"""


def measured(page, width, folder):
    """Lay the page out in a browser at this width, without its policy, which forbids to measure it."""
    bare = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", page)
    axe = os.environ.get("GRASPSENSE_AXE", "")
    source = f"window.AXE_SOURCE = {json.dumps(Path(axe).read_text())};" if axe else ""
    wrapper = folder / f"measure-{width}.html"
    text = MEASURE.replace("WIDTH", str(width)).replace("PAGE", escape(bare))
    wrapper.write_text(
        "<!doctype html>" + text.replace("AXE</script>", source.replace("</", "<\\/") + "</script>")
    )
    done = subprocess.run(
        [
            BROWSER,
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            f"--user-data-dir={folder / 'profile'}",
            "--window-size=1400,1000",
            "--virtual-time-budget=20000",
            "--dump-dom",
            wrapper.as_uri(),
        ],
        capture_output=True,
        text=True,
        timeout=300,
    )
    (content,) = re.findall(r'<pre id="measured">(.*?)</pre>', done.stdout, flags=re.DOTALL)
    assert content, done.stderr[-2000:]
    return json.loads(content.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&"))


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium here to lay a page out")
@pytest.mark.parametrize("size", SIZES)
def test_a_page_in_a_browser(page, size, tmp_path):
    width = SIZES[size]
    found = measured(page, width, tmp_path)

    assert found["across"] <= found["room"] <= width
    for box in found["sections"] + found["pictures"]:
        assert box["left"] >= -0.5
        assert box["right"] <= width + 0.5
    tops = [box["top"] for box in found["sections"]]
    assert tops == sorted(tops)
    assert found["answer"]["top"] < 400
    assert found["font"] >= 16
    shown = [one for one in found["texts"] if one["size"]]
    assert min(one["size"] for one in shown) >= 9.0
    assert [one["words"] for one in shown if one["out"] > 2.0] == []
    rows = {round(box["top"]) for box in found["pictures"]}
    assert (len(rows) == len(found["pictures"])) is (size == "phone")


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="no Chromium here to lay a page out")
@pytest.mark.skipif(
    "GRASPSENSE_AXE" not in os.environ,
    reason="GRASPSENSE_AXE does not name axe.min.js (npm install axe-core)",
)
@pytest.mark.parametrize("size", SIZES)
def test_a_page_passes_an_accessibility_check(page, size, tmp_path):
    assert measured(page, SIZES[size], tmp_path)["violations"] == []
