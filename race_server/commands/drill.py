"""`race drill`: trouble made on purpose. Each prints whether the server stood it."""

import json
from collections.abc import Callable
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

app = typer.Typer(help="Make trouble on purpose, and see what comes of it.", no_args_is_help=True)

AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]


@app.command()
def deny(as_json: AsJson = False) -> None:
    """Try everything that nobody may do to an open session, and what everybody may."""
    from race_server.drills.deny import drill_deny

    end_drill(drill_deny, as_json=as_json)


def end_drill(drill: Callable[[], dict[str, Any]], *, as_json: bool) -> None:
    """Run a drill, print what it found, and exit with 1 where it is not ok."""
    if as_json:
        document = drill()
        print(json.dumps(document))
    else:
        with Console(stderr=True).status("drilling", spinner="dots"):
            document = drill()
        _show(document)
    if not document["ok"]:
        raise typer.Exit(1)


def _show(document: dict[str, Any]) -> None:
    table = Table("act", "expected", "seen")
    for row in document.get("matrix", ()):
        seen = row["seen"] if row["ok"] else f"[red]{row['seen']}[/]"
        table.add_row(row["act"], row["expected"], seen)
    console = Console()
    if table.rows:
        console.print(table)
    for name, figure in document.items():
        if name not in {"matrix", "ok", "why"}:
            console.print(f"{name}: {figure}", highlight=False)
    verdict = "[green]ok[/]" if document["ok"] else f"[red]not ok[/]: {document['why']}"
    console.print(verdict, highlight=False)
