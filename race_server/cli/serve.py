"""`race serve`: one session on the network, restarted when it is killed."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from race_server.cli.access import SESSION
from race_server.cli.option_fields import expand_options
from race_server.cli.options import known_drivers
from race_server.cli.serve_event import event_of
from race_server.cli.serve_options import OPEN_ADDRESS, VALET, ServeOptions, check_pace
from race_server.errors import KeysError, ScenarioError
from race_server.kept_file import check_place
from race_server.logs import Log
from race_server.net.transport import DEFAULT_ADDRESS

if TYPE_CHECKING:
    from race_server.cli.service import Service
    from race_server.live.driver_processes import Command
    from race_server.live.server.supervisor import Past
    from race_server.net.auth.keys import ServerKeys
    from race_server.scenario.race import Scenario

# A race in which this many servers in a row were ended by an exception is not resumed again.
MOST_FAILURES = 3


@expand_options
def serve(options: ServeOptions) -> None:
    """Serve a race session: wait for drivers, race, and open the next race.

    When the server is killed or fails during a race it is restarted and resumes that race.
    """
    from race_server.cli.service import serve_races, serve_with_status
    from race_server.live.server.supervisor import supervised
    from race_server.live.suspects import CRASHES
    from race_server.live.watchdog import HUNG

    log = Log(as_json=options.log_json)
    service = _service_of(options, log)
    if not options.guard:
        serve_races(service, log, fresh=options.fresh)
        return

    def work(past: "Past") -> int:
        fresh = discards_race(past, fresh=options.fresh)
        return serve_with_status(service, log, fresh=fresh, replaces=past.ended > 0)

    def judge(code: int) -> None:
        service.suspects.judge(is_guilty=code == HUNG or -code in CRASHES)

    status = supervised(work, log.warn, judge)
    if status:
        raise typer.Exit(status)


def discards_race(past: "Past", *, fresh: bool) -> bool:
    """Return whether an unfinished race is put aside. fresh: as the option says.

    Only a server started by hand may do so. The one that replaces it resumes the race, unless it
    is the race itself that ends every server.
    """
    return past.failures >= MOST_FAILURES if past.ended else fresh


def _service_of(options: ServeOptions, log: Log) -> "Service":
    """Return what is to be served, checked and compiled.

    Raises:
        RaceError: an option is wrong, or does not fit another one.
    """
    from race_server.cli.service import Service
    from race_server.core.kernels.jit import is_compiled
    from race_server.live.driver_processes import is_trusted
    from race_server.live.server.warm_up import warm_up
    from race_server.net.auth.settings import ListenSettings, check_listen_settings

    if options.result is not None:
        check_place(options.result)
    held = _server_keys(options.keys, options.session, options.karts, is_open=options.is_open)
    session = held.session if held else options.session or SESSION
    address = options.listen or (OPEN_ADDRESS if held else DEFAULT_ADDRESS)
    check_listen_settings(
        ListenSettings(
            address, session, options.karts, held, steward_address=options.steward_listen
        )
    )
    check_pace(options.pace)
    fillers = known_drivers(options.fill)
    inside = tuple(name for name in fillers if options.one_process or is_trusted(name))
    event = None
    if options.format:
        event, scenario = event_of(options, needs_line=_needs_line(fillers, inside))
    else:
        scenario = _scenario(options, fillers, inside, log)
    valets = _valets(options) if scenario.course.lot is not None else ()
    if not is_compiled():
        log.say("compiling the simulation for this machine, once: about a minute")
    warm_up(scenario, (*inside, *valets))
    if options.lot:
        _check_round(options)
    every = 1 if fillers else options.karts
    return Service(
        scenario=scenario,
        session=session,
        pace=options.pace,
        fillers=fillers,
        awaited=options.wait_for if options.wait_for >= 0 else every,
        listen=address,
        steward_listen=options.steward_listen,
        results=options.results,
        record=options.record,
        result=options.result,
        once=options.once,
        review=options.review,
        metrics=options.metrics,
        as_json=options.as_json,
        keys=held,
        is_guarded=options.guard,
        valet=options.valet,
        measures=bool(options.lot),
        apart=None if options.one_process else _apart(address, session, held, fillers, options),
        event=event,
    )


def _apart(
    address: str,
    session: str,
    held: "ServerKeys | None",
    fillers: tuple[str, ...],
    options: ServeOptions,
) -> "Command":
    """Return how a driver runs that is kept apart from the server: as `race drive`.

    Raises:
        KeysError: it needs the keys of a seat, which are not beside those of the server.
    """
    from race_server.live.driver_processes import is_trusted

    def folder_of(seat: int) -> Path | None:
        return held.folder.parent / f"seat-{seat}" if held else None

    for seat in range(options.karts if fillers else 0):
        name, folder = fillers[seat % len(fillers)], folder_of(seat)
        if folder and not folder.is_dir() and not is_trusted(name):
            raise KeysError(
                f"driver {name} runs as a process and needs the keys of its seat: {folder} is not "
                "there; put it there, or serve with --one-process"
            )
    # A server that listens everywhere is found on this machine.
    near = address.replace("/0.0.0.0:", "/127.0.0.1:").replace("/[::]:", "/[::1]:")

    def command(name: str, seat: int) -> list[str]:
        folder = folder_of(seat)
        words = ["drive", name, "--connect", near, "--session", session, "--seat", str(seat)]
        return [*words, *(["--keys", str(folder)] if folder else [])]

    return command


def _scenario(
    options: ServeOptions, fillers: tuple[str, ...], inside: tuple[str, ...], log: Log
) -> "Scenario":
    """Return the race to be driven, with its reference line where one is known.

    inside: fillers that may be imported into this process.
    """
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.parking import parking_scenario
    from race_server.scenario.race import Rules, Scenario
    from race_server.scenario.raceline.attach import with_line
    from race_server.scenario.track.check import require_passable
    from race_server.scenario.track.load import load_course

    if options.lot:
        scenario = parking_scenario(
            options.lot,
            vehicles=options.karts,
            vehicle=options.vehicle,
            level=options.level,
            limit_s=options.limit,
        )
        # Until the lights go out all stand.
        rules = replace(scenario.rules, countdown_s=Rules.countdown_s)
        return replace(scenario, rules=rules, seed=options.seed)
    rules = Rules(
        laps=options.laps,
        items=options.items == "on",
        catch_up=options.catch_up == "on",
        finish_limit_s=options.finish_limit,
    )
    course, vehicle = load_course(options.track), vehicle_named(options.car)
    require_passable(course, vehicle)
    scenario = Scenario(
        course,
        karts=options.karts,
        vehicles=(vehicle,),
        rules=rules,
        seed=options.seed,
    )
    scenario = with_line(scenario, solve=_needs_line(fillers, inside))
    if scenario.line and scenario.line.note:
        log.warn(scenario.line.note)
    return scenario


def _needs_line(fillers: tuple[str, ...], inside: tuple[str, ...]) -> bool:
    """Return whether a filler observes the reference line. inside: may be imported here."""
    from race_server.core.driver import driver_named
    from race_server.core.observation import wants_line
    from race_server.live.driver_processes import preset_of

    presets = [
        driver_named(name).preset if name in inside else preset_of(name)
        for name in dict.fromkeys(fillers)
    ]
    return any(wants_line(preset) for preset in presets)


def _check_round(options: ServeOptions) -> None:
    """Check that the first round in a car park can be driven.

    Raises:
        ScenarioError: a vehicle starts in a wall, or no free way leads to its slot.
    """
    from race_server.scenario.lot.check import hopeless

    seeds = [options.seed]
    for fault in hopeless(options.lot, seeds, options.vehicle, options.karts).values():
        raise ScenarioError(
            f"lot {options.lot!r}, --seed {options.seed}: {fault}; choose another seed, or, "
            "where race lot check finds the same in others, mend the lot"
        )


def _valets(options: ServeOptions) -> tuple[str, ...]:
    """Return the driver that parks on request, if it is installed.

    Raises:
        ScenarioError: another one than the usual is not, or is of another package.
    """
    from race_server.core.driver import driver_names
    from race_server.live.driver_processes import is_trusted

    name = options.valet
    if name == VALET and name not in driver_names():
        return ()
    if known_drivers(name) and not (options.one_process or is_trusted(name)):
        raise ScenarioError(
            f"driver {name} would park inside the server, and is of another package or reads a "
            "file; add --one-process if you trust it"
        )
    return (name,)


def _server_keys(
    folder: Path | None, session: str, karts: int, *, is_open: bool
) -> "ServerKeys | None":
    """Return the keys to serve with, None for a session that is closed to other machines.

    Raises:
        KeysError: `--open` and `--keys` do not come together, or the keys cannot be used.
    """
    from race_server.net.auth.keys import read_server_keys

    if folder is None and not is_open:
        return None
    if folder is None:
        raise KeysError(
            f"--open needs keys: make them with `race keys new {session or SESSION} --seats "
            f"{karts} --host ADDRESS` and serve with --open --keys keys-{session or SESSION}"
        )
    if not is_open:
        raise KeysError(f"--keys {folder} is for clients from other machines: add --open")
    return read_server_keys(folder, session, karts)
