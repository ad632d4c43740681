"""What stands in a results file: races, laps and how a race ended."""

from pathlib import Path

from race_server.core.messages import Standing, Status
from race_server.storage.results.store import FINISHED, Change, Entry, Outcome, Race, Store


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
