"""A race over a bad network: the server in one network namespace, eight drivers in another.

TCP repairs what is lost, delayed and reordered, and the race has to cope with the rest: controls
come late or in bursts, karts coast and brake, links break and reconnect. All must finish, and the
laps that drivers were told must be those that the server counted.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from race_server.competition.launch import START_S
from race_server.errors import RaceError
from race_server.logs import last_words
from race_server.tools.drills.lossy_link import (
    ADDRESSES,
    LinkConditions,
    LossyLink,
    lossy_link,
    why_not,
    within,
)
from race_server.tools.drills.report import SmallDrill, document_of, skipped
from race_server.tools.drills.server_process import SESSION

SMALL = SmallDrill("--loss 0.05 --delay 20 --jitter 5 --laps 1", 22, "packets_lost")

TRACK, LAPS, KARTS = "oval-report", 3, 8
DRIVERS = ("pure_pursuit", "follow_gap", "avoider")
# With such latency slow drivers fall back further behind the winner than usual [s].
FINISH_S = 400.0
MOST_S = 900.0
PORT = 7447


def drill_network(
    conditions: LinkConditions,
    *,
    track: str = TRACK,
    laps: int = LAPS,
    drivers: Sequence[str] = DRIVERS,
    seed: int = 1,
    tell: Callable[[int], None] = lambda _: None,
) -> dict[str, Any]:
    """Race over a bad link and return the figures.

    tell: called with the seconds passed. If this machine can have no such link, the document says
    that the drill was skipped, and why.
    """
    if reason := why_not():
        return skipped(reason)
    faults: list[str] = []
    figures: dict[str, Any] = {}
    try:
        with (
            lossy_link(conditions, seed) as link,
            tempfile.TemporaryDirectory(prefix="drill-") as name,
        ):
            document, told = _race(link, Path(name), track, laps, drivers, tell)
            figures = {"packets": link.passed + link.lost, "packets_lost": link.lost}
        figures |= _compare(document, told, laps, faults)
    except RaceError as error:
        faults.append(str(error))
    return document_of(
        faults,
        **conditions.figures(),
        track=track,
        karts=KARTS,
        laps=laps,
        **figures,
        seed=seed,
    )


def _race(
    link: LossyLink,
    place: Path,
    track: str,
    laps: int,
    drivers: Sequence[str],
    tell: Callable[[int], None],
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Run the race; return the server's result and the link statistics of each driver."""
    address = f"tcp/{ADDRESSES[0]}:{PORT}"
    serve = ["serve", "--track", track, "--karts", str(KARTS), "--laps", str(laps), "--once"]
    serve += [
        "--finish-limit",
        f"{FINISH_S:g}",
        "--no-guard",
        "--fresh",
        "--record",
        "none",
        "--results",
        "none",
    ]
    serve += ["--listen", address, "--session", SESSION, "--result", str(place / "result.json")]
    processes = [start_within(link.names[0], serve, place / "server")]
    try:
        for seat in range(KARTS):
            words = ["drive", drivers[seat % len(drivers)], "--connect", address, "--json"]
            words += ["--session", SESSION, "--seat", str(seat), "--patience", str(START_S)]
            processes.append(start_within(link.names[1], words, place / f"driver-{seat}"))
        wait_for_end(processes, place / "server", tell)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    if not (place / "result.json").exists():
        raise RaceError(f"the race ended without a result: {last_words(place / 'server.err')}")
    told = []
    for seat in range(KARTS):
        text = (place / f"driver-{seat}.out").read_text()
        words_ = last_words(place / f"driver-{seat}.err")
        told.append(json.loads(text) if text else {"seat": seat, "outcome": words_})
    return json.loads((place / "result.json").read_text()), told


def start_within(namespace: str, words: list[str], log: Path) -> subprocess.Popen[bytes]:
    """Start ``race`` with these arguments in a namespace; `log` names the files of its output."""
    command = [*within(namespace), sys.executable, "-m", "race_server", *words]
    with log.with_suffix(".out").open("wb") as out, log.with_suffix(".err").open("wb") as err:
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err)


def wait_for_end(
    processes: list[subprocess.Popen[bytes]], log: Path, tell: Callable[[int], None]
) -> None:
    """Wait until all have ended. log: of the first process, a server.

    Raises:
        RaceError: the server has failed, or it takes too long.
    """
    begun = time.monotonic()
    while any(process.poll() is None for process in processes):
        gone = time.monotonic() - begun
        if processes[0].poll() not in {None, 0}:
            raise RaceError(f"the server has ended: {last_words(log.with_suffix('.err'))}")
        if gone > START_S + MOST_S:
            raise RaceError(f"the race did not end within {START_S + MOST_S:g} s")
        tell(round(gone))
        time.sleep(0.5)


def _compare(
    document: dict[str, Any], told: list[dict[str, Any]], laps: int, faults: list[str]
) -> dict[str, Any]:
    """Compare what drivers were told with the result; append what is wrong to `faults`."""
    karts = {kart["seat"]: kart for kart in document["karts"]}
    drivers = []
    for row in sorted(told, key=lambda row: row["seat"]):
        kart = karts[row["seat"]]
        drivers.append(
            {**row, "status": kart["status"], "laps_counted": kart["laps"], "rank": kart["rank"]}
        )
        if kart["status"] != "finished":
            faults.append(f"seat {row['seat']} has not finished but {kart['status']}")
        elif kart["laps"] != laps or len(kart["lap_times_us"]) != laps:
            faults.append(f"seat {row['seat']} finished with {kart['laps']} laps of {laps}")
        if row.get("laps", kart["laps"]) != kart["laps"]:
            faults.append(
                f"seat {row['seat']} was told of {row['laps']} laps, {kart['laps']} were counted"
            )
    return {
        "seconds": round(document["ticks"] / 60.0, 1),
        "missed_ticks": document["missed_ticks"],
        "refused": document["refused"],
        "drivers": drivers,
    }
