"""`race track list | show | check | import`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.cli.findings import print_findings
from race_server.cli.options import Course, Picture, VehicleName, picture_of
from race_server.errors import TrackError
from race_server.terminal import Console, say

app = typer.Typer(help="List, draw, check and import courses.", no_args_is_help=True)


@app.command("list")
def list_tracks(as_json: AsJson = False) -> None:
    """List all courses with length, width, sectors, grid places and item boxes."""
    from race_server.scenario.track.load import load_course, summary, track_names

    rows = [summary(load_course(name)) for name in track_names()]
    if as_json:
        print_document(rows)
        return
    table = Table("name", "title")
    for column in ("length [m]", "width [m]", "sectors", "grid places", "item boxes"):
        table.add_column(column, justify="right")
    for row in rows:
        table.add_row(
            row["name"],
            row["title"],
            f"{row['length_m']:.1f}",
            f"{row['width_min_m']:.2f} – {row['width_max_m']:.2f}",
            str(row["sectors"]),
            str(row["grid_places"]),
            str(row["item_spots"]),
        )
    Console().print(table)


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
    vehicle: VehicleName = "tt02",
    as_json: AsJson = False,
) -> None:
    """Check whether a vehicle can race on a course. Exit code 1 if it cannot."""
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.track.check import check_course
    from race_server.scenario.track.load import load_course

    course = load_course(name)
    findings = check_course(course, vehicle_named(vehicle))
    print_findings("track", course.name, vehicle, findings, as_json)


@app.command("import")
def import_track(
    source: Annotated[Path, typer.Argument(help="TUM .csv file, or the .yaml file of a ROS map.")],
    to: Annotated[Path, typer.Option("--to", help="Course file to write (.toml).")],
    scale: Annotated[
        str, typer.Option(help="Size of the karts: 1/10 (model cars) or kart.")
    ] = "kart",
    title: Annotated[
        str, typer.Option(help="Title of the course. Default: the name of the source file.")
    ] = "",
) -> None:
    """Convert a course from another format into a course file."""
    from race_server.scenario.track.importers import import_course

    if to.suffix != ".toml":
        raise TrackError(f"{to}: write the course as .toml")
    course = import_course(source, to, scale=scale, title=title or source.stem)
    say(f"{to}: {course.length:.1f} m, {course.width_min:.2f} to {course.width_max:.2f} m wide")
