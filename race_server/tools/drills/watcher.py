"""A browser that watches and counts snapshots, at a tenth of what reading them costs.

Of a frame it reads the head and the identifier: a thousand browsers leave the cores of a drill to
what is measured, gateways and server.
"""

import asyncio
import json
from typing import cast

from race_server.live.gateway.handshake import SUBPROTOCOL
from race_server.net.wire import topics

RATE = 30
# WebSocket (RFC 6455): kinds of frames, whole ones; a mask of zeros leaves the content as it is.
_TEXT, _PING, _PONG, _WHOLE, _MASKED, _MASK = 0x1, 0x9, 0xA, 0x80, 0x80, bytes(4)
_UPGRADE = (
    "GET /ws HTTP/1.1\r\nHost: {host}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: cmFjZSByYWNlIHJhY2Ugcg==\r\n"
    f"Sec-WebSocket-Protocol: {SUBPROTOCOL}\r\n\r\n"
)


class Watcher(asyncio.Protocol):
    """One browser."""

    def __init__(self, place: int) -> None:
        """Wait for a connection. place: number among others, in its name."""
        self.heard = 0  # snapshots
        self.is_there = False  # it was let in, and has not been sent away
        self._hello = {"role": "spectate", "rate": RATE, "name": f"watcher {place}"}
        self._upgraded = False
        self._unread = bytearray()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Ask for a WebSocket."""
        self._transport = cast("asyncio.Transport", transport)
        host, port = transport.get_extra_info("peername")[:2]
        self._transport.write(_UPGRADE.format(host=f"{host}:{port}").encode())

    def connection_lost(self, _error: Exception | None) -> None:
        """Count no more."""
        self.is_there = False

    def data_received(self, data: bytes) -> None:
        """Read all frames that are whole."""
        unread = self._unread
        unread += data
        if not self._upgraded:
            head, end, rest = unread.partition(b"\r\n\r\n")
            if not end or not head.startswith(b"HTTP/1.1 101"):
                return
            self._upgraded, unread[:] = True, rest
            self._send(_TEXT, json.dumps(self._hello).encode())
        first = 0
        while len(unread) >= first + 2:
            begin, size = first + 2, unread[first + 1]
            if size >= 126:
                begin += 2 if size == 126 else 8
                size = int.from_bytes(unread[first + 2 : begin])
            if len(unread) < begin + size:
                break
            self._take(unread[first] & 0xF, begin, size)
            first = begin + size
        del unread[:first]

    def _take(self, kind: int, begin: int, size: int) -> None:
        unread = self._unread
        if kind == _PING:
            self._send(_PONG, bytes(unread[begin : begin + size]))
        elif kind == _TEXT:
            self.is_there |= json.loads(unread[begin : begin + size])["type"] == "welcome"
        elif unread[begin + 4 : begin + 8] == topics.SNAPSHOT.identifier:
            self.heard += 1

    def _send(self, kind: int, content: bytes) -> None:
        """Send a frame of less than 126 bytes."""
        self._transport.write(bytes([_WHOLE | kind, _MASKED | len(content)]) + _MASK + content)
