"""A grasp that is shown live: what viewers and observers receive, and what bad viewers cannot do."""

import json
import os
import signal
import socket
import sys
import time
from contextlib import ExitStack
from urllib.error import HTTPError
from urllib.request import Request, urlopen

import click
import pytest
from commands import graspsense, printed
from live_grasp import COMMAND, device, port_of, reading, shown

from graspsense.cli.live import _host_and_port
from graspsense.core.pipeline.pipeline import load_pipeline
from graspsense.core.values.errors import ConfigError, PluginUnavailable
from graspsense.core.values.signals import SQUEEZE
from graspsense.live.feeds import LiveFeed

pytest.importorskip("websockets")

from cases import every_case
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

PATIENCE_S = 60.0


@pytest.fixture(scope="module")
def idle_feed():
    """A page that nobody sends a grasp to."""
    running = LiveFeed("graspsense.live.page_process", ["127.0.0.1", "0"])
    yield running
    assert running.close() == ""


def frames_of(feed):
    return feed.answer["address"].replace("http", "ws", 1) + "frames"


def received(viewer, until):
    """Return the messages up to the first of this kind."""
    messages = []
    while not any(message["kind"] == until for message in messages):
        messages += json.loads(viewer.recv(timeout=PATIENCE_S))
    return messages


def refused(address, headers=None):
    """Return the status with which a WebSocket is refused."""
    with pytest.raises(InvalidStatus) as answer, connect(address, additional_headers=headers):
        pass
    return answer.value.response.status_code


def column(messages, kind, name):
    return [value for message in messages if message["kind"] == kind for value in message[name]]


def last_grasp(messages):
    began = max((k for k, message in enumerate(messages) if message["kind"] == "grasp"), default=0)
    return messages[began:]


def check_received(messages, n=20):
    sent = [reading(k) for k in range(n)]
    assert column(messages, "ticks", "t_s") == [row.frame.t_s for row in sent]
    assert column(messages, "ticks", "gap_m") == [row.frame.gap_m for row in sent]
    assert column(messages, "ticks", "force_left_n") == [None] * n
    assert column(messages, "scalars", "temperature") == [300.0 + k for k in range(n)]
    assert column(messages, "samples", "values") == [[[k + i / 4, -1.0] for i in range(3)] for k in range(n)]
    images = [message for message in messages if message["kind"] == "image"]
    assert images[-1]["cells"] == [n - 1.0 + i for i in range(6)]


def test_viewers_receive_every_tick_sample_and_image_before_and_after_they_come(feed):
    with connect(frames_of(feed)) as early:
        shown(feed)
        check_received(received(early, "outcome"))
        with connect(frames_of(feed)) as late:
            check_received(received(late, "outcome"))
        shown(feed, 5)
        messages = received(early, "outcome")
        assert messages[0]["kind"] == "grasp"
        check_received(messages, 5)


def test_a_new_grasp_replaces_the_one_before_for_viewers_who_come_later(feed):
    shown(feed)
    shown(feed, 5)
    with connect(frames_of(feed)) as viewer:
        messages = []
        # A viewer who comes before the feed has got to the second grasp sees both.
        while len(column(last_grasp(messages), "ticks", "t_s")) != 5 or messages[-1]["kind"] != "outcome":
            messages += json.loads(viewer.recv(timeout=PATIENCE_S))
    check_received(last_grasp(messages), 5)


def test_only_the_page_itself_is_let_in_and_it_asks_for_nothing_from_outside(idle_feed):
    for path in ("/", "/wrong/", "/wrong/frames"):
        assert refused(f"ws://127.0.0.1:{port_of(idle_feed)}{path}") == 404, "without the token"
    for origin in ("http://elsewhere.example", "null"):
        assert refused(frames_of(idle_feed), {"Origin": origin}) == 403
    # As a page elsewhere has it that makes its own name lead to 127.0.0.1.
    host = {"Host": f"elsewhere.example:{port_of(idle_feed)}"}
    with pytest.raises(HTTPError) as refusal:
        urlopen(Request(idle_feed.answer["address"], headers=host), timeout=PATIENCE_S)
    refusal.value.close()
    assert refusal.value.code == 403
    with urlopen(idle_feed.answer["address"], timeout=PATIENCE_S) as answer:
        text, policy = answer.read().decode(), answer.headers["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'")
    assert "://" not in text


