"""The results file: what a race leaves, what can be wrong with it, and what it can be asked."""

import csv
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
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.core.messages import Event, EventKind, Standing, Status
from race_server.errors import ResultsError
from race_server.live.server import LOCKSTEP, REAL, RaceResult, RaceServer
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.spectate import decode_events
from race_server.scenario.race import Rules, Scenario
from race_server.session import Session
from race_server.session.lap_log import Lap
from race_server.storage.results import keeper, schema
from race_server.storage.results.export import export
from race_server.storage.results.keeper import Keeper
from race_server.storage.results.queries import all_laps, best_laps, finished_races, races
from race_server.storage.results.ratings import ratings
from race_server.storage.results.schema import MIGRATIONS, default_path, open_file, version_of
from race_server.storage.results.store import FINISHED, Change, Entry, Outcome, Race, Store
from race_server.storage.results.writer import Writer
from support.courses import TINY_RING


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "results.sqlite"


def a_race(*drivers: str, track: str = "ring") -> Race:
    entries = tuple(Entry(seat, name, "1", "tt02") for seat, name in enumerate(drivers))
    return Race(
        "2026-01-01T00:00:00.000+00:00",
        "race",
        track,
        "d1",
        "tt02",
        3,
        "real",
        1,
        "1-a",
        "0.1.0",
        entries,
    )


def standing(seat: int, driver: str, rank: int) -> Standing:
    return Standing(seat, driver, rank, 3, Status.FINISHED, 9, 8, 27, 0, 1, 5, 2)


def outcome(*drivers: str) -> Outcome:
    """Return the end of a race whose drivers, in order of their seats, came in that order."""
    rows = tuple(standing(seat, name, seat + 1) for seat, name in enumerate(drivers))
    return Outcome("digest", FINISHED, rows)


def fill(path: Path, *changes: Change) -> None:
    with Store(path) as store:
        store.write(changes)


# The file


def test_what_is_written_is_read_back(path: Path) -> None:
    lap = Lap(1, 1, 8_000_000, (3_000_000, 5_000_000), True)
    fill(path, a_race("ann", "bob"), lap, outcome("ann", "bob"))
    (race,) = races(path)
    assert (race["track"], race["ended"], race["digest"]) == ("ring", "finished", "digest")
    assert [entry["driver"] for entry in race["entries"]] == ["ann", "bob"]
    assert race["entries"][0]["penalty_us"] == 5
    (row,) = all_laps(path)
    assert (row["driver"], row["time_us"], row["is_clean"]) == ("bob", 8_000_000, True)
    assert json.loads(row["sectors"]) == [3_000_000, 5_000_000]


def test_the_file_is_in_wal_mode_and_its_tables_are_strict(path: Path) -> None:
    fill(path)
    with closing(open_file(path)) as connection:
        assert connection.execute("pragma journal_mode").fetchone()[0] == "wal"
        with pytest.raises(sqlite3.IntegrityError, match="cannot store TEXT value"):
            connection.execute(
                "insert into lap values (1, 1, 1, 'fast', '[]', 1)",
            )


def test_a_change_that_fails_takes_the_whole_transaction_back(path: Path) -> None:
    lap, stranger = Lap(0, 1, 8, (), True), Lap(7, 1, 8, (), True)
    with Store(path) as store:
        with pytest.raises(sqlite3.IntegrityError):
            store.write([a_race("ann"), lap, stranger])
        assert races(path) == []
        store.write([a_race("ann"), lap])
    assert len(all_laps(path)) == 1


