"""`race results list | best | export | ratings`."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.table import Table

from race_server.cli.document import AsJson, print_document
from race_server.core.clock import lap_text
from race_server.errors import ResultsError
from race_server.terminal import Console, say

app = typer.Typer(help="Query the results file: races, best laps, ratings.", no_args_is_help=True)

Track = Annotated[str, typer.Option(help="Show only this course. Default: all.")]
Results = Annotated[
    str,
    typer.Option(
        help="Results file. Default: $RACE_SERVER_RESULTS, else "
        "~/.local/share/race-server/results.sqlite."
    ),
]


def _file(results: str) -> Path:
    from race_server.storage.results.schema import path_of

    path = path_of(results)
    if path is None:
        raise ResultsError("no results file: $RACE_SERVER_RESULTS or --results says none")
    return path


def _table(texts: Sequence[str], figures: Sequence[str]) -> Table:
    """Return an empty table in the style of the leaderboard."""
    table = Table(header_style="dim underline", box=None, padding=(0, 1, 0, 0), pad_edge=False)
    for name in texts:
        table.add_column(name, no_wrap=True)
    for name in figures:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _winner(race: dict[str, Any]) -> str:
    """Return the winner of a race, or why there is none."""
    if race["ended"] != "finished":
        return "(stopped)" if race["ended"] else "(not ended)"
    if not race["entries"] or race["entries"][0]["rank"] != 1:
        return "(unknown)"  # of a file that was damaged
    first = race["entries"][0]
    return first["driver"] if first["status"] == "finished" else "(none finished)"


@app.command("list")
def list_races(
    track: Track = "",
    driver: Annotated[str, typer.Option(help="Show only races of this driver. Default: all.")] = "",
    limit: Annotated[
        int, typer.Option(min=1, max=1_000_000, help="Show at most this many races.")
    ] = 20,
    results: Results = "",
    as_json: AsJson = False,
) -> None:
    """List races, newest first."""
    from race_server.storage.results.queries import races

    rows = races(_file(results), track=track, driver=driver, limit=limit)
    if as_json:
        print_document(rows)
        return
    table = _table(("race", "started (UTC)", "track", "vehicle"), ("laps", "best lap"))
    table.add_column("winner", no_wrap=True)
    for row in rows:
        table.add_row(
            str(row["id"]),
            row["started_at"][:16].replace("T", " "),
            row["track"],
            row["vehicle"],
            str(row["laps_driven"]),
            lap_text(row["best_lap_us"]),
            _winner(row),
        )
    Console().print_whole(table)


@app.command()
def best(track: Track = "", results: Results = "", as_json: AsJson = False) -> None:
    """Show the best lap of each driver on each track with each vehicle."""
    from race_server.storage.results.queries import best_laps

    rows = best_laps(_file(results), track=track)
    if as_json:
        print_document(rows)
        return
    table = _table(("track", "vehicle", "driver"), ("best lap", "clean lap", "laps", "race"))
    for row in rows:
        table.add_row(
            edition_of(row, rows),
            row["vehicle"],
            row["driver"],
            lap_text(row["best_lap_us"]),
            lap_text(row["best_clean_lap_us"]),
            str(row["laps"]),
            str(row["race"]),
        )
    Console().print_whole(table)


def edition_of(row: dict[str, Any], rows: list[dict[str, Any]]) -> str:
    """Return the name of a track, with its digest if the file has several of that name."""
    digests = {other["track_digest"] for other in rows if other["track"] == row["track"]}
    # Behind a plus is the digest of the obstacles on it.
    parts = [part[:8] for part in row["track_digest"].split("+")]
    return row["track"] if len(digests) == 1 else f"{row['track']} {'+'.join(parts)}"


@app.command("export")
def export_table(
    to: Annotated[Path, typer.Argument(help="Table to write: a .csv or .parquet file.")],
    rows: Annotated[
        Literal["laps", "classification"],
        typer.Option(help="Export every lap, or the place of every kart in every race."),
    ] = "laps",
    results: Results = "",
) -> None:
    """Export every lap, or the classification of every race, to a table."""
    from race_server.storage.results.export import export
    from race_server.storage.results.queries import all_laps, classifications

    ask, things = (all_laps, "laps") if rows == "laps" else (classifications, "rows")
    found = ask(_file(results))
    export(found, to, rows)
    say(f"{to}: {len(found)} {things}")


@app.command()
def ratings(results: Results = "", as_json: AsJson = False) -> None:
    """Rate the drivers over all finished races (Plackett-Luce, with bounds of 95 %)."""
    from race_server.storage.results.queries import finished_races
    from race_server.storage.results.ratings import ratings as rate

    rows = rate(finished_races(_file(results)))
    if as_json:
        print_document([asdict(row) for row in rows])
        return
    table = _table(("driver",), ("rating", "from", "to", "races"))
    for row in rows:
        figures = (f"{row.mu:.0f}", f"{row.low:.0f}", f"{row.high:.0f}", str(row.races))
        table.add_row(row.driver, *figures)
    Console().print_whole(table)
