"""The results file: where it lies, its tables, its migrations, and what can be wrong with it.

A migration is never changed once released; a new one is added at the end. `user_version` of the
file counts those that it has been through.
"""

import os
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from itertools import chain
from pathlib import Path

from race_server.errors import ResultsError
from race_server.user_data import path_named, user_data

VARIABLE = "RACE_SERVER_RESULTS"
NOWHERE = "none"
# Written into the header, so that another program's SQLite file is distinguished from ours: "RACE".
APPLICATION = 0x52414345
# Another program may hold the file for at most this long.
BUSY_S = 2.0
_AGAIN_S = 0.01

_TABLES = (
    """
    create table race (
        id integer primary key autoincrement,
        started_at text not null,      -- UTC, ISO 8601
        session text not null,
        track text not null,
        track_digest text not null,
        vehicle text not null,
        laps integer not null,         -- to the finish; 0: no limit
        pace text not null,
        seed integer not null,
        rules_version text not null,
        server_version text not null,
        digest text not null default '',
        ended text check (ended in ('finished', 'stopped'))  -- null: not, or the server died
    ) strict
    """,
    """
    create table entry (
        race integer not null references race (id),
        seat integer not null,
        driver text not null,
        driver_version text not null,  -- '' where it is not known
        vehicle text not null,
        rank integer,                  -- this and the rest: null until the race has ended
        status text,
        race_time_us integer,          -- penalties included; 0: not finished
        penalties integer,
        penalty_us integer,
        items_used integer,
        primary key (race, seat)
    ) strict, without rowid
    """,
    """
    create table lap (
        race integer not null,
        seat integer not null,
        number integer not null,
        time_us integer not null,
        sectors text not null,         -- JSON list of times in microseconds
        is_clean integer not null check (is_clean in (0, 1)),
        primary key (race, seat, number),
        foreign key (race, seat) references entry (race, seat)
    ) strict, without rowid
    """,
)
_INDICES = (
    "create index race_by_track on race (track, vehicle)",
    "create index entry_by_driver on entry (driver)",
)
# Where a kart was in a lap, so that others can drive against it. A separate table: few laps have
# one, and questions about laps need not read past ten kilobytes each.
_TRACES = (
    """
    create table trace (
        race integer not null,
        seat integer not null,
        number integer not null,
        columns text not null,         -- JSON list of names
        numbers blob not null,         -- zlib of float32, little-endian, column by column
        primary key (race, seat, number),
        foreign key (race, seat, number) references lap (race, seat, number)
    ) strict
    """,
)
# How a vehicle fared on its way to its slot, whose length is in metres; null in races.
_PARKING = (
    "alter table entry add column ending text",
    "alter table entry add column way real",
    "alter table entry add column moves integer",
)
# Of a race of an event: the name of the event, that of its format, and which race of it.
_EVENTS = (
    "alter table race add column event text not null default ''",
    "alter table race add column format text not null default ''",
    "alter table race add column title text not null default ''",
)
MIGRATIONS = (_TABLES, _INDICES, _TRACES, _PARKING, _EVENTS)

# What SQLite reports, what that means, and the way out.
_OTHER_FILE = "name another with --results FILE, or race without: --results none"
_DAMAGED = (
    "is damaged",
    f"move it away (`sqlite3 FILE .recover` saves what is left), or {_OTHER_FILE}",
)
_MEANINGS = {
    "SQLITE_BUSY": ("is locked by another program", f"end that program, or {_OTHER_FILE}"),
    "SQLITE_LOCKED": ("is locked by another program", f"end that program, or {_OTHER_FILE}"),
    "SQLITE_NOTADB": ("is damaged, or no results file", f"move it away, or {_OTHER_FILE}"),
    "SQLITE_CORRUPT": _DAMAGED,
    "": _DAMAGED,  # said by Python: text that is not UTF-8
    "SQLITE_READONLY": ("cannot be written", f"make it and its folder writable, or {_OTHER_FILE}"),
    "SQLITE_CANTOPEN": ("cannot be opened", f"see to its folder and rights, or {_OTHER_FILE}"),
    "SQLITE_FULL": ("cannot grow: the disk is full", f"make room, or {_OTHER_FILE}"),
}


def default_path() -> Path | None:
    """Return where results go by default; None for nowhere."""
    if named := os.environ.get(VARIABLE):
        return path_of(named)
    return user_data("results.sqlite")


def path_of(words: str) -> Path | None:
    """Return the file that an option names: the default where it is empty, None for `none`.

    Raises:
        ScenarioError: it is in the home of no user.
    """
    if not words:
        return default_path()
    return None if words == NOWHERE else path_named(words)


def damaged(path: Path, why: object) -> ResultsError:
    """Return the error for a file whose content makes no sense."""
    what, way_out = _DAMAGED
    return ResultsError(f"results file {path} {what} ({why}); {way_out}")