def test_a_viewer_that_sends_something_is_dropped_and_the_others_stay(feed):
    with connect(frames_of(feed)) as good:
        for sent in ("x", b"\x00" * 100, "x" * 100_000):
            with connect(frames_of(feed)) as bad:
                bad.recv(timeout=PATIENCE_S)
                bad.send(sent)
                with pytest.raises(ConnectionClosed):
                    bad.recv(timeout=PATIENCE_S)
        shown(feed)
        check_received(received(good, "outcome"))


@pytest.mark.slow
def test_rubbish_and_a_thousand_connections_disturb_nobody(feed):
    with connect(frames_of(feed)) as good:
        crowd = []
        for k in range(1000):
            connection = socket.create_connection(("127.0.0.1", port_of(feed)))
            crowd.append(connection)
            if k % 100 == 0:
                connection.sendall(os.urandom(2000))
        shown(feed)
        check_received(received(good, "outcome"))
        for connection in crowd:
            connection.close()


def test_viewers_beyond_the_limit_are_refused(feed):
    with ExitStack() as viewers:
        for _ in range(16):
            viewers.enter_context(connect(frames_of(feed)))
        assert refused(frames_of(feed)) == 503
    shown(feed)
    until = time.monotonic() + PATIENCE_S
    while True:
        try:
            with connect(frames_of(feed)) as viewer:
                check_received(received(viewer, "outcome"))
                return
        except InvalidStatus:
            assert time.monotonic() < until, "the places of those who left are not free"


@pytest.mark.slow
def test_a_viewer_that_stalls_is_dropped_and_no_tick_waits(feed):
    request = (
        f"GET {frames_of(feed)[5 + len('127.0.0.1:') + len(str(port_of(feed))) :]} HTTP/1.1\r\n"
        f"Host: 127.0.0.1:{port_of(feed)}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    stalled = socket.socket()
    stalled.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    stalled.connect(("127.0.0.1", port_of(feed)))
    stalled.sendall(request.encode())
    assert stalled.recv(12) == b"HTTP/1.1 101"
    with stalled, connect(frames_of(feed), max_size=None) as good:
        feed.opened(device())
        sent = 0
        for k in range(0, 100_000, 1000):
            for i in range(k, k + 1000):
                feed.take(reading(i), SQUEEZE, COMMAND)
            times = []
            while not times or times[-1] < reading(k + 999).frame.t_s:
                text = good.recv(timeout=PATIENCE_S)
                sent += len(text)
                times += column(json.loads(text), "ticks", "t_s")
        assert times[-1] == reading(99_999).frame.t_s
        assert feed.dropped == 0
        assert _rest(stalled) < sent


def _rest(connection):
    """Return the number of bytes until the other side ends the connection."""
    connection.settimeout(PATIENCE_S)
    n = 0
    try:
        while data := connection.recv(1 << 20):
            n += len(data)
    except ConnectionResetError:
        pass
    return n


@every_case(("option", "address"), [("--live-address", "127.0.0.1:{}"), ("--foxglove", "{}")])
def test_a_port_that_is_taken_is_an_error_before_the_grasp(tmp_path, option, address):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        done = graspsense("run", option, address.format(port), "--save", tmp_path / "store")
    assert done.returncode == 2
    assert option.removesuffix("-address") in done.stderr
    assert str(port) in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "store").exists()


