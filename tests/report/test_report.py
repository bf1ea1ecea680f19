"""The page: what a reader, a printer and a screen reader find on it, and what it never loads."""

import base64
import hashlib
import re
from html.parser import HTMLParser
from importlib.resources import files
from itertools import pairwise

import kept
import pytest
from attrs import evolve
from cases import every_case
from commands import answered, printed, refused
from kept import keep

from graspsense.core.components.registry import installed
from graspsense.evaluation.intervals import Difference, RecognitionRate
from graspsense.evaluation.results import Evaluation, Measurement, confusion
from graspsense.experiments.executors.executor import Serial
from graspsense.experiments.experiment_file import read_experiment
from graspsense.experiments.page import write_page
from graspsense.experiments.results import Results
from graspsense.experiments.run import run_experiment
from graspsense.experiments.summary import summarise
from graspsense.recording.recording_info import RecordingInfo
from graspsense.report.confusion import confusion_table
from graspsense.report.found_table import FoundTable
from graspsense.report.html import Page, table
from graspsense.report.rates import RateRow, rate_scale, rates_over, rates_picture
from graspsense.report.store_page import store_page
from graspsense.report.svg import GRID, GROUND, INKS, QUIET, TEXT, AxisScale, Picture
from graspsense.report.traces import _label_lines
from graspsense.report.verdict import headline, verdict
from graspsense.store.store import Store

VOID = {"meta", "br", "hr", "img", "input", "link", "wbr"}


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
        if self.open[-1:] not in (["style"], ["script"]):
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


@pytest.mark.slow
def test_a_page_loads_nothing_and_runs_only_its_own_script(page):
    reader = Reader(page)
    scripts = re.findall(r"<script>(.*?)</script>", page, flags=re.DOTALL)

    assert scripts == [files("graspsense.report").joinpath("page.js").read_text()]
    assert reader.all("script") == [{}]
    assert not reader.all("link") + reader.all("img") + reader.all("iframe")
    for _, attrs in reader.elements:
        assert not {"src", "srcset", "data", "action"} & attrs.keys()
        assert not [name for name in attrs if name.startswith("on")]
        assert attrs.get("href", "#").startswith("#")
    for word in ("http:", "https:", "@import", "fetch(", "XMLHttpRequest", "import(", "eval("):
        assert word not in scripts[0].replace("http://www.w3.org/2000/svg", ""), word
    assert "url(" not in page.replace(scripts[0], "")
    assert "@import" not in page
    assert NASTY not in page
    assert "How hard " + NASTY in reader.text
    policy = next(element["content"] for element in reader.all("meta") if "http-equiv" in element)
    digest = base64.b64encode(hashlib.sha256(scripts[0].encode()).digest()).decode()
    assert policy.startswith("default-src 'none'")
    assert f"script-src 'sha256-{digest}'" in policy


@pytest.mark.slow
def test_a_page_answers_first_and_says_what_it_rests_on(page):
    reader = Reader(page)
    text = reader.text

    assert (
        text.index("Does it matter?")
        < text.index("he object and its state recognised in")
        < text.index("recognise the object")
        < text.index("Recognition rates")
    )
    assert re.search(
        r"in \d+\.\d % \(95 %: \d+\.\d to \d+\.\d %\) of 4 simulated grasps per seed, over 2 seeds", text
    )
    assert "real objects" in text
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


@pytest.mark.slow
def test_a_page_can_be_read_aloud(page):
    reader = Reader(page)
    ids = [attrs["id"] for _, attrs in reader.elements if "id" in attrs]
    levels = [int(tag[1]) for tag, _ in reader.elements if re.fullmatch(r"h[1-6]", tag)]

    assert reader.all("html")[0]["lang"] == "en"
    assert len(reader.all("main")) == len(reader.all("h1")) == 1
    assert levels[0] == 1
    assert all(after <= level + 1 for level, after in pairwise(levels))
    assert len(ids) == len(set(ids))
    assert {element["href"][1:] for element in reader.all("a")} <= set(ids)
    pictures = reader.all("svg")
    assert len(pictures) == 10
    for picture in pictures:
        assert picture["role"] == "img"
        assert len(picture["aria-label"]) > 40
    for element in reader.all("th"):
        assert element["scope"] in ("row", "col")
    for _, attrs in reader.elements:
        if attrs.get("class") == "wide":
            assert (attrs["tabindex"], attrs["role"]) == ("0", "region")


