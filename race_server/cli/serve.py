"""`race serve`: one session on the network, and the guard over it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_server.cli.access import SESSION
from race_server.cli.document import AsJson
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
from race_server.errors import KeysError, ScenarioError
from race_server.live.server.supervisor import supervised
from race_server.logs import Log
from race_server.net.transport import DEFAULT_ADDRESS

if TYPE_CHECKING:
    from race_server.net.auth.keys import ServerKeys
    from race_server.scenario.race import Rules, Scenario

# Encrypted, to all of this machine's networks.
OPEN_ADDRESS = "tls/0.0.0.0:7447"


def serve(
    track: Track = "covapsy-train-2023",
    vehicle: VehicleName = "tt02",
    karts: Karts = 8,
    laps: Laps = 3,
    seed: Seed = 1,
    pace: Pace = "real",
    items: Items = "on",
    catch_up: CatchUp = "on",
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
    from race_server.cli.service import Service, serve_and_tell, serve_races
    from race_server.core.kernels.jit import is_compiled
    from race_server.live.server import LOCKSTEP, REAL
    from race_server.live.server.warm_up import warm_up
    from race_server.net.auth.settings import ListenSettings, check_listen_settings
    from race_server.scenario.race import Rules

    held = _server_keys(keys, session, karts, is_open=is_open)
    session = held.session if held else session or SESSION
    address = listen or (OPEN_ADDRESS if held else DEFAULT_ADDRESS)
    check_listen_settings(ListenSettings(address, session, karts, held))
    if pace not in {REAL, LOCKSTEP}:
        raise ScenarioError(f"pace {pace!r} is unknown; choose {REAL} or {LOCKSTEP}")
    log = Log(as_json=log_json)
    fillers = known_drivers(fill)
    rules = Rules(
        laps=laps,
        items=items == "on",
        catch_up=catch_up == "on",
        finish_limit_s=finish_limit,
    )
    scenario = _scenario(track, vehicle, karts, rules, seed, fillers, log)
    if not is_compiled():
        log.say("compiling the simulation for this machine, once: about half a minute")
    warm_up(scenario, fillers)
    awaited = wait_for if wait_for >= 0 else (1 if fillers else karts)
    service = Service(
        scenario=scenario,
        session=session,
        pace=pace,
        fillers=fillers,
        awaited=awaited,
        listen=address,
        results=results,
        record=record,
        result=result,
        once=once,
        review=review,
        metrics=metrics,
        as_json=as_json,
        keys=held,
    )
    if not guard:
        serve_races(service, log, fresh=fresh)
        return
    # Only who is started by hand begins anew; who replaces a killed one takes its race up.
    status = supervised(
        lambda killed: serve_and_tell(service, log, fresh=fresh and killed == 0),
        log.warn,
    )
    if status:
        raise typer.Exit(status)


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
    from race_server.core.driver import driver_named
    from race_server.core.observation import wants_line
    from race_server.core.vehicles import vehicle_named
    from race_server.scenario.race import Scenario
    from race_server.scenario.raceline.attach import with_line
    from race_server.scenario.track.load import load_course

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
    from race_server.net.auth.keys import read_server_keys

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
