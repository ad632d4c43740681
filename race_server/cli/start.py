"""`race start`: a whole race in one command."""

import sys
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any

import typer

from race_server.cli.document import AsJson, print_document
from race_server.cli.event import newest_event, show_event
from race_server.cli.option_fields import argv_of, expand_options
from race_server.cli.options import Unfit, drivers_for, known_drivers, seeds_from
from race_server.cli.outcome import show_result
from race_server.cli.serve_options import VALET, RaceOptions, ServeOptions, check_pace
from race_server.core.bounds import MOST_S
from race_server.errors import ScenarioError
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.competition.launch import RaceSpec

DRIVERS = ("raceline", "idm", "follow_gap", "tentacles", "pure_pursuit", "avoider", "radar_line")


@dataclass(frozen=True)
class StartOptions(RaceOptions):
    """All options of `race start`."""

    drivers: Annotated[
        str,
        typer.Option(
            help=f"Comma-separated drivers, repeated until every seat is filled. Default: those of "
            f"{', '.join(DRIVERS)} that are made for the vehicle, with --lot {VALET}."
        ),
    ] = ""
    unfit: Unfit = False
    one_process: Annotated[
        bool,
        typer.Option("--one-process", help="Run the drivers inside the server process."),
    ] = False
    mixed: Annotated[
        int,
        typer.Option(
            help="Number of karts that are played as real ones, by `race plant` processes."
        ),
    ] = 0
    pedestrian: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            max=MOST_S,
            help="Time at which a person steps in front of the first real kart [s]. Default: none.",
        ),
    ] = None
    listen: Annotated[
        str, typer.Option(help="Address to listen on. Default: a free port of 127.0.0.1.")
    ] = ""
    session: Annotated[str, typer.Option(help="Name of the session.")] = "race"
    races: Annotated[
        int, typer.Option(min=1, help="Number of races in a row; after several, show ratings.")
    ] = 1
    page: Annotated[
        bool | None,
        typer.Option(
            "--page/--no-page",
            envvar="RACE_SERVER_PAGE",
            help="Let browsers on this machine watch. Default: if the page is built.",
        ),
    ] = None
    as_json: AsJson = False


@expand_options
def start(options: StartOptions) -> None:
    """Run a whole race: a server, one process for each driver, and the live leaderboard."""
    start_session(options)


def start_session(options: StartOptions) -> None:
    """Run a whole session, show its table and its result.

    Raises:
        RaceError: an option is wrong, or the session ends without a result.
    """
    from race_server.competition.launch import run_race
    from race_server.net.wire import topics
    from race_server.net.wire.topics import key_of

    names = _drivers(options)
    check_pace(options.pace)
    if options.format and options.races > 1:
        raise ScenarioError("--format and --races: an event has its races already, leave one out")
    key_of(topics.SNAPSHOT, options.session)  # a name that is not valid raises
    _check_results(options.results)
    console = Console(stderr=options.as_json)
    if not options.lot:
        _prepare_line(options.track, options.car, names, console)
    spec = _spec(options, names, page=_shows_page(options.page, console))
    if options.races > 1:
        _run_series(spec, options, console)
        return
    document = run_race(spec, console)
    if options.as_json:
        print_document(document)
    elif options.format:
        show_event(newest_event(options.record, options.session), Console())
    else:
        laps = 0 if options.lot else options.laps
        show_result(document, options.place, laps, options.session)
    if document["stopped"]:
        sys.exit(130)


def _drivers(options: StartOptions) -> tuple[str, ...]:
    """Return the drivers, which fill the seats in turn.

    Raises:
        ScenarioError: there are none, one is unknown, or there are more real karts than seats.
        DriverError: one is not made for the vehicle.
    """
    from race_server.core.driver import driver_names

    if options.lot:
        names = known_drivers(options.drivers or VALET)
    else:
        vehicles, courses = (options.car,), (options.track,)
        unfit = options.unfit
        names = drivers_for(options.drivers, DRIVERS, vehicles, unfit=unfit, courses=courses)
    if not names:
        raise ScenarioError(f"--drivers names none; choose from {', '.join(driver_names())}")
    mixed = options.mixed
    fits = 0 <= mixed <= options.karts
    if not fits or (mixed and (options.pace != "real" or options.one_process)):
        raise ScenarioError(
            f"--mixed {mixed}: choose at most {options.karts} karts, with --pace real and without "
            "--one-process"
        )
    if options.pedestrian is not None and not mixed:
        raise ScenarioError("--pedestrian steps in front of a real kart: add --mixed 1, or more")
    return names


