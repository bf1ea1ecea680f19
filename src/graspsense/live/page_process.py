"""The process that serves the page of live grasps: HTTP and a WebSocket on one port, under a random token.

It reads the messages of a `Feed` on its standard input. Nothing that a viewer sends is used: a viewer that sends
anything, or that does not take what it is sent, is dropped.

    python -m graspsense.live.page_process HOST PORT
"""

from __future__ import annotations

import asyncio
import json
import sys
from collections import deque
from contextlib import suppress
from http import HTTPStatus
from importlib.resources import files
from typing import Final

from websockets.asyncio.server import ServerConnection, broadcast
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from graspsense.core.values.json_values import json_ready
from graspsense.live.admission import (
    FLUSH_S,
    HISTORY_BYTES,
    MOST_VIEWERS,
    Address,
    viewer_refusal,
)
from graspsense.live.stream import Message, batches
from graspsense.live.viewer_server import ViewerServer
from graspsense.recording.layout import TICK_FIELDS
from graspsense.recording.wire_messages import leave_control_alone

WAITING_BYTES: Final = 8 << 20
"""Bytes that may wait for a viewer before it is dropped, beside those with which it began."""
LARGEST_MESSAGE: Final = 1024
FILES: Final = {"": "text/html", "page.js": "text/javascript", "curves.js": "text/javascript"}
POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
STICKY: Final = ("grasp", "stored", "progress", "prediction", "outcome")
"""Messages of which a viewer who comes later needs the newest."""
_SHOWN: Final = (
    "t_s",
    "gap_m",
    "effort_n",
    "force_left_n",
    "force_right_n",
    "command",
    "command_kind",
    "phase",
)
_LEFT_OUT: Final = tuple(name for name in TICK_FIELDS if name not in _SHOWN)


class History:
    """What a viewer needs who comes during a grasp: the newest of some messages, and the running grasp."""

    def __init__(self) -> None:
        self._newest: dict[str, str] = {}
        self._texts: deque[str] = deque()
        self._size = 0

    def add(self, messages: list[Message]) -> str:
        """Keep the messages and return them as the text for a viewer."""
        for message in messages:
            if message["kind"] == "ticks":
                for name in _LEFT_OUT:
                    message.pop(name, None)
        ready = [json_ready(message) for message in messages]
        began = [k for k, message in enumerate(ready) if message["kind"] == "grasp"]
        if began:
            self._texts.clear()
            self._size = 0
            self._newest = {k: text for k, text in self._newest.items() if k in ("progress", "stored")}
        for message in ready[began[-1] if began else 0 :]:
            if message["kind"] in STICKY:
                self._newest[message["kind"]] = json.dumps(message)
            elif message["kind"] == "image":
                text = json.dumps(message)
                self._newest.setdefault(f"first image {message['name']}", text)
                self._newest[f"image {message['name']}"] = text
            else:
                self._keep(json.dumps(message))
        return json.dumps(ready)

    def _keep(self, text: str) -> None:
        self._texts.append(text)
        self._size += len(text)
        while self._size > HISTORY_BYTES:
            self._size -= len(self._texts.popleft())

    def text(self) -> str:
        """Return all of it as the text for a viewer."""
        head = [self._newest["grasp"]] if "grasp" in self._newest else []
        others = [text for kind, text in self._newest.items() if kind != "grasp"]
        return f"[{','.join([*head, *self._texts, *others])}]"


class LivePage(ViewerServer[list[Message]]):
    """The page under its token, and the viewers that are connected to it."""

    def __init__(self, host: str) -> None:
        super().__init__(Address("http", host))
        self.history = History()
        self.viewers: dict[ServerConnection, int] = {}
        """Each viewer, with the bytes that may wait for it."""
        folder = files("graspsense.live")
        self._files = {name: (folder / (name or "page.html")).read_bytes() for name in FILES}

    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the answer to an HTTP request; None lets a WebSocket open."""
        folder, _, name = request.path.removeprefix("/").partition("/")
        refusal = self.address.refusal(folder, request.headers)
        if refusal is None and name == "frames":
            own = f"http://{request.headers.get('Host', '')}"
            refusal = viewer_refusal(request.headers, own.__eq__, len(self.viewers))
            if refusal is None:
                return None
        if refusal is not None:
            return connection.respond(*refusal)
        if name not in FILES:
            return connection.respond(HTTPStatus.NOT_FOUND, "no such page\n")
        body = self._files[name]
        headers = Headers(
            {
                "Content-Type": f"{FILES[name]}; charset=utf-8",
                "Content-Length": str(len(body)),
                "Content-Security-Policy": POLICY,
                "Referrer-Policy": "no-referrer",
                "X-Content-Type-Options": "nosniff",
                "Cache-Control": "no-store",
                "Connection": "close",
            }
        )
        return Response(HTTPStatus.OK, "OK", headers, body)

    async def show(self, viewer: ServerConnection) -> None:
        """Show everything to a viewer until it leaves, or says something, for which it is dropped."""
        if len(self.viewers) >= MOST_VIEWERS:
            return
        text = self.history.text()
        self.viewers[viewer] = WAITING_BYTES + len(text)
        broadcast([viewer], text)
        try:
            with suppress(ConnectionClosed):
                await viewer.recv()
                viewer.transport.abort()
        finally:
            del self.viewers[viewer]

    def pass_on(self, messages: list[Message]) -> None:
        """Hand messages to every viewer; one that has not taken those before is dropped."""
        broadcast(self.viewers, self.history.add(messages))
        for viewer, most in self.viewers.items():
            if viewer.transport.get_write_buffer_size() > most:
                viewer.transport.abort()

    async def end(self) -> None:
        """Let the viewers take what is left, for a short time."""
        async with asyncio.timeout(FLUSH_S):
            await asyncio.gather(*(viewer.close() for viewer in self.viewers))


def main(host: str, port: str) -> int:
    """Serve the page until the input ends."""
    leave_control_alone()
    page = LivePage(host)
    settings = {"max_size": LARGEST_MESSAGE, "max_queue": 1, "ping_interval": 10, "ping_timeout": 10}
    asyncio.run(page.serve("--live-address", int(port), batches(0), **settings))
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
