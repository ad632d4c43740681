"""A browser that reads one byte a second."""

import asyncio
import base64
import os
import socket
import time
from urllib.parse import urlsplit

from race_server.live.gateway.frames import frame_of
from race_server.live.gateway.handshake import SUBPROTOCOL
from race_server.live.gateway.limits import GatewayTiming
from race_server.tools.drills.report import Finding

# Size of the receive buffer, and of one read [bytes].
BUFFER, SIP = 4096, 1
PAUSE_S = 1.0
END = b"\r\n\r\n"  # of the HTTP response
# Until the buffers on the way are full.
FILL_S = 15.0


async def read_slowly(base: str, seconds: float) -> Finding:
    """Watch at one byte a second, and return when the gateway had enough."""
    act, expected = "a byte a second", "is disconnected"
    timing = GatewayTiming()
    if seconds < FILL_S + timing.unread_s:
        return Finding(act, expected, f"not tried in {seconds:g} s", ok=True)
    loop, parts = asyncio.get_running_loop(), urlsplit(base)
    begun = time.monotonic()
    with socket.socket() as line:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        line.setblocking(False)
        await loop.sock_connect(line, (parts.hostname, parts.port))
        await loop.sock_sendall(line, _handshake(parts.netloc))
        while not (await loop.sock_recv(line, BUFFER)).endswith(END):
            pass
        await loop.sock_sendall(line, _masked('{"role": "spectate"}'))
        while (gone := time.monotonic() - begun) < seconds:
            try:
                if not await loop.sock_recv(line, SIP):
                    break
            except OSError:
                break
            await asyncio.sleep(PAUSE_S)
            if _is_reset(line):
                break
        else:
            return Finding(act, expected, f"still connected after {gone:.0f} s", ok=False)
    ok = gone > timing.unread_s - timing.abort_s
    return Finding(act, expected, f"disconnected after {gone:.0f} s", ok=ok)


def _is_reset(line: socket.socket) -> bool:
    """Return whether the other end has closed the connection."""
    return bool(line.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR))


def _handshake(place: str) -> bytes:
    key = base64.b64encode(os.urandom(16)).decode()
    lines = [
        "GET /ws HTTP/1.1",
        f"Host: {place}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        f"Sec-WebSocket-Key: {key}",
        "Sec-WebSocket-Version: 13",
        f"Sec-WebSocket-Protocol: {SUBPROTOCOL}",
    ]
    return "\r\n".join(lines).encode() + END


def _masked(words: str) -> bytes:
    """Return a text frame as browsers send it; the mask is zero."""
    frame = bytearray(frame_of(words))
    frame[1] |= 0x80
    frame[2:2] = bytes(4)
    return bytes(frame)
