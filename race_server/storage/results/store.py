"""Writing to the results file: plain rows in, one transaction for as many as there are."""

import json
import sqlite3
import zlib
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np

from race_server.core.messages import Standing
from race_server.core.state import Float32s
from race_server.session.lap_log import Lap
from race_server.storage.results.schema import BUSY_S, explained, open_file, transaction

FINISHED, STOPPED = "finished", "stopped"


@dataclass(frozen=True)
class Entry:
    """Who takes part in a race."""

    seat: int
    driver: str
    driver_version: str
    vehicle: str


@dataclass(frozen=True)
class Race:
    """A race that begins."""

    started_at: str  # UTC, ISO 8601
    session: str
    track: str
    track_digest: str
    vehicle: str
    laps: int
    pace: str
    seed: int
    rules_version: str
    server_version: str
    entries: tuple[Entry, ...]
    event: str = ""  # this and the rest: of a race of an event, see `scenario.race.Occasion`
    format: str = ""
    title: str = ""
    is_taken_up: bool = False  # a server that was killed has begun it


@dataclass(frozen=True, eq=False)
class Trace:
    """Where a kart was in a lap; comes after that lap."""

    seat: int
    number: int
    columns: tuple[str, ...]
    numbers: Float32s  # (columns, N)


@dataclass(frozen=True)
class Outcome:
    """A race that is over."""

    digest: str
    ended: str  # FINISHED or STOPPED
    standings: tuple[Standing, ...]


@dataclass(frozen=True)
class Correction:
    """The result of a race of an event, after stewards changed it: that of any race so far."""

    event: str
    title: str
    rows: tuple[tuple[int, int, int, int], ...]  # rank, race_time_us, penalty_us, seat


# Fields of a race that are no columns of its table, and those that are empty without an event.
_NO_COLUMNS = ("entries", "is_taken_up")
_OF_AN_EVENT = ("event", "format", "title")

Change = Race | Lap | Trace | Outcome | Correction

# How the numbers of a trace lie in the file, whatever machine wrote them.
TRACE_TYPE = np.dtype("<f4")


class Store:
    """An open results file that a live race writes to. Laps belong to the race last begun."""

    def __init__(self, path: Path, *, busy_s: float = BUSY_S) -> None:
        """Open or make the file, and see that it can be written.

        busy_s: another program may hold the file for this long.

        Raises:
            ResultsError: it is locked, damaged, newer, or cannot be written.
        """
        self.path = path
        self._race = 0
        self._connection = open_file(path, create=True, busy_s=busy_s)
        try:
            with explained(path), transaction(self._connection):
                pass
            # Copying the log back waits for the disk: it is done between races, not at a lap.
            self._connection.execute("pragma wal_autocheckpoint = 0")
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def write(self, changes: Sequence[Change]) -> None:
        """Commit changes in order, all or none.

        Raises:
            ResultsError: they cannot be written now.
        """
        race = self._race
        with explained(self.path), transaction(self._connection):
            for change in changes:
                if isinstance(change, Race):
                    race = self._add_race(change)
                elif isinstance(change, Lap):
                    self._add_lap(race, change)
                elif isinstance(change, Trace):
                    self._add_trace(race, change)
                elif isinstance(change, Correction):
                    self._correct(change)
                else:
                    self._end_race(race, change)
        self._race = race
        if any(isinstance(change, Outcome) for change in changes):
            self._tidy()

    def _add_race(self, race: Race) -> int:
        """Return the number of a new race, or of one that a server which was killed has begun."""
        if race.is_taken_up:
            begun = self._connection.execute(
                # It may have an end here that its recording, which came later, has not.
                "select id from race where session = ? and started_at = ? order by id desc",
                (race.session, race.started_at),
            ).fetchone()
            if begun is not None:
                return int(begun[0])
        left_out = _NO_COLUMNS if race.event else (*_NO_COLUMNS, *_OF_AN_EVENT)
        names = [field.name for field in fields(race) if field.name not in left_out]
        number = self._connection.execute(
            f"insert into race ({', '.join(names)}) values ({', '.join('?' * len(names))})",
            [getattr(race, name) for name in names],
        ).lastrowid
        assert number is not None
        self._connection.executemany(
            "insert into entry (race, seat, driver, driver_version, vehicle) "
            "values (?, ?, ?, ?, ?)",
            [(number, *astuple(entry)) for entry in race.entries],
        )
        return number

    def _add_lap(self, race: int, lap: Lap) -> None:
        sectors = json.dumps(lap.sectors)
        self._connection.execute(
            # Of a race that is taken up the laps come again. One that was committed right before
            # its server was killed, and is in no recording, may have become another one.
            "insert into lap values (?, ?, ?, ?, ?, ?) on conflict do update set "
            "time_us = excluded.time_us, sectors = excluded.sectors, is_clean = excluded.is_clean",
            (race, lap.seat, lap.number, lap.time_us, sectors, int(lap.is_clean)),
        )

    def _add_trace(self, race: int, trace: Trace) -> None:
        packed = zlib.compress(trace.numbers.astype(TRACE_TYPE).tobytes())
        self._connection.execute(
            "insert into trace values (?, ?, ?, ?, ?)",
            (race, trace.seat, trace.number, json.dumps(trace.columns), packed),
        )

    def _end_race(self, race: int, outcome: Outcome) -> None:
        self._connection.execute(
            "update race set digest = ?, ended = ? where id = ?",
            (outcome.digest, outcome.ended, race),
        )
        self._connection.executemany(
            "update entry set rank = ?, status = ?, race_time_us = ?, penalties = ?, "
            "penalty_us = ?, items_used = ?, ending = ?, way = ?, moves = ? "
            "where race = ? and seat = ?",
            [
                (
                    row.rank,
                    row.status.name.lower(),
                    row.race_time_us,
                    row.penalties,
                    row.penalty_us,
                    row.items_used,
                    *_parking_of(row),
                    race,
                    row.seat,
                )
                for row in outcome.standings
            ],
        )

    def _correct(self, change: Correction) -> None:
        self._connection.executemany(
            "update entry set rank = ?, race_time_us = ?, penalty_us = ? where seat = ? and race = "
            "(select max(id) from race where event = ? and title = ?)",
            [(*row, change.event, change.title) for row in change.rows],
        )

    def _tidy(self) -> None:
        """Copy the log back into the file, or leave it to the next race while others read."""
        try:
            self._connection.execute("pragma wal_checkpoint(passive)").fetchall()
        except sqlite3.Error:
            return


def _parking_of(row: Standing) -> tuple[str | None, float | None, int | None]:
    """Return how a way to a slot ended, its length [m], and its changes of direction."""
    parking = row.parking
    if parking is None:
        return None, None, None
    return parking.ending.name.lower(), parking.way, parking.moves
