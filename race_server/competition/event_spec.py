"""An event that is to be served, and how it begins or is found again."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from race_server.competition.event_state import (
    Entrant,
    EventFile,
    EventState,
    event_files,
    read_event,
)
from race_server.competition.race_day.formats import Format
from race_server.competition.race_day.plan import DayPlan, teams_of
from race_server.errors import ScenarioError
from race_server.live.server import RaceServer
from race_server.logs import Log
from race_server.scenario.race import ABSENT, Scenario
from race_server.storage.recording.reader import Recording
from race_server.storage.recording.scenario_codec import unpack_scenario
from race_server.storage.results.keeper import utc_now


@dataclass(frozen=True)
class EventSpec:
    """An event that is to be served."""

    format: Format
    tracks: Mapping[str, str]  # names of the courses by letter
    vehicle: str
    seed: int
    folder: Path  # of its file, and of the recordings
    call_s: float  # a driver that is not ready by then, after its call, does not start
    review_s: float  # after each stage, and each round, stewards may still decide
    cool_down_s: float = 0.0  # after an attempt or race, before the next one begins
    needs_line: bool = False
    numbers: Mapping[str, int] = field(default_factory=dict)  # of drivers, by their names


def waiting_scenario(plan: DayPlan, seats: int) -> Scenario:
    """Return what stands in the world of an event until its first race. seats: of the session."""
    letter = plan.format.letters[0]
    course = plan.courses[letter]
    order = [place if place < len(course.grid) else ABSENT for place in range(seats)]
    scenario = plan.scenario(plan.format.stages[0], course, 1)
    return replace(scenario, karts=seats, grid_order=tuple(order))


def begin_event(server: RaceServer, spec: EventSpec, awaited: int) -> EventState | None:
    """Wait for the drivers of a new event; None where the server is stopped meanwhile.

    Raises:
        DriverError: the server is to fill seats, and no driver can take part.
        ScenarioError: the event cannot be driven by as many.
    """
    session = server.session
    session.is_event = True
    server.lobby.gather(awaited, server.fillers)
    if server.is_stopped:
        return None
    seats, numbers = session.seats.taken(), spec.numbers
    known = {name: f"{number} {name}" for name, number in numbers.items()}
    teams = teams_of([known.get(seat.driver, seat.driver) for seat in seats])
    entrants = tuple(
        Entrant(
            seat=seat.number,
            team=team.name,
            driver=seat.driver,
            preset=seat.preset,
            key=seat.key.hex(),
            number=numbers.get(seat.driver, 0),
            is_local=seat.number in server.local_drivers,
            is_apart=seat.number in server.processes,
            is_tracked=seat.is_tracked,
        )
        for seat, team in zip(seats, teams, strict=True)
    )
    begun_at = utc_now()
    state = EventState(
        name=f"{session.name} {begun_at}",
        begun_at=begun_at,
        format=spec.format,
        tracks=dict(spec.tracks),
        vehicle=spec.vehicle,
        seed=spec.seed,
        pace=server.pace,
        needs_line=spec.needs_line,
        entrants=entrants,
        epoch=session.epoch,
    )
    state.plan().check()
    return state


def file_name(server: RaceServer) -> str:
    """Return by what name a server keeps its events: that of its recordings, which is its alone."""
    return server.logbook.session if server.logbook else server.session.name


def unfinished_event(spec: EventSpec, name: str, seats: int, log: Log) -> EventState | None:
    """Return the event of a server that has begun and is not over, None where there is none.

    name: of its file, see `file_name`; seats: of the server now.

    Raises:
        ScenarioError: it is of another format, has drivers on more seats or titles that are not
            clear, or cannot be read.
    """
    state = EventFile(spec.folder, name).read()
    if state is None:
        return None
    if state.format.name != spec.format.name:
        raise ScenarioError(
            f"the event {state.name} is not over and has format {state.format.name}: go on with "
            f"--format {state.format.name}, or begin another one with --fresh"
        )
    if len(state.records) < state.plan().drives():
        # An event of before titles were checked; what was driven in it is found by them.
        state.format.check_names(
            f"the event {state.name} cannot go on", "begin another one with --fresh"
        )
    needed = 1 + max(one.seat for one in state.entrants)
    if needed > seats:
        raise ScenarioError(
            f"the event {state.name} is not over and has a driver on seat {needed - 1}: go on with "
            f"--karts {needed} or more, or begin another one with --fresh"
        )
    done = f"{len(state.records)} of {state.plan().drives()}"
    log.warn("going on with an event", name=state.name, driven=done)
    return state


def check_free(folder: Path, name: str) -> None:
    """Check that single races take no drivers away from an event that is not over.

    name: of its file, see `file_name`.

    Raises:
        ScenarioError: one has begun, or its file cannot be read.
    """
    state = EventFile(folder, name).read()
    if state is not None:
        raise ScenarioError(
            f"the event {state.name} is not over, {len(state.records)} attempts and races driven: "
            f"go on with --format {state.format.name}, name another --session, or serve single "
            "races beside it with --fresh"
        )


def event_ended_since(instant_s: float, spec: EventSpec, name: str) -> EventState | None:
    """Return the event that was served to its end since an instant, None where there is none.

    instant_s: as the times of files. name: of its file, see `file_name`.
    """
    for path in event_files(spec.folder, name):
        if path.stat().st_mtime < instant_s:
            return None
        with suppress(ScenarioError):
            if (state := read_event(path)).is_final:
                return state
    return None


def is_part_of(spec: EventSpec, name: str, recording: Recording) -> bool:
    """Return whether a race that is not over is one of the event that is not over.

    Raises:
        RaceError: the event or the recording cannot be read.
    """
    state = EventFile(spec.folder, name).read()
    scenario = unpack_scenario(recording.start.setting, recording.start.arrays)
    occasion = scenario.occasion
    return state is not None and occasion is not None and occasion.event == state.name


def put_away(folder: Path, name: str, log: Log) -> None:
    """Keep an event that has begun under another name, so that another one begins.

    name: of its file, see `file_name`.

    Raises:
        ScenarioError: its file cannot be moved.
    """
    file = EventFile(folder, name)
    try:
        try:
            state = file.read()
        except ScenarioError as error:
            log.warn(f"{error}; it is kept as {file.put_aside()}")
            return
        if state is not None:
            file.put_away(state)
            log.warn("an unfinished event does not go on", name=state.name)
    except OSError as error:
        raise ScenarioError(
            f"event {file.path} cannot be moved ({error.strerror or error}); name another folder "
            "with --record"
        ) from error
