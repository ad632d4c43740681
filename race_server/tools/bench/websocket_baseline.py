"""The same race over websockets and JSON: the baseline of `race drill load`.

The world, the seats, the tick, the messages and their rates are the same; only the network layer
differs: `websockets` on asyncio, and dictionaries that `orjson` writes and reads. As many clients
drive and watch it.
"""

import asyncio
import gc
import json
import resource
import sys
import time
from collections.abc import Awaitable, Callable
from dataclasses import asdict
from typing import Any

import orjson
from websockets.asyncio.client import ClientConnection
from websockets.asyncio.client import connect as connect_to
from websockets.asyncio.server import ServerConnection, broadcast, serve

from race_server.core.clock import SPIN_S, TICK_S
from race_server.core.messages import Button, Control
from race_server.core.observation import layout_of
from race_server.tools.drills.load_clients import Stopwatch, heard_between, pilot

HOST = "127.0.0.1"
Figures = dict[str, float]


def memory_mb() -> float:
    """Return how much memory this process holds now (Linux: /proc)."""
    with open("/proc/self/statm") as file:  # noqa: PTH123 (no path of ours)
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6


async def obey(mark: Callable[[], None]) -> None:
    """Say that all is ready and obey stdin; returns at ``end``."""
    loop = asyncio.get_running_loop()
    print("ready", flush=True)
    while (await loop.run_in_executor(None, sys.stdin.readline)).strip() == "mark":
        mark()


# The server


class PeerServer:
    """One race over websockets."""

    def __init__(self, karts: int, track: str) -> None:
        """Put the karts on the grid."""
        from race_server.live.server.counters import Counters
        from race_server.scenario.race import Rules, Scenario
        from race_server.scenario.track.load import load_course
        from race_server.session.session import Session

        self.session = Session(
            "peer", Scenario(load_course(track), karts=karts, rules=Rules(laps=1000))
        )
        for seat in range(karts):
            self.session.join(f"driver {seat}", "track", wanted=seat)
        self.drivers: dict[int, ServerConnection] = {}
        self.watchers: set[ServerConnection] = set()
        self.inbox: dict[int, str | bytes] = {}
        self.counters = Counters(karts)
        self.before: dict[str, Any] = {}

    async def meet(self, connection: ServerConnection) -> None:
        """Hear one driver, or keep one spectator, for as long as it is there."""
        assert connection.request is not None
        role, _, seat = connection.request.path.strip("/").partition("/")
        if role == "drive":
            self.drivers[int(seat)] = connection
            async for message in connection:
                self.inbox[int(seat)] = message  # the newest wins
        else:
            self.watchers.add(connection)
            await connection.wait_closed()
            self.watchers.discard(connection)

    async def race(self) -> None:
        """Run ticks for as long as this task lives, paced as the race server is."""
        from race_server.live.server.publisher import snapshot_of, standings_of

        session, counters = self.session, self.counters
        session.start()
        session.observe()
        gc.collect()
        gc.freeze()
        gc.disable()
        deadline = time.perf_counter() + TICK_S
        while True:
            begun = time.perf_counter()
            if session.tick % session.decision_ticks == 0:
                self._tell_drivers()
            self._hear()
            session.advance(1)
            frame = snapshot_of(session)
            names = frame.karts.dtype.names or ()
            document = {
                "monotonic_us": frame.monotonic_us,
                "epoch": frame.epoch,
                "tick": frame.tick,
                "karts": [dict(zip(names, row, strict=True)) for row in frame.karts.tolist()],
                "boxes": frame.boxes.tolist(),
            }
            broadcast(self.watchers, orjson.dumps(document))
            if session.tick % 30 == 0:
                broadcast(self.watchers, orjson.dumps(asdict(standings_of(session))))
            duration = time.perf_counter() - begun
            await asyncio.sleep(max(deadline - time.perf_counter() - SPIN_S, 0.0))
            while time.perf_counter() < deadline:
                pass
            late = time.perf_counter() - deadline
            skipped = int(late / TICK_S) if late > TICK_S else 0
            deadline += (1 + skipped) * TICK_S
            counters.ticks += 1
            counters.record_tick(duration, late, counters.missed + skipped)

    def _tell_drivers(self) -> None:
        from race_server.live.server.hud import hud_of

        session = self.session
        session.observe()
        for number, connection in self.drivers.items():
            seat = session.seats[number]
            seen = {
                "epoch": session.epoch,
                "tick": session.tick,
                "acknowledged": seat.sequence,
                "values": session.view(number).tolist(),
            }
            broadcast([connection], orjson.dumps(seen))
            hud = asdict(hud_of(session, seat))
            hud["effects"] = hud["effects"].tolist()
            broadcast([connection], orjson.dumps(hud))

    def _hear(self) -> None:
        for seat, message in self.inbox.items():
            sent = orjson.loads(message)
            control = Control(
                sent["steering"], sent["throttle"], sent["brake"], Button(sent["buttons"])
            )
            self.session.receive_control(
                seat, sent["epoch"], sent["sequence"], sent["tick"], control
            )
        self.inbox.clear()

    def mark(self) -> None:
        """Start to count."""
        self.before = self._now()

    def _now(self) -> dict[str, Any]:
        return {
            "ticks": self.counters.ticks,
            "missed": self.counters.missed,
            "duration": list(self.counters.duration.counts),
            "lateness": list(self.counters.lateness.counts),
            "cpu": time.process_time(),
            "wall": time.perf_counter(),
            "memory": memory_mb(),
        }

    def figures(self) -> dict[str, Any]:
        """Return what was counted since the mark."""
        return {"before": self.before, "after": self._now()}


