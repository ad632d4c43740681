"""`race exam sweep`: how far one thing may be off before a driver fails."""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_agents.commands.exam_laps import DRIVERS, Drivers, editions_of
from race_agents.commands.exam_watch import counted
from race_server.cli.document import AsJson, print_document
from race_server.cli.option_fields import expand_options
from race_server.cli.options import MOST_LAPS, Unfit, drivers_for, names_in, once
from race_server.errors import ScenarioError
from race_server.pictures import check_picture
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.competition.lap_exam import LapExamSpec
    from race_server.competition.lap_sweep import SweepRow


@dataclass(frozen=True)
class SweepOptions:
    """All options of `race exam sweep`."""

    drivers: Drivers = ""
    unfit: Unfit = False
    tracks: Annotated[
        str, typer.Option(help="Comma-separated tracks, each driven at each step.")
    ] = "covapsy-base,covapsy-test-2023"
    vehicle: Annotated[str, typer.Option(help="Vehicle.")] = "tt02"
    laps: Annotated[int, typer.Option(min=1, max=MOST_LAPS, help="Counted laps of each track.")] = 5
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw clean laps over the steps into this .png or .svg file."),
    ] = None
    jobs: Annotated[int, typer.Option(min=0, help="Processes; 0: one for each core.")] = 0
    as_json: AsJson = False


@expand_options
def sweep(options: SweepOptions) -> None:
    """Make one thing worse in steps until a driver fails: tyres, motor, delay, sensors.

    A step is held if nine of ten laps are clean. Finished runs are kept: a sweep that was stopped
    goes on with the next one.
    """
    from race_server.competition.lap_exam import LapExamSpec

    given = drivers_for(options.drivers, DRIVERS, (options.vehicle,), unfit=options.unfit)
    drivers = once(given)
    tracks = once(names_in(options.tracks))
    for names, option in ((drivers, "--drivers"), (tracks, "--tracks")):
        if not names:
            raise ScenarioError(f"{option} needs a name, or several separated by commas")
    if options.plot is not None:
        check_picture(options.plot)
    spec = LapExamSpec(tracks, options.vehicle, options.laps, options.jobs)
    console = Console(stderr=True)
    rows, stopped = _sweep(spec, drivers, console)
    if options.as_json:
        print_document({"rows": [asdict(row) for row in rows], "stopped": stopped})
    else:
        _show(rows, drivers)
    if options.plot is not None and rows:
        from race_server.competition.lap_sweep_picture import draw_sweep

        draw_sweep(rows, options.plot)
    if stopped:
        console.print("stopped: these are the factors that were finished", style="yellow")
        sys.exit(130)


def _sweep(
    spec: "LapExamSpec", drivers: Sequence[str], console: Console
) -> "tuple[list[SweepRow], bool]":
    """Return the rows, and whether it was stopped."""
    from race_server.competition.lap_sweep import SWEEPS, sweep_all

    editions = editions_of(drivers)
    return counted(
        len(SWEEPS) * len(drivers),
        lambda watch: sweep_all(spec, drivers, editions, watch),
        console,
    )


def _show(rows: "Sequence[SweepRow]", drivers: Sequence[str]) -> None:
    from rich.table import Table

    table = Table(title="holds up to | fails at (-: not within its steps)")
    table.add_column("one thing is off", no_wrap=True)
    for driver in drivers:
        table.add_column(driver, justify="right", no_wrap=True)
    for factor in dict.fromkeys(row.factor for row in rows):
        found = {row.driver: row for row in rows if row.factor == factor}
        unit = next(iter(found.values())).unit
        cells = (_in_words(found.get(driver)) for driver in drivers)
        table.add_row(f"{factor} [{unit}]", *cells)
    console = Console()
    console.print_whole(table)
    for row in rows:
        for remark in dict.fromkeys(remark for one in row.steps for remark in one["remarks"]):
            console.print(f"{row.driver}, {row.factor}: {remark}", style="yellow", highlight=False)


def _in_words(row: "SweepRow | None") -> str:
    if row is None:
        return ""
    held, broke = ("-" if step is None else f"{step:g}" for step in (row.held, row.broke))
    return f"{held} | {broke}"
