"""Clients of a gateway that are no browsers: they say nothing, or say it in two ways at once."""

import asyncio
import resource
import time
from contextlib import suppress
from urllib.parse import urlsplit

from race_server.live.gateway.limits import GatewayLimits
from race_server.tools.drills.report import Finding

# More than the gateway keeps open.
IDLE = GatewayLimits().connections + 100
# A page is answered within this time [s], whatever else is connected.
ANSWER_S = 1.0
WAIT_S = 15.0
HEAD = "GET /healthz HTTP/1.1\r\nHost: {}\r\n"
LAST = "Connection: close\r\n\r\n"
# The first request ends at the chunk of no bytes or four bytes later: the second is in it or not.
TWO_LENGTHS = "Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"


async def crowd_in(base: str) -> Finding:
    """Open a thousand connections that say nothing, and ask for a page."""
    _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    files = 2 * IDLE if most == resource.RLIM_INFINITY else min(most, 2 * IDLE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (files, most))
    idle = [(await _connect(base))[1] for _ in range(min(IDLE, files // 2))]
    try:
        begun = time.monotonic()
        status = await _statuses(base, HEAD.format(urlsplit(base).netloc) + LAST)
        taken_s = time.monotonic() - begun
    finally:
        for writer in idle:
            writer.close()
    expected = f"a page in {ANSWER_S:g} s"
    act = f"{len(idle)} idle connections"
    return Finding(
        act, expected, f"{status} in {taken_s:.2f} s", status == ["200"] and taken_s <= ANSWER_S
    )


async def smuggle(base: str) -> Finding:
    """Send a request with two lengths and another one behind it."""
    head = HEAD.format(urlsplit(base).netloc)
    statuses = await _statuses(base, head + TWO_LENGTHS + head + LAST)
    return Finding("a request of two lengths", "['400']", f"{statuses}", statuses == ["400"])


async def _connect(base: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    place = urlsplit(base)
    return await asyncio.open_connection(place.hostname, place.port)


async def _statuses(base: str, request: str) -> list[str]:
    """Return the statuses of all answers to some bytes."""
    heard = b""
    with suppress(TimeoutError, OSError):
        async with asyncio.timeout(WAIT_S):
            reader, writer = await _connect(base)
            writer.write(request.encode())
            heard = await reader.read(1 << 16)
            heard += await reader.read()
            writer.close()
    lines = heard.decode(errors="replace").split("\r\n")
    return [line.split()[1] for line in lines if line.startswith("HTTP/1.1 ")]
