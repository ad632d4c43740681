"""What a results file can be asked: lists, best laps, exports, ratings."""

import csv
import json
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner

from race_server.cli.results import app, edition_of
from race_server.errors import ResultsError
from race_server.session.lap_log import Lap
from race_server.storage.results.export import export
from race_server.storage.results.queries import (
    all_laps,
    best_laps,
    classifications,
    finished_races,
    races,
)
from race_server.storage.results.ratings import ratings
from support.results import a_race, fill, outcome


def two_tracks(path: Path) -> None:
    fill(
        path,
        a_race("ann", "bob"),
        Lap(0, 1, 9_000_000, (), True),
        Lap(0, 2, 8_000_000, (), False),
        Lap(1, 1, 8_500_000, (), True),
        outcome("ann", "bob"),
    )
    fill(path, a_race("bob", "cid", track="oval"), Lap(0, 1, 70_000_000, (), True))


def test_a_course_with_obstacles_is_told_from_the_same_without() -> None:
    rows = [
        {"track": "oval", "track_digest": digest}
        for digest in ("bba1ef779218cb16", "bba1ef779218cb16+686ab355fa89202c")
    ]
    names = [edition_of(row, rows) for row in rows]
    assert names == ["oval bba1ef77", "oval bba1ef77+686ab355"]
    assert edition_of(rows[0], rows[:1]) == "oval"


def test_races_are_listed_newest_first_by_track_driver_and_number(path: Path) -> None:
    two_tracks(path)
    assert [race["track"] for race in races(path)] == ["oval", "ring"]
    assert [race["track"] for race in races(path, limit=1)] == ["oval"]
    assert [race["track"] for race in races(path, track="ring")] == ["ring"]
    assert [race["id"] for race in races(path, driver="ann")] == [1]
    assert races(path, driver="ann")[0]["best_lap_us"] == 8_000_000
    assert races(path, driver="nobody") == []


def test_the_best_lap_is_that_of_each_driver_on_each_track(path: Path) -> None:
    two_tracks(path)
    found = [(row["track"], row["driver"], row["best_lap_us"]) for row in best_laps(path)]
    assert found == [
        ("oval", "bob", 70_000_000),
        ("ring", "ann", 8_000_000),
        ("ring", "bob", 8_500_000),
    ]
    ann = best_laps(path, track="ring")[0]
    assert (ann["is_clean"], ann["best_clean_lap_us"], ann["laps"]) == (False, 9_000_000, 2)


def test_an_export_holds_every_lap_in_both_formats(path: Path, tmp_path: Path) -> None:
    two_tracks(path)
    laps = all_laps(path)
    export(laps, tmp_path / "laps.csv", "laps")
    with (tmp_path / "laps.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["time_us"]) for row in rows] == [lap["time_us"] for lap in laps]
    assert rows[0]["driver"] == "ann"
    parquet = pytest.importorskip("pyarrow.parquet")
    export(laps, tmp_path / "laps.parquet", "laps")
    assert parquet.read_table(tmp_path / "laps.parquet").to_pylist() == laps


def test_an_export_of_classifications_has_a_row_for_each_kart_of_each_race(
    path: Path, tmp_path: Path
) -> None:
    two_tracks(path)
    places = classifications(path)
    first, second, *unfinished = places
    assert (first["driver"], first["rank"], first["laps"]) == ("ann", 1, 2)
    assert (first["best_lap_us"], second["best_lap_us"]) == (8_000_000, 8_500_000)
    assert [(row["driver"], row["rank"], row["laps"]) for row in unfinished] == [
        ("bob", None, 1),
        ("cid", None, 0),
    ]
    export(places, tmp_path / "places.csv", "classification")
    with (tmp_path / "places.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["race_time_us"] for row in rows] == ["27", "27", "", ""]
    parquet = pytest.importorskip("pyarrow.parquet")
    export(places, tmp_path / "places.parquet", "classification")
    assert parquet.read_table(tmp_path / "places.parquet").to_pylist() == places


def test_the_command_exports_laps_or_classifications(path: Path, tmp_path: Path) -> None:
    two_tracks(path)
    for words, rows in (([], "4 laps"), (["--rows", "classification"], "4 rows")):
        to = tmp_path / "table.csv"
        printed = CliRunner().invoke(app, ["export", str(to), *words, "--results", str(path)])
        assert printed.exit_code == 0
        assert rows in printed.output


def test_an_export_that_cannot_be_is_one_clear_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ResultsError, match=r"exported as .csv or .parquet"):
        export([], tmp_path / "laps.xls", "laps")
    with pytest.raises(ResultsError, match="cannot be written: No such file"):
        export([], tmp_path / "nowhere" / "laps.csv", "laps")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(ResultsError, match=r"needs pyarrow, from the extra `results`"):
        export([], tmp_path / "laps.parquet", "laps")


def test_who_wins_is_rated_above_who_loses(path: Path) -> None:
    for _ in range(3):
        fill(path, a_race("ann", "bob", "cid"), outcome("ann", "bob", "cid"))
    fill(path, a_race("cid", "ann"))  # not ended: does not count
    rated = ratings(finished_races(path))
    assert [row.driver for row in rated] == ["ann", "bob", "cid"]
    assert {row.races for row in rated} == {3}
    assert rated[0].low == pytest.approx(rated[0].mu - 1.96 * rated[0].sigma)
    assert sum(row.mu for row in rated) / 3.0 == pytest.approx(1500.0)


@pytest.mark.parametrize("words", [["list"], ["best"], ["ratings"]])
def test_the_commands_print_tables_and_json(path: Path, words: list[str]) -> None:
    two_tracks(path)
    command = [sys.executable, "-m", "race_server", "results", *words, "--results", str(path)]
    table, document = (
        subprocess.run(line, check=True, capture_output=True, text=True, timeout=60).stdout
        for line in (command, [*command, "--json"])
    )
    assert "ann" in table
    assert "ann" in json.dumps(json.loads(document))


@pytest.mark.parametrize("words", [["start", "--track", "oval"], ["serve"], ["results", "list"]])
def test_no_command_begins_with_a_file_that_it_cannot_use(path: Path, words: list[str]) -> None:
    path.write_bytes(b"no database" * 100)
    command = [sys.executable, "-m", "race_server", *words, "--results", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert f"error: results file {path} is damaged" in done.stderr
    assert "Traceback" not in done.stderr


def test_what_is_left_of_a_damaged_file_is_shown_and_rated(path: Path) -> None:
    for _ in range(3):
        fill(path, a_race("ann", "bob"), outcome("ann", "bob"))
    with closing(sqlite3.connect(path)) as connection:
        connection.execute("delete from entry where race = 2")
        connection.execute("update entry set rank = null where race = 3 and seat = 0")
        connection.commit()
    shown = CliRunner().invoke(app, ["list", "--results", str(path)])
    assert [line.split()[-1] for line in shown.stdout.splitlines()[1:]] == [
        *("(unknown)", "(unknown)", "ann")
    ]
    assert finished_races(path) == [[("ann", 1), ("bob", 2)]]
