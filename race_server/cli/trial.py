"""`race trial`: drivers against the clock."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from race_server.cli.document import AsJson, print_document
from race_server.cli.options import known_drivers, names_in
from race_server.errors import ResultsError, ScenarioError

if TYPE_CHECKING:
    from race_server.competition.time_trial.plan import Trial, TrialPlan
    from race_server.competition.time_trial.save import RunLog

REPORT_B = "report-b"

Drivers = Annotated[
    str, typer.Option("--drivers", "--driver", help="Comma-separated names of installed drivers.")
]
Tracks = Annotated[
    str,
    typer.Option("--tracks", "--track", help="Comma-separated: names from `race track list`."),
]
Vehicles = Annotated[
    str, typer.Option("--vehicles", "--vehicle", help="Comma-separated, such as tt02 or kart-60.")
]
Gaps = Annotated[
    str,
    typer.Option(
        "--gaps",
        "--gap",
        help="Comma-separated reality gaps: none, noise, dropouts, delay, battery, lag, play, "
        "grip, all. With none among several, a table says what degrades.",
    ),
]
Noise = Annotated[
    float | None, typer.Option(help="One more gap, `custom`: lidar noise in m, such as 0.02.")
]
Dropouts = Annotated[
    float | None, typer.Option(help="`custom`: share of lidar rays that drop out, 0 to 1.")
]
DelayMs = Annotated[
    float | None, typer.Option(help="`custom`: delay of answers in ms, a multiple of 50.")
]
Start = Annotated[
    str,
    typer.Option(
        help="flying: a lap that does not count comes first. standing: lap 1 counts from rest, "
        "but not for the median."
    ),
]
Seeds = Annotated[
    int, typer.Option(min=1, help="Runs of each: other sensor noise, another pose on the mark.")
]
Results = Annotated[
    str,
    typer.Option(
        help="File that keeps laps with their traces, or none; without it $RACE_SERVER_RESULTS, "
        "or ~/.local/share/race-server/results.sqlite."
    ),
]


def trial(
    drivers: Drivers = "raceline,follow_gap,tentacles",
    tracks: Tracks = "covapsy-train-2023",
    vehicles: Vehicles = "tt02",
    laps: Annotated[int, typer.Option(min=1, help="Laps that count in each run.")] = 5,
    seeds: Seeds = 1,
    first_seed: Annotated[int, typer.Option(min=0, help="The first seed; others follow.")] = 1,
    start: Start = "flying",
    gaps: Gaps = "none",
    noise: Noise = None,
    dropouts: Dropouts = None,
    delay_ms: DelayMs = None,
    ghost: Annotated[
        str,
        typer.Option(
            help="Lap to compare with: best, RACE/LAP of the results file, or a .csv of --save-lap."
        ),
    ] = "",
    plot: Annotated[
        Path | None, typer.Option(help="Draw laps, speed and delta into this .png or .svg.")
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Write the table into this file.")] = None,
    laps_csv: Annotated[Path | None, typer.Option(help="Write every lap into this file.")] = None,
    save_lap: Annotated[
        Path | None, typer.Option(help="Write the trace of the fastest lap into this .csv.")
    ] = None,
    beside: Annotated[
        str, typer.Option(help="report-b: show laps beside those of the 1/10 race's report.")
    ] = "",
    jobs: Annotated[int, typer.Option(min=0, help="Processes; 0: one for each core.")] = 0,
    decision_limit: Annotated[
        float, typer.Option(min=0.01, help="A driver that thinks for more seconds has stalled.")
    ] = 2.0,
    results: Results = "",
    as_json: AsJson = False,
) -> None:
    """Time drivers alone on the track: median, best, spread, clean laps, ratio to the limit.

    The exit status is 1 when a driver raised or stalled; the others' runs go on.
    """
    from race_server.competition.time_trial.gaps import NONE, custom_gap, gaps_named
    from race_server.competition.time_trial.plan import TrialPlan
    from race_server.competition.time_trial.run_spec import RunSpec, run_specs_of
    from race_server.competition.time_trial.save import RunLog
    from race_server.storage.results.schema import path_of

    settings = gaps_named(_names(gaps, "--gaps"))
    if custom := custom_gap(noise, dropouts, delay_ms):
        # Beside the nominal car, so that the loss can be told.
        settings = [*(settings or [NONE]), custom]
    names = known_drivers(drivers)
    if not names:
        raise ScenarioError("--drivers is empty; name one or more, separated by commas")
    like = RunSpec("", "", laps=laps, start=start, decision_limit_s=decision_limit)
    cells = run_specs_of(
        names,
        _names(tracks, "--tracks"),
        _names(vehicles, "--vehicles"),
        settings,
        range(first_seed, first_seed + seeds),
        like,
    )
    if beside not in {"", REPORT_B}:
        raise ScenarioError(f"--beside {beside!r} is unknown; choose {REPORT_B}")
    _check_files(plot, csv, laps_csv, save_lap)
    console = Console(stderr=True)
    with RunLog(path_of(results)) as ledger:
        plan = TrialPlan(tuple(cells), tuple(settings), jobs, ghost, ledger.path)
        done = _hold(plan, ledger, console, quiet=as_json)
        _write_files(done, plot, csv, laps_csv, save_lap, console)
        _show(done, names if beside else (), as_json=as_json)
        _finish(ledger, console)
    if done.stopped:
        console.print("[yellow]stopped: these are the runs that were over[/]")
        sys.exit(130)
    if done.failed:
        sys.exit(1)


def _names(text: str, option: str) -> list[str]:
    names = list(dict.fromkeys(names_in(text)))
    if not names:
        raise ScenarioError(f"{option} is empty; name one or more, separated by commas")
    return names


def _check_files(plot: Path | None, *tables: Path | None) -> None:
    """See before anybody drives that what is asked for can be written."""
    if plot is not None:
        from race_server.competition.time_trial.draw import check_picture

        check_picture(plot)
    for path in (plot, *tables):
        if path is not None and not path.absolute().parent.is_dir():
            raise ResultsError(f"{path}: its folder does not exist; make it first")


def _hold(plan: "TrialPlan", ledger: "RunLog", console: Console, *, quiet: bool) -> "Trial":
    from race_server.competition.time_trial.plan import compile_once, prepare
    from race_server.competition.time_trial.pool import is_ready

    with console.status("looking for the limits", spinner="dots") as status:
        trial = prepare(plan)
        if not is_ready():
            status.update("compiling the simulation for this machine, once: about a minute")
            compile_once(plan.cells[0])
    with _progress(plan, console, quiet=quiet) as report:
        trial.drive(ledger, report)
    return trial


@contextmanager
def _progress(
    plan: "TrialPlan", console: Console, *, quiet: bool
) -> Iterator[Callable[[int, int], None]]:
    """Show how many of all laps are driven."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    hidden = quiet or not console.is_terminal
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=hidden
    ) as bar:
        task = bar.add_task("laps", total=sum(cell.laps for cell in plan.cells))
        driven = [0] * len(plan.cells)

        def report(number: int, laps: int) -> None:
            driven[number] = laps
            cell = plan.cells[number]
            bar.update(task, completed=sum(driven), description=f"{cell.driver}, {cell.track}")

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
    console.print(tables_of(done.rows, gaps), markup=False)
    if done.losses:
        console.print(loss_tables(done.losses))
    for place, ghost in done.ghosts.items():
        console.print(ghost_table(ghost.name, done.against_ghost(place)), "\n")
    if beside:
        words = {name: description_of(name) for name in beside}
        console.print(beside_report_b(done.rows, words))


