"""`race limit`: the fastest lap that physics allows, and other lines beside it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.cli.options import Course
from race_server.pictures import check_picture
from race_server.terminal import Console, say

if TYPE_CHECKING:
    from race_server.scenario.raceline.reference import Limit


def limit(
    track: Course,
    vehicle: Annotated[
        str,
        typer.Option(
            help="Vehicle: tt02, tt02-drift, kart-13, kart-30, kart-60, car; an unknown name "
            "lists all."
        ),
    ] = "tt02",
    speed_cap: Annotated[
        float | None,
        typer.Option(help="Highest speed allowed [m/s]. Default: the vehicle's top speed."),
    ] = None,
    margin: Annotated[
        float | None,
        typer.Option(
            help="Least distance between body and border [m]. Default: 0.26 × vehicle width."
        ),
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(help="Draw the lines into this .png or .svg file.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Compute lap times along the fastest, the least curved, the centre and the shortest line.

    Drivers follow the one `with room`: it keeps more of it to the borders the
    faster it is, and turns over as fast as a body can follow.
    """
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.raceline.reference import NAMES, reference_limit
    from race_server.scenario.track.load import load_course

    if plot is not None:
        check_picture(plot)
    course = load_course(track)
    found = reference_limit(course, vehicle_named(vehicle), speed_cap, margin)
    capped = f", at most {speed_cap:g} m/s" if speed_cap is not None else ""
    if as_json:
        times = {f"{name}_s": round(getattr(found, name).time_s, 4) for name in NAMES}
        row = {"track": course.name, "vehicle": vehicle, "speed_cap": speed_cap, **times}
        print_document({**row, "solve_s": round(found.solve_s, 3)})
    else:
        _show(found, f"{course.name}, {vehicle}{capped}")
    if plot is not None:
        from race_server.scenario.raceline.draw import draw_limit

        draw_limit(course, found, f"{course.title}: {vehicle}{capped}", plot)


def _show(found: "Limit", title: str) -> None:
    from race_server.scenario.raceline.reference import NAMES

    table = Table(title=title, title_justify="left")
    table.add_column("line", no_wrap=True)
    for column in ("lap [s]", "length [m]", "slowest [m/s]", "fastest [m/s]", "braking zones"):
        table.add_column(column, justify="right")
    for name in NAMES:
        line = getattr(found, name)
        table.add_row(
            name.replace("_", " "),
            f"{line.time_s:.3f}",
            f"{line.length:.2f}",
            f"{line.speed.min():.2f}",
            f"{line.speed.max():.2f}",
            str(sum(zone.what == "brake" for zone in line.zones)),
        )
    Console().print_whole(table)
    say(
        f"solved in {found.solve_s:.2f} s"
        if found.solve_s
        else "read from the solutions already known"
    )