def _spec(options: StartOptions, names: tuple[str, ...], *, page: bool) -> "RaceSpec":
    """Return the race to run; its server gets the options that the two commands share."""
    from race_server.competition.launch import RaceSpec, TrackedSeat, free_address, spread

    race = {field.name: getattr(options, field.name) for field in fields(RaceOptions)}
    walks = options.pedestrian
    incident = () if walks is None else ("--pedestrian", str(walks))
    return RaceSpec(
        serve=tuple(argv_of(ServeOptions(**race, fresh=True))),
        drivers=tuple(names[seat % len(names)] for seat in range(options.karts)),
        address=options.listen or free_address(),
        session=options.session,
        in_process=options.one_process,
        real=tuple(
            TrackedSeat(seat, incident if number == 0 else ())
            for number, seat in enumerate(spread(options.mixed, options.karts))
        ),
        page=page,
        record=options.record,
    )


def _shows_page(wanted: bool | None, console: Console) -> bool:
    """Return whether browsers are to watch; warn if the page is wanted but not built."""
    from race_server.live.gateway.page import NOT_BUILT, is_built

    if wanted and not is_built():
        console.print(NOT_BUILT, style="yellow", soft_wrap=True)
    return is_built() if wanted is None else wanted


def _run_series(spec: "RaceSpec", options: StartOptions, console: Console) -> None:
    """Run several races and show the ratings of the drivers."""
    from race_server.competition.launch import run_race
    from race_server.competition.series import rating_table, run_series

    races, seed = options.races, options.seed
    seeds_from(seed, races, "--seed")
    is_rated = len(set(spec.drivers)) > 1
    if not is_rated:
        (driver,) = set(spec.drivers)
        console.print(
            f"ratings need two different drivers, and all seats have {driver}: name another one "
            "in --drivers, or give more seats with --karts",
            style="yellow",
            soft_wrap=True,
        )

    def run(one: "RaceSpec", number: int) -> dict[str, Any]:
        document = run_race(one, console)
        if document["stopped"]:
            return document
        best = min(document["karts"], key=lambda kart: kart["rank"])
        text = f"race {number + 1} of {races}, seed {seed + number}: won by {best['driver']}"
        console.print(text, style="dim", soft_wrap=True)
        return document

    found = run_series(spec, races, seed, run)
    if options.as_json:
        print_document(found)
    elif is_rated:
        console.print(rating_table(found["ratings"], len(found["races"])))
    if found["stopped"]:
        sys.exit(130)


def _prepare_line(track: str, vehicle: str, drivers: tuple[str, ...], console: Console) -> None:
    """Solve the reference line if a driver needs it, before the server looks for it.

    Prints a note if another line is used in its place.
    """
    from race_server.core.driver import driver_named
    from race_server.core.observation import wants_line
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.raceline.attach import reference_line
    from race_server.scenario.track.load import load_course

    course, car = load_course(track), vehicle_named(vehicle)
    if not reference_line(course, car).note:
        return
    if any(wants_line(driver_named(name).preset) for name in sorted(set(drivers))):
        if note := reference_line(course, car, solve=True).note:
            console.print(note, style="yellow", soft_wrap=True)


def _check_results(results: str) -> None:
    """Check before anything starts that the results file can be written.

    Raises:
        ResultsError: it is locked, damaged or newer than this program.
    """
    from race_server.storage.results.schema import path_of
    from race_server.storage.results.store import Store

    if path := path_of(results):
        Store(path).close()