@every_case("address", ["", ":80", "127.0.0.1:x", "127.0.0.1:70000", "[::1]:-1"])
def test_an_address_that_is_none_is_wrong_use(address):
    with pytest.raises(click.UsageError):
        _host_and_port(address)


def test_a_page_that_is_killed_loses_no_grasp():
    class Killer:
        ticks = 0

        def take(self, reading, phase, command):
            self.ticks += 1
            if self.ticks == 100:
                os.kill(feed._process.pid, signal.SIGKILL)
                feed._process.wait()

    feed = LiveFeed("graspsense.live.page_process", ["127.0.0.1", "0"])
    trial = load_pipeline("default").grasp(sinks=[Killer(), feed])
    assert (trial.outcome.words, trial.reason) == ("steady", "")
    assert "incomplete" in feed.close()


@every_case(("option", "module"), [("live", "websockets"), ("foxglove", "foxglove"), ("rerun", "rerun")])
def test_a_package_that_is_missing_is_named_before_the_grasp(monkeypatch, option, module):
    monkeypatch.setitem(sys.modules, module, None)
    done = graspsense("run", f"--{option}")
    assert done.returncode == PluginUnavailable.exit_code
    assert f"graspsense[{option}]" in done.stderr


@pytest.mark.slow
def test_a_trial_is_stored_as_without_a_page(tmp_path):
    pytest.importorskip("foxglove")
    pytest.importorskip("rerun")
    said = []
    shown_by = ["--live", "--foxglove", "--rerun", str(tmp_path / "grasp.rrd")]
    for name, live in (("with", shown_by), ("without", [])):
        asked = ["run", "--save", str(tmp_path / name), "--seed", "3", "--json", *live]
        said.append(json.loads(printed(*asked)))
    for line in said:
        del line["seconds_wall"], line["kept"]["store"]
    assert said[0] == said[1]


OBSERVER = """
import json, os, sys, time

HERE = os.path.dirname(__file__)

def observe(batches):
    print("not an answer")
    with open(os.path.join(HERE, "seen"), "w") as seen:
        for messages in batches:
            seen.writelines(json.dumps(message) + "\\n" for message in messages)

def fail(batches):
    next(batches)
    raise ValueError("a mistake")

def hang(batches):
    time.sleep(1000)
"""


@pytest.fixture
def observer(tmp_path, monkeypatch):
    """Start an observer by the name of its function."""
    (tmp_path / "lab_wall.py").write_text(OBSERVER)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    return lambda name: LiveFeed("graspsense.live.observer_process", [f"lab_wall:{name}"])


def test_an_observer_of_a_plugin_receives_the_whole_grasp(tmp_path, observer):
    feed = observer("observe")
    shown(feed)
    assert feed.close() == ""
    messages = [json.loads(line) for line in (tmp_path / "seen").read_text().splitlines()]
    assert column(messages, "ticks", "effort_n") == [1.0 + k for k in range(20)]
    assert column(messages, "scalars", "temperature") == [300.0 + k for k in range(20)]
    assert messages[0]["kind"] == "grasp"
    assert messages[-1]["outcome"] == "steady"


@pytest.mark.slow
def test_an_observer_that_fails_is_named_and_the_grasp_goes_on(observer):
    feed = observer("fail")
    trial = load_pipeline("default").grasp(sinks=[feed])
    assert (trial.outcome.words, trial.reason) == ("steady", "")
    assert "lab_wall:fail" in (problem := feed.close())
    assert "a mistake" in problem


def test_an_observer_that_cannot_be_imported_is_an_error_at_its_start(observer):
    with pytest.raises(ConfigError, match="missing"):
        observer("missing")


@pytest.mark.slow
def test_an_observer_that_takes_nothing_is_stopped_at_the_end(observer):
    feed = observer("hang")
    feed.opened(device())
    for k in range(100_000):
        feed.take(reading(k), SQUEEZE, COMMAND)
        if feed.dropped:
            break
    assert feed.dropped > 0
    assert "stopped" in feed.close()