def luminance(colour):
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    parts = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return 0.2126 * parts[0] + 0.7152 * parts[1] + 0.0722 * parts[2]


def contrast(colour, other):
    high, low = sorted((luminance(colour), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def colours(scheme):
    """Return the colours of the style sheet by name, of the light or the dark page."""
    style = files("graspsense.report").joinpath("page.css").read_text()
    blocks = re.findall(r":root\{(.*?)\}", style, flags=re.DOTALL)
    colours_of = {}
    for block in blocks[: 1 if scheme == "light" else 2]:
        colours_of |= dict(re.findall(r"--([\w-]+):(#\w+)", block))
    return {
        k: v if len(v) == 7 else "#" + "".join(2 * digit for digit in v[1:]) for k, v in colours_of.items()
    }


TEXTS = [
    *((name, "ground") for name in ("text", "quiet", "link", "accent", *(f"ink{k}" for k in range(8)))),
    *(("few" if k < 5 else "many", f"q{k}") for k in range(1, 9)),
    *(("text", name) for name in ("box", "code", "warn-box", "approach", "squeeze", "hold", "phase")),
    ("link", "box"),
    ("good", "good-box"),
    ("bad", "bad-box"),
]


@every_case("scheme", ["light", "dark"])
@every_case(("ink", "ground"), TEXTS)
def test_texts_stand_out_from_their_ground(scheme, ink, ground):
    """4.5 to 1: what WCAG 2 asks of text (success criterion 1.4.3)."""
    assert contrast(colours(scheme)[ink], colours(scheme)[ground]) >= 4.5


def test_pictures_and_the_style_sheet_have_the_same_colours():
    light = colours("light")

    for colour in (*INKS, QUIET, TEXT, GROUND, GRID):
        name, fallback = re.fullmatch(r"var\(--(\w+),(#\w+)\)", colour).groups()
        assert light[name] in (fallback, "#" + "".join(2 * digit for digit in fallback[1:])), name


@every_case(
    ("words", "kind"),
    [("agrees", 'good">✓'), ("differs", 'bad">✗'), ("yes", 'good">✓'), ("not known", None)],
)
def test_verdicts_have_a_mark_a_colour_and_words(words, kind):
    text = table("x", ("claim", "result"), [("c", words)], verdicts=(1,))

    assert (f'<span class="{kind} {words}</span>' if kind else f"<td>{words}</td>") in text


@every_case(
    ("rates", "axis"),
    [
        ([(0.872, (0.767, 0.976)), (0.875, (0.823, 0.927))], (75.0, 100.0)),
        ([(0.5, (0.41, 0.6))], (40.0, 65.0)),
        ([(0.25, (0.22, 0.3)), (0.95, (0.9, 1.0))], (20.0, 100.0)),
        ([(0.05, (0.0, 0.2)), (0.95, (0.9, 1.0))], (0.0, 100.0)),
    ],
)
def test_a_rate_axis_shows_the_difference_and_says_where_it_is_cut(rates, axis):
    rows = [RateRow(name=f"r{k}", rate=rate, interval=interval) for k, (rate, interval) in enumerate(rates)]
    scale = rate_scale(rows, 0.0, 100.0)
    told = Reader(rates_picture(rows, "c") + rates_over({"a": list(enumerate(rows))}, "x", "c")).text

    assert (scale.low, scale.high) == axis
    assert told.count(f"axis from {axis[0]:g} to {axis[1]:g}") == (0 if axis == (0.0, 100.0) else 2)
    for row in rows:
        assert row.words in told


def test_every_count_of_a_confusion_matrix_is_in_its_table():
    text = confusion_table(confusion(["a", "a", "b", "c"], ["a", "b", "b", "a"]), "x")

    assert re.findall(r"<td[^>]*>(\d+|·)</td>", text) == ["1", "1", "·", "·", "1", "·", "1", "·", "·"]
    assert re.findall(r'class="n">(\d+) %', text) == ["50", "100", "0"]


@every_case(("low", "high"), [(0.0, 1.0), (-3.0, 2000.0), (1e-6, 3e-6), (57.1, 57.2)])
def test_ticks_are_round_and_within(low, high):
    ticks = AxisScale(low, high, 0.0, 100.0).ticks()

    assert 2 <= len(ticks) <= 7
    assert low - 1e-9 <= ticks[0] <= ticks[-1] <= high + 1e-9 * max(1.0, abs(high))
    assert len({f"{width:.3g}" for width in (b - a for a, b in pairwise(ticks))}) == 1


def test_the_caption_of_a_table_below_its_own_heading_is_for_screen_readers_alone():
    body = FoundTable(id="rates", title="Rates", header=("case",), rows=(("a",),)).section().body
    assert 'aria-label="Rates, scrollable"' in body
    assert re.sub("<[^>]*>", " ", body).split() == ["case", "a"]


def test_words_in_backticks_are_code_and_names_cannot_make_elements():
    page = Page(kind="k", title="t", question="", answer="use `run --object <b>`").html()
    assert "use <code>run --object &lt;b&gt;</code>" in page
    assert Reader(page).text.startswith("t – graspsense")


@pytest.fixture
def folder(tmp_path):
    """The folder of a store with eight trials of two labels."""
    with Store.open(tmp_path / "trials") as store:
        for k in range(8):
            label = ("can:full_open", "can:empty_open")[k % 2]
            keep(store, label, values=(0.066 + 0.001 * (k % 3), 5.0 + 3 * (k % 2) + 0.01 * k), grasp=k)
    return tmp_path / "trials"


def test_the_page_of_a_store(folder, tmp_path):
    told = answered("report", folder, "--out", tmp_path / "page", "--folds", "2", "--grasp", "3")
    reader = Reader((tmp_path / "page" / "report.html").read_text())

    assert told["answer"].startswith("c45 recognises ")
    assert "Trial 3: can:full_open, steady" in reader.text
    assert "line per grasp" in reader.text
    assert "All trials" in reader.text
    # The newest trial of each label is drawn; the other small curves can be chosen.
    boxes = [element for element in reader.all("input") if element.get("type") == "checkbox"]
    assert [box["value"] for box in boxes] == [str(k) for k in range(8, 0, -1)]
    assert [box["value"] for box in boxes if "checked" in box] == ["8", "7"]
    lines = [element for element in reader.all("polyline") if "data-trial" in element]
    assert {line["data-trial"] for line in lines if "class" not in line} == {"8", "7"}


def test_evaluate_writes_a_page_and_replaces_none_of_a_store(folder, tmp_path):
    command = ("evaluate", folder, "--folds", "2", "--report")
    assert "report.html" in printed(*command, tmp_path / "page")
    reader = Reader((tmp_path / "page" / "report.html").read_text())

    refused(*command, folder)
    assert not (folder / "report.html").exists()
    for part in ("Controls", "Confusion matrix", "Features", "graspsense evaluate"):
        assert part in reader.text
    assert " of 8" in reader.text


def test_long_names_are_wrapped_within_a_picture():
    name = "closing speed 10 mm/s, probing force 20 N, rest window 0.2 s, a classifier"
    rows = [RateRow(name=name, rate=0.8, interval=None) for _ in range(2)]
    for picture in (rates_picture(rows, "c"), rates_over({name: list(enumerate(rows))}, name, "c")):
        texts = re.findall(r"<text[^>]*>([^<]*)</text>", picture)
        assert max(map(len, texts)) < 60
        assert name in " ".join(texts)


@pytest.mark.slow
def test_features_have_their_unit_and_meaning_from_their_plugin(page):
    text = Reader(page).text
    (chitta,) = [feature_set for feature_set in installed().feature_sets() if feature_set.name == "chitta"]

    assert "of this grasp" in text
    for feature in chitta.features:
        shown = re.escape("mm" if feature.unit == "m" else feature.unit.replace("m/", "mm/"))
        assert re.search(rf"{feature.name} (missing|-?[\d.]+ {shown}) {re.escape(feature.meaning)}", text), (
            feature
        )


def evaluated(right, difference, width=None):
    """Return an evaluation of 100 trials, compared with guessing, and with the width alone where that is given."""
    controls = {"majority_class": Measurement(what="w", rate=RecognitionRate(50, 100), difference=difference)}
    return Evaluation(
        classifier="x/c45 1",
        target="both",
        source="s",
        features=(),
        folds=2,
        seed=0,
        protocol="p",
        headline=RecognitionRate(right, 100),
        confusion=confusion(["a"], ["a"]),
        by_class={},
        protocols={},
        controls={**controls, **({} if width is None else {"width_only": width})},
        learning_curve=(),
        unknown=RecognitionRate(1, 100),
        warnings=(),
        notes=(),
    )


@every_case(
    ("rate", "words"),
    [(0.5, "is not shown to be more than the 50 by guessing"), (0.95, ", against 50 by guessing")],
)
def test_the_headline_of_an_evaluation_compares_with_guessing(rate, words):
    right = round(rate * 100)
    told = headline(evaluated(right, Difference(rate - 0.5, (rate - 0.6, rate - 0.4))))

    # The labels have no state.
    assert told.startswith(f"The object recognised in {right} of 100 grasps ({right} of 100)")
    assert told.endswith(words)


@every_case(
    ("difference", "words"),
    [
        (Difference(0.3, (0.2, 0.4)), "This is better than always"),
        (Difference(-0.3, (-0.4, -0.2)), "not better than always"),
        (Difference(0.0, (-0.01, 0.01)), "agrees with always"),
        (Difference(0.1, (-0.2, 0.4)), "cannot be told"),
        (Difference(0.1, None, "2 instances"), "cannot be told: 2 instances"),
    ],
)
def test_a_verdict_says_one_of_three_things(difference, words):
    assert words in verdict(evaluated(60, difference))


def test_the_recording_explains_nothing_only_where_the_rate_is_shown_to_be_higher():
    higher = Difference(0.3, (0.2, 0.4))

    def told(low):
        difference = Difference(0.1, (low, 0.3))
        control = Measurement(what="w", rate=RecognitionRate(30, 60), difference=difference)
        evaluation = evaluated(60, higher)
        return verdict(evolve(evaluation, controls={**evaluation.controls, "before_contact": control}))

    assert "does not explain" in told(0.05)
    assert "cannot be told" in told(-0.1)
    # No verdict comes from a control of two trials.
    few = Measurement(what="w", rate=RecognitionRate(2, 2), difference=Difference(-0.4, (-0.6, -0.2)))
    assert "100.0 % of 2 of 100 trials" in verdict(evaluated(60, higher, few))


def test_the_page_of_a_store_that_cannot_be_judged_has_its_grasp_with_its_warnings(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        record = kept.ended(label=None)
        result = evolve(record.result, details={"warnings": ["left fingertip stuck: check its cable"]})
        path = store.new_recording(record.made_at)
        kept.write_recording(path, 120, evolve(record, result=result))
        store.add(evolve(record, result=result), RecordingInfo.hashed(path, 120, 3), complete=True)
    page = store_page(str(tmp_path / "trials"))

    assert page.answer.startswith("There is 1 grasp, but no recognition rate: ")
    assert "One grasp, " in Reader(page.html()).text
    assert '<ul class="warning"><li>left fingertip stuck: check its cable</li></ul>' in page.html()


def test_long_names_have_a_line_or_two_within_their_picture():
    assert _label_lines("can:full_open") == ["can:full_open"]
    assert _label_lines("a_bottle_of_orange_juice:full_open") == ["a_bottle_of_orange_juice:", "full_open"]
    for label in ("n" * 180 + ":y", "quite_a_long_name_of_a_bottle_1:full_and_closed", "word " * 40):
        lines = _label_lines(label)
        assert len(lines) == 2
        assert lines[1].endswith("…") is (len(label) > 50)
    picture = Picture(100.0)
    picture.title("feature" + "_that_is_long" * 10)
    (drawn,) = picture.parts
    assert "…" in drawn
    assert len(re.sub("<[^>]*>", "", drawn)) < 60
