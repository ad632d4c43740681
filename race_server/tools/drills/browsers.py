"""Many browsers in one process, without a screen: they watch, or one of them drives.

The process prints ``ready``, starts to count at the line ``mark`` on stdin, and prints its figures
at ``end``, as those of `race_server.tools.drills.load_clients` do.
"""

import asyncio
import json
import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from race_server.core.messages import Control
from race_server.errors import WireError
from race_server.live.gateway.handshake import SUBPROTOCOL
from race_server.net.wire import topics
from race_server.net.wire.drive import ControlFrame, encode_control
from race_server.net.wire.spectate import decode_snapshot
from race_server.tools.drills.load_clients import heard_between
from race_server.tools.drills.watcher import Watcher

CONTROL_S = 0.025
CONTROL = Control(steering=0.2, throttle=0.2)
CONNECT_S = 30.0
NICE = 5


def socket_of(base: str, **named: Any) -> connect:
    """Return a WebSocket to the gateway at ``http://host:port/``, to be opened."""
    named.setdefault("subprotocols", [SUBPROTOCOL])
    address = f"{base.replace('http', 'ws', 1)}ws"
    return connect(address, compression=None, proxy=None, open_timeout=CONNECT_S, **named)


async def welcomed(socket: ClientConnection, **hello: Any) -> dict[str, Any]:
    """Say hello and return the answer: a welcome or a refusal."""
    with suppress(
        ConnectionClosed
    ):  # refused before it sent anything: the reason can still be read
        await socket.send(json.dumps(hello))
    while True:
        heard = await socket.recv()
        if isinstance(heard, str):
            words: dict[str, Any] = json.loads(heard)
            return words


class Watchers:
    """Browsers that watch and count."""

    def __init__(self, base: str, count: int) -> None:
        """Start to count, from zero for each."""
        self._base = base
        self._watchers = [Watcher(place) for place in range(count)]
        self._before = [0] * count

    async def run(self) -> None:
        """Watch from all of them until stdin says ``end``."""
        place, loop = urlsplit(self._base), asyncio.get_running_loop()
        host, port = place.hostname or "", place.port or 0
        for watcher in self._watchers:
            await loop.create_connection(partial(_same, watcher), host, port)
        while not all(watcher.is_there for watcher in self._watchers):
            await asyncio.sleep(0.1)
        await obey(self._mark)
        document = heard_between(self._before, self._heard())
        there = sum(watcher.is_there for watcher in self._watchers)
        print(json.dumps(document | {"still_there": there}), flush=True)

    def _heard(self) -> list[int]:
        return [watcher.heard for watcher in self._watchers]

    def _mark(self) -> None:
        self._before = self._heard()


def _same(watcher: Watcher) -> Watcher:
    return watcher


class BrowserDriver:
    """A browser that drives, badly but without interruption."""

    def __init__(self, base: str, token: str) -> None:
        """Start before the first control."""
        self._base, self._token = base, token
        self._sent: dict[int, float] = {}
        self._delays: list[float] = []
        self._seat = self._acknowledged = -1
        self._notices = 0

    async def run(self) -> None:
        """Take a seat, get ready, and drive until stdin says ``end``."""
        async with socket_of(self._base) as socket:
            words = await welcomed(socket, role="drive", token=self._token, rate=60, name="Ada")
            self._seat = words["seat"]
            await socket.send(json.dumps({"type": "ready", "ready": True}))
            tasks = [asyncio.create_task(one) for one in (self._hear(socket), self._send(socket))]
            await obey(self._mark)
            is_driving = not any(task.done() for task in tasks)
            print(json.dumps(self._figures() | {"is_driving": is_driving}), flush=True)
            for task in tasks:
                task.cancel()

    def _mark(self) -> None:
        self._delays.clear()
        self._notices = 0

    def _figures(self) -> dict[str, Any]:
        delays = 1e3 * np.array(self._delays or [0.0])
        return {
            "control_to_snapshot_p50_ms": round(float(np.median(delays)), 1),
            "control_to_snapshot_p99_ms": round(float(np.percentile(delays, 99)), 1),
            "controls_timed": len(self._delays),
            "dead_man_notices": self._notices,
        }

    async def _send(self, socket: ClientConnection) -> None:
        sequence = 0
        while True:
            sequence += 1
            self._sent[sequence] = time.perf_counter()
            await socket.send(encode_control(ControlFrame(0, sequence, 0, CONTROL)))
            await asyncio.sleep(CONTROL_S)

    async def _hear(self, socket: ClientConnection) -> None:
        async for heard in socket:
            if isinstance(heard, str):
                self._notices += json.loads(heard).get("code") == "dead-man"
            elif heard[4:8] == topics.SNAPSHOT.identifier:
                self._note_snapshot(heard)

    def _note_snapshot(self, data: bytes) -> None:
        try:
            karts = decode_snapshot(data).karts
        except WireError:
            return
        own = karts["acknowledged"][karts["seat"] == self._seat].tolist()
        begun = self._sent.pop(own[0], None) if own else None
        if begun is not None:
            self._delays.append(time.perf_counter() - begun)


async def obey(mark: Callable[[], None]) -> None:
    """Say that all is ready, and obey stdin until it says ``end``."""
    print("ready", flush=True)
    loop = asyncio.get_running_loop()
    while (await loop.run_in_executor(None, sys.stdin.readline)).strip() == "mark":
        mark()


if __name__ == "__main__":
    kind, where, more = sys.argv[1:4]
    # Real browsers are on other machines: these must not take the server's time.
    os.nice(NICE)
    player = Watchers(where, int(more)) if kind == "watchers" else BrowserDriver(where, more)
    asyncio.run(player.run())
