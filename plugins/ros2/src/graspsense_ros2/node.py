"""A ROS 2 node as the parts of this package use it: messages are bytes in CDR, whoever carries them."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Final, Protocol

from graspsense.plugin_api import ConfigError

MOST_DOMAIN: Final = 232
MOST_REQUESTS: Final = 32
"""Requests that a node answers at a time; a further one is refused."""


class ServiceFailed(Exception):
    """A service that does not answer, or that refuses."""


class Node(Protocol):
    """A node, open until `close`. Handlers are called in threads of their own."""

    def publisher(self, topic: str, type_name: str, latched: bool = False) -> Callable[[bytes], None]:
        """Return what publishes a message; a latched topic keeps its last one for who comes later."""

    def subscribe(self, topic: str, type_name: str, take: Callable[[bytes], None]) -> None:
        """Call `take` with each message of a topic."""

    def types_of(self, topic: str) -> Sequence[str]:
        """Return the types that a topic is published with; empty if nobody publishes it."""

    def service(self, name: str, type_name: str, answer: Callable[[bytes], bytes]) -> None:
        """Answer each request; one for which `answer` raises gets an error or no answer."""

    def client(self, name: str, type_name: str) -> Callable[[bytes, float], bytes]:
        """Return what sends a request and waits so many seconds for the answer. It raises ServiceFailed."""

    def close(self) -> None:
        """Leave the network."""


def domain_from_environment() -> int:
    """Return ROS_DOMAIN_ID, 0 if it is not set. Raises ConfigError."""
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not (text.isascii() and text.isdecimal() and int(text) <= MOST_DOMAIN):
        raise ConfigError(f"ROS_DOMAIN_ID is {text!r}: set it to a number from 0 to {MOST_DOMAIN}")
    return int(text)
