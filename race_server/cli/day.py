"""`race day`: a whole event, from qualification to podium."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from race_server.cli.document import AsJson, print_document
from race_server.cli.options import Results, VehicleName, known_drivers, names_in
from race_server.errors import ScenarioError

TEAMS = (
    "raceline",
    "tentacles",
    "follow_gap",
    "pure_pursuit",
    "tentacles_report_b",
    "idm",
    "unstuck:follow_gap",
    "avoider",
)
TRACKS = "covapsy-base,covapsy-train-2023,covapsy-test-2023"


def day(
    format_name: Annotated[
        str, typer.Option("--format", help="2023: by the order of a race. 2025: by points.")
    ] = "2023",
    seed: Annotated[int, typer.Option(help="Seed of all chance of the day.")] = 1,
    drivers: Annotated[
        str,
        typer.Option(help="Comma-separated, a team for each; by default eight, mixed."),
    ] = "",
    tracks: Annotated[
        str, typer.Option(help="Tracks A, B and C, comma-separated; a format may need fewer.")
    ] = TRACKS,
    vehicle: VehicleName = "tt02",
    sheet: Annotated[
        Path | None, typer.Option(help="Draw the sheet into this file: .png, .svg or .pdf.")
    ] = None,
    results: Results = "",
    as_json: AsJson = False,
) -> None:
    """Run a whole race day: qualification, races, podium, and the sheet for the wall."""
    from race_server.competition.race_day.day import (
        DayPlan,
        check_day_plan,
        drives_in,
        run_day,
        teams_of,
    )
    from race_server.competition.race_day.formats import format_named
    from race_server.competition.race_day.picture import check_picture, draw_picture
    from race_server.competition.race_day.report import day_document
    from race_server.competition.race_day.table import print_tables
    from race_server.core.kernels.jit import is_compiled
    from race_server.core.vehicles import vehicle_named
    from race_server.scenario.track.load import load_course
    from race_server.storage.results.keeper import Keeper
    from race_server.storage.results.writer import writer_for

    chosen = format_named(format_name)
    names = known_drivers(drivers or ",".join(TEAMS))
    car = vehicle_named(vehicle)
    files = _tracks_for(chosen.letters, tracks, format_name)
    courses = {letter: load_course(name) for letter, name in files.items()}
    plan = DayPlan(chosen, teams_of(names), courses, car, seed)
    check_day_plan(plan)
    if sheet is not None:
        check_picture(sheet)
    log = Console(stderr=True)
    say = partial(log.print, style="yellow", markup=False, soft_wrap=True)
    with writer_for(results, say) as writer:
        if not is_compiled():
            log.print("compiling the simulation and the drivers for this machine, once")
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=log, transient=True) as progress:
            task = progress.add_task("getting ready", total=drives_in(plan))

            def tell(what: str) -> None:
                is_first = progress.tasks[0].description == "getting ready"
                progress.update(task, description=what, advance=0 if is_first else 1)

            ledger = run_day(plan, Keeper(writer) if writer else None, tell)
    if as_json:
        print_document(day_document(plan, ledger))
    else:
        print_tables(plan, ledger, Console())
    if sheet is not None:
        draw_picture(plan, ledger, sheet)
        log.print(f"sheet: {sheet}", style="dim", markup=False)


def _tracks_for(letters: str, tracks: str, format_name: str) -> dict[str, str]:
    """Return the track of each letter that a format needs.

    Raises:
        ScenarioError: too few are given.
    """
    names = names_in(tracks)
    places = ["ABCDEFGHIJ".index(letter) for letter in letters]
    if places and max(places) >= len(names):
        raise ScenarioError(
            f"--tracks names {len(names)}: format {format_name} needs "
            f"{max(places) + 1}, for tracks {', '.join(letters)}"
        )
    return {letter: names[place] for letter, place in zip(letters, places, strict=True)}
