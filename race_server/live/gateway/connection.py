"""The only file that stands on uvicorn's protocol classes, which are no public API.

They are subclassed to add bounds that uvicorn does not have: a browser that reads slowly, never
ends a request, or asks for a thousand pongs costs a few kilobytes and a socket for a while, and
then no more. `tests/live/test_uvicorn.py` fails when the source of these classes changes, and says
what to do then.
"""

import asyncio
import socket
import struct
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode, Frame
from websockets.protocol import State

from race_server.errors import GatewayError
from race_server.live.gateway.limits import (
    ConnectionLimiter,
    GatewayLimits,
    GatewayTiming,
    RateLimiter,
)

# What is used of uvicorn's classes and not overridden here: attributes and methods.
USED_OF_WEBSOCKET = (
    *("close_sent", "conn", "curr_msg_data_type", "disconnected", "frames"),
    *("handle_parser_exception", "handshake_initiated", "loop", "scope", "transport", "writable"),
)
USED_OF_HTTP = ("client", "loop")
# Socket option: lingers for no time.
NO_LINGER = struct.pack("ii", 1, 0)
# The extension of the scope under which the application finds the connection of a WebSocket.
CONNECTION = "race.connection"


class WebSocketConnection(WebSocketsSansIOProtocol):
    """A WebSocket that takes whole frames, encoded once for all browsers."""

    on_writable: Callable[[], None] | None = None

    def __init__(
        self, *args: Any, limits: GatewayLimits, timing: GatewayTiming, **named: Any
    ) -> None:
        """Take the bounds; all else is for uvicorn."""
        super().__init__(*args, **named)
        self._limits, self._timing = limits, timing

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Bound what may wait."""
        super().connection_made(transport)
        limits = self._limits
        self.transport.set_write_buffer_limits(high=limits.write_buffer_bytes)
        self._bytes = RateLimiter(limits.bytes_hz, "bytes", limits.burst_s)

    async def run_asgi(self) -> None:
        """Show the application this connection, and end it for sure after that."""
        extensions: dict[str, Any] = self.scope["extensions"] or {}
        extensions[CONNECTION] = self
        try:
            await super().run_asgi()
        finally:
            self.loop.call_later(self._timing.abort_s, self._abort)

    def _abort(self) -> None:
        """End a connection that does not end by itself, and what the kernel keeps for it."""
        if self.disconnected:
            return
        line = self.transport.get_extra_info("socket")
        if line is not None:
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, NO_LINGER)
        self.transport.abort()

    def data_received(self, data: bytes) -> None:
        """Receive, unless the browser reads no answers or sends too much."""
        if self.transport.get_write_buffer_size() > self._limits.buffered_bytes:
            self._abort()
            return
        try:
            self._bytes.spend(len(data))
        except GatewayError as error:
            self._fail(CloseCode.POLICY_VIOLATION, str(error))
            return
        super().data_received(data)
        if self.conn.handshake_exc is not None and not self.handshake_initiated:
            # uvicorn does not answer a request that cannot be read, and waits without end.
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.transport.close()

    def handle_cont(self, event: Frame) -> None:
        """Receive a fragment, unless the message has too many: each of them may be empty."""
        if len(self.frames) < self._limits.fragments:
            super().handle_cont(event)
        elif not self.close_sent:
            self._fail(CloseCode.MESSAGE_TOO_BIG, f"more than {self._limits.fragments} pieces")

    def send_receive_event_to_app(self) -> None:
        """End a connection on which a text is not UTF-8; uvicorn would log each at length."""
        is_text = self.curr_msg_data_type == "text" and not self.close_sent
        if is_text and not _is_utf8(b"".join(self.frames)):
            self._fail(CloseCode.INVALID_DATA, "a text that is not UTF-8")
            return
        super().send_receive_event_to_app()

    def _fail(self, code: CloseCode, reason: str) -> None:
        """End a connection with a reason; one that is ending already, at once."""
        if self.close_sent or self.conn.state is not State.OPEN:
            self._abort()
            return
        self.conn.fail(code, reason)
        self.handle_parser_exception()

    def resume_writing(self) -> None:
        """Report that there is room again."""
        super().resume_writing()
        if self.on_writable is not None:
            self.on_writable()

    @property
    def is_open(self) -> bool:
        """Whether frames are still sent."""
        return not (self.disconnected or self.close_sent or self.transport.is_closing())

    @property
    def is_writable(self) -> bool:
        """Whether there is room for another frame."""
        return self.writable.is_set()

    def put(self, frame: bytes) -> None:
        """Send a frame; check `is_open` and `is_writable` first."""
        self.transport.write(frame)


class PendingConnection(H11Protocol):
    """A connection before it becomes a WebSocket, if it does."""

    def __init__(
        self, *args: Any, limiter: ConnectionLimiter, request_s: float, **named: Any
    ) -> None:
        """Take the bounds; all else is for uvicorn. limiter: counts all of these."""
        super().__init__(*args, **named)
        self._limiter, self._request_s = limiter, request_s
        self._host = ""
        self._end: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Count the connection, if there is room, and set its timeout."""
        super().connection_made(transport)
        host = self.client[0] if self.client else ""
        if not self._limiter.enter(host):
            transport.abort()
            return
        self._host = host
        self._end = self.loop.call_later(self._request_s, transport.abort)

    def connection_lost(self, exc: Exception | None) -> None:
        """Count the connection no longer."""
        super().connection_lost(exc)
        self._leave()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Count the connection no longer: WebSockets are counted when they have authenticated."""
        self._leave()
        super().handle_websocket_upgrade(event)

    def _leave(self) -> None:
        if self._end is not None:
            self._end.cancel()
            self._end = None
            self._limiter.leave(self._host)


def _is_utf8(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True
