"""A ROS 2 node through zenoh, as rmw_zenoh makes one; no ROS installation is needed."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher

from graspsense.plugin_api import ConfigError
from graspsense_ros2.names import (
    LATCHED,
    VOLATILE,
    Kind,
    NodeNames,
    attachment,
    gid_of,
    key_expression,
    publishers_of,
    sequence_and_gid,
    type_in,
)
from graspsense_ros2.node import MOST_REQUESTS, ServiceFailed, domain_from_environment

CONFIG_FILE: Final = "ZENOH_SESSION_CONFIG_URI"
CONFIG_OVERRIDE: Final = "ZENOH_CONFIG_OVERRIDE"
"""Environment variables of rmw_zenoh: a file for zenoh, and single settings as in `a/b=1;c/d="x"`."""
SESSION: Final[Mapping[str, Any]] = {
    "mode": "peer",
    "connect/endpoints": ["tcp/localhost:7447"],
    "connect/timeout_ms": -1,
    "connect/exit_on_failure": False,
    "listen/endpoints": ["tcp/localhost:0"],
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": True,
    "timestamping/enabled": True,
}
"""The settings with which rmw_zenoh opens a session, as far as they differ from those of zenoh."""
LISTING_S: Final = 1.0
"""Longest wait for the names of publishers."""
LOOK_AGAIN_S: Final = 0.01
_ENCODING: Final = zenoh.Encoding("application/cdr")


class ZenohNode:
    """A node in a session of its own. Raises ConfigError if zenoh does not accept the settings."""

    def __init__(self, name: str) -> None:
        domain = domain_from_environment()
        try:
            self._session = zenoh.open(_config())
        except zenoh.ZError as error:
            raise ConfigError(f"zenoh opens no session: {error}. Look at {CONFIG_OVERRIDE}") from error
        self._names = NodeNames(domain, str(self._session.info.zid()), name)
        self._declared: list[Any] = [self._session.liveliness().declare_token(self._names.token())]
        self._number = 0

    def publisher(self, topic: str, type_name: str, latched: bool = False) -> Callable[[bytes], None]:
        """Return what publishes a message; a latched topic keeps its last one for who comes later."""
        key = key_expression(self._names.domain, topic, type_name)
        gid = self._announce("MP", topic, type_name, LATCHED if latched else VOLATILE)
        publisher: Any
        if latched:
            cache = CacheConfig(1)
            publisher = declare_advanced_publisher(
                self._session, key, encoding=_ENCODING, cache=cache, publisher_detection=True
            )
        else:
            # A grasp is published from a process of its own, which may wait: zenoh drops what comes too fast.
            block = zenoh.CongestionControl.BLOCK
            publisher = self._session.declare_publisher(key, encoding=_ENCODING, congestion_control=block)
        self._declared.append(publisher)
        sequence = 0

        def publish(data: bytes) -> None:
            nonlocal sequence
            sequence += 1
            publisher.put(data, attachment=attachment(sequence, time.time_ns(), gid))

        return publish

    def subscribe(self, topic: str, type_name: str, take: Callable[[bytes], None]) -> None:
        """Call `take` with each message of a topic."""
        key = key_expression(self._names.domain, topic, type_name)
        self._announce("MS", topic, type_name, VOLATILE)
        self._declared.append(
            self._session.declare_subscriber(key, lambda sample: take(sample.payload.to_bytes()))
        )

    def types_of(self, topic: str) -> Sequence[str]:
        """Return the types that a topic is published with."""
        replies = self._session.liveliness().get(publishers_of(self._names.domain, topic), timeout=LISTING_S)
        types = (type_in(str(reply.ok.key_expr)) for reply in replies if reply.ok is not None)
        return tuple(dict.fromkeys(filter(None, types)))

    def service(self, name: str, type_name: str, answer: Callable[[bytes], bytes]) -> None:
        """Answer each request; one for which `answer` raises gets an error."""
        key = key_expression(self._names.domain, name, type_name)
        free = threading.Semaphore(MOST_REQUESTS)

        def answer_query(query: zenoh.Query) -> None:
            try:
                assert query.payload is not None
                assert query.attachment is not None
                sequence, gid = sequence_and_gid(query.attachment.to_bytes())
                data = answer(query.payload.to_bytes())
                query.reply(
                    key, data, encoding=_ENCODING, attachment=attachment(sequence, time.time_ns(), gid)
                )
            except Exception as error:
                query.reply_err(f"{type(error).__name__}: {error}".encode())
            finally:
                query.drop()  # type: ignore[no-untyped-call, unused-ignore]
                free.release()

        def take(query: zenoh.Query) -> None:
            if query.payload is None or query.attachment is None:
                query.reply_err(b"a request has a payload and an attachment")
            elif not free.acquire(blocking=False):
                query.reply_err(f"{MOST_REQUESTS} requests are being answered already".encode())
            else:
                threading.Thread(target=answer_query, args=(query,), daemon=True).start()

        self._announce("SS", name, type_name, VOLATILE)
        self._declared.append(self._session.declare_queryable(key, take, complete=True))

    def client(self, name: str, type_name: str) -> Callable[[bytes, float], bytes]:
        """Return what sends a request and waits so many seconds for the answer. It raises ServiceFailed."""
        key = key_expression(self._names.domain, name, type_name)
        gid = self._announce("SC", name, type_name, VOLATILE)
        querier: Any = self._session.declare_querier(key, target=zenoh.QueryTarget.ALL_COMPLETE)
        self._declared.append(querier)
        sequence = 0

        def ask(request: bytes, timeout_s: float) -> bytes:
            nonlocal sequence
            sequence += 1
            until = time.monotonic() + timeout_s
            while not querier.matching_status.matching and time.monotonic() < until:
                time.sleep(LOOK_AGAIN_S)
            replies = self._session.get(
                key,
                payload=request,
                encoding=_ENCODING,
                attachment=attachment(sequence, time.time_ns(), gid),
                target=zenoh.QueryTarget.ALL_COMPLETE,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=max(until - time.monotonic(), LOOK_AGAIN_S),
            )
            for reply in replies:
                if reply.ok is not None:
                    data: bytes = reply.ok.payload.to_bytes()
                    return data
                assert reply.err is not None
                said = reply.err.payload.to_bytes()[:200].decode(errors="replace")
                raise ServiceFailed(f"{name} refuses: {said}")
            raise ServiceFailed(f"{name} does not answer")

        return ask

    def close(self) -> None:
        """Leave the network: the tokens first, so that nobody asks for what is ending."""
        declared, self._declared = self._declared, []
        for each in declared:
            each.undeclare()
        if declared:
            self._session.close()  # type: ignore[no-untyped-call, unused-ignore]

    def _announce(self, kind: Kind, name: str, type_name: str, quality: str) -> bytes:
        """Declare the token of an endpoint, and return its gid."""
        self._number += 1
        token = self._names.endpoint(self._number, kind, name, type_name, quality)
        self._declared.append(self._session.liveliness().declare_token(token))
        return gid_of(token)


def _config() -> zenoh.Config:
    """Return the settings of a session. Raises ConfigError, zenoh.ZError."""
    path = os.environ.get(CONFIG_FILE, "").strip()
    if path:
        config = zenoh.Config.from_file(path)
    else:
        config = zenoh.Config()
        for key, value in SESSION.items():
            config.insert_json5(key, json.dumps(value))
    for setting in filter(str.strip, os.environ.get(CONFIG_OVERRIDE, "").split(";")):
        key, equals, text = setting.partition("=")
        if not equals:
            raise ConfigError(f"{CONFIG_OVERRIDE} has {setting!r}: write KEY=VALUE, separated by semicolons")
        config.insert_json5(key.strip(), text.strip())
    return config
