"""The connections of browsers as uvicorn holds them, with bounds that it does not know.

Whoever reads slowly, never ends a request, or asks for a thousand pongs costs a few kilobytes and a
socket for a while, and then no more.
"""

import asyncio
import socket
import struct
from collections import Counter
from collections.abc import Callable
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode, Frame, Opcode
from websockets.protocol import State

from race_server.errors import GatewayError
from race_server.live.gateway.limits import (
    ABORT_S,
    BYTES_HZ,
    MOST_CONNECTIONS,
    MOST_CONNECTIONS_OF_ADDRESS,
    MOST_PIECES,
    RateLimiter,
)
from race_server.live.gateway.origins import is_loopback

# So much waits in this process for a browser that reads slowly [bytes]; then only the newest is
# kept for it. As much again may wait in the kernel.
WRITE_BUFFER = 16_384
# Pongs and closing words go past that bound; who makes us pile up so much is no browser.
MOST_BUFFERED = 1 << 20
# A connection that has not become a WebSocket is over after so long; browsers open another.
REQUEST_S = 60.0
# Lingers for no time.
AT_ONCE = struct.pack("ii", 1, 0)
# The name under which the application finds the connection of a WebSocket.
PIPE = "race.pipe"


def frame_of(payload: bytes | str) -> bytes:
    """Return a message as it goes to every browser: written once for all of them."""
    if isinstance(payload, str):
        return Frame(Opcode.TEXT, payload.encode()).serialize(mask=False)
    return Frame(Opcode.BINARY, payload).serialize(mask=False)


class WebSocketConnection(WebSocketsSansIOProtocol):
    """A WebSocket into which frames may be put that were written once for everybody."""

    on_writable: Callable[[], None] | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Bound what may wait."""
        super().connection_made(transport)
        self.transport.set_write_buffer_limits(high=WRITE_BUFFER)
        self._bytes = RateLimiter(BYTES_HZ, "bytes")

    async def run_asgi(self) -> None:
        """Let the application find this connection, and end it for sure after that."""
        extensions: dict[str, Any] = self.scope["extensions"] or {}
        extensions[PIPE] = self
        try:
            await super().run_asgi()
        finally:
            self.loop.call_later(ABORT_S, self._abort)

    def _abort(self) -> None:
        """End a connection that does not end by itself, and what the kernel keeps for it."""
        if self.disconnected:
            return
        line = self.transport.get_extra_info("socket")
        if line is not None:
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, AT_ONCE)
        self.transport.abort()

    def data_received(self, data: bytes) -> None:
        """Hear no more from a browser that takes no answers, or does not stop talking."""
        if self.transport.get_write_buffer_size() > MOST_BUFFERED:
            self._abort()
            return
        try:
            self._bytes.spend(len(data))
        except GatewayError as error:
            self._fail(CloseCode.POLICY_VIOLATION, str(error))
            return
        super().data_received(data)
        if self.conn.handshake_exc is not None and not self.handshake_initiated:
            # uvicorn says nothing to a request that cannot be read, and waits for ever.
            self.transport.write(b"".join(self.conn.data_to_send()))
            self.transport.close()

    def handle_cont(self, event: Frame) -> None:
        """Hear no message that comes in pieces without end, each of them nothing."""
        if len(self.frames) < MOST_PIECES:
            super().handle_cont(event)
        elif not self.close_sent:
            self._fail(CloseCode.MESSAGE_TOO_BIG, f"more than {MOST_PIECES} pieces")

    def send_receive_event_to_app(self) -> None:
        """End whoever sends a text that is none; uvicorn would fill the log with each."""
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
        """Take note that there is room again."""
        super().resume_writing()
        if self.on_writable is not None:
            self.on_writable()

    @property
    def is_open(self) -> bool:
        """Whether frames still go out."""
        return not (self.disconnected or self.close_sent or self.transport.is_closing())

    @property
    def is_writable(self) -> bool:
        """Whether there is room for another frame."""
        return self.writable.is_set()

    def put(self, frame: bytes) -> None:
        """Send a frame; look at `is_open` and `is_writable` first."""
        self.transport.write(frame)


class ConnectionLimiter:
    """How many connections are open, and from where."""

    def __init__(self, most: int = MOST_CONNECTIONS) -> None:
        """Begin with none. most: of all addresses."""
        self._most = most
        self._of: Counter[str] = Counter()

    def enter(self, host: str) -> bool:
        """Let a connection in, if there is room."""
        is_full = self._of.total() >= self._most
        crowded = self._of[host] >= MOST_CONNECTIONS_OF_ADDRESS and not is_loopback(host)
        if is_full or crowded:
            return False
        self._of[host] += 1
        return True

    def leave(self, host: str) -> None:
        """Let a connection go."""
        self._of[host] -= 1
        if not self._of[host]:
            del self._of[host]


class PendingConnection(H11Protocol):
    """A connection before it becomes a WebSocket, if it does."""

    def __init__(self, *words: Any, porch: ConnectionLimiter, **named: Any) -> None:
        """Stand on a porch."""
        super().__init__(*words, **named)
        self._porch = porch
        self._host = ""
        self._end: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Come in, if there is room, for a while."""
        super().connection_made(transport)
        host = self.client[0] if self.client else ""
        if not self._porch.enter(host):
            transport.abort()
            return
        self._host = host
        self._end = self.loop.call_later(REQUEST_S, transport.abort)

    def connection_lost(self, exc: Exception | None) -> None:
        """Make room for others."""
        super().connection_lost(exc)
        self._leave()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Make room for others: WebSockets are counted where they say who they are."""
        self._leave()
        super().handle_websocket_upgrade(event)

    def _leave(self) -> None:
        if self._end is not None:
            self._end.cancel()
            self._end = None
            self._porch.leave(self._host)


def _is_utf8(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True
