"""Names are data: wherever they are shown, no output obeys them."""

import ast
import csv
import io
import json
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest.mock import Mock
from xml.etree import ElementTree

import pytest
from rich.table import Table
from rich.text import Text
from typer.testing import CliRunner

from race_server.cli import main
from race_server.cli.main import app
from race_server.cli.outcome import show_result
from race_server.core.messages import Phase
from race_server.errors import RaceError
from race_server.live.client.leaderboard import Headline, leaderboard
from race_server.logs import Log
from race_server.pictures import save
from race_server.printable import printable
from race_server.session.lap_log import Lap
from race_server.storage.csv_table import cell, write_csv
from race_server.storage.results.export import export
from race_server.storage.results.queries import all_laps
from race_server.terminal import Console, TextColumn, say
from support.results import a_race, fill, outcome, standing

ROOT = Path(__file__).parents[1]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "results.sqlite"


MARKUP = ("[/x]", "[red]", "[link=http://x]y", ":car:", "[/]", "\\[a]")
# Escapes (C0, C1), a new line, marks of direction, half of a pair of surrogates.
CONTROL = ("\x1b[2J", "\x9b2J", "a\nb", "a\r\bb", "\u202eabc", "\u2066x", "\ud800", "\x00")


def shown(*things: Any) -> str:
    stream = io.StringIO()
    console = Console(file=stream, width=120, force_terminal=True, color_system=None)
    for thing in things:
        console.print(thing)
    return stream.getvalue()


@pytest.mark.parametrize("name", MARKUP)
def test_a_terminal_shows_a_name_with_markup_as_it_is(name: str) -> None:
    table = Table(name, title=name, caption=name)
    table.add_row(name)
    assert shown(table).count(name) == 4
    assert shown(name, Text(name)) == f"{name}\n{name}\n"
    row = standing(0, name, 1)
    assert name in shown(leaderboard(Headline(name, name, 3, Phase.RUNNING), [row]))


