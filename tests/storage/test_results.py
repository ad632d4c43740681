"""The results file: what is written, and what can be wrong with it."""

import json
import sqlite3
import threading
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from race_agents.policies.registry import policy_path
from race_server.errors import ResultsError, ScenarioError
from race_server.session.lap_log import Lap
from race_server.storage.recording.logbook import folder_of
from race_server.storage.results import schema
from race_server.storage.results.queries import all_laps, races, trace_of
from race_server.storage.results.schema import (
    MIGRATIONS,
    default_path,
    open_file,
    path_of,
    version_of,
)
from race_server.storage.results.store import Store
from support.results import a_race, fill, outcome


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


def test_a_lap_that_is_driven_again_after_a_kill_replaces_the_one_before(path: Path) -> None:
    begun = a_race("ann")
    fill(path, begun, Lap(0, 1, 8_000_000, (8_000_000,), True))
    # Its server was killed before that lap was in the recording; driven again it took longer.
    fill(path, replace(begun, is_taken_up=True), Lap(0, 1, 9_000_000, (9_000_000,), False))
    (row,) = all_laps(path)
    assert (row["time_us"], row["is_clean"]) == (9_000_000, False)
    assert json.loads(row["sectors"]) == [9_000_000]


def test_a_race_whose_server_was_killed_right_after_its_end_is_in_the_file_once(
    path: Path,
) -> None:
    begun, lap = a_race("ann"), Lap(0, 1, 8_000_000, (8_000_000,), True)
    # The end was committed, the recording not yet closed: the next server takes the race up.
    fill(path, begun, lap, outcome("ann"))
    fill(path, replace(begun, is_taken_up=True), lap, outcome("ann"))
    (race,) = races(path)
    assert race["ended"] == "finished"
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


@pytest.mark.parametrize(
    ("word", "instead"),
    [(b"seed integer", b"seed integ\x94r"), (b"status text", b"statuz text")],
)
def test_a_file_with_a_damaged_table_is_a_clear_error(
    path: Path, word: bytes, instead: bytes
) -> None:
    fill(path, a_race("ann"))
    whole = path.read_bytes()
    assert whole.count(word) == 1
    path.write_bytes(whole.replace(word, instead))
    for attempt in (lambda: races(path), lambda: fill(path)):
        with pytest.raises(ResultsError, match=r"results.sqlite is damaged.*move it away"):
            attempt()


def test_text_that_is_not_utf_8_and_a_trace_that_is_none_are_a_clear_error(path: Path) -> None:
    fill(path, a_race("ann"), Lap(0, 1, 8, (), True))
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("insert into trace values (1, 0, 1, '[]', x'00')")
        connection.commit()
    with pytest.raises(ResultsError, match=r"results.sqlite is damaged.*move it away"):
        trace_of(path, 1, 0, 1)
    path.write_bytes(path.read_bytes().replace(b"ann", b"a\xffn"))
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


def test_a_server_waits_while_another_makes_the_file(path: Path) -> None:
    with closing(sqlite3.connect(path, isolation_level=None, check_same_thread=False)) as other:
        other.execute("begin immediate")
        ends = threading.Timer(0.2, other.execute, ("rollback",))
        ends.start()
        fill(path, a_race("ann"))
        ends.join()
    assert len(races(path)) == 1


def test_a_home_of_no_user_is_named_before_anything_is_driven() -> None:
    for path_of_words in (path_of, folder_of, policy_path):
        with pytest.raises(ScenarioError, match=r"~nosuch/x: ~nosuch is the home of no user here"):
            path_of_words("~nosuch/x")


def test_a_user_without_a_home_is_told_what_to_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("XDG_DATA_HOME", raising=False)
    monkeypatch.delenv("RACE_SERVER_RESULTS", raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda words: words)
    with pytest.raises(ScenarioError, match=r"let \$XDG_DATA_HOME or \$HOME name a folder"):
        default_path()


def test_the_file_lies_where_the_variable_or_the_desktop_standard_says(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert default_path() is None  # as the tests are set up
    monkeypatch.setenv("RACE_SERVER_RESULTS", str(tmp_path / "mine"))
    assert default_path() == tmp_path / "mine"
    monkeypatch.delenv("RACE_SERVER_RESULTS")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert default_path() == tmp_path / "race-server" / "results.sqlite"
