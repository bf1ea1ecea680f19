"""The page of live grasps in a real browser: what it shows is what was sent, in light and dark, on a narrow window."""

from __future__ import annotations

import json

import browser as browsers
import pytest

from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.live.feeds import LiveFeed

pytest.importorskip("websockets")
pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def browser():
    running = browsers.start()
    yield running
    running.close()


@pytest.fixture
def feed():
    running = LiveFeed("graspsense.live.page_process", ["127.0.0.1", "0"])
    yield running
    assert running.close() == ""


def shown(browser, script, wanted):
    """Wait until an expression of the page has this value, and return whether it got there."""
    waiting = f"""new Promise((done) => {{
      const until = Date.now() + 60000;
      const look = () => {{
        const found = JSON.stringify({script});
        if (found === {json.dumps(json.dumps(wanted, separators=(",", ":"), ensure_ascii=False))}) done(true);
        else if (Date.now() > until) done(found);
        else setTimeout(look, 20);
      }};
      look();
    }})"""
    found = browser.run(waiting)
    assert found is True, found
    return True


def simulated(feed):
    """Grasp with the simulated gripper and show it; return the trial."""
    trial = load_pipeline("default").grasp(sinks=[feed])
    feed.finished(trial)
    return trial


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_the_page_shows_what_was_sent(browser, feed, tmp_path, dark, width):
    browser.call("Network.enable")
    browser.call("Log.enable")
    browser.show(feed.answer["address"], width, dark=dark)
    trial = simulated(feed)
    feed.told("stored", {"rows": [["7", "can:full_open", "steady", "<b>can</b>:full_open"]]})
    trace = trial.trace

    shown(browser, "document.querySelectorAll('#rows td').length", 4)
    assert browser.run("document.querySelectorAll('#rows b').length") == 0
    kept = browser.run(
        "Object.fromEntries([...series].map(([name, s]) => [name, [...s.v.subarray(0, s.n)]]))"
    )
    times = browser.run("[...series.get('gap_m').t.subarray(0, series.get('gap_m').n)]")
    assert times == list(trace.t_s)
    assert kept["gap_m"] == list(trace.gap_m)
    assert kept["force_left_n"] == list(trace.force_left_n)
    assert kept["effort_n"] == list(trace.effort_n)
    last = f"{trace.gap_m[-1] * 1e3:.3f} mm"
    shown(browser, "document.querySelector('[data-name=gap_m]').textContent", last)
    assert browser.run("$('label').textContent") == trial.prediction.label
    assert browser.run("$('set').textContent") == (
        f"set: {trial.prediction.set_in_words}" if trial.prediction.set_in_words else ""
    )
    because = browser.run("[...document.querySelectorAll('#because li')].map((one) => one.textContent)")
    assert because == [reason.words for reason in trial.prediction.because]
    events = browser.run("[...document.querySelectorAll('#events li')].map((one) => one.textContent)")
    assert events == [f"{event.t_s:.3f} s  {event.what}" for event in trial.events]
    browser.screenshot(tmp_path / "page.png")
    found = browser.run(
        "({across: document.documentElement.scrollWidth, ground: getComputedStyle(document.body).backgroundColor})"
    )
    assert found["across"] <= width
    assert found["ground"] == ("rgb(20, 23, 26)" if dark else "rgb(255, 255, 255)")
    asked = [
        one["params"]["request"]["url"]
        for one in browser.events
        if one.get("method") == "Network.requestWillBeSent"
    ]
    assert all(url.startswith(feed.answer["address"]) for url in asked)
    assert [
        one for one in browser.events if one.get("method") in ("Log.entryAdded", "Runtime.exceptionThrown")
    ] == []
