"""Two sites race against each other: each with its own server, in its own network namespace.

Two karts drive at each site, and a relay lets all four race at both. Each server counts the laps
of all; for a kart of the other site it must count the same laps as that server, and place it nearly
where it is.
"""

import json
import tempfile
from collections.abc import Callable
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
)
from race_server.tools.drills.network import PORT, start_within, wait_for_end
from race_server.tools.drills.report import SmallDrill, document_of, skipped

SMALL = SmallDrill("--laps 1", 18, "laps")

TRACK, SESSIONS = "oval-report", ("north", "south")
# Seats that are driven at each site; the others are relayed.
HOME = ((0, 1), (2, 3))
DRIVERS = ("pure_pursuit", "follow_gap", "pure_pursuit", "follow_gap")
# 99th percentile of the position error of a relayed kart, at most [m]: the distance it drives while
# its pose is on the way, and half its length.
MISS_M = 0.5


def drill_sites(
    conditions: LinkConditions,
    *,
    laps: int = 2,
    seed: int = 1,
    tell: Callable[[int], None] = lambda _: None,
) -> dict[str, Any]:
    """Race two sites and return the figures, or why the drill was skipped."""
    if reason := why_not():
        return skipped(reason)
    faults: list[str] = []
    karts: list[dict[str, Any]] = []
    try:
        with (
            lossy_link(conditions, seed) as link,
            tempfile.TemporaryDirectory(prefix="drill-") as name,
        ):
            results, told = _race(link, Path(name), laps, tell)
        karts = _compare(results, told, laps, faults)
    except RaceError as error:
        faults.append(str(error))
    return document_of(
        faults,
        **conditions.figures(),
        laps=laps,
        karts=karts,
        seed=seed,
    )


def _race(
    link: LossyLink, place: Path, laps: int, tell: Callable[[int], None]
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Run both races; return the result of each server and the figures of the relay."""
    processes = []
    addresses = [f"tcp/{address}:{PORT}" for address in ADDRESSES]
    try:
        for site, (session, address) in enumerate(zip(SESSIONS, addresses, strict=True)):
            serve = ["serve", "--track", TRACK, "--karts", "4", "--laps", str(laps), "--once"]
            serve += ["--items", "off", "--no-guard", "--fresh", "--record", "none"]
            serve += ["--results", "none", "--listen", address, "--session", session]
            serve += ["--result", str(place / f"{session}.json")]
            processes.append(start_within(link.names[site], serve, place / session))
        for site, seats in enumerate(HOME):
            for seat in seats:
                words = ["drive", DRIVERS[seat], "--connect", addresses[site], "--seat", str(seat)]
                words += ["--session", SESSIONS[site], "--patience", str(START_S)]
                processes.append(start_within(link.names[site], words, place / f"kart-{seat}"))
        words = ["relay", "--here", addresses[0], "--there", addresses[1], "--json"]
        words += ["--session", SESSIONS[0], "--there-session", SESSIONS[1]]
        words += ["--bring", _list(HOME[1]), "--send", _list(HOME[0]), "--patience", str(START_S)]
        processes.append(start_within(link.names[0], words, place / "relay"))
        wait_for_end(processes, place / SESSIONS[0], tell)
    finally:
        for process in processes:
            process.kill()
            process.wait()
    results = [_result_of(place, session) for session in SESSIONS]
    text = (place / "relay.out").read_text()
    if not text:
        raise RaceError(f"the relay left no figures: {last_words(place / 'relay.err')}")
    return results, json.loads(text)


def _list(seats: tuple[int, ...]) -> str:
    return ",".join(str(seat) for seat in seats)


def _result_of(place: Path, session: str) -> dict[str, Any]:
    path = place / f"{session}.json"
    if not path.exists():
        raise RaceError(f"site {session} has no result: {last_words(place / f'{session}.err')}")
    document: dict[str, Any] = json.loads(path.read_text())
    return document


def _compare(
    results: list[dict[str, Any]], told: dict[str, Any], laps: int, faults: list[str]
) -> list[dict[str, Any]]:
    """Compare the results of each kart on the two servers."""
    rows = []
    tables = [{kart["seat"]: kart for kart in result["karts"]} for result in results]
    for home, seats in enumerate(HOME):
        away = 1 - home
        figures = {row["seat"]: row for row in told[SESSIONS[away]]}
        for seat in seats:
            own, guest = tables[home].get(seat), tables[away].get(seat)
            if own is None or guest is None:
                faults.append(f"seat {seat} did not race at both sites")
                continue
            rows.append(
                {
                    "seat": seat,
                    "home": SESSIONS[home],
                    "laps_home": own["laps"],
                    "laps_away": guest["laps"],
                    "rank_home": own["rank"],
                    "rank_away": guest["rank"],
                    "race_time_home_s": round(own["race_time_us"] / 1e6, 2),
                    "race_time_away_s": round(guest["race_time_us"] / 1e6, 2),
                    **figures[seat],
                }
            )
            if own["laps"] != laps or guest["laps"] != laps:
                faults.append(
                    f"seat {seat}: {own['laps']} laps at home, {guest['laps']} away, not {laps}"
                )
            if not figures[seat]["miss_p99_m"] <= MISS_M:
                faults.append(f"seat {seat} was {figures[seat]['miss_p99_m']} m from its place")
    return rows
