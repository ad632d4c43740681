"""`race bench plan`: how often and how fast parking is planned."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_agents.planning.plan_bench import Measured


def bench_plan(
    runs: Annotated[int, typer.Option(min=1, help="Random starts of each task.")] = 100,
    task: Annotated[
        str, typer.Option(help="Only tasks with this text in their names, such as parallel.")
    ] = "",
    seed: Annotated[int, typer.Option(min=0, help="Seed of the starts.")] = 0,
    plot: Annotated[
        Path | None, typer.Option(help="Draw a plan of each task into this file.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Plan how a car parks, from random starts into slots of many sizes.

    Times are CPU time of one core; a share comes with its 95 % interval.
    """
    from race_agents.planning.plan_bench import bench_plan as measure
    from race_agents.planning.plan_picture import plot_plans
    from race_server.core.vehicle_presets import CAR

    measured = measure(CAR, runs=runs, seed=seed, text=task)
    if plot is not None:
        plot_plans(CAR, measured.shown, plot)
    if as_json:
        print_document(measured.document())
    else:
        _show(measured)


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
    console = Console()
    # Wider than the terminal if necessary, so that no figure is cut off.
    console.width = max(console.width, table.__rich_measure__(console, console.options).maximum)
    console.print(table)
    for row in measured.rows:
        for reason, count in row.failures.items():
            console.print(f"{row.task}, {count} of {row.runs}: {reason}", highlight=False)
    console.print(f"the first plan took {measured.first_plan_s} s", highlight=False)