def _write_files(
    done: "Trial",
    plot: Path | None,
    csv: Path | None,
    laps_csv: Path | None,
    save_lap: Path | None,
    console: Console,
) -> None:
    from race_server.competition.time_trial.ghost import save_lap as save
    from race_server.competition.time_trial.table import lap_rows, write_csv

    paths = []
    if csv is not None:
        write_csv([row.as_json() for row in done.rows], csv)
        paths.append(csv)
    if laps_csv is not None:
        write_csv(lap_rows(done.done), laps_csv)
        paths.append(laps_csv)
    laps = [lap for run in done.done for lap in run.laps]
    if save_lap is not None and laps:
        save(min(laps, key=lambda lap: lap.time_us).trace, save_lap)
        paths.append(save_lap)
    if plot is not None:
        paths += done.draw(plot)
    for path in paths:
        console.print(f"written: {path}", style="dim", markup=False, soft_wrap=True)
    if (plot is not None or save_lap is not None) and not laps:
        console.print("nobody completed a lap: there is nothing to draw or to save")


def _finish(ledger: "RunLog", console: Console) -> None:
    """Write what the results file has not taken yet."""
    if beside := ledger.finish():
        text = f"{ledger.problem}. The laps are in {beside} instead"
        console.print(text, style="yellow", markup=False, soft_wrap=True)
