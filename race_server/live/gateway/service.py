"""A gateway that listens: its socket, its loop, and the end of both."""

import asyncio
import resource
import signal
import socket
import time
from functools import partial
from typing import Any

import uvicorn

from race_server.errors import LinkError
from race_server.live.gateway.app import make_app
from race_server.live.gateway.connection import (
    WRITE_BUFFER,
    ConnectionLimiter,
    PendingConnection,
    WebSocketConnection,
)
from race_server.live.gateway.hub import Hub
from race_server.live.gateway.limits import HEARTBEAT_S, MOST_CONNECTIONS, MOST_MESSAGE
from race_server.live.gateway.live import LiveRace
from race_server.live.gateway.page import Page
from race_server.live.gateway.settings import Addresses, Settings, addresses_of
from race_server.logs import Log

# Connections that wait to be accepted.
BACKLOG = 256
# Connections, recordings, the link to the race: often a process has 1024 until it asks for more.
WANTED_FILES = 4096
# Browsers are told of the end, and have so long to take it.
FAREWELL_S = 1
# A server that was killed is back before that; one that has ended is not.
GONE_S, LOOK_S = 10.0, 0.2


class Gateway:
    """Listens from its making on; serves while `serve` runs."""

    def __init__(self, settings: Settings, log: Log) -> None:
        """Listen.

        Raises:
            LinkError: the place is in use, or not of this machine.
        """
        self._settings, self._log = settings, log
        self._socket = _listening(settings.host, settings.port)
        self.addresses: Addresses = addresses_of(settings, self._socket.getsockname()[1])
        self._server: uvicorn.Server | None = None
        self.hub: Hub | None = None

    def run(self) -> None:
        """Serve in a loop of its own until a signal comes."""
        for number in (signal.SIGINT, signal.SIGTERM):
            # uvicorn takes them while it serves, and raises them again at its end.
            signal.signal(number, lambda *_: None)
        asyncio.run(self.serve())

    async def serve(self) -> None:
        """Serve until it is stopped."""
        hub = self.hub = Hub(self._settings, self._log)
        self._server = uvicorn.Server(self._config(hub))
        tasks = [asyncio.create_task(hub.look_after())]
        if self._settings.once:
            tasks.append(asyncio.create_task(self._end_with(hub.live)))
        try:
            with hub.listener:
                await self._server.serve(sockets=[self._socket])
                await hub.close()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._socket.close()

    async def _end_with(self, live: LiveRace) -> None:
        """Stop once a race that was there has been gone for a while."""
        while live.left_at is None or time.monotonic() - live.left_at < GONE_S:
            await asyncio.sleep(LOOK_S)
        self.stop()

    def stop(self) -> None:
        """End serving soon; may be called from any thread."""
        if self._server is not None:
            self._server.should_exit = True

    def _config(self, hub: Hub) -> uvicorn.Config:
        visit: Any = partial(PendingConnection, porch=ConnectionLimiter(_room_for_connections()))
        pipe: Any = WebSocketConnection
        settings = self._settings
        app: Any = make_app(hub, Page.read())
        return uvicorn.Config(
            app,
            http=visit,
            ws=pipe,
            ws_max_size=MOST_MESSAGE,
            ws_ping_interval=HEARTBEAT_S,
            ws_ping_timeout=HEARTBEAT_S,
            ws_per_message_deflate=False,  # snapshots hardly get smaller, and processors warmer
            lifespan="off",
            log_config=None,
            log_level="warning",
            access_log=False,
            # Whoever comes through a proxy says so in words that anybody could say.
            proxy_headers=False,
            server_header=False,
            date_header=False,
            timeout_graceful_shutdown=FAREWELL_S,
            ssl_certfile=settings.certificate,
            ssl_keyfile=settings.private_key,
        )


def _room_for_connections() -> int:
    """Return how many connections may be open before a browser has said anything.

    Half of what this process may open: browsers, recordings and the race need room too.
    """
    files, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    if files == resource.RLIM_INFINITY:
        return MOST_CONNECTIONS
    may = WANTED_FILES if most == resource.RLIM_INFINITY else min(most, WANTED_FILES)
    files = max(files, may)
    resource.setrlimit(resource.RLIMIT_NOFILE, (files, most))
    return min(files // 2, MOST_CONNECTIONS)


def _listening(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # Without naming TCP here asyncio would let small messages wait for those before: 30 ms.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Inherited by every connection: what waits in the kernel can no longer be overtaken.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, WRITE_BUFFER)
        listener.bind((host, port))
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        raise LinkError(
            f"cannot listen on {host}:{port} ({error.strerror or error}); choose another place "
            "with --listen HOST:PORT, or any free port with --port 0"
        ) from error
    listener.setblocking(False)
    return listener
