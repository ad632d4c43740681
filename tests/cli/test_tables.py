"""Tables of commands in terminals of any width."""

import io

import pytest
from rich.table import Table

from race_server.scenario.track.load import track_names
from race_server.terminal import Console


@pytest.mark.parametrize("width", [20, 200])
def test_no_name_and_no_figure_is_cut_off(width: int) -> None:
    table = Table("name", "figure")
    for name in track_names():
        table.add_row(name, "2.73 ± 0.37")
    shown = io.StringIO()
    Console(file=shown, width=width).print_whole(table)
    assert all(name in shown.getvalue() for name in track_names())
    assert shown.getvalue().count("2.73 ± 0.37") == len(track_names())
