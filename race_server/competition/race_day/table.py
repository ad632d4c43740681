"""The tables of a race day in a terminal."""

from rich.table import Table
from rich.text import Text

from race_server.competition.race_day.languages import Say, language_of, translated
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


def print_tables(plan: DayPlan, ledger: Ledger, console: Console, language: str = "en") -> None:
    """Print all tables of a day and its podium in a language."""
    say = language_of(language)
    console.print(Text(say(heading(plan)), style="bold"))
    console.print(Text(say(subtitle(plan)), style="dim"))
    for table in (translated(one, say) for one in tables_of(plan, ledger)):
        console.print()
        console.print(Text(table.title, style="bold"))
        console.print(_table(table))
    console.print()
    console.print(_podium_line(ledger, say))


def _podium_line(ledger: Ledger, say: Say) -> Text:
    """Return the podium on one line."""
    steps = [row for row in ledger.classification() if 1 <= row.place <= 3]
    line = Text("podium  ", style="bold")
    for row, style in zip(steps, _STEPS, strict=False):
        line.append(f"{row.place} {row.team}   ", style=f"bold {style}")
    return line if steps else Text(f"podium  {say('no team finished')}", style="bold")


def _table(shown: DayTable) -> Table:
    table = Table(
        header_style="dim underline",
        box=None,
        padding=(0, 1, 0, 0),
        pad_edge=False,
    )
    for column, head in zip(shown.columns, shown.heads, strict=True):
        is_words = column in shown.words
        table.add_column(
            head,
            justify="left" if is_words else "right",
            overflow="fold",
            no_wrap=not is_words,  # in a narrow terminal words take more lines, and figures stay
            style="dim" if column == "remarks" else "",
        )
    for row in shown.rows:
        table.add_row(*row, style="dim" if row[0] == NOT_CLASSIFIED else "")
    return table
