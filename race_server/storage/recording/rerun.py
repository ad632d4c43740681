"""Driving a recorded race again, and telling whether it is the same race."""

from collections.abc import Iterator
from dataclasses import dataclass

from race_server.core.clock import TICKS_PER_SECOND, ticks_of
from race_server.core.messages import Event
from race_server.core.stages.sightings import APART, REMEMBERED
from race_server.errors import RecordingError
from race_server.session.interventions import ON_KARTS, Intervention
from race_server.session.journal_entries import Entry, Inputs
from race_server.session.seats import Seat
from race_server.session.session import Session
from race_server.session.tracked.karts import Placements
from race_server.storage.recording.reader import Recording
from race_server.storage.recording.scenario_codec import unpack_scenario

# The part at the end of a blind rerun in which sensors scan: each does so twice at least. Where
# vehicles remember what they saw it is longer, and they remember the same, with its speed.
SEEING_TICKS, REMEMBERING_TICKS = TICKS_PER_SECOND, ticks_of(REMEMBERED + APART)


@dataclass(frozen=True)
class Difference:
    """The first tick at which the race driven again is another one."""

    tick: int
    recorded: str
    found: str
    # Where the race driven again was over at `tick`, and the recorded one was not: its last digest.
    recorded_to: int | None = None


def session_of(recording: Recording) -> Session:
    """Return a session at the start of a recorded race, with all drivers in their seats.

    Raises:
        RecordingError: the recording does not fit this version.
    """
    start = recording.start
    scenario = unpack_scenario(start.setting, start.arrays)
    try:
        session = Session(start.session, scenario, decision_ticks=start.decision_ticks)
        for row in start.seats:
            seat = Seat(row.number, row.driver, row.preset, row.key, is_tracked=row.is_tracked)
            seat.is_taken = seat.is_ready = True
            session.seats.put(seat)
            if row.is_tracked:
                session.tracked_karts.admit(row.number, scenario.vehicle_of(row.number))
        session.epoch = start.epoch - 1
        session.start()
    # Whatever a race trips over that no server would have begun.
    except Exception as error:
        raise RecordingError(f"recording {recording.path} makes no race: {error}") from error
    return session


def _check_seats(entry: Entry, recording: Recording, seats: int) -> None:
    """Do nothing for what concerns karts of the race; the world has no others.

    Raises:
        RecordingError: it concerns others.
    """
    numbers: list[int] = []
    if isinstance(entry, Inputs):
        numbers = entry.seats.tolist()
    elif isinstance(entry, Placements):
        numbers = entry.rows[:, 0].astype(int).tolist()
    elif isinstance(entry, Intervention):
        numbers = [entry.kart] if entry.kind in ON_KARTS else []
    if other := [number for number in numbers if not 0 <= number < seats]:
        raise RecordingError(
            f"recording {recording.path} is damaged: seat {other[0]} is not in a race of {seats}"
        )


class Rerun:
    """A recorded race as it is driven again."""

    def __init__(self, recording: Recording, *, is_blind: bool = False) -> None:
        """Line up.

        is_blind: take no scans but in the last seconds, which makes it several times faster. No
        race depends on scans but through what its drivers did, which is recorded.

        Raises:
            RecordingError: the recording does not fit this version.
        """
        self.recording, self.is_blind = recording, is_blind
        self.session = session_of(recording)
        for entry in recording.entries:
            _check_seats(entry, recording, len(self.session.seats))
        self.difference: Difference | None = None
        self.compared = 0  # digests that were equal

    def run(self, most_ticks: int = TICKS_PER_SECOND) -> Iterator[list[Event]]:
        """Drive to the last tick that is known, and yield what happened on the way.

        It goes in one step from one change to the next, at most `most_ticks` at a time, and ends
        early where a digest is another one, or where the race is over before the last of them, see
        `difference`.
        """
        session, recording = self.session, self.recording
        entries = iter(recording.entries)
        digests = iter(recording.digests)
        entry, digest = next(entries, None), next(digests, None)
        while True:
            tick = session.tick
            while digest is not None and digest[0] <= tick:
                if digest[0] == tick and not self._agrees(*digest):
                    return
                digest = next(digests, None)
            while entry is not None and entry.tick <= tick:
                session.repeat(entry)
                entry = next(entries, None)
            if self._is_over(digest):
                return
            stop = min(recording.last_tick, tick + most_ticks)
            stop = stop if entry is None else min(stop, entry.tick)
            stop = stop if digest is None else min(stop, digest[0])
            yield self._move(stop - tick)

    def _is_over(self, digest: tuple[int, str] | None) -> bool:
        """Return whether nothing is left to drive. digest: the next one to compare."""
        session = self.session
        if session.tick < self.recording.last_tick:
            # A server that takes several ticks in a step ends its last one behind the race's end.
            is_in_step = digest is not None and digest[0] - session.tick < session.decision_ticks
            if session.is_on or is_in_step:
                return False
        if digest is not None:
            last, recorded = self.recording.digests[-1]
            self.difference = Difference(session.tick, recorded, session.digest(), last)
        return True

    def _move(self, ticks: int) -> list[Event]:
        fitted = self.session.world.bodies["sensors"]
        remembers = self.session.world.sight.sightings.size > 0
        seeing = REMEMBERING_TICKS if remembers else SEEING_TICKS
        if not self.is_blind or self.session.tick + ticks > self.recording.last_tick - seeing:
            return self.session.move(ticks)
        sensors = fitted.copy()
        fitted[:] = 0
        events = self.session.move(ticks)
        fitted[:] = sensors
        return events

    def _agrees(self, tick: int, recorded: str) -> bool:
        found = self.session.digest()
        if found != recorded:
            self.difference = Difference(tick, recorded, found)
            return False
        self.compared += 1
        return True
