"""The only file that stands on uvicorn's protocol classes, which are no public API.

They are subclassed to add bounds that uvicorn does not have: a browser that reads slowly, never
ends a request, or asks for a thousand pongs costs a few kilobytes and a socket for a while, and
then no more. `tests/live/test_uvicorn.py` fails when the source of these classes changes, and says
what to do then.
"""

import asyncio
import re
import socket
import struct
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode, Frame
from websockets.protocol import State

from race_server.errors import GatewayError
from race_server.live.gateway.connection_limiter import ConnectionLimiter, is_always_idle
from race_server.live.gateway.limits import GatewayLimits, GatewayTiming, RateLimiter

# What is used of uvicorn's classes and not overridden here: attributes and methods.
USED_OF_WEBSOCKET = (
    *("close_sent", "conn", "curr_msg_data_type", "disconnected", "frames"),
    *("handle_parser_exception", "handshake_initiated", "loop", "scope", "transport", "writable"),
)
USED_OF_HTTP = ("client", "cycle", "loop", "transport")
# A line that ends without a carriage return, or goes on in the next: a proxy may read such a head
# as another request. In its place h11 gets what it refuses.
LENIENT, ILLEGAL = re.compile(rb"[^\r]\n|\n[ \t]"), b"\0\r\n\r\n"
# Socket option: lingers for no time.
NO_LINGER = struct.pack("ii", 1, 0)
# The extension of the scope under which the application finds the connection of a WebSocket.
CONNECTION = "race.connection"


class WebSocketConnection(WebSocketsSansIOProtocol):
    """A WebSocket that takes whole frames, encoded once for all browsers."""

    on_writable: Callable[[], None] | None = None

    def __init__(
        self,
        *args: Any,
        limits: GatewayLimits,
        timing: GatewayTiming,
        limiter: ConnectionLimiter,
        **named: Any,
    ) -> None:
        """Take the bounds; all else is for uvicorn. limiter: counts it until it is admitted."""
        super().__init__(*args, **named)
        self._limits, self._timing, self._limiter = limits, timing, limiter

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Bound what may wait."""
        super().connection_made(transport)
        self._limiter.watch(self.transport, is_always_idle)
        limits = self._limits
        self.transport.set_write_buffer_limits(high=limits.write_buffer_bytes)
        self._bytes = RateLimiter(limits.bytes_hz, "bytes", limits.burst_s)

    def connection_lost(self, exc: Exception | None) -> None:
        """Count the connection no longer."""
        self.on_admitted()
        super().connection_lost(exc)

    def on_admitted(self) -> None:
        """Count the connection no longer: from now on it counts as a browser."""
        self._limiter.leave(self.transport)

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
        self,
        *args: Any,
        limiter: ConnectionLimiter,
        timing: GatewayTiming,
        refuse: Callable[[GatewayError, str], None],
        **named: Any,
    ) -> None:
        """Take the bounds; all else is for uvicorn.

        limiter: counts all of these; refuse: is called with each request that cannot be read, and
        the address that sent it.
        """
        super().__init__(*args, **named)
        self._limiter, self._timing, self._refuse = limiter, timing, refuse
        self._end: asyncio.TimerHandle | None = None
        self._has_asked = False
        self._newest = b""  # byte

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Let the limiter watch the connection, and set its first timeout."""
        super().connection_made(transport)
        self._limiter.watch(transport, self._is_idle)
        self._end_after(self._timing.first_request_s)

    def data_received(self, data: bytes) -> None:
        """Receive, unless two programs could read it as different requests."""
        if LENIENT.search(self._newest + data):
            data = ILLEGAL
        self._newest = data[-1:]
        super().data_received(data)
        if self.cycle is not None and not self._has_asked:
            self._has_asked = True
            self._end_after(self._timing.request_s)

    def send_400_response(self, msg: str) -> None:
        """Answer a request that cannot be read; log it, but not each."""
        self._refuse(GatewayError("malformed", msg), self.client[0] if self.client else "")
        super().send_400_response(msg)

    def connection_lost(self, exc: Exception | None) -> None:
        """Count the connection no longer."""
        self._limiter.leave(self.transport)
        self._end_after(None)
        super().connection_lost(exc)

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Become a WebSocket, which is counted until it is admitted and has other timeouts."""
        self._end_after(None)
        super().handle_websocket_upgrade(event)

    def _is_idle(self) -> bool:
        """Return whether no answer is on its way."""
        return self.cycle is None or self.cycle.response_complete

    def _end_after(self, seconds: float | None) -> None:
        """Set the timeout of the connection; None for none."""
        if self._end is not None:
            self._end.cancel()
        self._end = None
        if seconds is not None:
            self._end = self.loop.call_later(seconds, self.transport.abort)


def _is_utf8(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True
