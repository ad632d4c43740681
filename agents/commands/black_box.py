"""`race black-box`: what a kart sensed, knew, decided and did."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.terminal import Console


def black_box(
    file: Annotated[Path, typer.Argument(help="Black box of a kart.")],
    every: Annotated[
        float,
        typer.Option(min=0.0, help="Seconds between two rows; a change of stage or cause has one."),
    ] = 1.0,
    as_json: AsJson = False,
) -> None:
    """Show the black box of a kart: one row a second, and one for each change of what it does."""
    from race_agents.onboard.black_box import read_black_box

    rows, turns, first, last = [], 0, 0.0, 0.0
    due, before = -float("inf"), ("none", ())
    for turn in read_black_box(file):
        now = turn["time_s"]
        first, last, turns = (now if turns == 0 else first), now, turns + 1
        does = turn["alert"]["stage"], tuple(turn["cause"])
        if now >= due or does != before:
            due = now + every if now >= due else due
            rows.append(row_of(turn, first))
        before = does
    document = {"turns": turns, "seconds": round(last - first, 2), "rows": rows}
    if as_json:
        print_document(document)
        return
    _show(document)


def row_of(turn: dict[str, Any], first: float) -> dict[str, Any]:
    """Return what is shown of a turn. first: time of the first one [s]."""
    state, alert = turn.get("state"), turn["alert"]
    _, throttle, brake = turn["command"]
    return {
        "at_s": round(turn["time_s"] - first, 2),
        "speed": None if state is None else state[3],
        "deviation": turn.get("deviation"),
        "stage": alert["stage"],
        "kind": alert["kind"],
        "distance": alert["distance"],
        "throttle": throttle,
        "brake": brake,
        "cause": turn["cause"],
    }


def _show(document: dict[str, Any]) -> None:
    names = ("time s", "speed m/s", "deviation m", "stage", "in the way", "at m", "throttle")
    table = Table(*names, "brake", "why")
    for row in document["rows"]:
        numbers = [row[name] for name in ("at_s", "speed", "deviation")]
        seen = "" if row["kind"] == "nothing" else row["kind"]
        table.add_row(
            *(_text(number) for number in numbers),
            *(row["stage"], seen, _text(row["distance"])),
            *(_text(row["throttle"]), _text(row["brake"]), ", ".join(row["cause"])),
        )
    console = Console()
    console.print(table)
    console.print(f"{document['turns']} turns in {document['seconds']:g} s")


def _text(number: float | None) -> str:
    return "" if number is None else f"{number:.2f}"
