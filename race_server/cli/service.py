"""Serve race after race, as `race serve` does.

Imports everything that serving needs, so that a server that replaces a killed one has it loaded.
"""

import json
import os
import signal
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from race_server.cli.document import print_document
from race_server.cli.outcome import show_result
from race_server.competition.event_spec import (
    EventSpec,
    begin_event,
    check_free,
    event_ended_since,
    file_name,
    is_part_of,
    put_away,
    unfinished_event,
)
from race_server.competition.event_state import EventState
from race_server.competition.live_event import LiveEvent
from race_server.competition.race_day.day import Day
from race_server.competition.race_day.report import event_document
from race_server.competition.race_day.table import print_tables
from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Event, Phase
from race_server.errors import KeysError, RaceError, RecordingError
from race_server.live.driver_processes import Command as DriverCommand
from race_server.live.driver_processes import DriverProcesses
from race_server.live.server import REAL, RaceResult, RaceServer
from race_server.live.server.resume import restore_session
from race_server.live.server.wheels import VALET
from race_server.live.suspects import Suspects
from race_server.live.watchdog import HUNG_S, Watchdog
from race_server.logs import LISTENING, Log
from race_server.net.auth.keys import ServerKeys
from race_server.net.auth.token import local_token
from race_server.net.transport import ServerLink
from race_server.scenario.race import Scenario
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook, folder_of, recordings_of
from race_server.storage.recording.reader import Recording, read_recording
from race_server.storage.results.keeper import Keeper, utc_now
from race_server.storage.results.writer import writer_for
from race_server.storage.whole_file import write_whole
from race_server.terminal import Console, say


@dataclass(frozen=True)
class Service:
    """What is to be served."""

    scenario: Scenario
    session: str
    pace: str
    fillers: tuple[str, ...]
    awaited: int  # drivers
    listen: str
    steward_listen: str
    results: str
    record: str
    result: Path | None
    once: bool
    review: float  # [s]
    metrics: int | None  # port
    as_json: bool
    keys: ServerKeys | None  # None: closed to other machines
    is_guarded: bool  # by a supervisor
    valet: str = VALET  # driver that parks on request
    measures: bool = False  # who parks from outside, against the plan of that driver
    apart: DriverCommand | None = None  # how fillers run that are kept apart; None: inside
    event: EventSpec | None = None  # in place of single races
    suspects: Suspects = field(default_factory=Suspects)  # shared with the supervisor
    begun_at: str = field(default_factory=utc_now)  # of the first server


def serve_with_status(service: Service, log: Log, *, fresh: bool, replaces: bool) -> int:
    """Serve, and return the exit status; print an error as `race` does."""
    try:
        serve_races(service, log, fresh=fresh, replaces=replaces)
    except RaceError as error:
        say(f"error: {error}", error=True)
        return 2
    return 0


def serve_races(service: Service, log: Log, *, fresh: bool, replaces: bool = False) -> None:
    """Serve race after race until stopped.

    fresh: do not resume an unfinished race; replaces: a server that has ended, so that what cannot
    be written any more is no reason not to serve.
    """
    with ExitStack() as stack:
        stack.enter_context(log)
        writer = logbook = None
        with _survived(log, "races go on without a results file") if replaces else nullcontext():
            writer = stack.enter_context(writer_for(service.results, log.warn))
        with _survived(log, "races go on without recordings") if replaces else nullcontext():
            logbook = stack.enter_context(_logbook(service.record, service.session, log))
        keeper = Keeper(writer) if writer else None
        if logbook and service.event is None and not (fresh or replaces):
            check_free(logbook.folder, logbook.session)
        race, resumed = _resumed(service, logbook, keeper, log, fresh=fresh) or (None, None)
        is_single = service.once and service.event is None
        if replaces and is_single and race is None and _is_driven(service, logbook, log):
            return
        race = race or Session(service.session, service.scenario)
        karts, keys = len(race.seats), service.keys
        address, name = service.listen, service.session
        link = stack.enter_context(_listening(service, karts))
        token = keys.token if keys else steward_token(address, name, log, stack)
        server = RaceServer(
            race,
            link,
            service.pace,
            service.fillers,
            keeper,
            logbook,
            token,
            log,
            amended=lambda result: _publish_result(result.as_json(), race, service, log),
            watchdog=Watchdog(HUNG_S),
            suspects=service.suspects,
            processes=stack.enter_context(DriverProcesses(service.apart, log)),
            valet=service.valet,
            measures=service.measures,
        )
        stack.callback(server.watchdog.rest)
        _stop_on_signals(server, is_guarded=service.is_guarded)
        title = race.scenario.course.title
        for seat in service.suspects.barred():
            log.warn("left out: its driver hung or crashed the server", seat=seat)
        log.say(LISTENING, address=address, session=race.name, course=title, seats=karts)
        if service.metrics is not None:
            from race_server.live.server.metrics import LOOPBACK, exposed

            port = stack.enter_context(exposed(server, service.metrics))
            log.say("metrics", address=f"http://{LOOPBACK}:{port}/metrics")
        if service.event is None:
            _serve_single_races(server, service, log, resumed)
            return
        over = None
        if fresh and not replaces:
            put_away(service.event.folder, file_name(server), log)
        elif replaces:
            over = event_ended_since(_instant(service), service.event, file_name(server))
        _serve_event(server, service, over, log, resumed)


Resumed = tuple[Recording, list[Event]]


def _serve_single_races(
    server: RaceServer, service: Service, log: Log, resumed: Resumed | None
) -> None:
    race = server.session
    awaited = min(service.awaited, len(race.seats))
    while not server.is_stopped:
        outcome = server.resume(*resumed) if resumed else server.run(awaited)
        resumed = None
        if outcome is None:
            return
        _publish_result(outcome.as_json(), race, service, log)
        if service.once:
            server.see_off(service.review)
            return
        server.reopen()


