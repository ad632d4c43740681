"""`race drill faults`: what a real kart does when something in it fails at 50 km/h."""

from typing import Annotated, Any

import typer
from rich.table import Table
from rich.text import Text

from race_server.cli.document import AsJson, print_document
from race_server.cli.drill_report import progress
from race_server.core.seeds import MOST_SEED
from race_server.terminal import Console


def drill_faults(
    track: Annotated[str, typer.Option(help="Course that is driven.")] = "hangar-400",
    vehicle: Annotated[str, typer.Option(help="Vehicle that is driven.")] = "kart-60",
    fault: Annotated[
        str, typer.Option(help="Only this fault, by its name in the table. Default: all.")
    ] = "",
    seed: Annotated[
        int,
        typer.Option(min=0, max=MOST_SEED, help="Seed of the kart as built and of its sensors."),
    ] = 1,
    as_json: AsJson = False,
) -> None:
    """Let each sensor and program of a real kart fail at 50 km/h, and check what the kart does."""
    import os

    os.environ["RACE_SERVER_INTERPRET"] = "1"  # one course needs no compiler
    from race_agents.plant.fault_drill import measure, names
    from race_server.core.vehicle_presets import vehicle_named

    known = names()
    if fault and fault not in known:
        raise typer.BadParameter(f"fault {fault!r} is unknown; choose one of {', '.join(known)}")
    with progress("driving", 1 if fault else len(known)) as tell:
        document = measure(track, vehicle_named(vehicle), seed, fault, tell)
    if as_json:
        print_document(document)
    else:
        _show(document["faults"])
    if not document["ok"]:
        raise typer.Exit(1)


def _show(rows: list[dict[str, Any]]) -> None:
    table = Table("fault", "expected", "shown after", "stopped within", "place off by", "ok")
    for row in rows:
        shown, way = row["shown_after_s"], row["way_m"]
        table.add_row(
            row["name"],
            row["expected"],
            "" if shown is None else f"{shown:.2f} s",
            "" if row["most_way_m"] is None else f"{way:.1f} of {row['most_way_m']:.1f} m",
            f"{row['off_m']:.2f} m",
            Text("yes", style="green") if row["ok"] else Text(row["why"], style="red"),
        )
    Console().print(table)