@contextmanager
def explained(path: Path) -> Iterator[None]:
    """Turn what goes wrong with a results file into one clear sentence.

    Raises:
        ResultsError: names the file, what is wrong and the way out.
    """
    try:
        yield
    except (sqlite3.IntegrityError, sqlite3.ProgrammingError):
        raise  # not the file's fault
    # UnicodeDecodeError: of a message of SQLite that quotes what stands in the file.
    except (sqlite3.Error, UnicodeDecodeError) as error:
        name = getattr(error, "sqlite_errorname", "")
        kind = "_".join(name.split("_")[:2])
        what, way_out = _MEANINGS.get(kind, ("cannot be used", _OTHER_FILE))
        raise ResultsError(f"results file {path} {what} ({error}); {way_out}") from error
    except OSError as error:
        reason = error.strerror or error
        raise ResultsError(
            f"results file {path} cannot be used ({reason}); {_OTHER_FILE}"
        ) from error


def open_file(path: Path, *, create: bool = False, busy_s: float = BUSY_S) -> sqlite3.Connection:
    """Return a connection to a results file, brought up to date.

    busy_s: another program may hold the file for this long.

    Raises:
        ResultsError: there is none, or it is locked, damaged, newer or not ours.
    """
    with explained(path):
        if create:
            path.parent.mkdir(parents=True, exist_ok=True)
        elif not path.exists():
            raise ResultsError(
                f"results file {path} does not exist; race first, or name another with --results"
            )
        connection = sqlite3.connect(
            path, timeout=busy_s, isolation_level=None, check_same_thread=False
        )
        try:
            connection.row_factory = sqlite3.Row
            _prepare(connection, path, busy_s)
        except BaseException:
            connection.close()
            raise
    return connection


def version_of(connection: sqlite3.Connection) -> int:
    """Return how many migrations a file has been through."""
    return int(connection.execute("pragma user_version").fetchone()[0])


def _prepare(connection: sqlite3.Connection, path: Path, busy_s: float) -> None:
    connection.execute("pragma foreign_keys = on")
    connection.execute("pragma synchronous = normal")
    _refuse_what_is_not_ours(connection, path)
    if version_of(connection) < len(MIGRATIONS):
        _write_ahead(connection, busy_s)
        _migrate(connection)
    if not _columns_known() <= _columns_of(connection):
        raise damaged(path, "it lacks columns")


def _write_ahead(connection: sqlite3.Connection, busy_s: float) -> None:
    """Let one write while others read; wait for others here, since SQLite does not at this."""
    ends_s = time.monotonic() + busy_s
    while True:
        try:
            connection.execute("pragma journal_mode = wal")
        except sqlite3.OperationalError as error:
            is_busy = error.sqlite_errorcode & 0xFF == sqlite3.SQLITE_BUSY  # or a kind of it
            if not is_busy or time.monotonic() >= ends_s:
                raise
            time.sleep(_AGAIN_S)
        else:
            return


def _columns_of(connection: sqlite3.Connection) -> set[tuple[str, str]]:
    """Return table and name of each column."""
    rows = connection.execute(
        "select tables.name, columns.name from sqlite_schema as tables, "
        "pragma_table_info(tables.name) as columns where tables.type = 'table'"
    )
    return {(table, column) for table, column in rows}


def _columns_known() -> set[tuple[str, str]]:
    """Return table and name of each column that a file has after all migrations."""
    with closing(sqlite3.connect(":memory:")) as model:
        for statement in chain.from_iterable(MIGRATIONS):
            model.execute(statement)
        return _columns_of(model)


def _refuse_what_is_not_ours(connection: sqlite3.Connection, path: Path) -> None:
    # One look at one state of the file: another server may be making it at this moment.
    connection.execute("begin")
    version = version_of(connection)
    application = connection.execute("pragma application_id").fetchone()[0]
    tables = connection.execute("select count(*) from sqlite_schema").fetchone()[0]
    connection.execute("commit")
    if application != APPLICATION and (version or tables):
        raise ResultsError(
            f"results file {path} is the SQLite file of another program; {_OTHER_FILE}"
        )
    if version > len(MIGRATIONS):
        raise ResultsError(
            f"results file {path} is from a newer race-server (version {version}, this one knows "
            f"{len(MIGRATIONS)}); update race-server, or {_OTHER_FILE}"
        )


def _migrate(connection: sqlite3.Connection) -> None:
    """Take a file through the migrations that it lacks, all or none of them."""
    with transaction(connection):
        # Another program may have migrated it in the meantime.
        for number in range(version_of(connection), len(MIGRATIONS)):
            for statement in MIGRATIONS[number]:
                connection.execute(statement)
        connection.execute(f"pragma application_id = {APPLICATION}")
        connection.execute(f"pragma user_version = {len(MIGRATIONS)}")


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """Write all of a block or nothing."""
    connection.execute("begin immediate")
    try:
        yield
        connection.execute("commit")
    except BaseException:
        if connection.in_transaction:
            connection.execute("rollback")
        raise
