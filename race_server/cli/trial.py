"""`race trial`: drivers against the clock."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_server.cli.document import AsJson, print_document
from race_server.cli.option_fields import expand_options
from race_server.cli.options import MOST_LAPS, Unfit, drivers_for, names_in, once, seeds_from
from race_server.errors import ScenarioError
from race_server.kept_file import check_place
from race_server.pictures import check_picture
from race_server.terminal import Console, TextColumn

if TYPE_CHECKING:
    from race_server.competition.time_trial.gaps import Gap
    from race_server.competition.time_trial.plan import Trial, TrialPlan
    from race_server.competition.time_trial.run_spec import RunSpec
    from race_server.competition.time_trial.save import RunLog

REPORT_B = "report-b"
DRIVERS = ("raceline", "follow_gap", "tentacles", "radar_line")


@dataclass(frozen=True)
class TrialOptions:
    """All options of `race trial`."""

    drivers: Annotated[
        str,
        typer.Option(
            "--drivers",
            "--driver",
            help=f"Comma-separated installed drivers. Default: those of {', '.join(DRIVERS)} that "
            "are made for the vehicles.",
        ),
    ] = ""
    unfit: Unfit = False
    tracks: Annotated[
        str,
        typer.Option("--tracks", "--track", help="Comma-separated names from `race track list`."),
    ] = "covapsy-train-2023"
    vehicles: Annotated[
        str,
        typer.Option(
            "--vehicles",
            "--vehicle",
            help="Comma-separated: tt02, tt02-drift, kart-13, kart-30, kart-60.",
        ),
    ] = "tt02"
    laps: Annotated[int, typer.Option(min=1, max=MOST_LAPS, help="Counted laps of each run.")] = 5
    seeds: Annotated[
        int,
        typer.Option(
            min=1,
            help="Runs of each combination, each with different sensor noise and start pose.",
        ),
    ] = 1
    first_seed: Annotated[
        int, typer.Option(min=0, help="Seed of the first run; the next runs count up from it.")
    ] = 1
    start: Annotated[
        str,
        typer.Option(
            help="flying: one lap that does not count comes first. standing: lap 1 starts from "
            "rest and does not enter the median."
        ),
    ] = "flying"
    gaps: Annotated[
        str,
        typer.Option(
            "--gaps",
            "--gap",
            help="Comma-separated reality gaps: none, noise, dropouts, delay, battery, lag, play, "
            "grip, all. With none and others, a table shows what each gap costs.",
        ),
    ] = "none"
    noise: Annotated[
        float | None, typer.Option(help="Gap `custom`: lidar noise [m], such as 0.02.")
    ] = None
    dropouts: Annotated[
        float | None, typer.Option(help="Gap `custom`: share of lidar rays that drop out, 0 to 1.")
    ] = None
    delay_ms: Annotated[
        float | None,
        typer.Option(help="Gap `custom`: delay of controls [ms], a multiple of 50."),
    ] = None
    ghost: Annotated[
        str,
        typer.Option(
            help="Lap to compare with: best, RACE/LAP or RACE/SEAT/LAP of the results file, or a "
            ".csv file written by --save-lap. Default: the reference limit."
        ),
    ] = ""
    plot: Annotated[
        Path | None, typer.Option(help="Plot laps, speed and delta into this .png or .svg file.")
    ] = None
    csv: Annotated[Path | None, typer.Option(help="Write the table into this .csv file.")] = None
    laps_csv: Annotated[Path | None, typer.Option(help="Write all laps into this .csv file.")] = (
        None
    )
    save_lap: Annotated[
        Path | None, typer.Option(help="Write the trace of the fastest lap into this .csv file.")
    ] = None
    beside: Annotated[
        str,
        typer.Option(help="report-b: show laps beside those of the report on the 1/10 race."),
    ] = ""
    jobs: Annotated[int, typer.Option(min=0, help="Processes; 0: one for each core.")] = 0
    decision_limit: Annotated[
        float,
        typer.Option(
            min=0.01,
            max=3600.0,
            help="Time limit of one decision [s]; a slower driver has stalled.",
        ),
    ] = 2.0
    results: Annotated[
        str,
        typer.Option(
            help="Results file for laps and traces, or none to keep nothing. Default: "
            "$RACE_SERVER_RESULTS, else ~/.local/share/race-server/results.sqlite."
        ),
    ] = ""
    as_json: AsJson = False


@expand_options
def trial(options: TrialOptions) -> None:
    """Time drivers alone on the track: median, best, spread, clean laps, ratio to the limit.

    Exit code 1 if a driver raised an exception or stalled; the runs of the others go on.
    """
    from race_server.competition.time_trial.plan import TrialPlan
    from race_server.competition.time_trial.save import RunLog
    from race_server.storage.results.schema import path_of

    names, gaps = _drivers(options), _gaps(options)
    specs = _specs(options, names, gaps)
    if options.beside not in {"", REPORT_B}:
        raise ScenarioError(f"--beside {options.beside!r} is unknown; choose {REPORT_B}")
    _check_files(options.plot, options.csv, options.laps_csv, options.save_lap)
    console = Console(stderr=True)
    with RunLog(path_of(options.results)) as log:
        plan = TrialPlan(tuple(specs), tuple(gaps), options.jobs, options.ghost, log.path)
        done = _drive(plan, log, console)
        _show(done, names if options.beside else (), as_json=options.as_json)
        try:
            _finish(log, console)
        finally:
            # What was driven is in these files, whatever becomes of the results file.
            _write_files(done, options, console)
    if done.stopped:
        console.print("stopped: these are the runs that were finished", style="yellow")
        sys.exit(130)
    if done.failed:
        sys.exit(1)


def _drivers(options: TrialOptions) -> tuple[str, ...]:
    vehicles = _names(options.vehicles, "--vehicles")
    tracks = _names(options.tracks, "--tracks")
    names = drivers_for(options.drivers, DRIVERS, vehicles, unfit=options.unfit, courses=tracks)
    if not names:
        raise ScenarioError(
            f"no usual driver is made for all of {', '.join(vehicles)}; name one with --drivers"
        )
    return once(names)


def _gaps(options: TrialOptions) -> "list[Gap]":
    """Return the reality gaps, each to be driven with every driver."""
    from race_server.competition.time_trial.gaps import NONE, custom_gap, gaps_named

    gaps = gaps_named(_names(options.gaps, "--gaps"))
    if custom := custom_gap(options.noise, options.dropouts, options.delay_ms):
        # Beside the nominal car, so that the loss is known.
        gaps = [*(gaps or [NONE]), custom]
    return gaps


def _specs(options: TrialOptions, names: tuple[str, ...], gaps: "list[Gap]") -> "list[RunSpec]":
    """Return a run for each combination of track, vehicle, gap, driver and seed.

    Raises:
        ScenarioError: no track or vehicle is named, or a seed is too large.
    """
    from race_server.competition.time_trial.run_spec import RunSpec, run_specs_of

    like = RunSpec(
        "",
        "",
        laps=options.laps,
        start=options.start,
        decision_limit_s=options.decision_limit,
    )
    return run_specs_of(
        names,
        _names(options.tracks, "--tracks"),
        _names(options.vehicles, "--vehicles"),
        gaps,
        seeds_from(options.first_seed, options.seeds),
        like,
    )


def _names(text: str, option: str) -> list[str]:
    names = list(once(names_in(text)))
    if not names:
        raise ScenarioError(f"{option} is empty; name one or more, separated by commas")
    return names


def _check_files(plot: Path | None, *tables: Path | None) -> None:
    """Check before the first run that the files can be written.

    Raises:
        ScenarioError: there is no place for one of them, two are the same, or the picture has
            another ending.
    """
    if plot is not None:
        check_picture(plot)
    given = [path for path in (plot, *tables) if path is not None]
    for path in given:
        check_place(path)
    files = [path.resolve() for path in given if not path.exists() or path.is_file()]
    if twice := [path for path in files if files.count(path) > 1]:
        raise ScenarioError(f"{twice[0]}: two options write this file; name another for one")


def _drive(plan: "TrialPlan", log: "RunLog", console: Console) -> "Trial":
    """Drive all runs of a trial and keep them in the log."""
    from race_server.competition.pool import is_ready
    from race_server.competition.time_trial.plan import compile_once, prepare

    with console.status("computing the limits", spinner="dots") as status:
        trial = prepare(plan)
        if not is_ready():
            status.update("compiling the simulation for this machine, once: about a minute")
            compile_once(plan.specs[0])
    with _progress(plan, console) as report:
        trial.drive(log, report)
    return trial


@contextmanager
def _progress(plan: "TrialPlan", console: Console) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar of laps."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    hidden = not console.is_terminal
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=hidden
    ) as bar:
        task = bar.add_task("laps", total=sum(spec.laps for spec in plan.specs))
        driven = [0] * len(plan.specs)

        def report(number: int, laps: int) -> None:
            driven[number] = laps
            spec = plan.specs[number]
            bar.update(task, completed=sum(driven), description=f"{spec.driver}, {spec.track}")

        yield report


def _show(done: "Trial", beside: tuple[str, ...], *, as_json: bool) -> None:
    if as_json:
        print_document(done.as_json())
        return
    from race_server.competition.time_trial.table import (
        beside_report_b,
        ghost_table,
        loss_tables,
        tables_of,
    )
    from race_server.core.driver import description_of

    console = Console()
    gaps = {gap.name: gap.words() for gap in done.plan.gaps}
    console.print_whole(tables_of(done.rows, gaps))
    if done.losses:
        console.print(loss_tables(done.losses))
    for place, ghost in done.ghosts.items():
        console.print(ghost_table(ghost.name, done.against_ghost(place)), "\n")
    if beside:
        words = {name: description_of(name) for name in beside}
        console.print(beside_report_b(done.rows, words))


def _write_files(done: "Trial", options: TrialOptions, console: Console) -> None:
    """Write the files that were asked for."""
    from race_server.competition.time_trial.ghost import save_lap
    from race_server.competition.time_trial.table import lap_rows
    from race_server.storage.csv_table import write_csv

    paths = []
    if options.csv is not None:
        write_csv([row.as_json() for row in done.rows], options.csv)
        paths.append(options.csv)
    if options.laps_csv is not None:
        write_csv(lap_rows(done.done), options.laps_csv)
        paths.append(options.laps_csv)
    laps = [lap for run in done.done for lap in run.laps]
    if options.save_lap is not None and laps:
        save_lap(min(laps, key=lambda lap: lap.time_us).trace, options.save_lap)
        paths.append(options.save_lap)
    if options.plot is not None:
        paths += done.draw(options.plot)
    for path in paths:
        console.print(f"written: {path}", style="dim", soft_wrap=True)
    if (options.plot is not None or options.save_lap is not None) and not laps:
        console.print("no driver completed a lap: there is nothing to draw or to save")


def _finish(log: "RunLog", console: Console) -> None:
    """Write the laps that the results file could not take so far."""
    if beside := log.finish():
        text = f"{log.problem}. The laps are in {beside} instead"
        console.print(text, style="yellow", soft_wrap=True)
