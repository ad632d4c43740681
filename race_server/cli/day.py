"""`race day`: a whole event, from qualification to the final classification."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn

from race_server.cli.document import AsJson, print_document
from race_server.cli.options import Language, Results, VehicleName, known_drivers
from race_server.cli.serve_event import TRACKS, tracks_for
from race_server.core.seeds import MOST_SEED
from race_server.pictures import check_picture
from race_server.terminal import Console, TextColumn

if TYPE_CHECKING:
    from race_server.competition.race_day.ledger import Ledger
    from race_server.competition.race_day.plan import DayPlan

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


def day(
    format_name: Annotated[
        str,
        typer.Option(
            "--format",
            help="2023: classified by the last race. 2025: by points. Or time-trial, or a .toml "
            "file.",
        ),
    ] = "2023",
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Seed of all random draws of the day.")
    ] = 1,
    drivers: Annotated[
        str,
        typer.Option(help="Comma-separated drivers, one team for each. Default: eight, mixed."),
    ] = "",
    tracks: Annotated[
        str,
        typer.Option(
            help="Comma-separated courses for tracks A, B and C; some formats need fewer."
        ),
    ] = TRACKS,
    vehicle: VehicleName = "tt02",
    sheet: Annotated[
        Path | None,
        typer.Option(help="Draw the tables of the day into this .png, .svg or .pdf file."),
    ] = None,
    language: Language = "en",
    results: Results = "",
    as_json: AsJson = False,
) -> None:
    """Run a whole race day: qualification, races, and the final classification."""
    from race_server.competition.race_day.formats import format_named
    from race_server.competition.race_day.languages import language_of
    from race_server.competition.race_day.picture import SUFFIXES, draw_picture
    from race_server.competition.race_day.plan import DayPlan, teams_of
    from race_server.competition.race_day.report import day_document
    from race_server.competition.race_day.table import print_tables
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.track.load import load_course

    language_of(language)
    chosen = format_named(format_name)
    names = known_drivers(drivers or ",".join(TEAMS))
    car = vehicle_named(vehicle)
    files = tracks_for(chosen, tracks)
    courses = {letter: load_course(name) for letter, name in files.items()}
    plan = DayPlan(chosen, teams_of(names), courses, car, seed)
    plan.check()
    if sheet is not None:
        check_picture(sheet, SUFFIXES)
    console = Console(stderr=True)
    ledger = _run(plan, results, console)
    if as_json:
        print_document(day_document(plan, ledger))
    else:
        print_tables(plan, ledger, Console(), language)
    if sheet is not None:
        draw_picture(plan, ledger, sheet, language)
        console.print(f"sheet: {sheet}", style="dim")


def _run(plan: "DayPlan", results: str, console: Console) -> "Ledger":
    """Run a race day with a progress bar and return its ledger."""
    from race_server.competition.race_day.day import run_day
    from race_server.core.kernels.jit import is_compiled
    from race_server.storage.results.keeper import Keeper
    from race_server.storage.results.writer import writer_for

    warn = partial(console.print, style="yellow", soft_wrap=True)
    with writer_for(results, warn) as writer:
        if not is_compiled():
            console.print("compiling the simulation and the drivers for this machine, once")
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
        )
        with Progress(*columns, console=console, transient=True) as progress:
            task = progress.add_task("preparing", total=plan.drives())

            def tell(title: str) -> None:
                is_first = progress.tasks[0].description == "preparing"
                progress.update(task, description=title, advance=0 if is_first else 1)

            return run_day(plan, Keeper(writer) if writer else None, tell)
