"""`race drill onboard`: what a real kart's program knows and does, against what is asked."""

import math
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from race_server.cli.document import AsJson, print_document
from race_server.cli.drill_report import progress
from race_server.terminal import Console

PARTS = ("place", "danger", "peers", "sides", "races")


def drill_onboard(
    seeds: Annotated[
        int, typer.Option(min=1, help="Number of karts as built, each with other noise.")
    ] = 10,
    track: Annotated[str, typer.Option(help="Course that is driven.")] = "hangar-400",
    vehicle: Annotated[str, typer.Option(help="Vehicle that is driven.")] = "kart-60",
    part: Annotated[
        str, typer.Option(help=f"Only one part: {', '.join(PARTS)}. Default: all.")
    ] = "",
    races: Annotated[
        Path | None,
        typer.Option(
            help="Folder of recordings: ask the reflex what it would have done in them. Without "
            "it, --part races drives races of eight scripted karts, on other courses, too."
        ),
    ] = None,
    first_race: Annotated[
        int, typer.Option(min=0, help="Seed of the first race that is driven; the next follow.")
    ] = 1,
    most_km: Annotated[
        float,
        typer.Option(
            "--most-km", help="Kilometres of all karts together to look at in those races."
        ),
    ] = 5.0,
    peers: Annotated[
        bool, typer.Option("--peers", help="In those races the karts tell one another.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Measure a real kart's estimation and its brakes for what is ahead, against what is asked.

    Meetings with people and karts have the shapes of Euro NCAP's: they are no rating.
    """
    import os

    drives_races = part == "races" and races is None
    if not drives_races:
        os.environ["RACE_SERVER_INTERPRET"] = "1"  # one course needs no compiler
    from race_agents.plant.onboard_drill import measure
    from race_server.core.vehicle_presets import vehicle_named

    if part and part not in PARTS:
        raise typer.BadParameter(f"part {part!r} is unknown; choose one of {', '.join(PARTS)}")
    total = math.ceil(most_km) if part == "races" else seeds * 9 + 137
    with progress("driving", total) as tell:
        document = measure(
            track,
            vehicle_named(vehicle),
            seeds,
            part or None,
            tell,
            races=races,
            first_race=first_race,
            most_km=most_km,
            peers=peers,
        )
    if as_json:
        print_document(document)
    else:
        _show(document)
    if not document["ok"]:
        raise typer.Exit(1)


def _show(document: dict[str, Any]) -> None:
    table = Table("measured", "unit", "before", "figure", "bar", "ok")
    for row in document["rows"]:
        before = "" if row["before"] is None else f"{row['before']:.3g}"
        ok = Text("yes", style="green") if row["ok"] else Text("no", style="red")
        table.add_row(row["measured"], row["unit"], before, f"{row['figure']:.3g}", row["bar"], ok)
    Console().print(table)
