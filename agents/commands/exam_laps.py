"""`race exam laps`: how drivers lap courses that they have never seen."""

import hashlib
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_agents.commands.exam_watch import counted
from race_server.cli.document import AsJson, print_document
from race_server.cli.option_fields import expand_options
from race_server.cli.options import MOST_LAPS, Unfit, drivers_for, names_in, once
from race_server.core.seeds import HELD_OUT
from race_server.errors import ScenarioError
from race_server.pictures import check_picture
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.competition.lap_exam import CourseTry, LapExamSpec, LapRow

# Courses with laps that were not clean that are told to a person, of each driver.
MOST_TOLD = 8
LEARNED = "learned:"
DRIVERS = ("raceline", "follow_gap")


Drivers = Annotated[
    str,
    typer.Option(
        "--drivers",
        "--driver",
        help=f"Comma-separated installed drivers. Default: those of {', '.join(DRIVERS)} that "
        "are made for the vehicle.",
    ),
]
Courses = Annotated[
    int, typer.Option(min=1, help="Courses to draw, of each kind of generated course in turn.")
]
DrawnFor = Annotated[
    str, typer.Option(help="Vehicle. It decides the scale of the courses that are drawn.")
]
Jobs = Annotated[int, typer.Option(min=0, help="Processes; 0: one for each core.")]


@dataclass(frozen=True)
class LapOptions:
    """All options of `race exam laps`."""

    drivers: Drivers = ""
    unfit: Unfit = False
    courses: Courses = 200
    first_seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="Seed of the first course; the next ones count up from it. No training draws the "
            "default's.",
        ),
    ] = HELD_OUT + 1
    folder: Annotated[
        Path | None,
        typer.Option(help="Drive the course files (.toml) of this folder; none is drawn."),
    ] = None
    vehicle: DrawnFor = "tt02"
    laps: Annotated[
        int, typer.Option(min=1, max=MOST_LAPS, help="Counted laps of each course.")
    ] = 5
    warm_up: Annotated[
        int,
        typer.Option(
            min=1,
            max=MOST_LAPS,
            help="Laps before those. 2: a driver that learns its course is asked from lap 3.",
        ),
    ] = 1
    gaps: Annotated[
        str,
        typer.Option(
            "--gaps",
            "--gap",
            help="Comma-separated reality gaps, each driven with each driver: see `race trial`.",
        ),
    ] = "none"
    plot: Annotated[
        Path | None, typer.Option(help="Draw clean laps and times into this .png or .svg file.")
    ] = None
    jobs: Jobs = 0
    as_json: AsJson = False


@expand_options
def laps(options: LapOptions) -> None:
    """Let drivers lap unseen courses alone, and count clean laps, contacts and lap times.

    The ratio is the time of a lap over the limit of its course, which is solved where it is not
    known. Finished courses are kept: an exam that was stopped goes on with the next one.
    """
    from race_server.competition.lap_exam import LapExamSpec, examined_courses, rows_of
    from race_server.competition.time_trial.gaps import NONE, gaps_named
    from race_server.core.vehicle_presets import vehicle_named

    given = drivers_for(options.drivers, DRIVERS, (options.vehicle,), unfit=options.unfit)
    drivers = once(given)
    if not drivers:
        raise ScenarioError("--drivers needs a name, or several separated by commas")
    if options.plot is not None:
        check_picture(options.plot)
    names = examined_courses(
        options.folder, options.courses, options.first_seed, vehicle_named(options.vehicle)
    )
    spec = LapExamSpec(
        *(names, options.vehicle, options.laps, options.jobs),
        gaps=tuple(gaps_named(list(once(names_in(options.gaps))) or [NONE.name])),
        warm_up=options.warm_up,
    )
    console, begun = Console(stderr=True), time.monotonic()
    tries, stopped = _examine(spec, drivers, console)
    rows = rows_of(tries)
    if options.as_json:
        seconds = round(time.monotonic() - begun, 1)
        document = {"rows": [asdict(row) for row in rows], "tries": [asdict(one) for one in tries]}
        print_document(document | {"stopped": stopped, "wall_s": seconds})
    else:
        _show(rows)
    if options.plot is not None and rows:
        from race_server.competition.lap_picture import draw_laps

        draw_laps(rows, tries, options.plot)
    if stopped:
        console.print("stopped: these are the courses that were finished", style="yellow")
        sys.exit(130)


def _examine(
    spec: "LapExamSpec", drivers: Sequence[str], console: Console
) -> "tuple[list[CourseTry], bool]":
    """Return how each driver did on each course, in that order, and whether it was stopped."""
    from race_server.competition.lap_exam import examine

    runs, editions = spec.runs_of(drivers), editions_of(drivers)
    tries, stopped = counted(
        len(runs), lambda watch: examine(spec, drivers, editions, watch), console
    )
    order = {(run.driver, run.gap.name, run.track): number for number, run in enumerate(runs)}
    return sorted(tries, key=lambda one: order[one.driver, one.gap, one.course]), stopped


def editions_of(drivers: Sequence[str]) -> dict[str, str]:
    """Return a digest of the policy of each driver that has learned, also behind a wrapper.

    Raises:
        DriverError: there is no such policy, or it cannot be read.
    """
    from race_agents.policies.registry import policy_bytes, policy_path

    # As in unstuck:learned:full; that a driver learned is said by the whole of a name.
    policies = {name: f":{name}".partition(f":{LEARNED}")[2] for name in drivers}
    files = {name: policy_bytes(policy_path(one)) for name, one in policies.items() if one}
    return {name: hashlib.sha256(data).hexdigest()[:16] for name, data in files.items()}


def _show(rows: "Sequence[LapRow]") -> None:
    from rich.table import Table

    table = Table()
    table.add_column("driver", no_wrap=True)
    table.add_column("gap", no_wrap=True)
    heads = ("courses", "laps", "clean laps", "95 %", "clean courses", "× limit", "95 %")
    for head in (*heads, "contacts", "rescues"):
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows:
        low, high = row.clean_lap_interval
        table.add_row(
            *(row.driver, row.gap, str(row.courses), str(row.laps)),
            f"{100.0 * row.clean_lap_rate:.1f} %",
            f"{100.0 * low:.1f}-{100.0 * high:.1f} %",
            f"{100.0 * row.clean_course_rate:.1f} %",
            *("-" if row.ratio is None else f"{row.ratio:.3f}", _between(row.ratio_interval)),
            *(str(row.contacts), str(row.rescues)),
        )
    console = Console()
    console.print_whole(table)
    for row in rows:
        who = row.driver if row.gap == "none" else f"{row.driver} ({row.gap})"
        if row.not_clean:
            told = [f"{Path(name).name} {clean}" for name, clean in row.not_clean.items()]
            more = ", …" * (len(told) > MOST_TOLD)
            words = f"{who}: clean laps of other courses {', '.join(told[:MOST_TOLD])}{more}"
            console.print(words, highlight=False)
        for remark in row.remarks[:MOST_TOLD]:
            console.print(f"{who}: {remark}", style="yellow", highlight=False)


def _between(bounds: tuple[float | None, float | None]) -> str:
    low, high = bounds
    return "-" if low is None or high is None else f"{low:.3f}-{high:.3f}"
