"""Tables of commands in terminals of any width."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from rich.table import Table
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.core.messages import Ending, Parking, Standing
from race_server.live.client.leaderboard import Headline, leaderboard
from race_server.scenario.track.load import track_names
from race_server.terminal import Console
from support.results import standing


@pytest.mark.parametrize("width", [20, 200])
def test_no_name_and_no_figure_is_cut_off(width: int) -> None:
    table = Table("name", "figure")
    for name in track_names():
        table.add_row(name, "2.73 ± 0.37")
    shown = io.StringIO()
    Console(file=shown, width=width).print_whole(table)
    assert all(name in shown.getvalue() for name in track_names())
    assert shown.getvalue().count("2.73 ± 0.37") == len(track_names())


@pytest.mark.parametrize(("kind", "known"), [("track", "oval"), ("lot", "yard-70")])
def test_a_file_that_is_not_valid_hides_no_other_from_a_list(
    kind: str, known: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.toml").write_text("title = 1")
    monkeypatch.setenv(f"RACE_{kind.upper()}S", str(tmp_path))
    result = CliRunner().invoke(app, [kind, "list", "--json"])
    names = [row["name"] for row in json.loads(result.stdout)]
    assert known in names
    assert "mine" not in names
    assert result.stderr.startswith("warning: mine.toml: ")


def shown(laps: int, *rows: Standing) -> str:
    written = io.StringIO()
    Console(file=written, width=200).print_whole(leaderboard(Headline("lap", "here", laps), rows))
    return written.getvalue()


def test_a_kart_that_parks_after_a_race_hides_no_other_from_its_table() -> None:
    way = Parking(Ending.PARKED, 4, 12.0, 0.0, 0, 0)
    rows = standing(0, "ada", 1), replace(standing(1, "bea", 2), parking=way)
    of_race = shown(3, *rows)
    assert all(word in of_race for word in ("ada 0", "bea 1", "laps", "home, parked"))
    in_lot = shown(0, rows[1])
    assert "12.0 m" in in_lot
    assert "laps" not in in_lot
