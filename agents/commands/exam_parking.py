"""`race exam parking` and `race exam trailer`: drivers that park, on tasks given by seeds."""

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from race_agents.commands.exam_parking_table import MOST_TOLD, show_parking
from race_agents.commands.exam_result import Result
from race_server.cli.document import AsJson, print_document
from race_server.cli.option_fields import expand_options
from race_server.cli.options import known_drivers, names_in, once, seeds_from
from race_server.core.seeds import HELD_OUT
from race_server.errors import ScenarioError
from race_server.pictures import check_picture
from race_server.terminal import Console, TextColumn

if TYPE_CHECKING:
    from race_server.competition.parking_exam import ExamSpec, Try

MOST_TASKS = 1_000_000  # of each scenario; more would be weeks of driving


@dataclass(frozen=True)
class ParkingOptions:
    """All options of `race exam parking`."""

    drivers: Annotated[
        str, typer.Option("--drivers", "--driver", help="Comma-separated drivers that can park.")
    ] = "valet"
    scenario: Annotated[
        str,
        typer.Option(
            "--scenario",
            "--lot",
            help="Comma-separated: 1 (zone-30) and 2 (yard-70) are those of the report on "
            "automatic parking of a kart; others are names from `race lot list`.",
        ),
    ] = "2"
    seeds: Annotated[int, typer.Option(min=1, max=MOST_TASKS, help="Tasks of each scenario.")] = (
        1000
    )
    first_seed: Annotated[
        int,
        typer.Option(
            min=0,
            help="Seed of the first task; the next ones count up from it. No training draws the "
            "default's.",
        ),
    ] = HELD_OUT + 1
    vehicles: Annotated[
        int, typer.Option(min=1, max=64, help="Vehicles of each task, each with a driver.")
    ] = 1
    level: Annotated[
        str, typer.Option(help="How well to stand, such as parked or precise. Default: the lot's.")
    ] = ""
    vehicle: Annotated[str, typer.Option(help="Vehicle. Default: the lot's.")] = ""
    limit_s: Annotated[float, typer.Option(help="Time limit [s]; 0: the lot's.")] = 0.0
    delay_s: Annotated[float, typer.Option(help="Delay of controls [s], a multiple of 0.1.")] = 0.0
    noise: Annotated[float, typer.Option(min=0.0, help="Noise of radar and lidar ranges [m].")] = (
        0.01
    )
    gap: Annotated[
        list[str] | None,
        typer.Option(
            help="Make the vehicle another one than its driver takes it for: FACTOR=VALUE, such as "
            "steering_play=0.05, hitch=1.1, mass=1.2; may be repeated."
        ),
    ] = None
    plot: Annotated[
        Path | None,
        typer.Option(help="Draw failures and times into this .png or .svg file."),
    ] = None
    record: Annotated[
        Path | None,
        typer.Option(
            help="Drive failed tasks again in a session, and record them into this folder; "
            "`race replay` and the page play them."
        ),
    ] = None
    as_json: AsJson = False


@dataclass(frozen=True)
class TrailerOptions(ParkingOptions):
    """All options of `race exam trailer`."""

    scenario: Annotated[
        str,
        typer.Option("--lot", "--scenario", help="Comma-separated names from `race lot list`."),
    ] = "dock-35"
    vehicle: Annotated[
        str, typer.Option(help="Vehicle that draws a trailer. Default: the lot's.")
    ] = ""


@expand_options
def parking(options: ParkingOptions) -> None:
    """Let drivers park, and count what is parked, aligned, hit, and how long it takes.

    Times and ways are of parked vehicles, and beside them those of the planner for the same task.
    A plan goes on to the middle of the slot and stops there: where the level asks for less, a ratio
    below 1 is no better way. A task of a lot is the same for every driver and every day: its seed
    decides it.
    """
    _examine_and_tell(options)


