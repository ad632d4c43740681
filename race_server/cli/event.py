"""`race event show | list`: an event on the network, at any moment and from any program."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from rich.text import Text

from race_server.cli.document import AsJson, print_document
from race_server.cli.options import Language
from race_server.errors import ScenarioError
from race_server.pictures import check_picture
from race_server.terminal import Console, say

if TYPE_CHECKING:
    from race_server.competition.event_state import EventState
    from race_server.competition.race_day.day import Day

app = typer.Typer(
    help="Events that are served: the classification so far, and the sheet for the wall.",
    no_args_is_help=True,
)

Record = Annotated[
    str,
    typer.Option(
        help="Folder of recordings, in which events are kept. Default: $RACE_SERVER_RECORDINGS, "
        "else ~/.local/share/race-server/recordings."
    ),
]


@app.command()
def show(
    event: Annotated[
        str,
        typer.Argument(help="A file, also by its name in `race event list`. Default: the newest."),
    ] = "",
    sheet: Annotated[
        Path | None,
        typer.Option(help="Draw the tables into this .png, .svg or .pdf file."),
    ] = None,
    language: Language = "en",
    record: Record = "",
    as_json: AsJson = False,
) -> None:
    """Show an event as it stands: all attempts and races so far, and the classification."""
    from race_server.competition.race_day.picture import SUFFIXES, draw_picture
    from race_server.competition.race_day.report import event_document

    day, state = _event_in(_file_of(event, record) if event else newest_event(record))
    if sheet is not None:
        check_picture(sheet, SUFFIXES)
    if as_json:
        print_document(event_document(day, state))
    else:
        _print_event(day, state, Console(), language)
    if sheet is not None:
        draw_picture(day.plan, day.ledger, sheet, language)


def show_event(path: Path, console: Console) -> None:
    """Print the tables of the event in a file, and what comes next.

    Raises:
        ScenarioError: it cannot be read.
    """
    _print_event(*_event_in(path), console, "en")


def _event_in(path: Path) -> "tuple[Day, EventState]":
    from race_server.competition.event_state import read_event

    state = read_event(path)
    return state.day(), state


def _print_event(day: "Day", state: "EventState", console: Console, language: str) -> None:
    from race_server.competition.race_day.languages import language_of, title_in
    from race_server.competition.race_day.table import print_tables

    print_tables(day.plan, day.ledger, console, language)
    if not state.is_final:
        say = language_of(language)
        coming = f", {say('next')}: {title_in(day.next.title, say)}" if day.next else ""
        console.print(f"{say('provisional')}{coming}", style="dim", soft_wrap=True)
        seats = ", ".join(f"{one.seat} {one.team}" for one in state.entrants)
        console.print(Text(f"{say('seats')}: {seats}", style="dim"), soft_wrap=True)


@app.command("list")
def list_events(record: Record = "", as_json: AsJson = False) -> None:
    """List events, newest first. Of one that cannot be read, it is said why."""
    from race_server.competition.event_state import read_event

    states = []
    for path in _files(record):
        try:
            states.append((path, read_event(path)))
        except ScenarioError as error:
            say(error, error=True)
    rows = [
        {
            "file": str(path),
            "format": state.format.name,
            "begun_at": state.begun_at,
            "drivers": len(state.entrants),
            "driven": len(state.records),
            "is_final": state.is_final,
        }
        for path, state in states
    ]
    if as_json:
        print_document(rows)
        return
    table = Table("begun (UTC)", "format", "drivers", "driven", "final", "file", box=None)
    for row, (path, state) in zip(rows, states, strict=True):
        when = state.begun_at[:16].replace("T", " ")
        final = "yes" if state.is_final else "no"
        figures = (str(row["drivers"]), str(row["driven"]), final)
        table.add_row(when, state.format.name, *figures, path.name)
    console = Console()
    console.print_whole(table)


def _file_of(event: str, record: str) -> Path:
    """Return the file of an event: at this path, or of this name in the folder of recordings."""
    from race_server.storage.recording.logbook import folder_of

    path, folder = Path(event), folder_of(record)
    return folder / event if folder and not path.exists() else path


def newest_event(record: str, session: str = "") -> Path:
    """Return the file of the event that was written last. session: "" for any.

    Raises:
        ScenarioError: there is none.
    """
    return _files(record, session)[0]


def _files(record: str, session: str = "") -> list[Path]:
    """Return the files of all events, the newest first."""
    from race_server.competition.event_state import event_files
    from race_server.storage.recording.logbook import folder_of

    folder = folder_of(record)
    found = event_files(folder, session) if folder else []
    if not found:
        raise ScenarioError(
            f"no event in {folder}: serve one with `race serve --format`, or name another folder "
            "with --record"
        )
    return found
