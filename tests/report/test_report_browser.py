"""Pages in a real browser: nothing overflows or is clipped, in light and dark, and tables and pictures can be used."""

import re

import pytest
from test_report_signals import CHANNELS, grasp

from graspsense.evaluation.results import confusion
from graspsense.experiments.executors.executor import Serial
from graspsense.experiments.experiment_file import read_experiment
from graspsense.experiments.findings import FoundTable
from graspsense.experiments.page import write_page
from graspsense.experiments.results import Results
from graspsense.experiments.run import run_experiment
from graspsense.experiments.summary import summarise
from graspsense.report.confusion import confusion_table
from graspsense.report.further_channels import channel_figures
from graspsense.report.grasp_curve import GraspCurve
from graspsense.report.html import Page, Section, bullets, facts, panels
from graspsense.report.rates import RateRow, rates_over, rates_picture
from graspsense.report.tactile import tactile_figures
from graspsense.report.trial_curves import trial_curves

pytestmark = pytest.mark.browser

WIDTHS = (390, 1280, 1920)
LABELS = [f"quite_a_long_name_of_a_bottle_{k}:full_and_closed" for k in range(11)]


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """A page of simulated grasps, and one whose names are long, as files by name."""
    folder = tmp_path_factory.mktemp("pages")
    (folder / "it.toml").write_text(
        'title = "How hard"\nquestion = "Does it matter?"\nseeds = 2\n'
        '[sweep]\n"controller.probing_force_n" = [17.0, 20.0]\n'
        '[data]\nobjects = ["can:full_open", "can:empty_open", "odwalla:full_open"]\ninstances = 2\ntrials = 1\n'
        "[judge]\nfolds = 2\ngrasps = 2\n"
    )
    planned, results = read_experiment(str(folder / "it.toml")), Results(folder / "out")
    run_experiment(planned, results, Serial)
    (folder / "long.html").write_text(long_page())
    (folder / "signals.html").write_text(signals_page())
    return {
        "experiment": write_page(summarise(planned, results), results),
        "long": folder / "long.html",
        "signals": folder / "signals.html",
    }


def signals_page():
    figures = [*tactile_figures(grasp(), CHANNELS), *channel_figures(grasp(), CHANNELS)]
    section = Section(id="signals", title="Tactile arrays and further channels", body=panels(figures))
    return Page(kind="k", title="t", question="q?", answer="a.", sections=(section,)).html()


def long_page():
    rates = [RateRow(name=f"case {k}", rate=0.8 + 0.01 * k, interval=(0.78, 0.93)) for k in range(10)]
    claims = FoundTable(
        id="claims",
        title="Claims",
        header=("claim", "basis", "result here", "measured, N", "criterion"),
        rows=tuple(
            (
                f"claim {k} " + 6 * "of many words ",
                "fitted",
                "agrees" if k % 3 else "differs",
                f"{7 * k % 10}.5",
                LABELS[0],
            )
            for k in range(10)
        ),
        numbers=3,
        verdicts=(2,),
    )
    over = rates_over({"c45": list(enumerate(rates)), "knn": list(enumerate(rates))}, "x", "c", 0.8)
    predicted = LABELS + LABELS[::-1] + LABELS[1:] + LABELS[:1]
    matrix = confusion_table(confusion(LABELS * 3, predicted), "M.")
    made = facts([("hash of " + "x" * 80, "f" * 128)]) + bullets(["/".join(LABELS)])
    return Page(
        kind="Experiment",
        title="t",
        question="q?",
        answer=" ".join(LABELS),
        headline=LABELS[0],
        sections=(
            claims.section(),
            Section(id="rates", title="Rates", body=rates_picture(rates, "c") + over),
            Section(id="confusion", title="Matrix", body=matrix),
            Section(id="made", title="Provenance", body=made),
        ),
    ).html()


MEASURE = """(() => {
  const root = document.documentElement, all = (what) => [...document.querySelectorAll(what)];
  const shown = (one) => one.getClientRects().length > 0, words = (one) => one.outerHTML.slice(0, 100);
  const box = (one) => one.getBoundingClientRect().toJSON();
  const outside = all("body *").filter((one) => shown(one) && !one.closest("svg, .wide, pre")
    && box(one).right > innerWidth + 0.5).map(words);
  const clipped = all("p, h1, h2, h3, dt, dd, li, figcaption, summary").filter((one) => shown(one)
    && !one.closest(".wide") && one.scrollWidth > one.clientWidth + 1)
    .concat(all(".matrix tbody th").filter((one) => one.scrollWidth > one.clientWidth + 1)).map(words);
  const texts = all("svg text").filter(shown).map((one) => {
    const t = box(one), b = box(one.closest("svg"));
    const out = Math.max(b.left - t.left, t.right - b.right, b.top - t.top, t.bottom - b.bottom);
    return {words: one.textContent, size: t.height, out};
  });
  const style = getComputedStyle(document.body);
  return {
    across: root.scrollWidth, room: root.clientWidth, outside, clipped, texts, sections: all("section").map(box),
    pictures: all("figure svg").map(box), top: box(document.querySelector(".sentence")).top,
    widest: Math.max(...all("main table, main figure, main section").map((one) => box(one).right)),
    ground: style.backgroundColor, text: style.color, font: parseFloat(style.fontSize),
  };
})()"""


