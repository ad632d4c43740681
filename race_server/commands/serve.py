"""`race serve`: one session on the network, and the guard over it."""

import json
import signal
import sys
import time
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from race_server.clock import TICKS_PER_SECOND
from race_server.commands.access import SESSION
from race_server.commands.race import (
    AsJson,
    CatchUp,
    Items,
    Karts,
    Laps,
    Pace,
    Record,
    Results,
    Seed,
    Track,
    VehicleName,
    known_drivers,
    results_writer,
    show_result,
)
from race_server.errors import KeysError, RaceError, RecordingError, ScenarioError
from race_server.logs import Log
from race_server.messages import Event
from race_server.transport import DEFAULT_ADDRESS
from race_server.watchdog import guarded

if TYPE_CHECKING:
    from race_server.admission.keys import ServerKeys
    from race_server.recording.logbook import Logbook
    from race_server.recording.reader import Recording
    from race_server.results.keeper import Keeper
    from race_server.scenario.base import Rules, Scenario
    from race_server.session import Session

# Encrypted, to all of this machine's networks.
OPEN_ADDRESS = "tls/0.0.0.0:7447"


def serve(
    track: Track = "covapsy-train-2023",
    vehicle: VehicleName = "tt02",
    karts: Karts = 8,
    laps: Laps = 3,
    seed: Seed = 1,
    pace: Pace = "real",
    items: Items = True,
    catch_up: CatchUp = True,
    fill: Annotated[
        str, typer.Option(help="Comma-separated drivers for seats that stay empty, in turn.")
    ] = "",
    wait_for: Annotated[
        int,
        typer.Option(help="Drivers to wait for; all seats, or one where --fill takes the rest."),
    ] = -1,
    finish_limit: Annotated[
        float, typer.Option(min=0.0, help="s after the winner in which others may finish; 0: all.")
    ] = 100.0,
    once: Annotated[bool, typer.Option("--once", help="End after one race.")] = False,
    review: Annotated[
        float,
        typer.Option(min=0.0, help="With --once: s after it in which stewards may add penalties."),
    ] = 0.0,
    result: Annotated[
        Path | None, typer.Option(help="Write the result of the last race to this file.")
    ] = None,
    listen: Annotated[
        str,
        typer.Option(help=f"Address to listen on; {DEFAULT_ADDRESS}, with --open {OPEN_ADDRESS}."),
    ] = "",
    is_open: Annotated[
        bool, typer.Option("--open", help="Let other machines in: those with keys.")
    ] = False,
    keys: Annotated[
        Path | None, typer.Option(help="Folder that `race keys new` made, with --open.")
    ] = None,
    session: Annotated[
        str, typer.Option("--session", help="Name of the session; that of the keys, or race.")
    ] = "",
    results: Results = "",
    record: Record = "",
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Do not take up a race whose server was killed.")
    ] = False,
    guard: Annotated[
        bool, typer.Option("--guard/--no-guard", help="Start the server again when it is killed.")
    ] = True,
    metrics: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Show /metrics for Prometheus and /healthz on this port of loopback; 0 for any.",
        ),
    ] = None,
    log_json: Annotated[
        bool, typer.Option("--log-json", help="Log JSON lines, even to a terminal.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Serve a race session: wait for drivers, race, and begin again.

    Started again after it was killed in a race, it takes up the race where it was.
    """
    from race_server.admission.settings import Door, check_door
    from race_server.kernels.jit import is_compiled
    from race_server.scenario.base import Rules
    from race_server.server import LOCKSTEP, REAL
    from race_server.server.rehearsal import warm_up

    held = _server_keys(keys, session, karts, is_open=is_open)
    session = held.session if held else session or SESSION
    address = listen or (OPEN_ADDRESS if held else DEFAULT_ADDRESS)
    check_door(Door(address, session, karts, held))
    if pace not in {REAL, LOCKSTEP}:
        raise ScenarioError(f"pace {pace!r} is unknown; choose {REAL} or {LOCKSTEP}")
    log = Log(as_json=log_json)
    fillers = known_drivers(fill)
    rules = Rules(laps=laps, items=items, catch_up=catch_up, finish_limit_s=finish_limit)
    scenario = _scenario(track, vehicle, karts, rules, seed, fillers, log)
    if not is_compiled():
        log.say("compiling the simulation for this machine, once: about half a minute")
    warm_up(scenario, fillers)
    awaited = wait_for if wait_for >= 0 else (1 if fillers else karts)
    service = Service(
        scenario,
        session,
        pace,
        fillers,
        awaited,
        address,
        results,
        record,
        result,
        once,
        review,
        metrics,
        as_json,
        held,
    )
    if not guard:
        _serve(service, log, fresh=fresh)
        return
    _load()
    # Only who is started by hand begins anew; who replaces a killed one takes its race up.
    status = guarded(
        lambda killed: _serve_and_tell(service, log, fresh=fresh and killed == 0),
        log.warn,
    )
    if status:
        raise typer.Exit(status)


@dataclass(frozen=True)
class Service:
    """What is to be served."""

    scenario: "Scenario"
    session: str
    pace: str
    fillers: tuple[str, ...]
    awaited: int  # drivers
    listen: str
    results: str
    record: str
    result: Path | None
    once: bool
    review: float  # [s]
    metrics: int | None  # port
    as_json: bool
    keys: "ServerKeys | None"  # None: closed to other machines


def _load() -> None:
    """Import all that serving needs, so that a server that replaces another one has it."""
    for module in ("results.keeper", "results.store", "results.writer", "server.resume"):
        import_module(f"race_server.{module}")


def _serve_and_tell(service: Service, log: Log, *, fresh: bool) -> int:
    """Serve, and return the exit status; what goes wrong is said as everywhere."""
    try:
        _serve(service, log, fresh=fresh)
    except RaceError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _serve(service: Service, log: Log, *, fresh: bool) -> None:
    from race_server.admission.token import local_token
    from race_server.results.keeper import Keeper
    from race_server.server import REAL, RaceServer
    from race_server.session import Session
    from race_server.transport import ServerLink

    with ExitStack() as stack:
        stack.enter_context(log)
        writer = stack.enter_context(results_writer(service.results, log.warn))
        keeper = Keeper(writer) if writer else None
        logbook = stack.enter_context(_logbook(service.record, service.session, log))
        race, taken_up = _take_up(logbook, keeper, log, fresh=fresh) or (None, None)
        race = race or Session(service.session, service.scenario)
        karts, course = len(race.seats), race.scenario.course
        address, name, keys = service.listen, service.session, service.keys
        real_time = service.pace == REAL
        link = stack.enter_context(ServerLink(address, name, karts, keys=keys, real_time=real_time))
        token = keys.token if keys else stack.enter_context(local_token(address, name))
        server = RaceServer(
            race,
            link,
            service.pace,
            service.fillers,
            keeper,
            logbook,
            token,
            log,
            amended=lambda result: _tell(result.as_json(), race, service),
        )
        stopped = _stop_on_signals(server)
        log.say(
            "listening",
            address=service.listen,
            session=race.name,
            course=course.title,
            seats=karts,
        )
        if service.metrics is not None:
            from race_server.server.metrics import LOOPBACK, exposed

            port = stack.enter_context(exposed(server, service.metrics))
            log.say("metrics", address=f"http://{LOOPBACK}:{port}/metrics")
        while not stopped:
            awaited = min(service.awaited, karts)
            outcome = server.go_on(*taken_up) if taken_up else server.run(awaited)
            taken_up = None
            if outcome is None:
                break
            _tell(outcome.as_json(), race, service)
            if service.once:
                server.see_off(service.review)
                break
            server.reopen()


def _tell(document: dict[str, Any], race: "Session", service: Service) -> None:
    """Put the result of a race where it is wanted."""
    if service.result is not None:
        service.result.write_text(json.dumps(document))
    if service.as_json:
        print(json.dumps(document), flush=True)
    else:
        show_result(document, race.scenario.course.name, race.scenario.rules.laps, race.name)


def _scenario(
    track: str,
    vehicle: str,
    karts: int,
    rules: "Rules",
    seed: int,
    fillers: tuple[str, ...],
    log: Log,
) -> "Scenario":
    """Return the race that is wanted, with a line to drive along where one is known."""
    from race_server.driver import driver_named
    from race_server.limit.line import with_line
    from race_server.observe import wants_line
    from race_server.params import vehicle_named
    from race_server.scenario.base import Scenario
    from race_server.track.load import load_course

    scenario = Scenario(
        load_course(track),
        karts=karts,
        vehicles=(vehicle_named(vehicle),),
        rules=rules,
        seed=seed,
    )
    wanted = any(wants_line(driver_named(name).preset) for name in fillers)
    scenario = with_line(scenario, solve=wanted)
    if scenario.line and scenario.line.note:
        log.warn(scenario.line.note)
    return scenario


def _server_keys(
    folder: Path | None, session: str, karts: int, *, is_open: bool
) -> "ServerKeys | None":
    """Return the keys to serve with, None for a session that is closed to other machines.

    Raises:
        KeysError: `--open` and `--keys` do not come together, or the keys cannot be used.
    """
    from race_server.admission.keys import read_server_keys

    if folder is None and not is_open:
        return None
    if folder is None:
        raise KeysError(
            f"--open needs keys: make them with `race keys new {session or SESSION} --seats "
            f"{karts} --host ADDRESS` and serve with --open --keys keys-{session or SESSION}"
        )
    if not is_open:
        raise KeysError(f"--keys {folder} lets other machines in: say so with --open")
    return read_server_keys(folder, session, karts)


def _logbook(words: str, session: str, log: Log) -> "AbstractContextManager[Logbook | None]":
    """Return where a session's recordings go, None for nowhere."""
    from race_server.recording.logbook import Logbook, folder_of

    if folder := folder_of(words):
        return Logbook(folder, session, log.warn)
    return nullcontext()


def _take_up(
    logbook: "Logbook | None", keeper: "Keeper | None", log: Log, *, fresh: bool
) -> "tuple[Session, tuple[Recording, list[Event]]] | None":
    """Return the session of a race whose server was killed, with its recording and its events."""
    from race_server.server.resume import take_up

    recording = logbook.unfinished() if logbook else None
    if logbook is None or recording is None:
        return None
    if fresh:
        logbook.put_aside("a race whose server was killed is not taken up")
        return None
    begun = time.perf_counter()
    try:
        session, events = take_up(recording, keeper)
    except RecordingError as error:
        logbook.put_aside(str(error))
        return None
    log.warn(
        "taking up a race whose server was killed",
        begun_at=recording.start.started_at,
        seconds=round(session.tick / TICKS_PER_SECOND, 1),
        laps=len(recording.laps),
        rebuilt_s=round(time.perf_counter() - begun, 2),
    )
    return session, (recording, events)


def _stop_on_signals(server: Any) -> list[int]:
    """Let Ctrl-C and SIGTERM end the race at the next tick; the result is still written."""
    received: list[int] = []

    def stop(number: int, _frame: object) -> None:
        received.append(number)
        server.stop()

    signal.signal(signal.SIGINT, stop)
    signal.signal(signal.SIGTERM, stop)
    return received
