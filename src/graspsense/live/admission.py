"""Who may look at live grasps: a token in the address, the origins of pages, and how many may connect."""

from __future__ import annotations

import errno
import json
import secrets
import sys
from collections.abc import Callable
from http import HTTPStatus
from typing import Any, Final, Protocol

MOST_VIEWERS: Final = 16
MOST_CONNECTIONS: Final = 64
"""Connections at a time, with those that have not asked for anything yet; further ones are closed."""
SHAKE_TIMEOUT_S: Final = 5.0
FLUSH_S: Final = 2.0
"""How long viewers may take what is left when the grasping program has ended."""
HISTORY_BYTES: Final = 16 << 20
"""Bytes of the running grasp that are kept for viewers who come later; of a longer grasp they see the end."""
LOOPBACK: Final = ("127.0.0.1", "localhost", "[::1]")

Refusal = tuple[HTTPStatus, str]


class Headers(Protocol):
    """The headers of a request."""

    def get(self, name: str, default: str, /) -> str:
        """Return a header, or the default."""


class Address:
    """The address that is printed for viewers, with its token."""

    def __init__(self, scheme: str, host: str) -> None:
        self._scheme, self.host = scheme, host
        self.port, self.token = 0, secrets.token_urlsafe(24)

    @property
    def text(self) -> str:
        """The address to open."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self._scheme}://{host}:{self.port}/{self.token}/"

    def refusal(self, token: str, headers: Headers) -> Refusal | None:
        """Return why a request with this token is not answered; None if it is."""
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            return HTTPStatus.NOT_FOUND, "wrong address: open the one that graspsense printed\n"
        host = headers.get("Host", "")
        if self.host in LOOPBACK and host not in {f"{name}:{self.port}" for name in LOOPBACK}:
            return HTTPStatus.FORBIDDEN, "wrong host\n"
        return None


def viewer_refusal(headers: Headers, is_known_origin: Callable[[str], bool], viewers: int) -> Refusal | None:
    """Return why a viewer beside so many others may not look; None if it may."""
    origin = headers.get("Origin", "")
    if origin and not is_known_origin(origin):
        return HTTPStatus.FORBIDDEN, "wrong origin\n"
    if viewers >= MOST_VIEWERS:
        return HTTPStatus.SERVICE_UNAVAILABLE, f"{MOST_VIEWERS} viewers already\n"
    return None


def why_not(option: str, host: str, port: int, error: OSError) -> str:
    """Return why an address cannot be listened on, as a message about the option that named it."""
    if error.errno == errno.EADDRINUSE:
        return f"{option}: port {port} of {host} is taken: name another one, or leave it out for a free one"
    place, why = f"{host}, port {port}" if port else host, error.strerror or error
    return f"{option}: cannot listen on {place}: {why}. Name an address of this machine, as in 127.0.0.1:8700"


def say(answer: dict[str, Any]) -> None:
    """Print a line of JSON for the grasping program: what was found, or `error`."""
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()
