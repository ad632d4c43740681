"""Load test: many karts and spectators for minutes; then the same over websockets.

Both servers run one after the other with as many clients on the same machine, and the clients share
its cores with the server: only the comparison of the two columns means something.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from race_server.competition.launch import free_port
from race_server.core.messages import Phase
from race_server.errors import RaceError
from race_server.live.server.counters import DURATIONS, LATENESSES
from race_server.tools.drills.report import SmallDrill, document_of
from race_server.tools.drills.server_process import (
    Figures,
    ServerProcess,
    server_process,
    tick_times_between,
    ticks_between,
)

SMALL = SmallDrill("--karts 16 --spectators 20 --minutes 0.05", 20, "race_server.missed_share")

TRACK = "covapsy-test-2023"
MISSED = 0.001  # share of ticks
WARM_UP_S = 3.0  # not counted: the countdown, and caches that fill
MOST_MINUTES = 14.0  # a race is over after 15
DURATION, LATENESS = "race_tick_duration_seconds", "race_tick_lateness_seconds"


class LoadClients:
    """A process that plays many clients and takes commands on stdin."""

    def __init__(self, words: Sequence[str]) -> None:
        """Start ``python -m race_server.tools.drills.…``."""
        command = [sys.executable, "-m", *words]
        environment = {**os.environ, "RACE_SERVER_INTERPRET": "1"}
        if words[1] == "server":
            environment.pop("RACE_SERVER_INTERPRET")
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )

    def wait_until_ready(self) -> None:
        """Wait until all its clients are connected."""
        self._read()

    def tell(self, word: str) -> None:
        """Send it a command."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()

    def end(self) -> dict[str, Any]:
        """End it, and return its figures."""
        self.tell("end")
        document: dict[str, Any] = json.loads(self._read())
        return document

    def _read(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RaceError(f"a process of clients has ended with {self._process.wait()}")
        return line

    def kill(self) -> None:
        """Kill it."""
        self._process.kill()
        self._process.communicate()


@contextmanager
def load_clients(*all_words: Sequence[str]) -> Iterator[list[LoadClients]]:
    """Start processes of clients, one for each list of arguments; they end with the block."""
    with ExitStack() as stack:
        started = []
        for words in all_words:
            started.append(clients := LoadClients(words))
            stack.callback(clients.kill)
        yield started


def drill_load(
    karts: int, spectators: int, minutes: float, *, tell: Callable[[int], None] = lambda _: None
) -> dict[str, Any]:
    """Race with many clients for some minutes and return the figures of both servers.

    tell: called with the seconds passed so far, of both.
    """
    seconds = 60.0 * min(minutes, MOST_MINUTES)
    ours = _load_race_server(karts, spectators, seconds, tell)
    peer = None
    if find_spec("websockets") and find_spec("orjson"):
        peer = _load_peer(karts, spectators, seconds, lambda done: tell(round(seconds) + done))
    faults = []
    if ours["missed_share"] > MISSED:
        faults.append(
            f"{100 * ours['missed_share']:.2f} % of ticks were missed, {100 * MISSED:g} % are "
            "allowed"
        )
    return document_of(
        faults,
        karts=karts,
        spectators=spectators,
        minutes=round(seconds / 60.0, 2),
        cores=os.cpu_count(),
        race_server=ours,
        websockets_orjson=peer,
        note="" if peer else "no comparison: `pip install race-server[bench]` installs it",
    )


@contextmanager
def crowded_server(
    words: Sequence[str], karts: int, spectators: int
) -> Iterator[tuple[ServerProcess, LoadClients, LoadClients]]:
    """Yield a server in a race, its spectators and its drivers. words: of `race serve`."""
    words = ["--track", TRACK, "--karts", str(karts), "--laps", "1000", *words]
    clients = "race_server.tools.drills.load_clients"
    with (
        server_process(words) as place,
        load_clients(
            [clients, "spectators", place.address, str(spectators)],
            [clients, "drivers", place.address, str(karts)],
        ) as (watching, driving),
    ):
        watching.wait_until_ready()
        driving.wait_until_ready()
        place.wait_for(Phase.RUNNING)
        yield place, watching, driving


def _load_race_server(
    karts: int, spectators: int, seconds: float, tell: Callable[[int], None]
) -> dict[str, Any]:
    with crowded_server(["--record", "none"], karts, spectators) as (place, watching, driving):
        time.sleep(WARM_UP_S)
        before, begun = _mark(place, (watching, driving))
        busy = _pass_time(seconds, tell)
        after, wall = place.figures(), time.perf_counter() - begun
        told = watching.end() | driving.end()
        place.stop()
    cpu = after["process_cpu_seconds_total"] - before["process_cpu_seconds_total"]
    memory = [figures["process_resident_memory_bytes"] / 1e6 for figures in (before, after)]
    return _column(before, after, told, cpu / wall, memory) | {"machine_busy": busy}


def _mark(place: ServerProcess, all_clients: Sequence[LoadClients]) -> tuple[Figures, float]:
    for clients in all_clients:
        clients.tell("mark")
    return place.figures(), time.perf_counter()


def _load_peer(
    karts: int, spectators: int, seconds: float, tell: Callable[[int], None]
) -> dict[str, Any]:
    port, peer = str(free_port()), "race_server.tools.bench.websocket_baseline"
    with load_clients([peer, "server", port, str(karts), str(spectators), TRACK]) as (server,):
        server.wait_until_ready()
        with load_clients(
            [peer, "spectators", port, str(spectators)], [peer, "drivers", port, str(karts)]
        ) as (watching, driving):
            watching.wait_until_ready()
            driving.wait_until_ready()
            time.sleep(WARM_UP_S + 3.0)  # its countdown
            for clients in (server, watching, driving):
                clients.tell("mark")
            busy = _pass_time(seconds, tell)
            counted = server.end()
            told = watching.end() | driving.end()
    before, after = counted["before"], counted["after"]
    share = (after["cpu"] - before["cpu"]) / (after["wall"] - before["wall"])
    memory = [before["memory"], after["memory"]]
    return _column(_as_figures(before), _as_figures(after), told, share, memory) | {
        "machine_busy": busy
    }


def _as_figures(counted: dict[str, Any]) -> Figures:
    """Return the counts of the websocket server under the names of our metrics."""
    figures = {"race_ticks_total": counted["ticks"], "race_ticks_missed_total": counted["missed"]}
    for name, key, ends in (
        (DURATION, "duration", DURATIONS),
        (LATENESS, "lateness", LATENESSES),
    ):
        so_far = 0
        for end, count in zip([*ends, float("inf")], counted[key], strict=True):
            so_far += count
            figures[f'{name}_bucket{{le="{end}"}}'] = so_far
    return figures


def _column(
    before: Figures, after: Figures, told: dict[str, Any], cpu: float, memory: Sequence[float]
) -> dict[str, Any]:
    """Return the figures of one server; times of ticks are upper ends of bins."""
    ticks, _ = ticks_between(before, after)
    return {
        **tick_times_between(before, after, {"tick": DURATION, "lateness": LATENESS}),
        **told,
        "heard_share": round(told["heard_mean"] / max(ticks, 1.0), 3),
        "cpu": round(cpu, 3),
        "memory_start_mb": round(memory[0], 1),
        "memory_end_mb": round(memory[1], 1),
    }


def _pass_time(seconds: float, tell: Callable[[int], None]) -> float | None:
    """Wait, and return the mean number of busy cores of the machine (Linux: /proc)."""
    begun, before = time.monotonic(), _busy_s()
    while (gone := time.monotonic() - begun) < seconds:
        tell(round(gone))
        time.sleep(min(1.0, seconds - gone))
    after = _busy_s()
    return None if before is None or after is None else round((after - before) / gone, 2)


def _busy_s() -> float | None:
    """Return the total busy time [s] of all cores since the machine started."""
    path = Path("/proc/stat")
    if not path.exists():
        return None
    user, nice, system, _idle, _wait, *interrupts = map(
        int, path.read_text().split("\n")[0].split()[1:9]
    )
    return (user + nice + system + sum(interrupts)) / os.sysconf("SC_CLK_TCK")
