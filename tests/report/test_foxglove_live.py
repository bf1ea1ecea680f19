"""Grasps in Foxglove while they go on: the messages of a recording, and what bad viewers cannot do."""

import itertools
import json
import socket
import struct
import threading
from contextlib import closing, suppress
from importlib.resources import files
from xml.etree import ElementTree

import pytest
from cases import every_case
from live_grasp import COMMAND, device, port_of, reading, shown
from mcap.reader import make_reader

from graspsense import load_pipeline
from graspsense.core.components.registry import installed
from graspsense.core.values.signals import SQUEEZE
from graspsense.live.feeds import LiveFeed
from graspsense.recording.layout import IS_TICK, TICK, TICK_FIELDS, TICK_WIRE
from graspsense.store.record_grasp import record_grasp
from graspsense.store.store import Store

pytest.importorskip("websockets")
pytest.importorskip("foxglove")

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from graspsense.live import foxglove_process

PATIENCE_S = 60.0
SDK = "foxglove.sdk.v1"


def running_feed():
    running = LiveFeed("graspsense.live.foxglove_process", ["0"])
    yield running
    assert running.close() == ""


feed = pytest.fixture(running_feed)
kept_feed = pytest.fixture(running_feed, scope="module")
"""For tests of viewers that are refused, which leave it as it was."""


def opened(feed, protocol=SDK):
    """Return a connection that the test or the server ends."""
    address = feed.answer["address"]
    # No pings: they would end the connection where this machine is held up.
    return connect(address, subprotocols=[protocol], max_size=None, ping_interval=None).__enter__()


class Viewer:
    """Subscribes to everything, until the connection ends."""

    def __init__(self, feed, protocol=SDK):
        self.link = opened(feed, protocol)
        self.topics, self.found = {}, {}
        self.has_come = threading.Condition()
        self.thread = threading.Thread(target=self.listen)
        self.thread.start()

    def listen(self):
        try:
            for message in self.link:
                with self.has_come:
                    self.take(message)
                    self.has_come.notify_all()
        except ConnectionClosed:
            pass

    def take(self, message):
        if isinstance(message, bytes):
            kind, number, log_ns = struct.unpack_from("<BIQ", message)
            assert kind == 1
            self.found[self.topics[number]["topic"]].append((log_ns, message[13:]))
            return
        said = json.loads(message)
        for channel in said.get("channels", ()):
            self.topics[channel["id"]], self.found[channel["topic"]] = channel, []
            wanted = [{"id": channel["id"], "channelId": channel["id"]}]
            self.link.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def wait_for(self, topic, count):
        with self.has_come:
            assert self.has_come.wait_for(lambda: len(self.found.get(topic, ())) >= count, PATIENCE_S)

    def wait_for_all(self, n=20):
        for topic in ("tick", "scalars", "signals/skin", "signals/sound"):
            self.wait_for(f"/grasp/{topic}", n)

    def ended(self):
        """Wait until the connection has ended, and return the messages by topic."""
        self.thread.join(PATIENCE_S)
        assert not self.thread.is_alive()
        return self.found


def refused(feed, address=None, headers=None, protocols=(SDK,)):
    """Return the status with which a viewer is refused."""
    address = address or feed.answer["address"]
    with (
        pytest.raises(InvalidStatus) as answer,
        connect(address, subprotocols=protocols or None, additional_headers=headers),
    ):
        pass
    return answer.value.response.status_code


def messages_until_the_end(link):
    """Return how many messages come until the server ends the connection."""
    for count in itertools.count():
        try:
            link.recv(timeout=PATIENCE_S)
        except ConnectionClosed:
            return count


def check_complete(messages, n=20):
    times = [struct.unpack_from("<4xd", data)[0] for _, data in messages["/grasp/tick"]]
    assert times == [k / 1000 for k in range(n)]
    skin = [struct.unpack_from("<4xdq6d", data)[2:] for _, data in messages["/grasp/signals/skin"]]
    assert skin == [tuple(float(k + i) for i in range(6)) for k in range(n)]
    assert len(messages["/grasp/signals/sound"]) == len(messages["/grasp/scalars"]) == n


