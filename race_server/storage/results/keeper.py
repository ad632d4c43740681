"""What of a race goes into the results file: who drove, every lap, how it ended."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import entry_points

from race_server.core.driver import ENTRY_POINTS
from race_server.core.messages import Phase, Standing
from race_server.scenario.race import Rules
from race_server.session.lap_log import Lap
from race_server.session.seats import Seat
from race_server.session.session import Session
from race_server.storage.queue import Ticket
from race_server.storage.results.store import FINISHED, STOPPED, Correction, Entry, Outcome, Race
from race_server.storage.results.writer import Writer
from race_server.version import __version__

# The end of a race waits no longer than this for the file.
HOLD_S = 3.0


class Keeper:
    """Writes one race after another."""

    def __init__(self, writer: Writer) -> None:
        """Write through `writer`."""
        self._writer = writer
        self._outcome: Outcome | None = None  # of the race that was closed last

    def begin(self, session: Session, pace: str, started_at: str = "") -> None:
        """Open a race in the file. started_at: UTC, ISO 8601; now, if it is empty."""
        self._outcome = None
        self._writer.submit(_race_of(session, pace, started_at or utc_now()))

    def resume(self, session: Session, pace: str, started_at: str) -> None:
        """Open a race again that a server which was killed has begun."""
        race = _race_of(session, pace, started_at)
        self._writer.submit(replace(race, is_taken_up=True))

    def end(self, session: Session) -> None:
        """Close a race in the file, and wait until that is done."""
        ended = FINISHED if session.phase is Phase.FINISHED else STOPPED
        self._outcome = Outcome(session.digest(), ended, tuple(session.standings()))
        self._writer.submit(self._outcome).wait(HOLD_S)

    def amend(self, standings: Sequence[Standing]) -> None:
        """Replace the result of the race that was closed last, as soon as the file can be written.

        Nothing waits for the file: links and real karts need the server meanwhile.
        """
        if self._outcome is not None:
            self._outcome = replace(self._outcome, standings=tuple(standings))
            self._writer.submit(self._outcome)

    def correct(self, correction: Correction) -> None:
        """Change the result of a race of an event, as soon as the file can be written.

        Nothing waits for the file: another race may be on.
        """
        self._writer.submit(correction)

    def add_laps(self, laps: Iterable[Lap]) -> Ticket:
        """Hand laps over to the file, and return the ticket of the last."""
        ticket = self._writer.nothing
        for lap in laps:
            ticket = self._writer.submit(lap)
        return ticket


def utc_now() -> str:
    """Return the time as it is written down."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _race_of(session: Session, pace: str, started_at: str) -> Race:
    scenario = session.scenario
    entries = tuple(_entry_of(session, seat) for seat in session.lined_up())
    occasion = scenario.occasion
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
        event=occasion.event if occasion else "",
        format=occasion.format if occasion else "",
        title=occasion.title if occasion else "",
    )


def _entry_of(session: Session, seat: Seat) -> Entry:
    vehicle = session.scenario.vehicle_of(seat.number).name
    return Entry(seat.number, seat.driver, driver_version(seat.driver), vehicle)


def rules_version(rules: Rules) -> str:
    """Return what two races must share to have been driven by the same rules, but for the laps."""
    apart = ("laps", "edition")
    settings = {name: value for name, value in asdict(rules).items() if name not in apart}
    text = json.dumps(settings, sort_keys=True)
    return f"{rules.edition}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


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
