"""`race bench`: how fast this machine runs the program."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.pictures import check_picture
from race_server.terminal import Console, say

app = typer.Typer(help="Measure the speed of this program on this machine.", no_args_is_help=True)


@app.command()
def core(
    track: Annotated[str, typer.Option(help="Course to measure on.")] = "covapsy-train-2023",
    seconds: Annotated[float, typer.Option(help="CPU seconds to measure each figure.")] = 2.0,
    as_json: AsJson = False,
) -> None:
    """Measure how many karts one core simulates, with radar and lidar, and where time is spent."""
    from race_server.scenario.track.load import load_course
    from race_server.tools.bench.core import bench_core

    _show(bench_core(load_course(track), seconds=seconds), as_json=as_json)


@app.command()
def wire(
    seconds: Annotated[float, typer.Option(help="Seconds to measure each number of karts.")] = 10.0,
    as_json: AsJson = False,
) -> None:
    """Measure encoding and decoding, and the latency from control to effect over loopback."""
    from race_server.tools.bench.wire import bench_wire

    _show(bench_wire(seconds=seconds), as_json=as_json)


@app.command()
def env(
    cores: Annotated[int, typer.Option(min=1, help="Cores that step batches of races.")] = 1,
    seconds: Annotated[float, typer.Option(help="Seconds to measure each figure.")] = 2.0,
    plot: Annotated[
        Path | None,
        typer.Option(
            help="Also measure the scaling with karts, races and cores, and plot it into this file."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Measure steps per second of the training world through each interface, beside highway-env."""
    from race_server.tools.bench.env import bench_env, bench_scaling
    from race_server.tools.bench.scaling_plot import plot_scaling

    if plot is not None:
        check_picture(plot)
    figures = bench_env(cores=cores, seconds=seconds)
    if figures["highway_lidar"] is None:
        _miss_highway()
    if plot is not None:
        figures["scaling"] = bench_scaling(seconds=0.25 * seconds)
        plot_scaling(figures["scaling"], plot)
    _show(figures, as_json=as_json)


@app.command()
def lot(
    seconds: Annotated[float, typer.Option(help="Seconds to measure each figure.")] = 2.0,
    as_json: AsJson = False,
) -> None:
    """Measure decisions per second of vehicles that park, beside highway-env's parking."""
    from race_server.tools.bench.lot import PARKING, bench_lot

    figures = bench_lot(seconds=seconds)
    if figures[PARKING] is None:
        _miss_highway()
    _show(figures, as_json=as_json)


@app.command()
def learn(
    rollouts: Annotated[int, typer.Option(min=1, help="Rollouts to measure each figure.")] = 8,
    as_json: AsJson = False,
) -> None:
    """Measure the speed of PPO training, and what it would be if the simulation took no time."""
    from race_server.tools.bench.learn import bench_learn

    _show(bench_learn(rollouts=rollouts), as_json=as_json)


def _miss_highway() -> None:
    say(
        "highway-env is not installed, so there is no comparison with it; "
        "`pip install race-server[bench]` installs it.",
        error=True,
    )


def _show(figures: dict[str, Any], *, as_json: bool) -> None:
    if as_json:
        print_document(figures)
        return
    table = Table("figure", "value")
    for name, value in _flat(figures):
        table.add_row(name, f"{value:,}" if isinstance(value, int) else str(value))
    Console().print_whole(table)


def _flat(figures: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    rows: list[tuple[str, Any]] = []
    for name, value in figures.items():
        if isinstance(value, dict):
            rows += _flat(value, f"{prefix}{name}.")
        else:
            rows.append((prefix + name, value))
    return rows
