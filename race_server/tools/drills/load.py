"""A full hall: many karts, many spectators, for minutes; next to it the same over websockets.

Both servers run one after the other with crowds of the same size on the same machine, and the
crowds share its cores with the server: the two columns are to be compared with each other.
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
from race_server.tools.drills.report import document_of
from race_server.tools.drills.server_process import (
    Figures,
    ServerProcess,
    pace_between,
    server_process,
    ticks_between,
)

TRACK = "covapsy-test-2023"
MISSED = 0.001  # share of ticks
WARM_UP_S = 3.0  # not counted: the countdown, and caches that fill
MOST_MINUTES = 14.0  # a race is over after 15
DURATION, LATENESS = "race_tick_duration_seconds", "race_tick_lateness_seconds"


class LoadClients:
    """A process that plays many clients and obeys on stdin."""

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
        """Wait until all its clients are there."""
        self._read()

    def tell(self, word: str) -> None:
        """Say a word to it."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()

    def end(self) -> dict[str, Any]:
        """Let it end, and return its figures."""
        self.tell("end")
        document: dict[str, Any] = json.loads(self._read())
        return document

    def _read(self) -> str:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RaceError(f"a crowd of the drill has ended with {self._process.wait()}")
        return line

    def kill(self) -> None:
        """End it for good."""
        self._process.kill()
        self._process.communicate()


@contextmanager
def load_clients(*all_words: Sequence[str]) -> Iterator[list[LoadClients]]:
    """Start crowds, one for each list of words; they end with the block."""
    with ExitStack() as stack:
        started = []
        for words in all_words:
            started.append(crowd := LoadClients(words))
            stack.callback(crowd.kill)
        yield started


def drill_load(
    karts: int, spectators: int, minutes: float, *, tell: Callable[[int], None] = lambda _: None
) -> dict[str, Any]:
    """Race before a full hall for some minutes and return the figures of both servers.

    tell: is told how many seconds of both have gone by.
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
        note="" if peer else "no comparison: `pip install race-server[bench]` brings it",
    )


def _load_race_server(
    karts: int, spectators: int, seconds: float, tell: Callable[[int], None]
) -> dict[str, Any]:
    words = ["--track", TRACK, "--karts", str(karts), "--laps", "1000", "--record", "none"]
    crowd = "race_server.tools.drills.load_clients"
    with (
        server_process(words) as place,
        load_clients(
            [crowd, "spectators", place.address, str(spectators)],
            [crowd, "drivers", place.address, str(karts)],
        ) as (watching, driving),
    ):
        watching.wait_until_ready()
        driving.wait_until_ready()
        place.wait_for(Phase.RUNNING)
        time.sleep(WARM_UP_S)
        before, begun = _mark(place, (watching, driving))
        busy = _pass_time(seconds, tell)
        after, wall = place.figures(), time.perf_counter() - begun
        told = watching.end() | driving.end()
        place.stop()
    cpu = after["process_cpu_seconds_total"] - before["process_cpu_seconds_total"]
    memory = [figures["process_resident_memory_bytes"] / 1e6 for figures in (before, after)]
    return _column(before, after, told, cpu / wall, memory) | {"machine_busy": busy}


def _mark(place: ServerProcess, all_crowds: Sequence[LoadClients]) -> tuple[Figures, float]:
    for crowd in all_crowds:
        crowd.tell("mark")
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
            for crowd in (server, watching, driving):
                crowd.tell("mark")
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
    """Return what the peer has counted under the names of the server's metrics."""
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
        **pace_between(before, after, {"tick": DURATION, "lateness": LATENESS}),
        **told,
        "heard_share": round(told["heard_mean"] / max(ticks, 1.0), 3),
        "cpu": round(cpu, 3),
        "memory_start_mb": round(memory[0], 1),
        "memory_end_mb": round(memory[1], 1),
    }


def _pass_time(seconds: float, tell: Callable[[int], None]) -> float | None:
    """Wait, and return how many cores of the machine were busy meanwhile (Linux: /proc)."""
    begun, before = time.monotonic(), _busy_s()
    while (gone := time.monotonic() - begun) < seconds:
        tell(round(gone))
        time.sleep(min(1.0, seconds - gone))
    after = _busy_s()
    return None if before is None or after is None else round((after - before) / gone, 2)


def _busy_s() -> float | None:
    """Return for how long the cores of this machine have worked since it started, together."""
    path = Path("/proc/stat")
    if not path.exists():
        return None
    user, nice, system, _idle, _wait, *interrupts = map(
        int, path.read_text().split("\n")[0].split()[1:9]
    )
    return (user + nice + system + sum(interrupts)) / os.sysconf("SC_CLK_TCK")