@pytest.mark.parametrize("name", ["experiment", "long", "signals"])
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", WIDTHS)
def test_nothing_overflows_or_is_clipped(browser, pages, name, width, dark):
    browser.show(pages[name], width, dark=dark)
    browser.run("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
    answer = browser.run(MEASURE)

    assert answer["across"] <= answer["room"] <= width
    assert answer["outside"] == []
    assert answer["clipped"] == []
    assert [text["words"] for text in answer["texts"] if text["out"] > 2.0] == []
    assert min(text["size"] for text in answer["texts"]) >= 9.0
    assert answer["font"] >= 16
    assert answer["widest"] >= 0.9 * width
    tops = [box["top"] for box in answer["sections"]]
    assert tops == sorted(tops)
    assert (answer["ground"], answer["text"]) == (
        ("rgb(20, 23, 26)", "rgb(232, 232, 232)") if dark else ("rgb(255, 255, 255)", "rgb(26, 26, 26)")
    )
    if name == "experiment":
        assert answer["top"] < 450
        rows = {round(box["top"]) for box in answer["pictures"]}
        assert (len(rows) == len(answer["pictures"])) is (width == 390)


def test_a_page_runs_its_script_under_its_own_policy_and_loads_nothing(browser, pages):
    browser.call("Network.enable")
    browser.call("Log.enable")
    browser.show(pages["experiment"], 1280)
    asked = [
        event["params"]["request"]["url"]
        for event in browser.events
        if event.get("method") == "Network.requestWillBeSent"
    ]

    assert browser.run("document.documentElement.className") == "scripted"
    assert [address for address in asked if not address.endswith("report.html")] == []
    assert [
        event
        for event in browser.events
        if event.get("method") in ("Log.entryAdded", "Runtime.exceptionThrown")
    ] == []


COLUMN = (
    "[...document.querySelectorAll('#claims tbody tr')].filter((row) => !row.hidden)"
    ".map((row) => row.cells[3].textContent)"
)


def test_a_click_on_a_heading_sorts_a_table(browser, pages):
    browser.show(pages["long"], 1280)
    click = "document.querySelectorAll('#claims thead th button')[3].click()"
    column = browser.run(COLUMN)
    browser.run(click)
    once = browser.run(COLUMN)
    browser.run(click)

    assert column != sorted(column, key=float) == once
    assert browser.run(COLUMN) == sorted(column, key=float, reverse=True)
    assert browser.run("document.querySelectorAll('#claims th')[3].getAttribute('aria-sort')") == "descending"


def test_the_box_above_a_table_filters_it(browser, pages):
    browser.show(pages["long"], 1280)
    assert browser.run(COLUMN + ".length") == 10
    browser.run(
        "{const box = document.querySelector('#claims .filter input'); box.value = '✗ CLAIM';"
        " box.dispatchEvent(new Event('input'));}"
    )

    assert browser.run(COLUMN + ".length") == 4
    assert browser.run("document.querySelector('#claims .filter span').textContent") == "4 of 10 rows"


BOX = "((one) => { const b = one.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })"


def place_in(browser, selector, across, down):
    """Scroll a picture into view and return a place in it, by shares of its width and height."""
    browser.run(f"document.querySelector('{selector}').scrollIntoView({{block: 'center'}})")
    box = browser.run(f"{BOX}(document.querySelector('{selector}'))")
    return box[0] + across * box[2], box[1] + down * box[3]


TIP = "[...document.querySelectorAll('.tip')].filter((one) => !one.hidden).map((one) => one.textContent)"


def test_values_are_read_out_under_the_pointer(browser, pages):
    browser.show(pages["experiment"], 1280)
    browser.mouse("mouseMoved", *place_in(browser, "#grasp svg", 0.75, 0.7))
    (told,) = browser.run(TIP)
    time, force, gap = told.split("\n")

    assert re.fullmatch(r"−?[\d.]+ s", time)
    assert 40 < float(re.fullmatch(r"gap, mm: ([\d.]+)", gap)[1]) < 90
    assert 1 < float(re.fullmatch(r"force, N: ([\d.]+)", force)[1]) < 30

    browser.show(pages["long"], 1280)
    mark = "[...document.querySelectorAll('#rates g[transform]')].find((one) => one.querySelector('title'))"
    browser.run(mark + ".scrollIntoView({block: 'center'})")
    left, top, width, height = browser.run(f"{BOX}({mark})")
    x, y = left + width / 2, top + height / 2
    browser.mouse("mouseMoved", x + 2, y + 1)
    assert browser.run(TIP) == ["case 0: 80.0 % (78.0 to 93.0)"]
    browser.mouse("mouseMoved", 1, 1)
    assert browser.run(TIP) == []
    # So is every series of a picture, and what is drawn across it moves with the axis.
    mark = mark.replace(".find(", ".filter(") + ".at(-1)"
    browser.run(mark + ".scrollIntoView({block: 'center'})")
    left, top, width, height = browser.run(f"{BOX}({mark})")
    browser.mouse("mouseMoved", left + width / 2, top + height / 2)
    assert browser.run(TIP)[0].startswith("case 9: ")
    dashed = "one.getAttribute('stroke-dasharray') === '3 3'"
    guess = (
        f"[...document.querySelectorAll('#rates polyline')].find((one) => {dashed}).getAttribute('points')"
    )
    drawn = browser.run(guess)
    browser.drag((left - 60, top - 30), (left, top + 30))
    assert browser.run(guess) != drawn


def axis(browser):
    texts = browser.run(
        "[...document.querySelectorAll('#grasp g.axis.x text')].map((one) => one.textContent)"
    )
    return [float(text.replace("−", "-")) for text in texts]


def test_a_drag_enlarges_a_part_of_a_picture_and_a_double_click_restores_it(browser, pages):
    browser.show(pages["experiment"], 1280)
    lines = "[...document.querySelectorAll('#grasp polyline[data-name]')].map((one) => one.getAttribute('points'))"
    whole, drawn = axis(browser), browser.run(lines)
    start, end = place_in(browser, "#grasp svg", 0.5, 0.7), place_in(browser, "#grasp svg", 0.75, 0.7)
    browser.drag(start, end)
    part = axis(browser)

    assert max(part) - min(part) < 0.5 * (max(whole) - min(whole))
    assert browser.run(lines) != drawn
    assert browser.run("getComputedStyle(document.querySelector('#grasp .reset')).display") != "none"
    browser.double_click(place_in(browser, "#grasp svg", 0.6, 0.7))
    assert axis(browser) == whole
    assert browser.run(lines) == drawn
    assert browser.run("getComputedStyle(document.querySelector('#grasp .reset')).display") == "none"


@pytest.mark.parametrize("name", ["experiment", "long", "signals"])
def test_a_page_is_printed_light_whole_and_without_what_is_only_for_the_screen(browser, pages, name):
    browser.show(pages[name], 720, dark=True, media="print")
    answer = browser.run(MEASURE)
    hidden = browser.run(
        "['nav', '.filter', '.tip', '.reset'].flatMap((what) => [...document.querySelectorAll(what)])"
        ".filter((one) => one.getClientRects().length).length"
    )

    assert answer["ground"] == "rgb(255, 255, 255)"
    assert answer["text"] == "rgb(26, 26, 26)"
    assert answer["clipped"] == []
    assert hidden == 0
    rows = "[...document.querySelectorAll('table.rows')].filter((one) => !one.closest('details'))"
    assert browser.run(rows + ".every((one) => one.getBoundingClientRect().right <= innerWidth + 1)")
    assert browser.pdf().startswith(b"%PDF-")


def test_the_colours_of_a_heat_map_differ_in_light_dark_and_print(browser, pages):
    colour = "getComputedStyle(document.querySelector('#signals rect[fill*=\"--q8\"]')).fill"
    seen = []
    for dark, media in ((False, "screen"), (True, "screen"), (True, "print")):
        browser.show(pages["signals"], 1280, dark=dark, media=media)
        seen.append(browser.run(colour))

    assert seen == ["rgb(8, 60, 110)", "rgb(182, 217, 245)", "rgb(8, 60, 110)"]


def test_boxes_choose_which_trials_are_drawn_over_each_other(browser, tmp_path):
    curves = [
        GraspCurve(
            label=("can:full", "can:empty")[k % 2],
            trial=k,
            t_s=(-0.2, 0.0, 0.5),
            gap_mm=(70.0, 66.0, 64.0),
            force_n=(0.0, 1.0, 5.0 + k),
            phase=("approach", "squeeze", "hold"),
        )
        for k in range(5, 0, -1)
    ]
    page = Page(kind="k", title="t", question="q?", answer="a.", sections=(trial_curves(curves),))
    (tmp_path / "page.html").write_text(page.html())
    browser.show(tmp_path / "page.html", 400)
    shown = (
        "[...new Set([...document.querySelectorAll('[data-trial]')]"
        ".filter((one) => getComputedStyle(one).display !== 'none').map((one) => one.dataset.trial))]"
    )

    assert sorted(browser.run(shown)) == ["4", "5"]
    browser.run("document.querySelector('.small input[value=\"2\"]').click()")
    browser.run("document.querySelector('.small input[value=\"5\"]').click()")
    assert sorted(browser.run(shown)) == ["2", "4"]


def test_on_a_phone_each_cell_of_a_table_stands_with_its_heading(browser, pages):
    browser.show(pages["long"], 390)
    cell = "document.querySelector('#claims tbody td:nth-child(4)')"
    assert browser.run(f"getComputedStyle({cell}, '::before').content") == '"measured, N: "'
    assert browser.run("document.querySelector('#claims .wide').scrollWidth") <= 390
