"""Between a race and its audience: a lap is in the results file before anybody is told of it."""

import hashlib
import json
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import entry_points

from race_server import __version__
from race_server.driver import ENTRY_POINTS
from race_server.messages import Event, EventKind, Phase
from race_server.results.store import FINISHED, STOPPED, Entry, Lap, Outcome, Race
from race_server.results.writer import Writer
from race_server.scenario.base import Rules
from race_server.session import Seat, Session

# The rule book as code; raise it when the same settings come to mean another race.
RULE_BOOK = 1
# An announcement is held back no longer than this, whatever the file does.
HOLD_S = 3.0
# After one of these a lap is not clean, see `lap_clean` in the stages of the world.
DIRTY = {
    EventKind.CONTACT_WALL,
    EventKind.SHORT_CUT,
    EventKind.OFF_TRACK,
    EventKind.RESCUED,
}


class Keeper:
    """Writes one race after another, and holds back what is not yet committed."""

    def __init__(self, writer: Writer) -> None:
        """Write through `writer`."""
        self._writer = writer
        self._held: deque[tuple[int, float, list[Event]]] = deque()
        self._sectors: dict[int, list[int]] = {}
        self._dirty: set[int] = set()

    def begin(self, session: Session, pace: str) -> None:
        """Open a race in the file."""
        self._held.clear()
        self._sectors.clear()
        self._writer.submit(_race_of(session, pace))

    def end(self, session: Session) -> None:
        """Close a race in the file, and wait until that is done."""
        ended = FINISHED if session.phase is Phase.FINISHED else STOPPED
        outcome = Outcome(session.digest(), ended, tuple(session.standings()))
        self._writer.wait(self._writer.submit(outcome), HOLD_S)

    def look(self, session: Session) -> None:
        """Note before a tick whose lap has been clean so far."""
        clean = session.world.karts["lap_clean"][0]
        self._dirty = {kart for kart in range(len(clean)) if not clean[kart]}

    def keep(self, events: list[Event]) -> None:
        """Hand the laps among the newest events to the file, and hold them all back until then."""
        ticket = 0
        for event in events:
            if (lap := self._lap_of(event)) is not None:
                ticket = self._writer.submit(lap)
        if events:
            self._held.append((ticket, time.monotonic() + HOLD_S, events))

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

    def released(self, *, wait: bool) -> Iterator[list[Event]]:
        """Yield, in order, the events that may be told now; with `wait`, all of them."""
        while self._held:
            ticket, deadline, events = self._held[0]
            now = time.monotonic()
            if wait:
                self._writer.wait(ticket, max(deadline - now, 0.0))
            elif now < deadline and not self._writer.is_settled(ticket):
                return
            self._held.popleft()
            yield events

    def told(self, events: Iterable[Event]) -> list[Event]:
        """Return those of the events that are not held back."""
        first = self._held[0][2][0].sequence if self._held else None
        return [event for event in events if first is None or event.sequence < first]


def _race_of(session: Session, pace: str) -> Race:
    scenario = session.scenario
    entries = tuple(_entry_of(session, seat) for seat in session.seats if seat.is_taken)
    vehicles = dict.fromkeys(entry.vehicle for entry in entries)
    return Race(
        started_at=datetime.now(UTC).isoformat(timespec="milliseconds"),
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