@expand_options
def trailer(options: TrailerOptions) -> None:
    """Let drivers park a vehicle with a trailer: the exam of parking, and jack-knives."""
    for lot in names_in(options.scenario):
        _require_trailer(lot, options.vehicle)
    _examine_and_tell(options)


def _require_trailer(lot: str, vehicle: str) -> None:
    """Check that the vehicle of a lot draws a trailer.

    Raises:
        LotError, VehicleError: a name is unknown.
        ScenarioError: it draws none.
    """
    from race_server.competition.parking_exam import ExamSpec

    drawing = ExamSpec(lot, vehicle=vehicle).scenario_of().vehicle_of(0)
    if not drawing.trailers:
        raise ScenarioError(
            f"vehicle {drawing.name!r} in the lot {lot!r} draws no trailer: choose --vehicle "
            "lorry-16m5 or another one that does, or race exam parking"
        )


def _examine_and_tell(options: ParkingOptions) -> None:
    """Hold the exam that options ask for, and print its rows.

    Raises:
        ScenarioError: no driver or lot is named, or the picture has another ending.
        RecordingError: failures cannot be recorded into the folder, or one was not.
    """
    from race_agents.commands.exam_gap import gap_of
    from race_server.competition.parking_exam import ExamSpec
    from race_server.storage.recording.logbook import check_folder

    drivers = once(known_drivers(options.drivers))
    scenarios = once(names_in(options.scenario))
    if not drivers or not scenarios:
        raise ScenarioError("--drivers and --scenario need a name each, separated by commas")
    if options.plot is not None:
        check_picture(options.plot)
    if options.record is not None and (options.delay_s or options.gap):
        given = ",".join(options.gap or ["none"])
        raise ScenarioError(
            f"--delay-s {options.delay_s:g} --gap {given}: failures are recorded in sessions, "
            "which have neither; leave both out, or --record"
        )
    if options.record is not None:
        check_folder(options.record)
    gap, seeds = gap_of(options.gap or []), seeds_from(options.first_seed, options.seeds)
    specs = [
        ExamSpec(
            scenario,
            seeds,
            vehicles=options.vehicles,
            vehicle=options.vehicle,
            level=options.level,
            limit_s=options.limit_s,
            delay_s=options.delay_s,
            noise=options.noise,
            gap=gap,
        )
        for scenario in scenarios
    ]
    console, begun = Console(stderr=True), time.monotonic()
    results, stopped = _finished(_examine(specs, drivers, console))
    recorded: list[dict[str, Any]] = []
    if not options.as_json:
        show_parking(results)
    try:
        if options.record is not None and not stopped:
            _record(results, options.record, console, recorded)
    except KeyboardInterrupt:
        stopped = True
    finally:
        # Hours of driving are told whatever becomes of their recordings.
        end = {"stopped": stopped, "wall_s": round(time.monotonic() - begun, 1)}
        _tell(options, results, recorded, end)
    if stopped:
        console.print("stopped: these are the rows that were finished", style="yellow")
        sys.exit(130)


def _finished(results: Iterator[Result]) -> tuple[list[Result], bool]:
    """Return what an exam finished, and whether Ctrl-C stopped it."""
    finished: list[Result] = []
    try:
        finished.extend(results)  # those before the one that is stopped stay in the list
    except KeyboardInterrupt:
        return finished, True
    return finished, False


def _tell(
    options: ParkingOptions,
    results: Sequence[Result],
    recorded: Sequence[dict[str, Any]],
    end: dict[str, Any],
) -> None:
    """Print the document of an exam, or what was recorded of it, and draw its picture.

    end: of the document.
    """
    if options.as_json:
        document = {"rows": [result.row() for result in results], **end}
        print_document(document | ({"recordings": recorded} if options.record else {}))
    for row in () if options.as_json else recorded:
        words = f"{row['path']}: {row['driver']}, seed {row['seed']}, {row['endings']}"
        Console().print(words, highlight=False, soft_wrap=True)
    if options.plot is not None and results:
        _draw(results, options.plot)


