"""What a results file can be asked. Rows are plain dictionaries, ready for JSON."""

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from race_server.errors import ResultsError
from race_server.storage.results.schema import damaged, explained, open_file
from race_server.storage.results.store import TRACE_TYPE

Row = dict[str, Any]

# An hour of 60 rows a second and 16 columns.
MOST_TRACE_BYTES = 1 << 24

_RACES = """
    select race.id, started_at, session, track, track_digest, race.vehicle, laps, pace, seed,
        rules_version, server_version, digest, ended, event, format, title,
        (select count(*) from lap where lap.race = race.id) as laps_driven,
        (select min(time_us) from lap where lap.race = race.id) as best_lap_us
    from race
    where (:track = '' or track = :track) and (:driver = '' or exists (
        select 1 from entry where entry.race = race.id and entry.driver = :driver))
    order by race.id desc limit :limit
"""
_ENTRIES = "select * from entry where race = ? order by rank is null, rank, seat"
_BEST = """
    select driver, driver_version, track, track_digest, vehicle, laps, best_lap_us, is_clean,
        best_clean_lap_us, race, seed, rules_version
    from (
        select entry.driver, entry.driver_version, race.track, race.track_digest, entry.vehicle,
            lap.time_us as best_lap_us, lap.is_clean, lap.race, race.seed, race.rules_version,
            count(*) over peers as laps,
            min(case when is_clean then time_us end) over peers as best_clean_lap_us,
            row_number() over (peers order by lap.time_us, lap.race) as place
        from lap join entry using (race, seat) join race on race.id = lap.race
        where :track = '' or race.track = :track
        window peers as (
            partition by entry.driver, race.track, race.track_digest, entry.vehicle)
    )
    where place = 1 order by track, track_digest, vehicle, best_lap_us
"""
_OF_ENTRY = """
    race.id as race, started_at, session, track, track_digest, entry.vehicle, race.laps as
        race_laps, pace, seed, rules_version, server_version, ended, event, format, title,
        entry.seat, driver, driver_version, rank, status
"""
_LAPS = f"""
    select {_OF_ENTRY}, number as lap, time_us, sectors, is_clean
    from lap join entry using (race, seat) join race on race.id = lap.race
    order by race.id, lap.number, lap.seat
"""
_CLASSIFICATIONS = f"""
    select {_OF_ENTRY}, count(number) as laps, min(time_us) as best_lap_us, race_time_us,
        penalties, penalty_us, items_used, ending, way, moves
    from entry join race on race.id = entry.race left join lap using (race, seat)
    group by entry.race, entry.seat
    order by entry.race, rank is null, rank, entry.seat
"""
_ON = """
    select lap.race, lap.seat, lap.number, driver, race.track, race.track_digest, entry.vehicle,
        time_us, sectors, is_clean, started_at, trace.race is not null as has_trace
    from lap join entry using (race, seat) join race on race.id = lap.race
        left join trace using (race, seat, number)
    where race.track = :track and race.track_digest = :digest
    order by time_us, lap.race, lap.seat, lap.number
"""
_TRACE = "select columns, numbers from trace where race = ? and seat = ? and number = ?"


def races(path: Path, *, track: str = "", driver: str = "", limit: int = 20) -> list[Row]:
    """Return the newest races with their entries, newest first; a negative limit takes all.

    Raises:
        ResultsError: the file cannot be read.
    """
    words = {"track": track, "driver": driver, "limit": limit}
    with explained(path):
        connection = open_file(path)
        try:
            rows = [dict(row) for row in connection.execute(_RACES, words)]
            for row in rows:
                entries = [dict(entry) for entry in connection.execute(_ENTRIES, (row["id"],))]
                row["entries"] = [
                    {name: value for name, value in entry.items() if name != "race"}
                    for entry in entries
                ]
        finally:
            connection.close()
    return rows


def best_laps(path: Path, *, track: str = "") -> list[Row]:
    """Return the best lap of each driver on each track (and edition of it) with each vehicle.

    Raises:
        ResultsError: the file cannot be read.
    """
    return [_with_truth(row) for row in _ask(path, _BEST, {"track": track})]


def all_laps(path: Path) -> list[Row]:
    """Return every lap with all that is known of it, in order.

    Raises:
        ResultsError: the file cannot be read.
    """
    return [_with_truth(row) for row in _ask(path, _LAPS)]


def classifications(path: Path) -> list[Row]:
    """Return every kart of every race with its place and its sums, in order.

    A race that has not ended has no places yet.

    Raises:
        ResultsError: the file cannot be read.
    """
    return _ask(path, _CLASSIFICATIONS)


def finished_races(path: Path) -> list[list[tuple[str, int]]]:
    """Return driver and rank of each kart of each race that ran to its end, oldest first.

    A race is left out where a damaged file has lost a rank of it.

    Raises:
        ResultsError: the file cannot be read.
    """
    rows = _ask(
        path,
        "select race, driver, rank from entry join race on race.id = race "
        "where ended = 'finished' order by race, rank",
    )
    found: dict[int, list[tuple[str, int]]] = {}
    for row in rows:
        found.setdefault(row["race"], []).append((row["driver"], row["rank"]))
    return [ranks for ranks in found.values() if all(rank is not None for _, rank in ranks)]


def laps_on(path: Path, *, track: str, digest: str) -> list[Row]:
    """Return all laps on one edition of a track, the fastest first.

    Raises:
        ResultsError: the file cannot be read.
    """
    rows = _ask(path, _ON, {"track": track, "digest": digest})
    return [{**_with_truth(row), "has_trace": bool(row["has_trace"])} for row in rows]


def trace_of(path: Path, race: int, seat: int, number: int) -> dict[str, Any]:
    """Return the trace of a lap by column, each shape (N,); empty where none is kept.

    Raises:
        ResultsError: the file cannot be read.
    """
    rows = _ask(path, _TRACE, (race, seat, number))
    if not rows:
        return {}
    try:
        return decode_trace(rows[0]["columns"], rows[0]["numbers"])
    except ResultsError as error:
        raise damaged(path, f"the trace of lap {race}/{seat}/{number} {error}") from error


def decode_trace(columns: str, numbers: bytes) -> dict[str, Any]:
    """Return a trace by column, each shape (N,).

    Raises:
        ResultsError: it is damaged, or longer than that of any lap.
    """
    unpacker = zlib.decompressobj()
    try:
        names = json.loads(columns)
        data = unpacker.decompress(numbers, MOST_TRACE_BYTES)
        table = np.frombuffer(data, TRACE_TYPE).reshape(len(names), -1).astype(np.float64)
        found = dict(zip(names, table, strict=True))
    except (ValueError, TypeError, RecursionError, zlib.error) as error:
        raise ResultsError(f"is damaged: {str(error)[:80]}") from error
    if not unpacker.eof or not all(isinstance(name, str) for name in found):
        raise ResultsError(f"is damaged, or longer than {MOST_TRACE_BYTES} bytes")
    return found


def _ask(path: Path, question: str, words: Row | tuple[int, ...] | None = None) -> list[Row]:
    with explained(path):
        connection = open_file(path)
        try:
            return [dict(row) for row in connection.execute(question, words or {})]
        finally:
            connection.close()


def _with_truth(row: Row) -> Row:
    return {**row, "is_clean": bool(row["is_clean"])}
