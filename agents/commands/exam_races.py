"""`race exam races`: how drivers race one another on courses that they have never seen."""

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_agents.commands.exam_laps import MOST_TOLD, Courses, DrawnFor, Jobs, editions_of
from race_agents.commands.exam_watch import counted
from race_server.cli.document import AsJson, print_document
from race_server.cli.option_fields import expand_options
from race_server.cli.options import MOST_LAPS, Unfit, drivers_for
from race_server.core.seeds import HELD_OUT
from race_server.pictures import check_picture
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.competition.race_exam import RaceOutcome, RaceRow, RaceTask

DRIVERS = ("learned:race", "learned:full", "raceline", "idm", "follow_gap", "tentacles")


@dataclass(frozen=True)
class RaceOptions:
    """All options of `race exam races`."""

    drivers: Annotated[
        str,
        typer.Option(
            "--drivers",
            "--driver",
            help="Comma-separated installed drivers, one kart each; a name may stand there twice. "
            f"Default: those of {', '.join(DRIVERS)} that are made for the vehicle.",
        ),
    ] = ""
    unfit: Unfit = False
    races: Annotated[int, typer.Option(min=1, help="Races. Each has another grid.")] = 40
    courses: Courses = 20
    first_seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="Seed of the first course and of the first race; the next ones count up from it. "
            "No training draws the default's.",
        ),
    ] = HELD_OUT + 1
    folder: Annotated[
        Path | None,
        typer.Option(help="Race on the course files (.toml) of this folder; none is drawn."),
    ] = None
    vehicle: DrawnFor = "tt02"
    laps: Annotated[int, typer.Option(min=1, max=MOST_LAPS, help="Laps of each race.")] = 5
    items: Annotated[bool, typer.Option(help="Race with items.")] = True
    finish_limit_s: Annotated[
        float,
        typer.Option(
            "--finish-limit",
            min=0.0,
            help="A kart that comes home later than this after the winner [s] has not finished; "
            "0: no such limit, and 15 minutes for the race.",
        ),
    ] = 0.0
    plot: Annotated[
        Path | None, typer.Option(help="Draw ratings and finishes into this .png or .svg file.")
    ] = None
    jobs: Jobs = 0
    as_json: AsJson = False


@expand_options
def races(options: RaceOptions) -> None:
    """Let drivers race one another on unseen courses: who comes home, in which place, how strong.

    Each driver starts once from each place of the grid. Ratings are Plackett-Luce with bounds of
    95 %, of more races on the same courses; on how many of them a driver's mean place is better
    than the next one's stands beside them. Finished races are kept: an exam that was stopped goes
    on with the next one.
    """
    from race_server.competition.lap_exam import examined_courses
    from race_server.competition.race_exam import RaceTask, race_rows, tasks_of
    from race_server.core.vehicle_presets import vehicle_named

    drivers = drivers_for(options.drivers, DRIVERS, (options.vehicle,), unfit=options.unfit)
    if options.plot is not None:
        check_picture(options.plot)
    courses = examined_courses(
        options.folder, options.courses, options.first_seed, vehicle_named(options.vehicle)
    )
    like = RaceTask(
        *("", (), 0, options.vehicle, options.laps, options.items, options.finish_limit_s)
    )
    tasks = tasks_of(drivers, courses, options.races, options.first_seed, like)
    console, begun = Console(stderr=True), time.monotonic()
    outcomes, stopped = _hold(tasks, drivers, options.jobs, console)
    rows = race_rows(outcomes)
    if options.as_json:
        seconds = round(time.monotonic() - begun, 1)
        document = {"rows": [asdict(row) for row in rows]}
        document |= {"races": [asdict(outcome) for outcome in outcomes]}
        print_document(document | {"stopped": stopped, "wall_s": seconds})
    else:
        _show(rows, outcomes)
    if options.plot is not None and rows:
        from race_server.competition.race_picture import draw_ratings

        draw_ratings(rows, options.plot)
    if stopped:
        console.print("stopped: these are the races that were finished", style="yellow")
        sys.exit(130)


def _hold(
    tasks: "Sequence[RaceTask]",
    drivers: Sequence[str],
    jobs: int,
    console: Console,
) -> "tuple[list[RaceOutcome], bool]":
    """Return the races in their order, and whether they were stopped."""
    from race_server.competition.race_exam import hold_races

    editions = editions_of(drivers)
    outcomes, stopped = counted(
        len(tasks), lambda watch: hold_races(tasks, jobs, editions, watch), console
    )
    return sorted(outcomes, key=lambda outcome: outcome.task.seed), stopped


def _show(rows: "Sequence[RaceRow]", outcomes: "Sequence[RaceOutcome]") -> None:
    from rich.table import Table

    table = Table()
    table.add_column("driver", no_wrap=True)
    heads = ("rating", "95 %", "ahead of next", "mean place", "wins", "starts", "finished", "95 %")
    for head in (*heads, "walls", "karts", "rescues", "wrong way"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        low, high = row.finish_interval
        counts = (row.wall_contacts, row.kart_contacts, row.rescues, row.wrong_way)
        table.add_row(
            *(row.driver, f"{row.rating:.0f}"),
            "{:.0f}-{:.0f}".format(*row.rating_interval),
            f"{row.ahead_on} of {row.courses}",
            *(f"{row.mean_place:.2f} ± {row.place_error:.2f}", str(row.wins), str(row.starts)),
            *(f"{100.0 * row.finish_rate:.1f} %", f"{100.0 * low:.1f}-{100.0 * high:.1f} %"),
            *map(str, counts),
        )
    console = Console()
    console.print_whole(table)
    home = sum(kart.has_finished for outcome in outcomes for kart in outcome.karts)
    all_karts = sum(len(outcome.karts) for outcome in outcomes)
    console.print(f"{home} of {all_karts} karts finished", highlight=False)
    for row in rows:
        for where, why in list(row.retired.items())[:MOST_TOLD]:
            console.print(f"{row.driver}: {where}: {why}", style="yellow", highlight=False)
    for outcome in outcomes:
        if outcome.failure:
            words = f"{outcome.task.course} seed {outcome.task.seed}: {outcome.failure}"
            console.print(words, style="red", highlight=False)
