"""The laps of a recorded race, with their traces: the recording is driven again."""

from dataclasses import dataclass

from race_server.coaching.circumstances import Circumstances
from race_server.competition.lap_witness import Around, LapWitness, gaps_ahead, touched
from race_server.competition.time_trial.gaps import DECISION_TICKS
from race_server.competition.time_trial.lap import TrialLap, note_of
from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.messages import Event, Flag
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
    seats = [LapWitness(number) for number in range(len(session.seats))]
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
        for lap, circumstances in seat.laps(course.length)
    )
    return RecordedLaps(session.scenario, found, remark)


def _tell(session: Session, seats: list[LapWitness], events: list[Event]) -> None:
    for event in events:
        for number in touched(event):
            if number < len(seats):
                end_us = int(session.world.racers[0, number].lap_start_us)
                seats[number].take(event, end_us)


def _note(session: Session, seats: list[LapWitness], length: float) -> None:
    world, race = session.world, session.world.races[0]
    gaps = gaps_ahead(
        world.racers["progress"][0],
        world.bodies["speed"][0],
        world.bodies["status"][0] == codes.RACING,
        length,
    )
    since_lights = (session.tick - int(race.start_tick)) * TICK_S
    acts = (world.players["effects"]["source"][0] > 0).any(axis=1)
    for seat in seats:
        racer = world.racers[0, seat.number]
        is_cautioned = bool(racer.yellow or race.flag in (Flag.YELLOW, Flag.RED))
        around = Around(bool(acts[seat.number]), is_cautioned, float(gaps[seat.number]))
        seat.note(note_of(since_lights, world.bodies[0, seat.number], racer), around)
