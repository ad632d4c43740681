"""What a live race writes into the results file, however slow or locked it is."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Event, EventKind
from race_server.live.server import LOCKSTEP, REAL, RaceResult, RaceServer
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.spectate import decode_events
from race_server.scenario.race import Rules, Scenario
from race_server.session.lap_log import Lap
from race_server.session.session import Session
from race_server.storage.results import keeper
from race_server.storage.results.keeper import Keeper
from race_server.storage.results.queries import all_laps, races
from race_server.storage.results.store import Change, Correction, Store
from race_server.storage.results.writer import Writer
from support.courses import TINY_RING
from support.results import a_race, fill


def run_race(store: Store, pace: str, log: list[str], hear: Callable[[Event], None]) -> RaceResult:
    """Run a race of two on loopback; `hear` is called with each event as a spectator gets it."""
    rules = Rules(laps=2, countdown_s=0.5, items=False, limit_s=60.0)
    session = Session("race", Scenario(TINY_RING, karts=2, seed=7, rules=rules))
    address = free_address()

    def receive(data: bytes) -> None:
        for event in decode_events(data)[1]:
            hear(event)

    with (
        Writer(store, log.append) as writer,
        ServerLink(address, "race", 2) as link,
        spectator(address, receive),
    ):
        server = RaceServer(session, link, pace, ("pure_pursuit", "follow_gap"), Keeper(writer))
        result = server.run(0)
    assert result is not None
    return result


@contextmanager
def spectator(address: str, receive: Callable[[bytes], None]) -> Iterator[None]:
    with ClientLink(address, "race") as link:
        link.listen(topics.EVENTS, receive)
        time.sleep(0.3)
        yield
        time.sleep(0.3)


def lap_is_in(path: Path, event: Event) -> bool:
    with closing(sqlite3.connect(path)) as connection:
        found = connection.execute(
            "select 1 from lap where seat = ? and number = ? and time_us = ?",
            (event.kart, event.other, event.value),
        )
        return found.fetchone() is not None


class SlowStore(Store):
    """A results file on a slow disk."""

    def write(self, changes: Sequence[Change]) -> None:
        time.sleep(0.5)
        super().write(changes)


@pytest.mark.live
@pytest.mark.parametrize("pace", [LOCKSTEP, pytest.param(REAL, marks=pytest.mark.slow)])
def test_a_lap_is_in_the_file_when_its_event_arrives_however_slow_the_disk(
    path: Path, pace: str
) -> None:
    heard: list[Event] = []
    there: list[bool] = []

    def hear(event: Event) -> None:
        heard.append(event)
        if event.kind is EventKind.LAP:
            there.append(lap_is_in(path, event))

    result = run_race(SlowStore(path), pace, [], hear)
    laps = [event for event in result.events if event.kind is EventKind.LAP]
    assert len(laps) == 4
    assert there == [True] * len(laps)
    assert [event.sequence for event in heard] == sorted(event.sequence for event in heard)
    assert heard == result.events[-len(heard) :]
    if pace == REAL:
        # The disk took 30 ticks for each of four laps.
        assert result.missed_ticks < 60


@pytest.mark.live
def test_a_race_leaves_its_laps_sectors_entries_and_digest(path: Path) -> None:
    result = run_race(Store(path), LOCKSTEP, [], lambda _: None)
    (race,) = races(path)
    assert (race["digest"], race["ended"], race["pace"]) == (result.digest, "finished", "lockstep")
    assert (race["track"], race["vehicle"], race["seed"]) == ("ring", "tt02", 7)
    entries = {entry["seat"]: entry for entry in race["entries"]}
    assert entries[0]["driver_version"].startswith("race-server ")
    laps = all_laps(path)
    for row in result.standings:
        mine = [lap for lap in laps if lap["seat"] == row.seat]
        assert tuple(lap["time_us"] for lap in mine) == row.lap_times_us
        assert all(sum(json.loads(lap["sectors"])) == lap["time_us"] for lap in mine)
        assert entries[row.seat]["rank"] == row.rank
        assert entries[row.seat]["race_time_us"] == row.race_time_us
    dirty = {EventKind.CONTACT_WALL, EventKind.OFF_TRACK, EventKind.SHORT_CUT, EventKind.RESCUED}
    touched = {event.kart for event in result.events if event.kind in dirty}
    assert all(lap["is_clean"] for lap in laps if lap["seat"] not in touched)


@pytest.mark.live
def test_a_file_locked_during_a_race_stops_nothing_and_is_written_in_the_end(
    path: Path,
) -> None:
    log: list[str] = []
    fill(path)
    with closing(sqlite3.connect(path, isolation_level=None, check_same_thread=False)) as other:

        def hear(event: Event) -> None:
            if event.kind is EventKind.GREEN:
                other.execute("begin immediate")
            if event.kind is EventKind.RACE_OVER:
                other.execute("rollback")

        result = run_race(Store(path, busy_s=0.05), LOCKSTEP, log, hear)
    assert len(log) == 1
    assert "is locked by another program" in log[0]
    assert "The race goes on" in log[0]
    assert all(len(row.lap_times_us) == 2 for row in result.standings)
    assert len(all_laps(path)) == 4


def test_what_stewards_change_waits_for_no_other_program_and_is_written_in_the_end(
    path: Path,
) -> None:
    fill(path)
    session = Session("race", Scenario(TINY_RING, karts=2, seed=7))
    for name in ("ann", "bob"):
        session.join(name, "track")
    log: list[str] = []
    with (
        closing(sqlite3.connect(path, isolation_level=None)) as other,
        Writer(Store(path, busy_s=2.0), log.append) as writer,
    ):
        kept = Keeper(writer)
        kept.begin(session, LOCKSTEP)
        kept.end(session)
        other.execute("begin immediate")
        begun = time.monotonic()
        kept.amend([replace(row, penalty_us=5) for row in session.standings()])
        kept.correct(Correction("cup", "Heat", ((1, 2, 3, 0),)))
        assert time.monotonic() - begun < 0.5
        other.execute("rollback")
    (race,) = races(path)
    assert [row["penalty_us"] for row in race["entries"]] == [5, 5]
    assert log == []


def test_a_writer_that_is_full_drops_the_rest_of_the_race_and_takes_the_next(
    path: Path,
) -> None:
    log: list[str] = []
    gate = threading.Event()

    class GatedStore(Store):
        def write(self, changes: Sequence[Change]) -> None:
            gate.wait(5.0)
            super().write(changes)

    with Writer(GatedStore(path), log.append, most_waiting=3) as writer:
        tickets = [writer.submit(a_race("ann"))]
        tickets += [writer.submit(Lap(0, number, 8, (), True)) for number in range(1, 6)]
        gate.set()
        assert tickets[2].wait(5.0)
        writer.submit(a_race("bob"))
    assert [ticket.number > 0 for ticket in tickets] == [True] * 3 + [False] * 3
    assert len(log) == 1
    assert "takes no more" in log[0]
    assert len(all_laps(path)) == 2
    assert len(races(path)) == 2


@pytest.mark.live
def test_laps_that_were_announced_outlive_a_server_that_is_killed(path: Path) -> None:
    address = free_address()
    command = [sys.executable, "-m", "race_server", "serve", "--track", "oval", "--karts", "2"]
    command += ["--laps", "500", "--pace", "lockstep", "--items", "off", "--fill", "pure_pursuit"]
    command += ["--wait-for", "0", "--listen", address, "--results", str(path)]
    command += ["--no-guard"]
    announced: list[Event] = []
    enough = threading.Event()

    def receive(data: bytes) -> None:
        announced.extend(e for e in decode_events(data)[1] if e.kind is EventKind.LAP)
        if len(announced) >= 3:
            enough.set()

    server = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        with ClientLink(address, "race", timeout_s=60.0) as link:
            link.listen(topics.EVENTS, receive)
            assert enough.wait(60.0)
            os.kill(server.pid, signal.SIGKILL)
    finally:
        server.kill()
        server.communicate(timeout=10.0)
    assert all(lap_is_in(path, event) for event in announced)
    (race,) = races(path)
    assert race["ended"] is None


def test_rules_versions_tell_settings_apart_but_not_the_number_of_laps() -> None:
    assert keeper.rules_version(Rules(laps=3)) == keeper.rules_version(Rules(laps=5))
    assert keeper.rules_version(Rules(items=True)) != keeper.rules_version(Rules(items=False))
    assert keeper.driver_version("a stranger") == ""
