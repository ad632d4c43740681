"""`race start`, `race drive`, `race watch`."""

import os
import time
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.live import Live
from rich.status import Status as Spinner

from race_server.cli.access import Connect, KeysFolder, SessionName, access
from race_server.cli.document import AsJson, print_document
from race_server.cli.options import (
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
)
from race_server.cli.outcome import show_result
from race_server.core.messages import Phase
from race_server.errors import RaceError, ScenarioError

if TYPE_CHECKING:
    from race_server.competition.launch import RaceSpec
    from race_server.live.client.link_stats import LinkStats

MIXED = ("raceline", "idm", "follow_gap", "tentacles", "pure_pursuit", "avoider")


def start(
    track: Track = "covapsy-train-2023",
    vehicle: VehicleName = "tt02",
    karts: Karts = 8,
    laps: Laps = 3,
    seed: Seed = 1,
    pace: Pace = "real",
    drivers: Annotated[
        str, typer.Option(help="Comma-separated; repeated until every seat is filled.")
    ] = ",".join(MIXED),
    items: Items = "on",
    catch_up: CatchUp = "on",
    one_process: Annotated[
        bool, typer.Option("--one-process", help="Drivers inside the server, not each its own.")
    ] = False,
    mixed: Annotated[
        int, typer.Option(help="So many of the karts exist: plants in processes of their own.")
    ] = 0,
    listen: Annotated[str, typer.Option(help="Address to listen on.")] = "",
    session: Annotated[str, typer.Option(help="Name of the race session.")] = "race",
    races: Annotated[
        int, typer.Option(min=1, help="So many races, one after another; then ratings are shown.")
    ] = 1,
    results: Results = "",
    record: Record = "",
    page: Annotated[
        bool | None,
        typer.Option(
            "--page/--no-page",
            envvar="RACE_SERVER_PAGE",
            help="Let browsers of this machine watch; without it, where the page is built.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Run a whole race: a server, a process for each driver, and the live leaderboard."""
    from race_server.competition.launch import RaceSpec, TrackedSeat, free_address, run_race, spread
    from race_server.core.driver import driver_names

    names = known_drivers(drivers)
    if not names:
        raise ScenarioError(f"--drivers is empty; choose from {', '.join(driver_names())}")
    if not 0 <= mixed <= karts or (mixed and (pace != "real" or one_process)):
        raise ScenarioError(
            f"--mixed {mixed}: choose at most {karts} karts, with --pace real and a process each"
        )
    serve = ["--track", track, "--vehicle", vehicle, "--karts", str(karts), "--laps", str(laps)]
    serve += ["--seed", str(seed), "--pace", pace]
    serve += ["--items", items, "--catch-up", catch_up]
    serve += ["--results", results] if results else []
    serve += ["--record", record] if record else []
    serve += ["--fresh"]
    _check_results(results)
    console = Console(stderr=as_json)
    _prepare_line(track, vehicle, names, console)
    plan = RaceSpec(
        serve=tuple(serve),
        drivers=tuple(names[seat % len(names)] for seat in range(karts)),
        address=listen or free_address(),
        session=session,
        in_process=one_process,
        real=tuple(TrackedSeat(seat) for seat in spread(mixed, karts)),
        page=_shows_page(page, console),
        record=record,
    )
    if races > 1:
        _start_series(plan, races, seed, console, as_json=as_json)
        return
    document = run_race(plan, console)
    if as_json:
        print_document(document)
    else:
        show_result(document, track, laps, session)


def _shows_page(wanted: bool | None, console: Console) -> bool:
    """Return whether browsers are to watch; say so where there is nothing to see."""
    from race_server.live.gateway.page import NOT_BUILT, is_built

    if wanted and not is_built():
        console.print(NOT_BUILT, style="yellow", markup=False, soft_wrap=True)
    return is_built() if wanted is None else wanted


def _start_series(
    plan: "RaceSpec", races: int, seed: int, console: Console, *, as_json: bool
) -> None:
    """Run several races and show who is how strong."""
    from race_server.competition.launch import run_race
    from race_server.competition.series import rating_table, run_series

    def run(one: "RaceSpec", number: int) -> dict[str, Any]:
        document = run_race(one, console)
        best = min(document["karts"], key=lambda kart: kart["rank"])
        text = f"race {number + 1} of {races}, seed {seed + number}: won by {best['driver']}"
        console.print(text, style="dim", markup=False, soft_wrap=True)
        return document

    found = run_series(plan, races, seed, run)
    if as_json:
        print_document(found)
    else:
        console.print(rating_table(found["ratings"], races))


def _prepare_line(track: str, vehicle: str, drivers: tuple[str, ...], console: Console) -> None:
    """Find the reference line, if a driver wants it, before the server looks for it.

    Says in one sentence if another line stands in.
    """
    from race_server.core.driver import driver_named
    from race_server.core.observation import wants_line
    from race_server.core.vehicles import vehicle_named
    from race_server.scenario.raceline.attach import reference_line
    from race_server.scenario.track.load import load_course

    course, laps_it = load_course(track), vehicle_named(vehicle)
    if not reference_line(course, laps_it).note:
        return
    if any(wants_line(driver_named(name).preset) for name in sorted(set(drivers))):
        if note := reference_line(course, laps_it, solve=True).note:
            console.print(note, style="yellow", markup=False, soft_wrap=True)


def _check_results(results: str) -> None:
    """Say before anything is started that a results file cannot be written.

    Raises:
        ResultsError: it is locked, damaged or newer than this program.
    """
    from race_server.storage.results.schema import path_of
    from race_server.storage.results.store import Store

    if path := path_of(results):
        Store(path).close()


def drive(
    name: Annotated[str, typer.Argument(help="An installed driver.")],
    connect: Connect = "",
    session: SessionName = "",
    seat: Annotated[
        int, typer.Option(help="The seat wanted; -1 for any, or that of the keys.")
    ] = -1,
    keys: KeysFolder = None,
    patience: Annotated[float, typer.Option(help="Seconds to wait for a server.")] = 20.0,
    raw: Annotated[
        bool, typer.Option("--raw", help="Make no allowance for a slow network.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="One JSON document on stdout: what was heard.")
    ] = False,
) -> None:
    """Take a seat and drive one race."""
    # Before any kernel is imported: a driver decides 20 times a second and needs no compiler.
    os.environ["RACE_SERVER_INTERPRET"] = "1"
    from race_server.core.driver import driver_named
    from race_server.live.client.driver import run_driver as drive_race
    from race_server.live.client.link_stats import LinkStats

    given = access(keys, connect, session)
    link_stats, console = LinkStats(), Console(stderr=True)
    drive_now = partial(
        drive_race,
        driver_named(name),
        name,
        address=given.address,
        session=given.session,
        wanted=given.seat(seat),
        timeout_s=patience,
        keys=given.keys,
        raw=raw,
        link_stats=link_stats if as_json or console.is_terminal else None,
    )
    if console.is_terminal:
        with console.status(f"{name}: waiting for the race") as status:
            taken = drive_now(on_observation=partial(_show_reception, status, name)).seat
        console.print(f"{name}, seat {taken}: {link_stats.outcome or 'the race is over'}")
    else:
        taken = drive_now().seat
    if as_json:
        print_document({"driver": name, "seat": taken, **link_stats.as_json()})


def _show_reception(status: Spinner, name: str, link_stats: "LinkStats") -> None:
    """Show a few times a second how old it is what a driver sees."""
    if link_stats.received % 5 == 1:
        status.update(f"{name} {link_stats}")


def watch(
    connect: Connect = "",
    session: SessionName = "",
    keys: KeysFolder = None,
    foxglove: Annotated[
        int | None,
        typer.Option(help="Let Foxglove draw the race: serve it on this port, 0 for any."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show the live leaderboard of a race; with --json the standings once."""
    from dataclasses import asdict

    from race_server.competition.launch import board_of
    from race_server.live.client.foxglove import FoxgloveServer
    from race_server.live.client.spectator import Spectator
    from race_server.live.client.timing import ClientTiming
    from race_server.net.transport import ClientLink

    given, timeout_s = access(keys, connect, session), ClientTiming().spectator_timeout_s
    with ClientLink(given.address, given.session, keys=given.keys) as link:
        watcher = Spectator(link)
        if as_json:
            print_document(asdict(watcher.standings) if watcher.standings else {})
            return
        _, items = watcher.rules()
        with ExitStack() as stack:
            if foxglove is not None:
                view = stack.enter_context(FoxgloveServer(link, watcher, given.session, foxglove))
                print(f"Foxglove: open {view.address} as a Foxglove WebSocket", flush=True)
            live = stack.enter_context(Live(refresh_per_second=8))
            while watcher.standings is None or watcher.standings.phase is not Phase.FINISHED:
                live.update(board_of(watcher, given.session, items))
                time.sleep(0.12)
                if watcher.silence_s() > timeout_s and not watcher.refresh():
                    silent = watcher.silence_s()
                    raise RaceError(
                        f"the server at {given.address} has gone: silent for {silent:.0f} s"
                    )
            live.update(board_of(watcher, given.session, items))
