"""`race event`: events in their files, damaged ones among them."""

import json
import os
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from race_server.cli.event import app, newest_event
from race_server.competition.event_state import Entrant, EventFile, EventState, read_event
from race_server.competition.race_day.protest import UPHELD, Protest
from race_server.competition.race_day.record import RaceRecord, TeamResult
from race_server.errors import ScenarioError
from support.served_event import TRIAL

LONG = "an-evening-with-a-name-that-is-longer-than-any-column-of-a-terminal-would-be-by-itself"
RESULT = TeamResult("Anna", 1, 1, 9_000_000, 9_000_000, (9_000_000,), 0, 0, 0, 0, "")
DRIVE = RaceRecord("0a", (RESULT,))


def write(folder: Path, name: str, records: int = 1) -> Path:
    """Write the event of one driver with two attempts; return its file."""
    entrants = (Entrant(0, "Anna", "Anna", "lidar", "00"),)
    tracks = {"A": "oval"}
    state = EventState(
        *(name, "2026-11-23T18:00", TRIAL, tracks, "tt02", 1, "lockstep", False, entrants),
        records=(DRIVE,) * records,
    )
    file = EventFile(folder, name)
    file.write(state)
    return file.path


def shown(folder: Path, *words: str) -> str:
    """Return what a command prints about the events in a folder.

    Raises:
        ScenarioError: it cannot.
    """
    done = CliRunner().invoke(app, [*words, "--record", str(folder)])
    if done.exception is not None:
        raise done.exception
    return done.stdout


def test_an_event_is_shown_by_the_name_that_the_list_prints(tmp_path: Path) -> None:
    write(tmp_path, LONG)
    write(tmp_path, "cup")
    names = [line.split()[-1] for line in shown(tmp_path, "list").splitlines()[1:]]
    assert sorted(names) == [f"{LONG}.event.json", "cup.event.json"]
    for name in names:
        document = json.loads(shown(tmp_path, "show", name, "--json"))
        assert document["event"] == name.removesuffix(".event.json")


def test_the_newest_event_of_a_session_is_not_that_of_another_whose_name_begins_alike(
    tmp_path: Path,
) -> None:
    mine, over = write(tmp_path, "cup"), tmp_path / "cup-20261123T180000.event.json"
    others = [write(tmp_path, name) for name in ("cup-b", "cup2")]
    for seconds, path in enumerate((mine, *others)):
        os.utime(path, (seconds, seconds))
    assert newest_event(str(tmp_path), "cup") == mine
    mine.rename(over)
    assert newest_event(str(tmp_path), "cup") == over
    assert newest_event(str(tmp_path)) == others[-1]


def test_in_a_narrow_terminal_protests_keep_their_numbers_and_decisions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path, "cup")
    why = "cut the chicane in lap 2 and again in lap 3, on the inside of both cones"
    title = "Time trial: Anna, attempt 1"
    protest = Protest(12, 0, title, "", "Anna", why, "2026-11-23T18:00", UPHELD, 5.0)
    EventFile(tmp_path, "cup").write(replace(read_event(path), protests=(protest,)))
    monkeypatch.setenv("COLUMNS", "60")
    text = shown(tmp_path, "show")
    assert "…" not in text
    (row,) = [line for line in text.splitlines() if line.startswith("12 ")]
    assert "upheld" in row
    assert "seats: 0 Anna" in text


def test_a_damaged_event_hides_no_other(tmp_path: Path) -> None:
    write(tmp_path, "cup")
    (tmp_path / "hurt.event.json").write_text("[" * 100_000)
    done = CliRunner().invoke(app, ["list", "--json", "--record", str(tmp_path)])
    assert [Path(row["file"]).name for row in json.loads(done.stdout)] == ["cup.event.json"]
    assert "hurt.event.json is damaged" in done.stderr
    assert done.exit_code == 0


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('"begun_at": "2026-11-23T18:00"', '"begun_at": 5', "begun_at = 5: give a text"),
        ('"begun_at": "2026-11-23T18:00"', '"begun_at": "soon"', "Invalid isoformat string"),
        ('"tracks": {\n  "A": "oval"\n }', '"tracks": "oval"', "tracks = 'oval': give a table"),
        ('"A": "oval"', '"B": "oval"', "tracks: there is none for letter A"),
        ('"seat": 0', '"seat": true', r"entrants\[0\].seat = True: give a whole number"),
        ('"seed": 1', '"seed": -1', "seed = -1: give one from 0 to"),
        ('"seat": 0', '"seat": 64', "an entrant has seat 64: give one from 0 to 63"),
        ('"key": "00"', '"key": "tcp"', "non-hexadecimal number"),
        ('"time_us": 9000000', f'"time_us": {10**30}', "time_us = 1000.*: give a whole number of"),
        ('"place": 1', '"plaice": 1', r"records\[0\].drives\[0\].plaice is unknown"),
        ('"place": 1,', "", r"records\[0\].drives\[0\].place is missing"),
        ('"grid": []', '"grid": ["Bert"]', "the grid of a record is Bert: not its teams"),
        ('"time_us": 9000000', '"time_us": Infinity', "Infinity is no finite number"),
        ('"time_us": 9000000', '"time_us": -1e999', "-1e999 is no finite number"),
        ('"team": "Anna",\n     "place"', '"team": "Bert",\n     "place"', "a record is of Bert"),
    ],
)
def test_a_file_with_a_wrong_value_is_damaged(
    tmp_path: Path, old: str, new: str, fault: str
) -> None:
    path = write(tmp_path, "cup")
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ScenarioError, match=f"cup.event.json is damaged .*{fault}"):
        shown(tmp_path, "show")


def test_a_file_with_two_teams_of_one_name_is_damaged(tmp_path: Path) -> None:
    path = write(tmp_path, "cup")
    words = json.loads(path.read_text())
    words["entrants"] *= 2
    path.write_text(json.dumps(words))
    with pytest.raises(ScenarioError, match=r"is damaged .*two entrants have the team 'Anna'"):
        shown(tmp_path, "show")


def test_a_file_with_more_records_than_its_format_has_attempts_is_refused(tmp_path: Path) -> None:
    write(tmp_path, "cup", records=3)
    with pytest.raises(
        ScenarioError, match="is over after 2 attempts and races; there is a record"
    ):
        shown(tmp_path, "show")