def _record(
    results: Sequence[Result], folder: Path, console: Console, rows: list[dict[str, Any]]
) -> None:
    """Drive the first failures of each kind again, and add what was recorded of them to rows."""
    from race_server.competition.parking_recordings import record_tasks

    with console.status("recording failures", spinner="dots"):
        for result in results:
            kinds = result.failed_seeds().values()
            seeds = {seed for kind in kinds for seed in kind[:MOST_TOLD]}
            failed = [one for one in result.tries if one.seed in seeds]
            for one in record_tasks(result.spec, result.driver, failed, folder, console.print):
                endings = ", ".join(ending.name.lower() for ending in one.endings)
                row = {"driver": result.driver, "lot": result.spec.lot, "seed": one.seed}
                rows.append({**row, "path": str(one.path), "endings": endings})


def _examine(
    specs: "Sequence[ExamSpec]", drivers: Sequence[str], console: Console
) -> Iterator[Result]:
    """Yield the result of each driver in each scenario.

    Raises:
        RaceError: one of them makes no exam; before any is driven, as hours of it would be lost.
    """
    from race_agents.planning.planned_way import planned_way
    from race_server.competition.parking_exam import check_exam, drive_exam
    from race_server.competition.parking_rounds import RoundTally
    from race_server.competition.parking_tally import ParkingTally
    from race_server.core.messages import PlannedWay

    with _progress(specs, drivers, console) as advance:
        # The first one says at once what is wrong with it.
        for spec, driver in list(product(specs, drivers))[1:]:
            check_exam(spec, driver)
        for spec in specs:
            vehicle = spec.scenario_of().vehicle_of(0)
            plans: dict[tuple[int, int], PlannedWay | None] = {}
            for driver in drivers:
                tries = []
                for one in drive_exam(spec, driver):
                    tries.append(one)
                    key = (one.seed, one.vehicle)
                    # Nothing that failed is measured against a plan.
                    if one.figures["is_success"] and key not in plans:
                        plans[key] = planned_way(vehicle, one.start, one.order)
                    advance(f"{driver}, {spec.lot}")
                known = {key: plan for key, plan in plans.items() if plan is not None}
                tally = ParkingTally.of(one.figures for one in tries)
                rounds = RoundTally.of(tries) if spec.vehicles > 1 else None
                yield Result(driver, spec, tries, known, tally, rounds, _hopeless(spec, tries))


def _hopeless(spec: "ExamSpec", tries: "Sequence[Try]") -> dict[int, str]:
    """Return in which of the rounds with failures a vehicle could never park, by seed, and why."""
    from race_server.scenario.lot.check import hopeless

    rounds = {one.round_seed: one.seed for one in tries if not one.figures["is_success"]}
    found = hopeless(spec.lot, list(rounds), spec.vehicle, spec.vehicles) if rounds else {}
    return {rounds[seed]: fault for seed, fault in found.items()}


@contextmanager
def _progress(
    specs: "Sequence[ExamSpec]", drivers: Sequence[str], console: Console
) -> Iterator[Any]:
    """Show a progress bar of tasks."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    hidden = not console.is_terminal
    with Progress(
        *columns, TimeRemainingColumn(), console=console, transient=True, disable=hidden
    ) as bar:
        total = len(drivers) * sum(len(spec.seeds) * spec.vehicles for spec in specs)
        task = bar.add_task("getting ready; compiling takes minutes, once", total=total)

        def advance(words: str) -> None:
            bar.update(task, advance=1, description=words)

        yield advance


def _draw(results: Sequence[Result], path: Path) -> None:
    from race_server.competition.parking_picture import Drawn, draw_exam

    drawn = [
        Drawn(f"{one.driver}, {one.spec.lot}", one.tries, one.ratios("time_s")) for one in results
    ]
    draw_exam(drawn, path)
