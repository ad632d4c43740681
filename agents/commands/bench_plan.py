"""`race bench plan`: how often and how fast parking is planned, and how docks are driven into."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.core.seeds import MOST_SEED
from race_server.errors import ScenarioError
from race_server.pictures import check_picture
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_agents.planning.dock_bench import Driven
    from race_agents.planning.plan_bench import Measured


def bench_plan(
    runs: Annotated[
        int, typer.Option("--runs", "--seeds", min=1, help="Random starts of each task.")
    ] = 100,
    task: Annotated[
        str, typer.Option(help="Only tasks with this text in their names, such as parallel.")
    ] = "",
    vehicle: Annotated[
        str,
        typer.Option(help="Vehicle: with a trailer, such as lorry-16m5, it reverses into docks."),
    ] = "car",
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the starts.")] = 0,
    plot: Annotated[
        Path | None, typer.Option(help="Draw a plan of each task into this file.")
    ] = None,
    drive: Annotated[
        bool,
        typer.Option(
            "--drive", help="Drive the plans of a vehicle with a trailer, under several troubles."
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Plan how a vehicle parks, from random starts into slots of many sizes.

    Times are CPU time of one core; a share comes with its 95 % interval. A task is given up after
    50 starts of which none was solved.
    """
    from race_agents.planning.dock_bench import bench_drive
    from race_agents.planning.plan_bench import bench_plan as measure
    from race_agents.planning.plan_picture import plot_plans
    from race_server.core.vehicle_presets import vehicle_named

    parked = vehicle_named(vehicle)
    if plot is not None:
        check_picture(plot)
    if drive and plot is not None:
        raise ScenarioError("--drive measures what is driven and plots nothing: leave --plot out")
    if drive:
        driven = bench_drive(parked, runs=runs, seed=seed, text=task)
        if as_json:
            print_document(driven.document())
        else:
            _show_drives(driven)
        return
    measured = measure(parked, runs=runs, seed=seed, text=task)
    if as_json:
        print_document(measured.document())
    else:
        _show(measured)
    if plot is not None and measured.shown:
        plot_plans(parked, measured.shown, plot)
    elif plot is not None:
        Console(stderr=True).print(f"nothing was solved: {plot} is not drawn", soft_wrap=True)


def _show(measured: "Measured") -> None:
    table = Table()
    table.add_column("task", no_wrap=True)
    for head in ("solved", "95 %", "median ms", "p95 ms", "most ms", "changes", "way m"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in measured.rows:
        table.add_row(
            row.task,
            f"{row.solved} of {row.runs}",
            f"{100.0 * row.share_low:.1f}-{100.0 * row.share_high:.1f} %",
            f"{row.cpu_ms_median:.1f}",
            f"{row.cpu_ms_p95:.1f}",
            f"{row.cpu_ms_most:.1f}",
            "-" if row.changes_mean is None else f"{row.changes_mean:.1f}",
            "-" if row.length_mean_m is None else f"{row.length_mean_m:.1f}",
        )
    console = _print(table)
    for row in measured.rows:
        for reason, count in row.failures.items():
            console.print(f"{row.task}, {count} of {row.runs}: {reason}", highlight=False)
    console.print(f"the first plan took {measured.first_plan_s} s", highlight=False)


def _show_drives(driven: "Driven") -> None:
    table = Table()
    for head in ("task", "trouble"):
        table.add_column(head, no_wrap=True)
    for head in ("docked", "95 %", "time s", "plans", "offset m", "turn rad", "otherwise"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in driven.rows:
        figures = (row.time_s_median, row.plans_mean, row.offset_m_p95, row.turn_rad_p95)
        others = (f"{count} {name}" for name, count in row.endings.items() if name != "docked")
        table.add_row(
            row.task,
            row.trouble,
            f"{row.docked} of {row.runs}",
            f"{100.0 * row.share_low:.1f}-{100.0 * row.share_high:.1f} %",
            *("-" if figure is None else f"{figure:g}" for figure in figures),
            ", ".join(others) or "-",
        )
    _print(table)


def _print(table: Table) -> Console:
    """Print a table wider than the terminal if necessary, so that no figure is cut off."""
    console = Console()
    console.print_whole(table)
    return console
