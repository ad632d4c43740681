"""Protests against a result, and what a record is once they are decided.

A record stays as it was driven. Decisions stand beside it, and each result is worked out from both.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from race_server.competition.race_day.record import DeletedLap, RaceRecord, TeamResult
from race_server.core.clock import MICROSECONDS

OPEN, UPHELD, DISMISSED, DISQUALIFIED = "open", "upheld", "dismissed", "disqualified"


@dataclass(frozen=True)
class Protest:
    """A protest of one team against another, and what stewards decided, also by themselves."""

    number: int  # from 1
    drive: int  # that it is about: its record, from 0
    title: str  # of that attempt or race
    by: str  # team; empty where stewards decided by themselves
    against: str  # team
    why: str
    lodged_at: str  # UTC, ISO 8601
    verdict: str = OPEN  # or UPHELD, DISMISSED, DISQUALIFIED
    seconds: float = 0.0  # added to the time of the team that it is against
    decided_at: str = ""
    decided_by: str = ""

    @property
    def outcome(self) -> str:
        """The verdict in words."""
        added = f", +{self.seconds:g} s" if self.seconds else ""
        return self.verdict + added


def result_of(record: RaceRecord, protests: Iterable[Protest]) -> RaceRecord:
    """Return a record with what the decisions on protests about it change, ranked again."""
    drives, gone = record.drives, set[str]()
    for protest in protests:
        changed = _CHANGES.get(protest.verdict)
        if changed is None:
            continue
        gone |= {protest.against} if protest.verdict == DISQUALIFIED else set()
        drives = tuple(
            changed(drive, protest) if drive.team == protest.against else drive for drive in drives
        )
    if drives == record.drives:
        return record
    places = {team: place for place, team in enumerate(record.grid)}

    def rank(drive: TeamResult) -> tuple[float, ...]:
        """As in the race: by time, then the better best lap, then the grid."""
        best_us = drive.best_lap_us or math.inf
        return drive.time_us, best_us, places.get(drive.team, 0)

    placed = sorted((drive for drive in drives if drive.place), key=rank)
    ranked = [replace(drive, place=place) for place, drive in enumerate(placed, start=1)]
    out = sorted((drive for drive in drives if not drive.place), key=lambda one: one.team in gone)
    return replace(record, drives=(*ranked, *out))


def _penalised(drive: TeamResult, protest: Protest) -> TeamResult:
    added_us = round(protest.seconds * MICROSECONDS)
    remark = f"+{protest.seconds:g} s protest {protest.number}"
    return replace(
        drive,
        time_us=drive.time_us + added_us if drive.place else 0,
        penalty_us=drive.penalty_us + added_us,
        stewards_us=drive.stewards_us + added_us,
        remark="; ".join(filter(None, (drive.remark, remark))),
    )


def _disqualified(drive: TeamResult, protest: Protest) -> TeamResult:
    """Return a result without place, time and laps that count."""
    laps = range(1, len(drive.lap_times_us) + 1)
    # One remark: sheet and page say each part between two "; " in the reader's language.
    remark = f"disqualified: {protest.why.replace('; ', ', ')}"
    return replace(
        drive,
        place=0,
        time_us=0,
        deleted=tuple(DeletedLap(lap, "disqualified") for lap in laps),
        remark="; ".join(filter(None, (drive.remark, remark))),
    )


_CHANGES: dict[str, Callable[[TeamResult, Protest], TeamResult]] = {
    UPHELD: _penalised,
    DISQUALIFIED: _disqualified,
}
