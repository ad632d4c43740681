"""A gateway as a process: its socket, its event loop, and the end of both."""

import asyncio
import math
import signal
import socket
import time
from functools import partial
from typing import Any

import uvicorn

from race_server.errors import LinkError
from race_server.live.gateway.app import make_app
from race_server.live.gateway.connection import PendingConnection, WebSocketConnection
from race_server.live.gateway.connection_limiter import BoundedSocket, ConnectionLimiter
from race_server.live.gateway.limits import GatewayLimits
from race_server.live.gateway.live import LiveRace
from race_server.live.gateway.page import Page
from race_server.live.gateway.settings import Addresses, Settings, addresses_of
from race_server.live.gateway.state import GatewayState
from race_server.logs import Log
from race_server.net.open_files import raise_open_files

# Between two checks whether the race has gone [s].
ONCE_POLL_S = 0.2


class Gateway:
    """Listens as soon as it is made; serves while `serve` runs."""

    def __init__(self, settings: Settings, log: Log) -> None:
        """Listen.

        Raises:
            LinkError: the address is in use, or not of this machine.
        """
        self._settings, self._log = settings, log
        self._socket = _listen(settings)
        self.addresses: Addresses = addresses_of(settings, self._socket.getsockname()[1])
        self._server: uvicorn.Server | None = None
        self.state: GatewayState | None = None

    def run(self) -> None:
        """Serve in a new event loop until a signal arrives."""
        for number in (signal.SIGINT, signal.SIGTERM):
            # uvicorn handles them while it serves, and raises them again at its end.
            signal.signal(number, lambda *_: None)
        asyncio.run(self.serve())

    async def serve(self) -> None:
        """Serve until `stop` is called."""
        state = self.state = GatewayState(self._settings, self._log)
        self._server = uvicorn.Server(self._config(state))
        tasks = [asyncio.create_task(state.run())]
        if self._settings.once:
            tasks.append(asyncio.create_task(self._end_with(state.live)))
        try:
            with state.listener:
                await self._server.serve(sockets=[self._socket])
                await state.close()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            self._socket.close()

    async def _end_with(self, live: LiveRace) -> None:
        """Stop once a race that was there has been gone for a while."""
        gone_s = self._settings.timing.race_gone_s
        while live.left_at is None or time.monotonic() - live.left_at < gone_s:
            await asyncio.sleep(ONCE_POLL_S)
        self.stop()

    def stop(self) -> None:
        """End serving soon; may be called from any thread."""
        if self._server is not None:
            self._server.should_exit = True

    def _config(self, state: GatewayState) -> uvicorn.Config:
        settings = self._settings
        limits, timing = settings.limits, settings.timing
        limiter = ConnectionLimiter(room_for_connections(limits), limits.connections_per_address)
        self._socket.limiter = limiter
        pending: Any = partial(
            PendingConnection, limiter=limiter, timing=timing, refuse=state.log_refusal
        )
        connection: Any = partial(
            WebSocketConnection, limits=limits, timing=timing, limiter=limiter
        )
        app: Any = make_app(state, Page.read())
        return uvicorn.Config(
            app,
            http=pending,
            ws=connection,
            ws_max_size=limits.message_bytes,
            ws_ping_interval=timing.heartbeat_s,
            ws_ping_timeout=timing.heartbeat_s,
            ws_per_message_deflate=False,  # snapshots hardly get smaller, for much work
            lifespan="off",
            log_config=None,
            log_level="error",  # what a client does wrong is logged by `log_refusal`
            access_log=False,
            # The headers of a proxy could be sent by any client.
            proxy_headers=False,
            server_header=False,
            date_header=False,
            timeout_graceful_shutdown=math.ceil(timing.farewell_s),
            ssl_certfile=settings.certificate,
            ssl_keyfile=settings.private_key,
        )


def room_for_connections(limits: GatewayLimits) -> int:
    """Ask for more open files, and return how many connections may be open.

    At most half of the files that this process may open: browsers, recordings and the race need
    some too.
    """
    return min(raise_open_files(limits.open_files) // 2, limits.connections)


def _listen(settings: Settings) -> BoundedSocket:
    host, port, limits = settings.host, settings.port, settings.limits
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # Without TCP named here asyncio would not set TCP_NODELAY: small messages would wait 30 ms.
    listener = BoundedSocket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Inherited by every connection: what waits in the kernel cannot be replaced by newer data.
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, limits.write_buffer_bytes)
        listener.bind((host, port))
        listener.listen(limits.backlog)
    except OSError as error:
        listener.close()
        raise LinkError(
            f"cannot listen on {host}:{port} ({error.strerror or error}); choose another place "
            "with --listen HOST:PORT, or any free port with --port 0"
        ) from error
    listener.setblocking(False)
    return listener
