"""The page of live grasps in a real browser: what it shows is what was sent, in light and dark, on a narrow window."""

import json
import math
import resource
from pathlib import Path

import pytest
from attrs import evolve
from live_grasp import COMMAND, device

from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.signals import NO_PADS, SQUEEZE, Frame, Image, Reading, Samples
from graspsense.plugin_api import signal_type

pytest.importorskip("websockets")
pytestmark = pytest.mark.browser
PAGE_BYTES = resource.getpagesize()


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
    answer = browser.run(waiting)
    assert answer is True, answer
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
    assert browser.run("$('certainty').textContent") == trial.prediction.certainty_in_words
    assert browser.run("$('set').textContent") == (
        f"set: {trial.prediction.set_in_words}" if trial.prediction.set_in_words else ""
    )
    because = browser.run("[...document.querySelectorAll('#because li')].map((one) => one.textContent)")
    assert because == [reason.words for reason in trial.prediction.because]
    vague = evolve(trial.prediction, calibrated=True, certainty_interval=(0.21, 0.69))
    feed.told("prediction", vague.in_words)
    shown(browser, "$('certainty').textContent", vague.certainty_in_words)
    assert "(21 to 69 %)" in vague.certainty_in_words
    events = browser.run("[...document.querySelectorAll('#events li')].map((one) => one.textContent)")
    assert events == [f"{event.t_s:.3f} s: {event.what}" for event in trial.events]
    browser.screenshot(tmp_path / "page.png")
    answer = browser.run(
        "({across: document.documentElement.scrollWidth, ground: getComputedStyle(document.body).backgroundColor})"
    )
    assert answer["across"] <= width
    assert answer["ground"] == ("rgb(20, 23, 26)" if dark else "rgb(255, 255, 255)")
    asked = [
        logged["params"]["request"]["url"]
        for logged in browser.events
        if logged.get("method") == "Network.requestWillBeSent"
    ]
    assert all(url.startswith(feed.answer["address"]) for url in asked)
    assert [
        logged
        for logged in browser.events
        if logged.get("method") in ("Log.entryAdded", "Runtime.exceptionThrown")
    ] == []


CHANNELS = (
    Channel("gap", "m", 1000.0),
    TactileArray("skin", "counts", 100.0, rows=2, columns=3),
    FastChannel("sound", "V", 4000.0, samples=4),
)


def test_arrays_are_heat_maps_and_fast_channels_have_a_spectrogram_and_nothing_grows(browser, feed):
    """A tone of an eighth of the rate stands at a quarter of the spectrogram; a curve keeps its last points."""
    signals, ticks, nan = signal_type(CHANNELS), 31_000, math.nan
    browser.show(feed.answer["address"], 1280)
    feed.opened(device(CHANNELS))
    for k in range(ticks):
        frame = Frame(k / 1000, 0.001, 0.05, 0.0, nan, nan, nan, nan, nan, 0)
        cells = tuple(float(k * i) for i in range(6))
        tone = tuple((math.sin(2 * math.pi * (4 * k + i) / 8),) for i in range(4))
        new = Samples(k / 1000, 4 * k + 4, 4, tone)
        feed.take(Reading(frame, NO_PADS, signals(Image(k / 1000, k + 1, cells), new)), SQUEEZE, COMMAND)
        if k % 4000 == 0:
            feed.told("progress", {"text": f"tick {k}"})
            shown(browser, "$('done').textContent", f"tick {k}")
    feed.told("outcome", {"outcome": "steady", "reason": ""})
    shown(browser, "$('outcome').textContent", "outcome: steady")
    assert browser.run("[series.get('gap_m').n, series.get('sound value').n]") == [30_000, 30_000]
    assert browser.run("series.get('gap_m').last()") == 0.05
    assert browser.run("arrays.get('skin').text.textContent") == "skin: change of 0 to 155000 counts"
    picture = "arrays.get('skin').canvas.getContext('2d').getImageData(0, 0, 3, 2).data"
    assert browser.run(f"[{picture}[0], {picture}[20], {picture}.length]") == [0, 255, 24]
    column = "spectra.get('sound').canvas.getContext('2d').getImageData(0, 0, 1, 128).data"
    strongest = browser.run(
        f"(() => {{ const d = {column}; return [...Array(128).keys()].sort((a, b) => "
        "d[4 * b] + d[4 * b + 1] - d[4 * a] - d[4 * a + 1])[0]; })()"
    )
    assert abs(127 - strongest - 32) <= 1


@pytest.mark.parametrize("ticks", [100_000, pytest.param(600_000, marks=pytest.mark.long)])
def test_fifty_channels_do_not_grow_the_page_or_its_process(browser, feed, ticks):
    """At 1 kHz these are 100 s, and the ten minutes of the full count; a curve and the process keep the last 30 s."""
    names = [f"channel_{i:02d}" for i in range(50)]
    channels = (Channel("gap", "m", 1000.0), *(Channel(name, "N", 1000.0) for name in names))
    signals, nan = signal_type(channels), math.nan
    browser.show(feed.answer["address"], 1280)
    feed.opened(device(channels))
    kept = []
    for k in range(ticks):
        frame = Frame(k / 1000, 0.001, 0.05, 0.0, nan, nan, nan, nan, nan, 0)
        feed.take(Reading(frame, NO_PADS, signals(*(k + i for i in range(50)))), SQUEEZE, COMMAND)
        if k % 2000 == 1999:
            feed.told("progress", {"text": f"tick {k}"})
            shown(browser, "$('done').textContent", f"tick {k}")
        if k % 10_000 == 9_999 and k >= 50_000:
            browser.call("HeapProfiler.collectGarbage")
            used = browser.call("Runtime.getHeapUsage")
            pages = Path(f"/proc/{feed._process.pid}/statm").read_text().split()[1]
            kept.append((used["usedSize"] + used.get("backingStorageSize", 0), int(pages) * PAGE_BYTES))
    assert browser.run("series.size") == 52
    assert browser.run("[...series.values()].every((curve) => curve.n === 30000)")
    assert browser.run("series.get('channel channel_49').last()") == ticks - 1 + 49
    assert feed.dropped == 0
    page, process = zip(*kept, strict=True)
    assert max(page) < page[0] + (4 << 20), kept
    # A tick is some 470 bytes of text: keeping all of them adds 250 MB in ten minutes. What waits to be sent comes and
    # goes by some 10 MB with the load, and so does what the allocator holds.
    assert max(process) < process[0] + (32 << 20), kept
