"""A node through zenoh: its router, and what others ask of it that is no request."""

import json
import threading

import pytest
import zenoh
from routers import free_port, opened_router

from graspsense_ros2.message_types import encode
from graspsense_ros2.names import key_expression
from graspsense_ros2.node import MOST_REQUESTS, ServiceFailed
from graspsense_ros2.zenoh_node import ZenohNode

PATIENCE_S = 120.0
TRIGGER = "std_srvs/srv/Trigger"
REQUEST = encode(f"{TRIGGER}_Request", {})
RESPONSE = encode(f"{TRIGGER}_Response", {"success": True})


@pytest.mark.slow
def test_a_router_that_comes_later_is_found(monkeypatch):
    port = free_port()
    monkeypatch.setenv("ZENOH_CONFIG_OVERRIDE", f'connect/endpoints=["tcp/127.0.0.1:{port}"]')
    node = ZenohNode("early")
    appeared = threading.Event()
    _, router = opened_router(port)
    try:
        router.liveliness().declare_subscriber("@ros2_lv/**", lambda sample: appeared.set(), history=True)
        assert appeared.wait(PATIENCE_S)
    finally:
        node.close()
        router.close()


@pytest.mark.slow
def test_more_requests_than_are_answered_at_a_time_are_refused(router):
    server, clients = ZenohNode("server"), ZenohNode("client")
    go_on, begun = threading.Event(), threading.Semaphore(0)

    def answer(request):
        begun.release()
        assert go_on.wait(PATIENCE_S)
        return RESPONSE

    server.service("/slow", TRIGGER, answer)
    ask = clients.client("/slow", TRIGGER)
    answers = []
    waiting = [
        threading.Thread(target=lambda: answers.append(ask(REQUEST, PATIENCE_S)))
        for _ in range(MOST_REQUESTS)
    ]
    try:
        for thread in waiting:
            thread.start()
        for _ in waiting:
            assert begun.acquire(timeout=PATIENCE_S)
        with pytest.raises(ServiceFailed, match=str(MOST_REQUESTS)):
            ask(REQUEST, PATIENCE_S)
        go_on.set()
        for thread in waiting:
            thread.join(PATIENCE_S)
        assert answers == [RESPONSE] * MOST_REQUESTS
    finally:
        go_on.set()
        server.close()
        clients.close()


def test_a_request_without_a_sound_attachment_is_refused(router):
    server = ZenohNode("server")
    server.service("/asked", TRIGGER, lambda request: RESPONSE)
    config = zenoh.Config()
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{router}"]))
    config.insert_json5("scouting/multicast/enabled", "false")
    stranger = zenoh.open(config)
    try:
        key = key_expression(0, "/asked", TRIGGER)
        for attachment in (None, b"", b"\0" * 16, b"\0" * 33):
            replies = []
            # The stranger does not know the server until the router has told it.
            while not replies:
                replies = list(stranger.get(key, payload=REQUEST, attachment=attachment, timeout=PATIENCE_S))
            assert all(reply.ok is None for reply in replies)
    finally:
        stranger.close()
        server.close()
