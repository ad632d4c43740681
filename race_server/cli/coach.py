"""`race coach`: where a driver's laps were lost, why, and what to try."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from race_server.cli.access import Connect, KeysFolder, SessionName, access
from race_server.cli.document import AsJson, print_document
from race_server.cli.options import MOST_LAPS, drivers_for, refuse_options
from race_server.core.clock import MICROSECONDS, lap_text
from race_server.core.seeds import MOST_SEED
from race_server.errors import ScenarioError
from race_server.pictures import check_picture
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.coaching.lesson import Lesson

# Options that mean nothing where a race is on.
OF_A_DRIVER = ("track", "vehicle", "laps", "seed")
# Of the table, so that no figure is cut off.
WIDTH = 120


def coach(
    context: typer.Context,
    source: Annotated[
        str,
        typer.Argument(
            help="Recording (.mcap file), or an installed driver to drive here; none with --live."
        ),
    ] = "",
    track: Annotated[
        str, typer.Option(help="Of a driver: course, a name from `race track list`.")
    ] = "hangar-400",
    vehicle: Annotated[str, typer.Option(help="Of a driver: its vehicle.")] = "kart-60",
    laps: Annotated[
        int, typer.Option(min=1, max=MOST_LAPS, help="Of a driver: laps after a flying start.")
    ] = 3,
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Of a driver: seed of the run.")
    ] = 1,
    only: Annotated[
        str,
        typer.Option("--driver", help="Of a recording or a race: only this driver. Default: all."),
    ] = "",
    live: Annotated[
        bool, typer.Option("--live", help="Coach the race that is on, lap by lap, until it ends.")
    ] = False,
    cues: Annotated[
        bool, typer.Option("--cues", help="With --live: also say what to do before each place.")
    ] = False,
    tell: Annotated[
        bool,
        typer.Option(
            "--tell", help="With --live: tell drivers on their pages, too; needs a steward's keys."
        ),
    ] = False,
    connect: Connect = "",
    session: SessionName = "",
    keys: KeysFolder = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            help="Draw the report into this .png or .svg file; of several drivers into one file "
            "each, with the seat's number before the ending."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Tell what each corner costs, name the fault, and give at most three tips.

    Of a race that is on each lap is told as it ends. Laps are compared with the limit of the course
    and with the driver's best lap. Laps from the start, in traffic, under a flag or with a contact
    are listed, and not compared.
    """
    if picture is not None:
        check_picture(picture)
    console = Console(stderr=True)
    if live is bool(source):
        raise ScenarioError(
            f"--live coaches the race that is on, not {source}: leave one of them out"
            if live
            else "name a recording or a driver, or coach the race that is on with --live"
        )
    if (cues or tell) and not live:
        raise ScenarioError(f"--{'cues' if cues else 'tell'} is of a race that is on: add --live")
    if live:
        from race_server.cli.coach_live import coach_race

        why = "is of a driver that drives here, and the race that is on has its own; leave it out"
        refuse_options(context, OF_A_DRIVER, why)
        given = access(keys, connect, session)
        if tell:
            given.check_steward()
        shown = console if as_json else Console()
        lessons = coach_race(given, only, with_cues=cues, tells=tell, console=shown)
    else:
        lessons = _lessons(source, track, vehicle, laps, seed, only, console)
    if as_json:
        print_document({"lessons": [lesson.as_json() for lesson in lessons.values()]})
    else:
        for lesson in lessons.values():
            _show(lesson)
    if picture is not None:
        _draw(lessons, picture, console)


def _lessons(
    source: str, track: str, vehicle: str, laps: int, seed: int, only: str, console: Console
) -> "dict[int, Lesson]":
    """Return the lessons by seat; a driver that drives here has seat 0."""
    from race_server.competition.lessons import lesson_of_driver, lessons_of_recording
    from race_server.competition.time_trial.plan import compile_once
    from race_server.competition.time_trial.run_spec import RunSpec

    with console.status("driving", spinner="dots"):
        if source.endswith(".mcap") or Path(source).is_file():

            def warn(words: str) -> None:
                console.print(words, style="yellow", highlight=False, soft_wrap=True)

            return lessons_of_recording(Path(source), only, warn)
        (name,) = drivers_for(source, (), (vehicle,), unfit=True) or ("",)
        spec = RunSpec(name, track, vehicle, seed=seed, laps=laps)
        compile_once(spec)
        return {0: lesson_of_driver(spec)}


def _draw(lessons: "dict[int, Lesson]", picture: Path, console: Console) -> None:
    """Draw each lesson; of several the name of the file ends with the number of the seat.

    Raises:
        ScenarioError: there is nothing to draw, or a file cannot be written.
    """
    from race_server.competition.lesson_picture import draw_lesson

    has_drawn = False
    for seat, lesson in lessons.items():
        path = picture
        if lesson.best is None and len(lessons) > 1:
            console.print(f"no lap of {lesson.driver} is to be compared", style="yellow")
            continue
        if len(lessons) > 1:
            path = picture.with_name(f"{picture.stem}-{seat}{picture.suffix}")
        draw_lesson(lesson, path)
        console.print(f"written: {path}", style="dim", soft_wrap=True)
        has_drawn = True
    if not has_drawn:
        raise ScenarioError(f"{picture}: nothing is drawn, for no lap of any driver is compared")


def _show(lesson: "Lesson") -> None:
    console = Console()
    console.width = max(console.width, WIDTH)
    document, best = lesson.as_json(), lesson.best
    title = f"{lesson.driver}, {lesson.course.name}, {lesson.vehicle.name}"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for head in ("corner", "", "apex [m]", "best lap - limit [s]", "laps - best lap [s]"):
        table.add_column(head, justify="left" if head in {"corner", ""} else "right", no_wrap=True)
    table.add_column("fault of the best lap")
    words = {fault.corner.name: fault.words for fault in best.faults} if best else {}
    for row in document["corners"]:
        costs = (row["best_against_limit_s"], row["laps_against_best_s"])
        table.add_row(
            *(row["corner"], row["side"], f"{row['apex']:.0f}"),
            *("-" if cost is None else f"{cost:+.3f}" for cost in costs),
            words.get(row["corner"], ""),
        )
    if best and best.against_limit:
        rest, total = best.against_limit.line_us, best.against_limit.total_us
        table.add_row("line", "", "", f"{rest / MICROSECONDS:+.3f}", "", "from the lap before")
        table.add_row("lap", "", "", f"{total / MICROSECONDS:+.3f}", "", "")
    console.print(table)
    for one in lesson.laps:
        told = f", not compared: {one.reason}" if one.reason else ""
        console.print(f"lap {one.number}: {lap_text(one.lap.time_us)}{told}", highlight=False)
    if lesson.pieces and best and lesson.pieces.time_us < best.lap.time_us:
        parts = ", ".join(
            f"lap {part['lap']} to {part['end']:.0f} m" for part in document["pieces"]
        )
        console.print(
            f"best pieces together: {lap_text(lesson.pieces.time_us)} ({parts})", highlight=False
        )
    if lesson.note:
        console.print(lesson.note, style="yellow", highlight=False, soft_wrap=True)
    for number, tip in enumerate(lesson.tips, start=1):
        console.print(
            f"{number}. {tip.words} ({tip.cost_us / MICROSECONDS:.2f} s a lap, in {tip.laps} of "
            f"{tip.of} laps)",
            style="bold",
            highlight=False,
            soft_wrap=True,
        )