def test_a_file_of_version_1_is_migrated_and_keeps_its_rows(path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(schema, "MIGRATIONS", MIGRATIONS[:1])
        fill(path, a_race("ann"), Lap(0, 1, 8, (), True))
        with closing(open_file(path)) as connection:
            assert version_of(connection) == 1
    assert len(all_laps(path)) == 1
    with closing(open_file(path)) as connection:
        assert version_of(connection) == len(MIGRATIONS)
        names = {row["name"] for row in connection.execute("select name from sqlite_schema")}
    assert "race_by_track" in names


def test_a_migration_that_fails_leaves_the_file_as_it_was(path: Path) -> None:
    fill(path, a_race("ann"))
    with pytest.MonkeyPatch.context() as patch:
        broken = ("create table podium (id integer) strict", "nonsense")
        patch.setattr(schema, "MIGRATIONS", (*MIGRATIONS, broken))
        with pytest.raises(ResultsError, match="cannot be used"):
            races(path)
    with closing(open_file(path)) as connection:
        assert version_of(connection) == len(MIGRATIONS)
        found = connection.execute("select 1 from sqlite_schema where name = 'podium'")
        assert found.fetchall() == []
    assert len(races(path)) == 1


def test_a_file_from_a_newer_version_is_refused_and_left_alone(path: Path) -> None:
    fill(path, a_race("ann"))
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("pragma user_version = 99")
    before = path.read_bytes()
    for attempt in (lambda: races(path), lambda: fill(path)):
        with pytest.raises(ResultsError, match=r"newer race-server \(version 99.*update race-s"):
            attempt()
    assert path.read_bytes() == before


def test_a_locked_file_is_a_clear_error(path: Path) -> None:
    fill(path)
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("begin immediate")
        with pytest.raises(ResultsError, match=r"results.sqlite is locked by another program.*--r"):
            Store(path, busy_s=0.1)
        assert races(path) == []  # a reader is not in the way


@pytest.mark.parametrize("damage", [b"this is no database, it is a letter " * 40, b""])
def test_a_damaged_file_is_a_clear_error(path: Path, damage: bytes) -> None:
    fill(path, a_race("ann"))
    whole = path.read_bytes()
    path.write_bytes(damage or whole[:4096] + b"\x55" * (len(whole) - 4096))
    with pytest.raises(ResultsError, match=r"results.sqlite is damaged.*move it away"):
        races(path)


def test_a_file_that_is_not_there_or_not_ours_is_a_clear_error(path: Path) -> None:
    with pytest.raises(ResultsError, match="does not exist; race first"):
        races(path)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("create table recipes (name text)")
    with pytest.raises(ResultsError, match="SQLite file of another program"):
        fill(path)
    with pytest.raises(ResultsError, match="cannot be used"):
        fill(path / "below a file")


def test_many_servers_can_make_the_same_file_at_once(path: Path) -> None:
    errors: list[ResultsError] = []

    def make() -> None:
        try:
            fill(path, a_race("ann"))
        except ResultsError as error:
            errors.append(error)

    threads = [threading.Thread(target=make) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10.0)
    assert not errors
    assert len(races(path)) == 8


def test_the_file_lies_where_the_variable_or_the_desktop_standard_says(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert default_path() is None  # as the tests are set up
    monkeypatch.setenv("RACE_SERVER_RESULTS", str(tmp_path / "mine"))
    assert default_path() == tmp_path / "mine"
    monkeypatch.delenv("RACE_SERVER_RESULTS")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert default_path() == tmp_path / "race-server" / "results.sqlite"


# What a live race writes


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
        time.sleep(0.1)
        super().write(changes)


@pytest.mark.net
@pytest.mark.parametrize("pace", [LOCKSTEP, REAL])
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
        assert result.missed_ticks < 10  # the disk took six ticks for each of four laps


@pytest.mark.net
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


@pytest.mark.net
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


@pytest.mark.net
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


# What the file can be asked


def two_tracks(path: Path) -> None:
    fill(
        path,
        a_race("ann", "bob"),
        Lap(0, 1, 9_000_000, (), True),
        Lap(0, 2, 8_000_000, (), False),
        Lap(1, 1, 8_500_000, (), True),
        outcome("ann", "bob"),
    )
    fill(path, a_race("bob", "cid", track="oval"), Lap(0, 1, 70_000_000, (), True))


def test_races_are_listed_newest_first_by_track_driver_and_number(path: Path) -> None:
    two_tracks(path)
    assert [race["track"] for race in races(path)] == ["oval", "ring"]
    assert [race["track"] for race in races(path, limit=1)] == ["oval"]
    assert [race["track"] for race in races(path, track="ring")] == ["ring"]
    assert [race["id"] for race in races(path, driver="ann")] == [1]
    assert races(path, driver="ann")[0]["best_lap_us"] == 8_000_000
    assert races(path, driver="nobody") == []


def test_the_best_lap_is_that_of_each_driver_on_each_track(path: Path) -> None:
    two_tracks(path)
    found = [(row["track"], row["driver"], row["best_lap_us"]) for row in best_laps(path)]
    assert found == [
        ("oval", "bob", 70_000_000),
        ("ring", "ann", 8_000_000),
        ("ring", "bob", 8_500_000),
    ]
    ann = best_laps(path, track="ring")[0]
    assert (ann["is_clean"], ann["best_clean_lap_us"], ann["laps"]) == (False, 9_000_000, 2)


def test_an_export_holds_every_lap_in_both_formats(path: Path, tmp_path: Path) -> None:
    two_tracks(path)
    laps = all_laps(path)
    export(laps, tmp_path / "laps.csv")
    with (tmp_path / "laps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["time_us"]) for row in rows] == [lap["time_us"] for lap in laps]
    assert rows[0]["driver"] == "ann"
    parquet = pytest.importorskip("pyarrow.parquet")
    export(laps, tmp_path / "laps.parquet")
    assert parquet.read_table(tmp_path / "laps.parquet").to_pylist() == laps


def test_an_export_that_cannot_be_is_one_clear_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ResultsError, match=r"exported as .csv or .parquet"):
        export([], tmp_path / "laps.xls")
    with pytest.raises(ResultsError, match="cannot be written: No such file"):
        export([], tmp_path / "nowhere" / "laps.csv")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ResultsError, match=r"needs pyarrow, from the extra `results`"):
        export([], tmp_path / "laps.parquet")


def test_who_wins_is_rated_above_who_loses(path: Path) -> None:
    for _ in range(3):
        fill(path, a_race("ann", "bob", "cid"), outcome("ann", "bob", "cid"))
    fill(path, a_race("cid", "ann"))  # not ended: does not count
    rated = ratings(finished_races(path))
    assert [row.driver for row in rated] == ["ann", "bob", "cid"]
    assert {row.races for row in rated} == {3}
    assert rated[0].ordinal == pytest.approx(rated[0].mu - 3.0 * rated[0].sigma)


def test_a_driver_with_several_karts_counts_once_by_their_mean_rank() -> None:
    mixed = [("ann", 1), ("bob", 2), ("bob", 3), ("ann", 6)]
    assert [row.driver for row in ratings([mixed])] == ["bob", "ann"]
    assert ratings([[("ann", 1), ("ann", 2)]]) == []


def test_ratings_without_openskill_name_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "openskill.models", None)
    with pytest.raises(ResultsError, match=r"need openskill, from the extra `results`"):
        ratings([])


@pytest.mark.parametrize("words", [["list"], ["best"], ["ratings"]])
def test_the_commands_print_tables_and_json(path: Path, words: list[str]) -> None:
    two_tracks(path)
    command = [sys.executable, "-m", "race_server", "results", *words, "--results", str(path)]
    table, document = (
        subprocess.run(line, check=True, capture_output=True, text=True, timeout=60).stdout
        for line in (command, [*command, "--json"])
    )
    assert "ann" in table
    assert "ann" in json.dumps(json.loads(document))


@pytest.mark.parametrize("words", [["start", "--track", "oval"], ["serve"], ["results", "list"]])
def test_no_command_begins_with_a_file_that_it_cannot_use(path: Path, words: list[str]) -> None:
    path.write_bytes(b"no database" * 100)
    command = [sys.executable, "-m", "race_server", *words, "--results", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert f"error: results file {path} is damaged" in done.stderr
    assert "Traceback" not in done.stderr
