"""`race transfer`: the same drivers on the same tracks, here and in a second simulator."""

import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from race_agents.commands.exam_laps import editions_of
from race_server.cli.document import AsJson, print_document
from race_server.cli.option_fields import expand_options
from race_server.cli.options import MOST_LAPS, known_drivers, names_in, once
from race_server.errors import ScenarioError
from race_server.pictures import check_picture
from race_server.terminal import Console, TextColumn

if TYPE_CHECKING:
    from race_server.competition.lap_exam import CourseTry, LapExamSpec
    from race_server.competition.transfer import TransferRow
    from race_server.core.vehicles import Vehicle


@dataclass(frozen=True)
class TransferOptions:
    """All arguments and options of `race transfer`."""

    drivers: Annotated[str, typer.Argument(help="Comma-separated installed drivers.")] = (
        "raceline,idm,follow_gap,learned:time-trial"
    )
    to: Annotated[
        str,
        typer.Option(
            help="The other simulator: highway-env, or its environments as they are: "
            "highway-env-itself, highway-env-itself:pedals,crash-only."
        ),
    ] = "highway-env"
    tracks: Annotated[
        str,
        typer.Option(
            help="Comma-separated tracks. Default: the race tracks of highway-env, a tenth of "
            "their size for model cars."
        ),
    ] = ""
    vehicle: Annotated[str, typer.Option(help="Vehicle: a model car or a kart.")] = "tt02"
    laps: Annotated[
        int,
        typer.Option(
            min=1, max=MOST_LAPS, help="Counted laps of each run; one that is not comes first."
        ),
    ] = 5
    traffic: Annotated[
        int, typer.Option(min=0, help="Vehicles of highway-env to overtake, here and there.")
    ] = 0
    plot: Annotated[
        Path | None, typer.Option(help="Draw clean laps and times into this .png or .svg file.")
    ] = None
    jobs: Annotated[int, typer.Option(min=0, help="Processes; 0: one for each core.")] = 0
    as_json: AsJson = False


@expand_options
def transfer(options: TransferOptions) -> None:
    """Drive here and in a second simulator, and say which difference costs most.

    Between the two stands a ladder of changes; beside it each acts alone. Finished runs are kept:
    a transfer that was stopped goes on with the next one.
    """
    from race_server.competition.lap_exam import LapExamSpec
    from race_server.competition.transfer import rows_of
    from race_server.competition.transfer_traffic import is_target
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.second.highway_options import NAME
    from race_server.second.simulator import check_simulator

    drivers = once(known_drivers(options.drivers))
    if not drivers:
        raise ScenarioError("no driver; name one or more, separated by commas")
    if not is_target(options.to):
        raise ScenarioError(f"--to {options.to!r}: choose {NAME} or {NAME}-itself")
    check_simulator(options.to)
    if options.plot is not None:
        check_picture(options.plot)
    tracks = once(names_in(options.tracks)) or own_tracks(vehicle_named(options.vehicle))
    spec = LapExamSpec(tracks, options.vehicle, options.laps, options.jobs, traffic=options.traffic)
    console = Console(stderr=True)
    if options.traffic or options.to != NAME:
        if options.plot is not None:
            raise ScenarioError(f"--plot {options.plot}: only the ladder is drawn; leave it out")
        _drive_in_traffic(spec, drivers, options, console)
        return
    found, stopped = _drive(spec, drivers, console)
    rows = sorted(rows_of(found), key=lambda row: tracks.index(row.track))
    rows.sort(key=lambda row: drivers.index(row.driver))
    if options.as_json:
        print_document({"rows": [asdict(row) for row in rows], "stopped": stopped})
    else:
        _show(rows)
    if options.plot is not None and rows:
        from race_server.competition.transfer_picture import draw_transfer

        draw_transfer(rows, options.plot)
    if stopped:
        console.print("stopped: these are the runs that were finished", style="yellow")
        sys.exit(130)


def own_tracks(vehicle: "Vehicle") -> tuple[str, ...]:
    """Return the race tracks of highway-env for a vehicle."""
    from race_server.scenario.track.highway_roads import PREFIX, TRACKS

    return tuple(PREFIX + track + ":tenth" * vehicle.is_model_car for track in TRACKS)