def test_viewers_receive_the_messages_and_schemas_of_the_recording_and_late_ones_too(feed, tmp_path):
    settings = load_pipeline(options=["classifier.type=none", "gripper.rate_hz=250"]).settings
    early = Viewer(feed)
    with Store.open(tmp_path) as store:
        feed.finished(record_grasp(store, settings, installed(), labels={}, origin="run", sinks=[feed]).trial)
    (path,) = (tmp_path / "recordings").glob("*.mcap")
    recorded, schemas = {}, {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            recorded.setdefault(channel.topic, []).append((message.log_time, message.data))
            schemas[channel.topic] = (schema.name, schema.encoding, schema.data.decode(), "cdr")
    late = Viewer(feed)
    for viewer in (early, late):
        for topic, messages in recorded.items():
            viewer.wait_for(topic, len(messages))
    feed.close()
    assert {"/grasp/tick", "/grasp/pads"} <= recorded.keys()
    for viewer in (early, late):
        received = viewer.ended()
        data = {topic: [body for _, body in messages] for topic, messages in received.items()}
        assert data == {topic: [body for _, body in messages] for topic, messages in recorded.items()}
        keys = ("schemaName", "schemaEncoding", "schema", "encoding")
        assert {
            channel["topic"]: tuple(map(channel.get, keys)) for channel in viewer.topics.values()
        } == schemas
        spans = [
            messages[-1][0] - messages[0][0]
            for messages in (received["/grasp/tick"], recorded["/grasp/tick"])
        ]
        assert spans[0] == spans[1]


def test_images_samples_and_further_channels_come_too(feed):
    viewer = Viewer(feed, "foxglove.websocket.v1")
    assert viewer.link.subprotocol == "foxglove.websocket.v1"
    shown(feed)
    viewer.wait_for_all()
    feed.close()
    check_complete(viewer.ended())


def test_a_viewer_who_comes_later_sees_the_last_grasp_alone(feed):
    shown(feed, 30)  # without any viewer, it is shown as well
    early = Viewer(feed)
    early.wait_for_all(30)
    shown(feed, 5)
    early.wait_for_all(35)
    viewer = Viewer(feed)
    viewer.wait_for_all(5)
    assert (feed.close(), feed.dropped) == ("", 0)
    check_complete(viewer.ended(), 5)


def test_what_is_kept_for_viewers_who_come_later_does_not_grow(monkeypatch):
    monkeypatch.setattr(foxglove_process, "HISTORY_BYTES", 10_000)
    grasp = foxglove_process.RunningGrasp()
    tick = TICK_WIRE.pack(IS_TICK, TICK.size, 0, *reading(1).frame, SQUEEZE, *COMMAND)
    kept = []
    for _ in range(3):
        grasp.take(bytearray(tick * 10_000))
        kept.append(sum(len(data) for _, _, data in grasp.history))
    assert kept[0] == kept[1] == kept[2]
    assert 10_000 - len(tick) < kept[0] <= 10_000


@every_case(
    ("status", "path", "given"),
    [
        # Without the token, from the pages of others, and with another protocol or none.
        *((404, path, {}) for path in ("", "wrong", "wrong/")),
        (403, None, {"headers": {"Origin": "https://elsewhere.example"}}),
        (403, None, {"headers": {"Origin": "null"}}),
        (403, None, {"headers": {"Origin": "https://app.foxglove.dev.elsewhere.example"}}),
        (400, None, {"protocols": ()}),
        (400, None, {"protocols": ("chat",)}),
    ],
)
def test_only_a_viewer_of_foxglove_with_the_token_is_let_in(kept_feed, status, path, given):
    address = None if path is None else f"ws://127.0.0.1:{port_of(kept_feed)}/{path}"
    assert refused(kept_feed, address, **given) == status


@every_case(
    ("head", "status"),
    [
        ("GET {path} HTTP/1.1\r\nHost: elsewhere.example:{port}\r\n\r\n", 403),
        ("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nOrigin: http://[\r\n\r\n", 403),
        ("GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n", 426),
        ("POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n", None),
        ("\r\n\r\n", None),
        ("x" * 100_000, None),
        ("GET {path} HTTP/1.1\r\n" + "A: 1\r\n" * 500 + "\r\n", None),
    ],
)
def test_what_is_no_request_of_a_viewer_is_refused_or_dropped(kept_feed, head, status):
    """What websockets cannot read as a request, it drops, or answers with a status of its own."""
    address, port = kept_feed.answer["address"], port_of(kept_feed)
    text = head.format(path="/" + address.split("/", 3)[3], port=port)
    with socket.create_connection(("127.0.0.1", port), PATIENCE_S) as link:
        with suppress(ConnectionError):
            link.sendall(text.encode())
        answer = b""
        with suppress(ConnectionError):
            while data := link.recv(4096):
                answer += data
    statuses = answer.split(b" ")[1:2]
    assert statuses == [str(status).encode()] if status else all(word.startswith(b"4") for word in statuses)


@every_case("origin", ["https://app.foxglove.dev", "file://"])
def test_foxglove_itself_is_let_in(kept_feed, origin):
    headers = {"Origin": origin}
    with connect(kept_feed.answer["address"], subprotocols=[SDK], additional_headers=headers) as viewer:
        assert json.loads(viewer.recv(timeout=PATIENCE_S))["op"] == "serverInfo"


@pytest.mark.slow
def test_what_is_not_a_subscription_is_an_error_and_the_others_go_on(feed):
    good = Viewer(feed)
    for sent in (
        "x",
        b"\x99" * 100,
        '{"op":"subscribe"}',
        '{"op":"subscribe","subscriptions":[{"id":1,"channelId":99}]}',
        '{"op":"fetchAsset","uri":"package://../../etc/passwd","requestId":1}',
        '{"op":"setParameters","parameters":[{"name":"x","value":1}]}',
    ):
        with connect(feed.answer["address"], subprotocols=[SDK]) as bad:
            bad.send(sent)
            said = [json.loads(bad.recv(timeout=PATIENCE_S)) for _ in range(3)]
        assert said[-1]["op"] == "status", sent
    # More than any subscription.
    with closing(opened(feed)) as bad:
        with suppress(ConnectionClosed):
            bad.send("x" * (2 << 20))
        messages_until_the_end(bad)
    shown(feed)
    good.wait_for_all()
    feed.close()
    check_complete(good.ended())


@pytest.mark.slow
def test_a_viewer_that_stalls_is_dropped_and_no_tick_waits(feed):
    stalled, good = opened(feed), Viewer(feed)
    feed.opened(device())
    feed.take(reading(0), SQUEEZE, COMMAND)
    channels = []
    while len(channels) < 4:
        channels += json.loads(stalled.recv(timeout=PATIENCE_S)).get("channels", ())
    wanted = [{"id": channel["id"], "channelId": channel["id"]} for channel in channels]
    stalled.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    n = 120_000
    for k in range(1, n):
        feed.take(reading(k), SQUEEZE, COMMAND)
        if k % 1000 == 999:
            good.wait_for("/grasp/tick", k + 1)
    assert feed.dropped == 0
    assert messages_until_the_end(stalled) < 4 * n
    feed.close()
    check_complete(good.ended(), n)


def test_the_layouts_show_fields_that_a_recording_has():
    folder = files("graspsense.live")
    layout = json.loads((folder / "foxglove_layout.json").read_text())
    panels = layout["configById"]
    paths = [series["value"] for panel in panels.values() for series in panel.get("paths", ())]
    paths += [panel["xAxisPath"]["value"] for panel in panels.values() if "xAxisPath" in panel]
    root = ElementTree.fromstring((folder / "plotjuggler_layout.xml").read_text())
    curves = [curve.get("name") for curve in root.iter("curve")]
    for shown_paths, between in ((paths, "."), (curves, "/")):
        assert {"gap_m", "force_left_n", "effort_n", "phase"} <= {
            path.removeprefix(f"/grasp/tick{between}") for path in shown_paths
        }
        assert {path.removeprefix(f"/grasp/tick{between}") for path in shown_paths} <= set(TICK_FIELDS)

    def leaves(place):
        return [place] if isinstance(place, str) else [*leaves(place["first"]), *leaves(place["second"])]

    assert sorted(leaves(layout["layout"])) == sorted(panels)
