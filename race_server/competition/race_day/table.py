"""The tables of a race day in a terminal."""

from rich.table import Table
from rich.text import Text

from race_server.competition.race_day.ledger import Ledger
from race_server.competition.race_day.plan import DayPlan
from race_server.competition.race_day.tables import (
    NOT_CLASSIFIED,
    DayTable,
    heading,
    subtitle,
    tables_of,
)
from race_server.terminal import Console

_STEPS = ("gold3", "grey74", "orange3")


def print_tables(plan: DayPlan, ledger: Ledger, console: Console) -> None:
    """Print all tables of a day and its podium."""
    console.print(Text(heading(plan), style="bold"))
    console.print(Text(subtitle(plan), style="dim"))
    for table in tables_of(plan, ledger):
        console.print()
        console.print(Text(table.title, style="bold"))
        console.print(_table(table))
    console.print()
    console.print(podium_line(ledger))


def podium_line(ledger: Ledger) -> Text:
    """Return the podium on one line."""
    steps = [row for row in ledger.classification() if 1 <= row.place <= 3]
    line = Text("podium  ", style="bold")
    for row, style in zip(steps, _STEPS, strict=False):
        line.append(f"{row.place} {row.team}   ", style=f"bold {style}")
    return line if steps else Text("podium  no team finished", style="bold")


def _table(shown: DayTable) -> Table:
    table = Table(
        header_style="dim underline",
        box=None,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for column in shown.columns:
        is_words = column in shown.words
        table.add_column(
            column,
            justify="left" if is_words else "right",
            no_wrap=column != "remarks",
            style="dim" if column == "remarks" else "",
        )
    for row in shown.rows:
        table.add_row(*row, style="dim" if row[0] == NOT_CLASSIFIED else "")
    return table
