"""`race entrants import | list`: names and numbers that are kept over events."""

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.terminal import Console, say

app = typer.Typer(
    help="Names of drivers and their numbers, kept over events.", no_args_is_help=True
)


@app.command("import")
def import_entrants(
    file: Annotated[Path, typer.Argument(help="A .csv file with the columns number and name.")],
    as_json: AsJson = False,
) -> None:
    """Take over names and numbers; a name without a number gets the lowest that is free.

    If a row is wrong none is taken over. Events show the number of a driver that joins by its name.
    """
    from race_server.competition.entrants import (
        default_path,
        known_entrants,
        read_entrants,
        write_entrants,
    )

    path = default_path()
    found = read_entrants(file, known_entrants(path))
    for fault in found.faults:
        say(f"{file}, {fault}", error=True)
    if found.faults:
        say(f"error: {len(found.faults)} wrong rows, none was taken over", error=True)
        raise typer.Exit(2)
    write_entrants(path, found.entrants)
    if as_json:
        print_document({"file": str(path), "entrants": found.entrants, "added": found.added})
    else:
        say(f"{path}: {len(found.entrants)} entrants, {found.added} of them new")


@app.command("list")
def list_entrants(as_json: AsJson = False) -> None:
    """List the entrants by number."""
    from race_server.competition.entrants import default_path, known_entrants

    entrants = known_entrants(default_path())
    rows = sorted((number, name) for name, number in entrants.items())
    if as_json:
        print_document([{"number": number, "name": name} for number, name in rows])
        return
    table = Table("number", "name", box=None, header_style="dim underline", pad_edge=False)
    for number, name in rows:
        table.add_row(str(number), name)
    Console().print_whole(table)