@pytest.mark.parametrize("name", CONTROL)
def test_a_terminal_never_obeys_a_name(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    harmless = name.replace("\n", "")
    table = Table(harmless, title=Text(harmless))
    table.add_row(Text(harmless), harmless)
    say(f"error: {harmless}", error=True)
    say(harmless)
    told = capsys.readouterr()
    for output in (shown(table, harmless, Text(harmless)), told.out, told.err):
        assert all(letter.isprintable() or letter == "\n" for letter in output)
    assert "error: " in told.err


@pytest.mark.parametrize("error", [ValueError("\x1b[2J [/x]"), RaceError("\x1b[2J [/x]")])
def test_an_error_that_quotes_a_name_is_told_as_text(
    error: Exception, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(main, "command_line", lambda: Mock(side_effect=error))
    with pytest.raises(SystemExit) as end:
        main.main()
    assert end.value.code == (2 if isinstance(error, RaceError) else 1)
    told = capsys.readouterr().err
    assert "\N{REPLACEMENT CHARACTER}[2J [/x]" in told
    assert "\x1b" not in told


def test_a_name_with_an_escape_keeps_the_columns_of_a_table() -> None:
    table = Table("driver", "laps")
    table.add_row("a\x1b[2Jb", "3")
    table.add_row("bob", "4")
    lines = shown(table).splitlines()
    assert len({len(line) for line in lines}) == 1
    assert "a\N{REPLACEMENT CHARACTER}[2Jb" in lines[3]


def test_a_spinner_and_a_progress_bar_show_a_name_with_markup_as_it_is() -> None:
    console = Console(file=io.StringIO())
    assert shown(console.status("[/x]").renderable).strip().endswith("[/x]")
    bar = TextColumn("{task.description}")
    assert bar.markup is False


def test_what_cannot_be_seen_is_replaced_and_each_letter_that_can_be_stays() -> None:
    assert printable("Zoë 名前 🏎") == "Zoë 名前 🏎"
    assert printable("a\tb\u00a0c\u3000d") == "a b c d"
    assert printable("a\x1b\u202e\nb") == "a\ufffd\ufffd\ufffdb"


@pytest.mark.parametrize("name", [*MARKUP, *CONTROL])
def test_the_result_of_any_driver_is_shown(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    kart = {**vars_of(standing(0, name, 1)), "status": "finished", "lap_times_us": [8, 9]}
    document = {"karts": [kart], "ticks": 60, "missed_ticks": 0, "events": [], "digest": "d"}
    show_result(document, "oval", 1, "race")
    assert "1.0 s of racing" in capsys.readouterr().out


def vars_of(row: Any) -> dict[str, Any]:
    return {name: getattr(row, name) for name in row.__dataclass_fields__}


@pytest.mark.parametrize("words", [["list"], ["best"], ["ratings"]])
def test_results_of_a_driver_called_as_markup_or_an_escape_are_listed(
    path: Path, words: list[str]
) -> None:
    fill(path, a_race("[/x]", "\x1b[2J"), Lap(0, 1, 8, (), True), outcome("[/x]", "\x1b[2J"))
    done = CliRunner().invoke(app, ["results", *words, "--results", str(path)])
    assert done.exception is None
    assert "[/x]" in done.stdout
    assert "\x1b" not in done.stdout


@pytest.mark.parametrize("name", [*MARKUP, *CONTROL])
def test_one_event_is_one_line_of_the_log_with_nothing_but_what_can_be_seen(name: str) -> None:
    stream = io.StringIO()
    Log(stream=stream).say("joined", driver=name)
    (line,) = stream.getvalue().splitlines()
    assert json.loads(line)["driver"] == printable(name)
    terminal = type("Terminal", (io.StringIO,), {"isatty": lambda _: True})()
    Log(stream=terminal).say("joined", driver=name)
    assert printable(name) in terminal.getvalue()
    assert terminal.getvalue().count("\n") == 1


def test_a_log_whose_disk_is_full_raises_nothing() -> None:
    full = Path("/dev/full").open("w")  # noqa: SIM115  # closing it raises, too
    Log(stream=full).say("joined", driver="ann")
    with Log(stream=full) as log:
        log.warn("left")
    with suppress(OSError):
        full.close()


@pytest.mark.parametrize(
    "name", ["=1+1", "+1", "-1", "@SUM(A1)", "\t=1", " =1", "\uff1d1", "=cmd|' /C calc'!A0"]
)
def test_no_name_is_a_formula_in_a_table_for_spreadsheets(
    path: Path, tmp_path: Path, name: str
) -> None:
    fill(path, a_race(name, "bob"), Lap(0, 1, 8, (), True))
    export(all_laps(path), tmp_path / "laps.csv", "laps")
    with (tmp_path / "laps.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row["driver"] == f"'{printable(name)}"
    assert row["time_us"] == "8"
    assert cell("\r=1") == "\ufffd=1"


def test_numbers_in_a_table_for_spreadsheets_stay_numbers(tmp_path: Path) -> None:
    write_csv([{"lost_s": -0.5, "laps": [1, -2], "name": "ann"}], tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text() == "lost_s,laps,name\n-0.5,1 -2,ann\n"


def test_tables_with_text_in_them_are_written_in_one_place() -> None:
    wanted = {"csv.writer", "csv.DictWriter"}
    writers = {file.name for file in files_with("csv.") if wanted & calls_in(file)}
    # The trace of a lap and the curve of a training are numbers.
    assert writers == {"csv_table.py", "ghost.py", "curve.py"}


def files_with(*words: str) -> list[Path]:
    """Return the files of both packages in which any of some words stands."""
    files = [*ROOT.glob("race_server/**/*.py"), *ROOT.glob("agents/**/*.py")]
    return [file for file in files if any(word in file.read_text() for word in words)]


def calls_in(file: Path) -> set[str]:
    nodes = ast.walk(ast.parse(file.read_text()))
    return {ast.unparse(node.func) for node in nodes if isinstance(node, ast.Call)}


@pytest.mark.parametrize("name", ["$\\frac{$", "$x$", "100 $", "\x1b[2J", "<b>&--></b>", "a\nb"])
def test_a_picture_shows_a_name_as_it_is(tmp_path: Path, name: str) -> None:
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.subplots()
    axes.plot([1, 2], label=name)
    axes.legend()
    axes.set_title(name)
    figure.suptitle(name)
    for suffix in ("svg", "png"):
        save(figure, tmp_path / f"a.{suffix}")
    ElementTree.parse(tmp_path / "a.svg")
    assert axes.get_title() == "\n".join(map(printable, name.split("\n")))


def test_all_that_is_drawn_or_shown_live_goes_the_one_way() -> None:
    without_console, pictures = [], []
    for path in files_with("Live", "Progress", ".savefig"):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.Call):
                continue
            name = ast.unparse(node.func)
            if name in {"Live", "Progress"} and "console" not in {k.arg for k in node.keywords}:
                without_console.append(path.name)
            if name.endswith(".savefig"):
                pictures.append(path.name)
    assert without_console == []
    assert pictures == ["pictures.py"]
