"""The laps of a recorded race, with their traces: the recording is driven again."""

from dataclasses import dataclass, replace

import numpy as np

from race_server.coaching.circumstances import TRAFFIC_S, Circumstances
from race_server.competition.time_trial.gaps import DECISION_TICKS
from race_server.competition.time_trial.lap import Mark, TrialLap, laps_of, note_of
from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.messages import Cleanness, Event, EventKind, Flag
from race_server.core.state import Floats
from race_server.errors import RecordingError
from race_server.scenario.race import Scenario
from race_server.session.session import Session
from race_server.storage.recording.reader import Recording
from race_server.storage.recording.rerun import Rerun


@dataclass(frozen=True, eq=False)
class RecordedLap:
    """A lap of a race, and what happened in it."""

    seat: int
    driver: str
    lap: TrialLap
    circumstances: Circumstances


@dataclass(frozen=True, eq=False)
class RecordedLaps:
    """All laps of a recording, in the order of seats and laps."""

    scenario: Scenario
    laps: tuple[RecordedLap, ...]
    remark: str  # why they end early; empty where they do not


class _Seat:
    """One kart of the race while it is driven again."""

    def __init__(self, number: int) -> None:
        self.number = number
        self.notes: list[tuple[float, ...]] = []
        self.marks: list[Mark] = []
        self.circumstances: list[Circumstances] = []
        self._noted = 0  # tick
        self._begin()

    def _begin(self) -> None:
        self._now = Circumstances(is_flying=bool(self.marks), is_clean=True)
        self._walls = self._rescues = 0

    def note(self, session: Session, gap_s: float) -> None:
        """Keep where the kart is. gap_s: to the kart ahead [s]."""
        world = session.world
        body, racer = world.bodies[0, self.number], world.racers[0, self.number]
        since_lights = (session.tick - int(world.races[0].start_tick)) * TICK_S
        self.notes.append(note_of(since_lights, body, racer))
        spent, now = (session.tick - self._noted) * TICK_S, self._now
        self._noted = session.tick
        acts = bool((world.players["effects"]["source"][0, self.number] > 0).any())
        cautioned = racer.yellow or world.races[0].flag in (Flag.YELLOW, Flag.RED)
        self._now = replace(
            now,
            effect_s=now.effect_s + spent * acts,
            caution_s=now.caution_s + spent * bool(cautioned),
            traffic_s=now.traffic_s + spent * (gap_s < TRAFFIC_S),
        )

    def take(self, event: Event, end_us: int) -> None:
        """Take what happened to the kart. end_us: when its last lap ended, of a lap."""
        now = self._now
        if event.kind is EventKind.HIT:
            self._now = replace(now, hits=now.hits + 1)
        elif event.kind is EventKind.CONTACT_KART:
            self._now = replace(now, contacts=now.contacts + 1)
        elif event.kind is EventKind.CONTACT_WALL:
            self._walls += 1
        elif event.kind is EventKind.RESCUED:
            self._rescues += 1
        elif event.kind is EventKind.LAP:
            is_clean = event.detail == Cleanness.CLEAN
            mark = Mark(end_us, event.value, (), is_clean, self._walls, self._rescues)
            self.circumstances.append(replace(now, is_clean=is_clean))
            self.marks.append(mark)
            self._begin()


def recorded_laps(recording: Recording) -> RecordedLaps:
    """Return the laps of a recording.

    The race is driven again from its journal, without scans. Where the world of this version
    differs from the recorded one, the laps end, and a remark says so.

    Raises:
        RecordingError: it does not fit this version, or was made in a car park.
    """
    rerun = Rerun(recording, is_blind=True)
    session = rerun.session
    course = session.scenario.course
    if course.lot is not None or not len(course.line):
        raise RecordingError(
            f"recording {recording.path} is of the car park {course.name}: there are no laps in it"
        )
    seats = [_Seat(number) for number in range(len(session.seats))]
    _note(session, seats, course.length)
    # A rerun stops wherever inputs came; laps are of samples at equal steps.
    for events in rerun.run(1):
        _tell(session, seats, events)
        if session.tick % DECISION_TICKS == 0:
            _note(session, seats, course.length)
    if session.tick % DECISION_TICKS:
        _note(session, seats, course.length)
    difference = rerun.difference
    remark = (
        f"from {difference.tick * TICK_S:.1f} s on the race differs from the recorded one"
        if difference
        else ""
    )
    found = tuple(
        RecordedLap(seat.number, session.seats[seat.number].driver, lap, circumstances)
        for seat in seats
        for lap, circumstances in zip(
            laps_of(seat.notes, seat.marks, course.length, flying=False),
            seat.circumstances,
            strict=True,
        )
    )
    return RecordedLaps(session.scenario, found, remark)


def _tell(session: Session, seats: list[_Seat], events: list[Event]) -> None:
    for event in events:
        touched = event.other if event.kind is EventKind.CONTACT_KART else -1
        for number in (event.kart, touched):
            if 0 <= number < len(seats):
                end_us = int(session.world.racers[0, number].lap_start_us)
                seats[number].take(event, end_us)


def _note(session: Session, seats: list[_Seat], length: float) -> None:
    world = session.world
    gaps = gaps_ahead(
        world.racers["progress"][0],
        world.bodies["speed"][0],
        world.bodies["status"][0] == codes.RACING,
        length,
    )
    for seat in seats:
        seat.note(session, float(gaps[seat.number]))


def gaps_ahead(progress: Floats, speed: Floats, racing: np.ndarray, length: float) -> Floats:
    """Return how long (K,) [s] each kart takes to where the next one ahead is; inf without one.

    progress: (K,) [m] along the course of `length` [m]; speed: (K,) [m/s]; racing: (K,) karts that
    are on the course.
    """
    ahead = (progress[None, :] - progress[:, None]) % length
    ahead[:, ~racing] = np.inf
    np.fill_diagonal(ahead, np.inf)
    nearest = ahead.min(axis=1)
    return np.asarray(np.where(racing, nearest / np.maximum(speed, 0.1), np.inf))
