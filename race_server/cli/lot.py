"""`race lot list | show | check | import`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.cli.findings import print_findings, rows_of
from race_server.cli.options import Picture, picture_of
from race_server.core.seeds import MOST_SEED
from race_server.errors import LotError
from race_server.pictures import check_picture
from race_server.terminal import Console, say

app = typer.Typer(help="List, draw, check and import car parks.", no_args_is_help=True)

LotName = Annotated[
    str,
    typer.Argument(
        help="A name from `race lot list`, a .toml file, or a generated lot: generated:yard:SEED, "
        "generated:aisle:SEED, generated:kerb:SEED, generated:street:SEED."
    ),
]
Vehicle = Annotated[
    str,
    typer.Option(
        help="Vehicle, such as kart-13, car or car-trailer; an unknown name lists all. Default: "
        "that of the lot."
    ),
]

Vehicles = Annotated[int, typer.Option(min=1, max=64, help="Vehicles that drive there.")]


@app.command("list")
def list_lots(as_json: AsJson = False) -> None:
    """List all car parks with size, slots, vehicle, blocks and people."""
    from race_server.scenario.lot.load import load_lot, lot_names, summary

    rows = rows_of(lot_names(), lambda name: summary(load_lot(name)))
    if as_json:
        print_document(rows)
        return
    table = Table("name", "vehicle", header_style="dim underline", box=None, pad_edge=False)
    for column in ("size [m]", "slots", "taken", "blocks", "people"):
        table.add_column(column, justify="right")
    table.add_column("title")
    for row in rows:
        fewest, most = row["blocks"]
        table.add_row(
            row["name"],
            row["vehicle"],
            f"{row['size_m'][0]:g}×{row['size_m'][1]:g}",
            str(row["slots"] or "zone"),
            f"{row['taken']:.0%}",
            f"{fewest}–{most}" if most else "–",
            str(row["people"] or "–"),
            row["title"],
        )
    Console().print_whole(table)


@app.command()
def show(
    name: LotName,
    seed: Annotated[int, typer.Option(min=0, max=MOST_SEED, help="Seed of the round to draw.")] = 0,
    vehicle: Vehicle = "",
    vehicles: Vehicles = 1,
    to: Picture = None,
) -> None:
    """Draw a car park, and one round in it, into a .png or .svg file."""
    from race_server.scenario.lot.draw import draw_lot

    path = to or picture_of(name.removesuffix(".toml"))
    check_picture(path)
    draw_lot(name, seed, path, vehicle, vehicles)
    say(path)


@app.command()
def check(
    name: LotName,
    vehicle: Vehicle = "",
    vehicles: Vehicles = 1,
    seeds: Annotated[
        int, typer.Option(min=0, max=10_000, help="Rounds to draw, under the seeds from 0.")
    ] = 200,
    as_json: AsJson = False,
) -> None:
    """Check whether a vehicle can park in a car park. Exit code 1 if it cannot.

    Slots have to be large enough, and a way as wide as the vehicle has to lead there, from the
    start to the slot of each round that is drawn; whether the vehicle can turn on it, `race park`
    shows.
    """
    from race_server.core.kernels.jit import is_compiled
    from race_server.core.vehicle_presets import vehicle_named
    from race_server.scenario.lot.check import check_lot
    from race_server.scenario.lot.load import load_lot, summary

    lot = summary(load_lot(name))
    vehicle_named(vehicle or lot["vehicle"])
    if not is_compiled():
        say("compiling the simulation for this machine, once: about a minute", error=True)
    findings = check_lot(name, vehicle, seeds, vehicles)
    print_findings("lot", lot["name"], vehicle or lot["vehicle"], findings, as_json)


@app.command("import")
def import_lot(
    source: Annotated[Path, typer.Argument(help="Case of the TPCAP benchmark (.csv).")],
    to: Annotated[Path, typer.Option("--to", help="File to write (.toml).")],
    title: Annotated[
        str, typer.Option(help="Title of the lot. Default: the name of the source file.")
    ] = "",
) -> None:
    """Convert a case of the TPCAP benchmark into a car park."""
    from race_server.scenario.lot.load import summary
    from race_server.scenario.lot.tpcap import import_case, read_case

    if to.suffix != ".toml":
        raise LotError(f"{to}: write the lot as .toml")
    lot = summary(import_case(source, to, title=title or source.stem))
    beyond = len(read_case(source).polygons) - lot["polygons"]
    left_out = f", {beyond} outside of it left out" if beyond > 0 else ""
    size = f"{lot['size_m'][0]:g} × {lot['size_m'][1]:g} m"
    say(f"{to}: {size}, {lot['polygons']} obstacles{left_out}")
