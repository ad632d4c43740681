"""`race park`: a whole session in a car park in one command."""

from dataclasses import dataclass
from typing import Annotated

import typer

from race_server.cli.document import AsJson
from race_server.cli.option_fields import expand_options
from race_server.cli.options import Results, known_drivers, once
from race_server.cli.serve_options import VALET
from race_server.cli.start import StartOptions, start_session
from race_server.core.bounds import MOST_ROUND_S
from race_server.core.seeds import MOST_SEED
from race_server.errors import ScenarioError


@dataclass(frozen=True)
class ParkOptions:
    """All options of `race park`: those of `race start` that a car park has, by its own names."""

    lot: Annotated[
        str, typer.Option(help="Car park: a name from `race lot list`, or a .toml file.")
    ] = "yard-70"
    driver: Annotated[
        str,
        typer.Option(
            help="Comma-separated drivers that park, repeated until every seat is filled."
        ),
    ] = VALET
    seats: Annotated[int, typer.Option(min=1, max=64, help="Number of vehicles.")] = 1
    level: Annotated[str, typer.Option(help="How well to park. Default: as the car park says.")] = (
        ""
    )
    limit: Annotated[
        float,
        typer.Option(
            min=0.0, max=MOST_ROUND_S, help="Seconds to park in; 0: as the car park says."
        ),
    ] = 0.0
    vehicle: Annotated[
        str, typer.Option(help="Vehicle. Default: the one that the car park is made for.")
    ] = ""
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the round.")] = 1
    pace: Annotated[
        str, typer.Option(help="real: 60 ticks a second. lockstep: wait for every driver.")
    ] = "real"
    one_process: Annotated[
        bool, typer.Option("--one-process", help="Run the drivers inside the server process.")
    ] = False
    results: Results = ""
    record: Annotated[
        str,
        typer.Option(
            help="Folder for recordings, or none to record nothing. Default: as `race serve`."
        ),
    ] = ""
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
def park(options: ParkOptions) -> None:
    """Let vehicles park: a server, one process for each driver, and a live table."""
    from race_server.core.driver import check_parks

    if not options.driver.strip():
        raise ScenarioError(f"--driver names none; choose one that parks, such as {VALET}")
    for name in once(known_drivers(options.driver)):
        check_parks(name)
    start_session(
        StartOptions(
            lot=options.lot,
            level=options.level,
            limit=options.limit,
            vehicle=options.vehicle,
            karts=options.seats,
            seed=options.seed,
            pace=options.pace,
            results=options.results,
            record=options.record,
            drivers=options.driver,
            one_process=options.one_process,
            page=options.page,
            as_json=options.as_json,
        )
    )
