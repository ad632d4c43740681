"""`race drill`: what may go wrong, done on purpose."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

app = typer.Typer(help="Drills: what may go wrong in a session, done on purpose.")

AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on stdout.")]
Seed = Annotated[int, typer.Option(help="Of the moments that are chosen at random.")]


@app.command()
def crash(
    times: Annotated[int, typer.Option(min=1, help="So often the server is killed.")] = 10,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Kill the server of a live race of eight, and see that the race goes on and no lap is lost."""
    from race_server.drills.crash import drill_crash

    with progress("killing the server", times) as tell:
        document = drill_crash(times, seed=seed, tell=tell)
    finish(document, as_json=as_json)


@app.command()
def hostile(
    messages: Annotated[int, typer.Option(min=1000, help="So many are sent and decoded.")] = 20_000,
    rate: Annotated[int, typer.Option(min=1, help="So many a second.")] = 5000,
    seed: Seed = 1,
    as_json: AsJson = False,
) -> None:
    """Send damaged and crafted messages on every inbound topic while a race of eight runs."""
    from race_server.drills.hostile import drill_hostile

    with progress("sending", messages) as tell:
        document = drill_hostile(messages, rate=rate, seed=seed, tell=tell)
    finish(document, as_json=as_json)


@contextmanager
def progress(what: str, total: int) -> Iterator[Any]:
    """Show how far a drill has come, on stderr; yields what is to be told."""
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


def finish(document: dict[str, Any], *, as_json: bool) -> None:
    """Print what a drill found, and end with 1 where it is not well."""
    if as_json:
        print(json.dumps(document))
    else:
        table = Table("figure", "value")
        for name, value in document.items():
            if not isinstance(value, (list, dict)) and name not in {"ok", "why"}:
                table.add_row(name.replace("_", " "), str(value))
        console = Console()
        console.print(table)
        console.print("[green]well[/]" if document["ok"] else f"[red]{document['why']}[/]")
    if not document["ok"]:
        raise typer.Exit(1)
