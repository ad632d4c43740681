"""What of a race goes into the results file: who drove, every lap, how it ended."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import entry_points

from race_server import __version__
from race_server.core.driver import ENTRY_POINTS
from race_server.core.messages import Event, EventKind, Phase, Standing
from race_server.scenario.race import Rules
from race_server.session import Session
from race_server.session.seats import Seat
from race_server.storage.results.store import FINISHED, STOPPED, Entry, Lap, Outcome, Race
from race_server.storage.results.writer import Writer

# The rule book as code; raise it when the same settings come to mean another race.
RULE_BOOK = 1
# The end of a race waits no longer than this for the file.
HOLD_S = 3.0
# After one of these a lap is not clean, see `lap_clean` in the stages of the world.
DIRTY = {
    EventKind.CONTACT_WALL,
    EventKind.SHORT_CUT,
    EventKind.OFF_TRACK,
    EventKind.RESCUED,
}


class Keeper:
    """Writes one race after another."""

    def __init__(self, writer: Writer) -> None:
        """Write through `writer`."""
        self._writer = writer
        self._sectors: dict[int, list[int]] = {}
        self._dirty: set[int] = set()
        self._outcome: Outcome | None = None  # of the race that was closed last

    def begin(self, session: Session, pace: str, started_at: str = "") -> None:
        """Open a race in the file. started_at: UTC, ISO 8601; now, if it is empty."""
        self._sectors.clear()
        self._outcome = None
        self._writer.submit(_race_of(session, pace, started_at or utc_now()))

    def take_up(self, session: Session, pace: str, started_at: str) -> None:
        """Open a race again that a server which was killed has begun."""
        self._sectors.clear()
        race = _race_of(session, pace, started_at)
        self._writer.submit(replace(race, is_taken_up=True))

    def end(self, session: Session) -> None:
        """Close a race in the file, and wait until that is done."""
        ended = FINISHED if session.phase is Phase.FINISHED else STOPPED
        self._outcome = Outcome(session.digest(), ended, tuple(session.standings()))
        self._writer.wait(self._writer.submit(self._outcome), HOLD_S)

    def amend(self, standings: Sequence[Standing]) -> None:
        """Replace the result of the race that was closed last, and wait until that is done."""
        if self._outcome is not None:
            self._outcome = replace(self._outcome, standings=tuple(standings))
            self._writer.wait(self._writer.submit(self._outcome), HOLD_S)

    def look(self, session: Session) -> None:
        """Note before a tick whose lap has been clean so far."""
        clean = session.world.racers["lap_clean"][0]
        self._dirty = {kart for kart in range(len(clean)) if not clean[kart]}

    def keep(self, events: list[Event]) -> int:
        """Hand the laps among the newest events to the file, and return the ticket of the last."""
        ticket = 0
        for event in events:
            if (lap := self._lap_of(event)) is not None:
                ticket = self._writer.submit(lap)
        return ticket

    def is_settled(self, ticket: int) -> bool:
        """Return whether a lap is in the file, or the file cannot be written now."""
        return self._writer.is_settled(ticket)

    def wait(self, ticket: int, timeout_s: float) -> bool:
        """Wait until it is; False if it is not by the timeout."""
        return self._writer.wait(ticket, timeout_s)

    def _lap_of(self, event: Event) -> Lap | None:
        """Return the lap that an event completes."""
        if event.kind in DIRTY:
            self._dirty.add(event.kart)
        elif event.kind is EventKind.SECTOR:
            self._sectors.setdefault(event.kart, []).append(event.value)
        elif event.kind is EventKind.LAP:
            sectors = tuple(self._sectors.pop(event.kart, ()))
            is_clean = event.kart not in self._dirty
            return Lap(event.kart, event.other, event.value, sectors, is_clean)
        return None


def utc_now() -> str:
    """Return the time as it is written down."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _race_of(session: Session, pace: str, started_at: str) -> Race:
    scenario = session.scenario
    entries = tuple(_entry_of(session, seat) for seat in session.seats if seat.is_taken)
    vehicles = dict.fromkeys(entry.vehicle for entry in entries)
    return Race(
        started_at=started_at,
        session=session.name,
        track=scenario.course.name,
        track_digest=scenario.course.digest,
        vehicle=", ".join(vehicles),
        laps=scenario.rules.laps,
        pace=pace,
        seed=scenario.seed,
        rules_version=rules_version(scenario.rules),
        server_version=__version__,
        entries=entries,
    )


def _entry_of(session: Session, seat: Seat) -> Entry:
    vehicle = session.scenario.vehicle_of(seat.number).name
    return Entry(seat.number, seat.driver, driver_version(seat.driver), vehicle)


def rules_version(rules: Rules) -> str:
    """Return what two races must share to have been driven by the same rules, but for the laps."""
    settings = {name: value for name, value in asdict(rules).items() if name != "laps"}
    text = json.dumps(settings, sort_keys=True)
    return f"{RULE_BOOK}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


@cache
def driver_version(name: str) -> str:
    """Return the package and version that offers a driver here; empty for a stranger.

    The network carries no version: a driver that calls itself by the name of an installed one is
    taken for it.
    """
    for point in entry_points(group=ENTRY_POINTS):
        if point.name == name and point.dist is not None:
            return f"{point.dist.name} {point.dist.version}"
    return ""