def _drive_in_traffic(
    spec: "LapExamSpec", drivers: tuple[str, ...], options: TransferOptions, console: Console
) -> None:
    """Drive among others here and there, and show both."""
    from rich.table import Table

    from race_server.competition.transfer_traffic import drive_in_traffic, traffic_rows

    found, stopped = [], False
    try:
        for name, one in drive_in_traffic(spec, drivers, editions_of(drivers), options.to):
            found.append((name, one))
            if not options.as_json:
                console.print(f"{one.driver}, {one.course}, {name}", highlight=False)
    except KeyboardInterrupt:
        stopped = True
    rows = traffic_rows(found, options.traffic)
    if options.as_json:
        print_document({"rows": [asdict(row) for row in rows], "stopped": stopped})
    else:
        table = Table(title=f"{options.traffic} vehicles of highway-env, here | {options.to}")
        table.add_column("driver, track", no_wrap=True)
        heads = ("clean laps", "× limit", "touched walls", "karts", "overtakes")
        for head in heads:
            table.add_column(head, justify="right", no_wrap=True)
        table.add_column("remark", no_wrap=True)
        for row in rows:
            pairs = zip(_traffic_cells(row.here), _traffic_cells(row.there), strict=True)
            cells = [f"{here} | {there}" for here, there in pairs]
            remark = row.there["remark"] or row.here["remark"]
            table.add_row(f"{row.driver}, {row.track}", *cells, remark)
        wide = Console()
        wide.print_whole(table)
    if stopped:
        console.print("stopped: these are the runs that were finished", style="yellow")
        sys.exit(130)


def _traffic_cells(one: Mapping[str, Any]) -> tuple[str, ...]:
    ratio = "-" if one["ratio"] is None else f"{one['ratio']:.3f}"
    counts = (one["wall_contacts"], one["kart_contacts"], one["overtakes"])
    return (f"{one['clean_laps']} of {one['laps_wanted']}", ratio, *map(str, counts))


def _drive(
    spec: "LapExamSpec", drivers: tuple[str, ...], console: Console
) -> "tuple[list[tuple[str, CourseTry]], bool]":
    """Return what was driven, and whether it was stopped."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    from race_server.competition.transfer import RUNGS, drive_ladder

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    hidden = not console.is_terminal
    found: list[tuple[str, CourseTry]] = []
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=hidden
    ) as bar:
        total = len(drivers) * len(spec.courses) * len(RUNGS)
        task = bar.add_task("getting ready; compiling takes minutes, once", total=total)
        try:
            for name, one in drive_ladder(spec, drivers, editions_of(drivers)):
                found.append((name, one))
                bar.update(task, advance=1, description=f"{one.driver}, {one.course}, {name}")
        except KeyboardInterrupt:
            return found, True
    return found, False


def _show(rows: "list[TransferRow]") -> None:
    from rich.table import Table

    from race_server.competition.transfer import RUNGS

    if not rows:
        return
    table = Table()
    table.add_column("driver, track", no_wrap=True)
    ladder = [one["change"] for one in rows[0].ladder]
    alone = [one["change"] for one in rows[0].alone if one["change"] != "tyres"]
    for name in (*ladder, *(f"only {name}" for name in alone)):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("costs most", no_wrap=True)
    table.add_column("wins back most", no_wrap=True)
    for row in rows:
        single = [one for one in row.alone if one["change"] in alone]
        cells = [_in_words(one) for one in (*row.ladder, *single)]
        table.add_row(f"{row.driver}, {row.track}", *cells, row.factor or "-", row.mends or "-")
    console = Console()
    console.print_whole(table)
    console.print("clean laps, and the median lap over the limit of its track", highlight=False)
    for rung in RUNGS:
        console.print(f"{rung.name}: {rung.meaning}", style="dim", highlight=False)
    for row in rows:
        only = ({**one, "change": f"only {one['change']}"} for one in row.alone[1:])
        for one in (*row.ladder, *only):
            if one["remark"]:
                words = f"{row.driver}, {row.track}, {one['change']}: {one['remark']}"
                console.print(words, style="yellow", highlight=False)


def _in_words(one: Mapping[str, Any]) -> str:
    if one["failed"]:
        return "refused" if not one["laps"] else "failed"
    ratio = "-" if one["ratio"] is None else f"{one['ratio']:.3f}"
    return f"{100.0 * one['clean_lap_rate']:.0f} % {ratio}"
