"""The WebSocket server of a process that shows live grasps: whom it lets in, how it begins, and how it ends."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, Generic, TypeVar

from websockets.asyncio.server import ServerConnection, serve
from websockets.http11 import Request, Response

from graspsense.live.admission import FLUSH_S, MOST_CONNECTIONS, SHAKE_TIMEOUT_S, Address, say, why_not

PartT = TypeVar("PartT")


class LimitedConnection(ServerConnection):  # type: ignore[misc, unused-ignore]
    """A connection that is closed at once if there are too many."""

    connected = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Count a connection."""
        LimitedConnection.connected += 1
        super().connection_made(transport)
        if LimitedConnection.connected > MOST_CONNECTIONS:
            self.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Count one less."""
        LimitedConnection.connected -= 1
        super().connection_lost(exc)


class ViewerServer(ABC, Generic[PartT]):
    """Serves viewers at this address the parts of grasps that come."""

    def __init__(self, address: Address) -> None:
        self.address = address

    @abstractmethod
    def answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the answer to an HTTP request; None lets a WebSocket open."""

    @abstractmethod
    async def show(self, viewer: ServerConnection) -> None:
        """Show the grasp to a viewer until its connection ends."""

    @abstractmethod
    def pass_on(self, part: PartT) -> None:
        """Hand what has come to every viewer."""

    @abstractmethod
    async def end(self) -> None:
        """Let the viewers take what is left, for a short time. Raises TimeoutError."""

    async def serve(self, option: str, port: int, incoming: Iterator[PartT], **settings: Any) -> None:
        """Serve while parts come in. Print one line of JSON: the address, or why there is none.

        `option` is that of the command line that names the address, and `settings` are further ones of `websockets`.
        """
        host, loop = self.address.host, asyncio.get_running_loop()
        try:
            server = await serve(
                self.show,
                host,
                port,
                process_request=self.answer,
                create_connection=LimitedConnection,
                compression=None,
                server_header=None,
                open_timeout=SHAKE_TIMEOUT_S,
                close_timeout=FLUSH_S,
                **settings,
            )
        except OSError as error:
            say({"error": why_not(option, host, port, error)})
            return
        async with server:
            self.address.port = next(iter(server.sockets)).getsockname()[1]
            say({"address": self.address.text})
            while (part := await loop.run_in_executor(None, next, incoming, None)) is not None:
                self.pass_on(part)
            with suppress(TimeoutError):
                await self.end()
