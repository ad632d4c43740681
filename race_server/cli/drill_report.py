"""What a drill shows: its progress, and its document."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import typer
from rich.progress import Progress
from rich.table import Table
from rich.text import Text

from race_server.cli.document import print_document
from race_server.terminal import Console


@contextmanager
def progress(what: str, total: int | None) -> Iterator[Any]:
    """Show a progress bar on stderr; yields the function that takes the number done."""
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done: bar.update(task, completed=done)


def _show_findings(rows: list[dict[str, Any]]) -> None:
    """Print one row for each act that was tried."""
    table = Table("act", "expected", "seen")
    for row in rows:
        seen = Text(row["seen"], style="" if row["ok"] else "red")
        table.add_row(row["act"], row["expected"], seen)
    Console().print(table)


def finish(
    document: dict[str, Any], *, as_json: bool, columns: tuple[str, ...] = (), rows: str = ""
) -> None:
    """Print the result of a drill, its acts first; exit with 1 if it failed.

    columns: parts of the document with the same figures, shown side by side; rows: the part that is
    a list of such figures, shown in the same way.
    """
    if as_json:
        print_document(document)
    else:
        if document.get("matrix"):
            _show_findings(document["matrix"])
        console = Console()
        table = Table("figure", "value")
        for name, value in document.items():
            if not isinstance(value, (list, dict)) and name not in {"ok", "why"}:
                table.add_row(name.replace("_", " "), str(value))
        console.print(table)
        if columns:
            console.print(_side_by_side({name: document[name] or {} for name in columns}))
        if document.get(rows):
            # Only numbers: texts would need a wider terminal, and are in the document.
            numbers = [
                {name: value for name, value in row.items() if not isinstance(value, str)}
                for row in document[rows]
            ]
            console.print(_side_by_side({f"{n}": row for n, row in enumerate(numbers)}))
        is_ok = document["ok"]
        console.print("passed" if is_ok else document["why"], style="green" if is_ok else "red")
    if not document["ok"]:
        raise typer.Exit(1)


def _side_by_side(parts: dict[str, dict[str, Any]]) -> Table:
    table = Table("figure", *(name.replace("_", " ") for name in parts))
    for name in next(iter(parts.values())):
        table.add_row(name.replace("_", " "), *(str(part.get(name, "")) for part in parts.values()))
    return table


def show_drills(rows: list[dict[str, Any]]) -> None:
    """Print one row for each drill."""
    table = Table("drill", "ok", "seconds", "figure", "why")
    for row in rows:
        ok = Text("yes", style="green") if row["ok"] else Text("no", style="red")
        table.add_row(row["name"], ok, f"{row['seconds']:.0f}", row["figure"], row["why"])
    Console().print(table)