def _serve_event(
    server: RaceServer,
    service: Service,
    over: EventState | None,
    log: Log,
    resumed: Resumed | None,
) -> None:
    """Serve an event, one that has begun to its end; its tables stay until the server is stopped.

    No other one begins by itself: drivers that are still there would drive it, and its result would
    take the place of this one's. over: the event that a server which this one replaces has served
    to its end.
    """
    spec = service.event
    assert spec is not None

    def publish(day: Day, state: EventState) -> None:
        if service.result is not None:
            with _survived(log, f"the event is not in {service.result}; make room"):
                write_whole(service.result, json.dumps(event_document(day, state)))
        if over is not None or not state.is_final:
            return  # it was printed, or will be
        with _survived(log, "the result is not printed"):
            if service.as_json:
                print_document(event_document(day, state))
            else:
                print_tables(day.plan, day.ledger, Console())

    seats, name = len(server.session.seats), file_name(server)
    awaited = min(service.awaited, seats)
    state = over or unfinished_event(spec, name, seats, log)
    state = state or begin_event(server, spec, awaited)
    if state is None or not LiveEvent(server, spec, state, log, publish).run(resumed):
        return
    server.see_off(service.review)
    if not service.once:
        log.say("the event is over: the page shows it until Ctrl-C", name=state.name)
        server.lobby.wait_until(lambda: False)


def _instant(service: Service) -> float:
    """Return when the first server began, as files have it [s]."""
    return datetime.fromisoformat(service.begun_at).timestamp()


def _is_driven(service: Service, logbook: Logbook | None, log: Log) -> bool:
    """Return whether a server that this one replaces has driven the only race; publish its result.

    That server was killed after the end of the recording.
    """
    paths = recordings_of(logbook.folder, logbook.session) if logbook else []
    ended_at = paths[-1].stat().st_mtime if paths else 0.0
    if ended_at < _instant(service):
        return False
    try:
        session, events = restore_session(read_recording(paths[-1]), None)
    except RecordingError as error:
        log.warn("a recording is left out", why=str(error))
        return False
    if session.phase is not Phase.FINISHED:
        return False  # it was to start again
    log.say("the race was over", recording=paths[-1].name)
    there = service.result
    # A result that is there may hold what stewards changed, and the recording does not.
    if there is None or not there.exists() or there.stat().st_mtime < ended_at:
        result = RaceResult.of(session, events, 0, {}, 0)
        _publish_result(result.as_json(), session, service, log)
    return True


def _listening(service: Service, seats: int) -> ServerLink:
    """Return the server's end of the network."""
    return ServerLink(
        service.listen,
        service.session,
        seats,
        keys=service.keys,
        real_time=service.pace == REAL,
        steward_address=service.steward_listen,
    )


def _publish_result(document: dict[str, Any], race: Session, service: Service, log: Log) -> None:
    """Write the result of a race to its file, and print it; whatever fails is logged."""
    if service.result is not None:
        with _survived(log, f"the result is not in {service.result}; make room or name another"):
            write_whole(service.result, json.dumps(document))
    with _survived(log, "the result is not printed"):
        if service.as_json:
            print_document(document)
        else:
            show_result(document, race.scenario.course.name, race.scenario.rules.laps, race.name)


@contextmanager
def _survived(log: Log, without: str) -> Iterator[None]:
    """Log what fails inside, and serve on. without: what is missing then."""
    try:
        yield
    except Exception as error:
        why = str(error) if isinstance(error, RaceError) else f"{type(error).__name__}: {error}"
        log.warn(without, why=why)


def steward_token(address: str, session: str, log: Log, stack: ExitStack) -> str:
    """Return the steward's token, whose file goes with `stack`; "" where none can be written."""
    try:
        return stack.enter_context(local_token(address, session))
    except KeysError as error:
        log.warn("races have no steward", why=str(error))
        return ""


def _logbook(words: str, session: str, log: Log) -> AbstractContextManager[Logbook | None]:
    """Return the recordings of a session, None if nothing is recorded."""
    if folder := folder_of(words):
        return Logbook(folder, session, log.warn)
    return nullcontext()


def _resumed(
    service: Service, logbook: Logbook | None, keeper: Keeper | None, log: Log, *, fresh: bool
) -> tuple[Session, tuple[Recording, list[Event]]] | None:
    """Return the session of an unfinished race, with its recording and its events."""
    recording = logbook.unfinished() if logbook else None
    if logbook is None or recording is None:
        return None
    if fresh:
        logbook.put_aside("an unfinished race is not resumed")
        return None
    if service.event and not is_part_of(service.event, logbook.session, recording):
        logbook.put_aside("an unfinished race is no part of the event")
        return None
    begun = time.perf_counter()
    try:
        session, events = restore_session(recording, keeper)
    except RecordingError as error:
        logbook.put_aside(str(error))
        return None
    log.warn(
        "resuming an unfinished race",
        begun_at=recording.start.started_at,
        seconds=round(session.tick / TICKS_PER_SECOND, 1),
        laps=len(recording.laps),
        rebuilt_s=round(time.perf_counter() - begun, 2),
    )
    return session, (recording, events)


def _stop_on_signals(server: RaceServer, *, is_guarded: bool) -> None:
    """End the race at the next tick on Ctrl-C or SIGTERM; its result is still written.

    A second signal ends the process at once. Below a supervisor that is its duty: a Ctrl-C reaches
    both, and so this process twice.
    """
    received: list[int] = []

    def stop(number: int, _frame: object) -> None:
        if received and not is_guarded:
            signal.signal(number, signal.SIG_DFL)
            os.kill(os.getpid(), number)
        received.append(number)
        server.stop()

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)