async def serve_race(port: int, karts: int, spectators: int, track: str) -> None:
    """Serve until stdin ends; the race begins once all are there."""
    peer = PeerServer(karts, track)
    async with serve(peer.meet, HOST, port, compression=None, max_queue=4):
        ready = asyncio.create_task(obey(peer.mark))
        while len(peer.drivers) < karts or len(peer.watchers) < spectators + 1:
            await asyncio.sleep(0.05)
        race = asyncio.create_task(peer.race())
        await asyncio.wait({ready, race}, return_when=asyncio.FIRST_COMPLETED)
        if race.done():
            race.result()
        race.cancel()
        print(json.dumps(peer.figures()), flush=True)


# The clients


async def drive_all(port: int, karts: int) -> None:
    """Drive all karts, and time from a control to the snapshot that shows it."""
    watch, layout = Stopwatch(), layout_of("track", 1)
    place = f"ws://{HOST}:{port}"

    async def drive(seat: int, connection: ClientConnection) -> None:
        sequence = 0
        async for message in connection:
            seen = orjson.loads(message)
            if "values" not in seen:
                continue
            sequence = max(sequence, seen["acknowledged"]) + 1
            watch.sent(seat, sequence)
            control = asdict(pilot(layout, seen["values"]))
            control |= {"epoch": seen["epoch"], "tick": seen["tick"], "sequence": sequence}
            await connection.send(orjson.dumps(control))

    async def look(connection: ClientConnection) -> None:
        async for message in connection:
            for kart in orjson.loads(message).get("karts", ()):
                watch.shown(kart["seat"], kart["acknowledged"])

    works: list[Awaitable[None]] = []
    for seat in range(karts):
        connection = await connect_to(f"{place}/drive/{seat}", compression=None)
        works.append(drive(seat, connection))
    works.append(look(await connect_to(f"{place}/watch", compression=None)))
    tasks = [asyncio.ensure_future(work) for work in works]
    await obey(watch.mark)
    print(json.dumps(watch.figures()), flush=True)
    for task in tasks:
        task.cancel()


async def watch_all(port: int, spectators: int) -> None:
    """Watch the race from many places."""
    heard = [0] * spectators
    before = heard.copy()

    async def listen(number: int, connection: ClientConnection) -> None:
        async for message in connection:
            # Standings arrive as well; only snapshots count.
            heard[number] += message[:15] == b'{"monotonic_us"'

    def mark() -> None:
        before[:] = heard

    tasks = []
    for number in range(spectators):
        connection = await connect_to(f"ws://{HOST}:{port}/watch", compression=None)
        tasks.append(asyncio.ensure_future(listen(number, connection)))
    await obey(mark)
    print(json.dumps(heard_between(before, heard)), flush=True)
    for task in tasks:
        task.cancel()


if __name__ == "__main__":
    role, words = sys.argv[1], sys.argv[2:]
    if role == "server":
        asyncio.run(serve_race(int(words[0]), int(words[1]), int(words[2]), words[3]))
    elif role == "drivers":
        asyncio.run(drive_all(int(words[0]), int(words[1])))
    else:
        asyncio.run(watch_all(int(words[0]), int(words[1])))
