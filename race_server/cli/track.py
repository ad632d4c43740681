"""`race track list | show | check | import`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.cli.drill_report import progress
from race_server.cli.findings import print_findings, rows_of
from race_server.cli.options import Course, Picture, picture_of
from race_server.errors import TrackError
from race_server.kept_file import check_place
from race_server.terminal import Console, say

# The vehicle that a course is checked for, by its scale.
USUAL = {"1/10": "tt02", "kart": "kart-60"}

app = typer.Typer(help="List, draw, check and import courses.", no_args_is_help=True)


@app.command("list")
def list_tracks(as_json: AsJson = False) -> None:
    """List all courses with length, width, sectors, grid places and item boxes."""
    from race_server.scenario.track.load import load_course, summary, track_names

    rows = rows_of(track_names(), lambda name: summary(load_course(name)))
    if as_json:
        print_document(rows)
        return
    table = Table("name", header_style="dim underline", box=None, pad_edge=False)
    for column in ("length [m]", "width [m]", "sectors", "places", "boxes"):
        table.add_column(column, justify="right")
    table.add_column("title")
    for row in rows:
        table.add_row(
            row["name"],
            f"{row['length_m']:.1f}",
            f"{row['width_min_m']:.2f}–{row['width_max_m']:.2f}",
            str(row["sectors"]),
            str(row["grid_places"]),
            str(row["item_spots"]),
            row["title"],
        )
    Console().print_whole(table)


@app.command()
def show(
    name: Course,
    to: Picture = None,
) -> None:
    """Draw a course into a .png or .svg file."""
    from race_server.scenario.track.draw import draw_course
    from race_server.scenario.track.load import load_course

    course = load_course(name)
    path = to or picture_of(course.name)
    draw_course(course, path)
    say(path)


@app.command()
def check(
    name: Course,
    vehicle: Annotated[
        str,
        typer.Option(
            help="Vehicle: tt02, tt02-drift, kart-13, kart-30, kart-60 or car. Default: tt02 or "
            "kart-60, as the width suggests."
        ),
    ] = "",
    drawn_after: Annotated[
        Path | None,
        typer.Option(
            "--map",
            help="Map (.yaml) to compare the course with. Default: the one that an import kept "
            "beside it.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Check whether a vehicle can race on a course. Exit code 1 if it cannot.

    A course that was imported from a map is compared with it: its line and its borders must not
    lie in a wall.
    """
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.places import path_of
    from race_server.scenario.track.build import scale_for
    from race_server.scenario.track.check import check_course
    from race_server.scenario.track.importers import map_beside
    from race_server.scenario.track.load import load_course
    from race_server.scenario.track.occupancy_map import read_map

    course = load_course(name)
    car = vehicle_named(vehicle or USUAL[scale_for(course.width_mean)])
    file = path_of("tracks", name)
    drawn_after = drawn_after or (map_beside(file) if file else None)
    findings = check_course(course, car, read_map(drawn_after) if drawn_after else None)
    print_findings("track", course.name, car.name, findings, as_json)


@app.command("import")
def import_track(
    source: Annotated[
        Path,
        typer.Argument(
            help="TUM .csv file, the .yaml file of a ROS map, or highway:racetrack-v0: roads of "
            "highway-env."
        ),
    ],
    to: Annotated[Path, typer.Option("--to", help="Course file to write (.toml).")],
    scale: Annotated[
        str,
        typer.Option(
            help="Size of the karts: 1/10 (model cars) or kart. Default: as the width suggests."
        ),
    ] = "",
    title: Annotated[
        str, typer.Option(help="Title of the course. Default: the name of the source file.")
    ] = "",
) -> None:
    """Convert a course from another format into a course file. A map is kept beside it."""
    from race_server.scenario.track.build import WIDTH_OF_KARTS
    from race_server.scenario.track.importers import import_course

    if to.suffix != ".toml":
        raise TrackError(f"{to}: write the course as .toml")
    check_place(to)
    with progress(f"importing {source.name}", 100) as bar:
        done = import_course(
            source,
            to,
            scale=scale,
            title=title or source.stem,
            report=lambda share: bar(100.0 * share),
        )
    course, width = done.course, done.course.width_mean
    say(f"{to}: {course.length:.1f} m, {course.width_min:.2f} to {course.width_max:.2f} m wide")
    why = f"{width:.1f} m wide on average, and karts race on {WIDTH_OF_KARTS:g} m and more"
    if done.scale == done.likely_scale:
        others = [name for name in USUAL if name != done.scale]
        say(f"scale {done.scale}: {why}; choose --scale {others[0]} if that is wrong")
    else:
        say(f"warning: --scale {done.scale} looks wrong: {why}", error=True)
    if done.remark:
        say(f"warning: {done.remark}", error=True)
