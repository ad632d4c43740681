"""A disk that takes nothing, or a folder that is gone, never ends a server."""

import io
import json
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from race_server.cli.serve import MOST_FAILURES, discards_race
from race_server.cli.service import Service, serve_races
from race_server.competition.launch import free_address
from race_server.competition.time_trial.ghost import save_lap
from race_server.errors import ResultsError
from race_server.kept_file import part_of
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.live.server.supervisor import Past
from race_server.logs import Log
from race_server.net.transport import ServerLink
from race_server.pictures import save
from race_server.scenario.race import Rules, Scenario
from race_server.session.session import Session
from race_server.storage.csv_table import write_csv
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import read_recording
from race_server.storage.whole_file import write_whole
from support.courses import SMALL_RING
from support.served_race import one_race, record_race

FULL = Path("/dev/full")  # takes no byte: ENOSPC
SCENARIO = Scenario(SMALL_RING, karts=1, seed=5, rules=Rules(laps=1, countdown_s=0.5))

pytestmark = pytest.mark.live


def service(folder: Path, result: Path) -> Service:
    """Return one race of one driver, in lockstep, with nowhere to write."""
    (folder / "file").write_text("no folder")
    nowhere = str(folder / "file" / "below")
    return replace(one_race(result), results=nowhere, record=nowhere)


def events_of(stream: io.StringIO) -> list[str]:
    return [json.loads(line)["event"] for line in stream.getvalue().splitlines()]


@pytest.mark.usefixtures("handlers")
def test_a_server_that_replaces_another_serves_without_files_where_there_is_no_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said, full = io.StringIO(), FULL.open("w")
    monkeypatch.setattr(sys, "stdout", full)
    serve_races(service(tmp_path, FULL), Log(stream=said), fresh=False, replaces=True)
    with suppress(OSError):
        full.close()
    events = events_of(said)
    assert [event for event in events if "without" in event or "result is" in event] == [
        "races go on without a results file",
        "races go on without recordings",
        f"the result is not in {FULL}; make room or name another",
        "the result is not printed",
    ]
    assert events.index("race ended") < events.index("the result is not printed")


def test_a_server_that_is_started_by_hand_says_at_once_that_it_cannot_write(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="below cannot be used"):
        serve_races(service(tmp_path, FULL), Log(stream=io.StringIO()), fresh=False)


@pytest.mark.parametrize("where", ["full", "folder"])
def test_a_race_goes_on_without_its_recording(tmp_path: Path, where: str) -> None:
    journal = tmp_path / "cup.journal.mcap"
    said: list[str] = []
    session = Session("cup", SCENARIO)
    with (
        Logbook(tmp_path, "cup", said.append) as book,
        ServerLink(free_address(), "cup", 1) as link,
    ):
        journal.symlink_to(FULL) if where == "full" else journal.mkdir()
        outcome = RaceServer(session, link, LOCKSTEP, ("pure_pursuit",), logbook=book).run(0)
    assert outcome is not None
    assert outcome.standings[0].laps == 1
    (line,) = said
    assert line.endswith("The race goes on without it")


@pytest.mark.parametrize("where", ["full", "folder"])
def test_an_old_journal_that_cannot_be_copied_is_kept_whole(tmp_path: Path, where: str) -> None:
    journal = record_race(tmp_path).rename(tmp_path / "cup.journal.mcap")
    start, content = read_recording(journal).start, journal.read_bytes()
    said: list[str] = []
    with Logbook(tmp_path, "cup", said.append) as book:
        part = tmp_path / "cup.part.mcap"
        part.symlink_to(FULL) if where == "full" else part.mkdir()
        assert book.begin(start, takes_up=True) is None
    assert not journal.exists()
    assert (tmp_path / "cup.journal.aside.mcap").read_bytes() == content
    assert "the journal is kept as" in said[-1]


def test_a_folder_that_takes_nothing_leaves_the_journal_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []
    with Logbook(tmp_path, "cup", said.append) as book:
        (tmp_path / "cup.journal.mcap").write_text("rubbish")

        def refuse(*_: object, **__: object) -> None:
            raise OSError(30, "Read-only file system")

        for act in ("replace", "unlink"):
            monkeypatch.setattr(Path, act, refuse)
        assert book.unfinished() is None
    assert said[0].endswith("the journal stays where it is (Read-only file system)")


def test_a_file_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    write_whole(path, "old")
    part_of(path).symlink_to(FULL)
    with pytest.raises(OSError, match="No space left"):
        write_whole(path, "new")
    assert path.read_text() == "old"
    write_whole(path, "new")
    assert [file.name for file in tmp_path.iterdir()] == ["result.json"]
    assert path.read_text() == "new"


def test_a_table_or_a_picture_that_the_disk_does_not_take_leaves_the_old_one(
    tmp_path: Path,
) -> None:
    table, lap, picture = (tmp_path / name for name in ("t.csv", "lap.csv", "p.png"))
    writers: dict[Path, Callable[[], object]] = {
        table: lambda: write_csv([{"driver": "ann"}], table),
        lap: lambda: save_lap(np.zeros((8, 2)), lap),
        picture: lambda: save(Figure(), picture),
    }
    for path, write in writers.items():
        path.write_text("old")
        part_of(path).symlink_to(FULL)
        with pytest.raises((OSError, ResultsError), match="No space left"):
            write()
        assert path.read_text() == "old"
        write()
        assert path.read_bytes() != b"old"
    assert {path.name for path in tmp_path.iterdir()} == {"t.csv", "lap.csv", "p.png"}


def test_a_file_in_a_folder_that_takes_no_other_is_written_in_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "result.json"
    write_whole(path, "old")
    part_of(path).mkdir()
    monkeypatch.setattr("race_server.kept_file.os.access", lambda *_: False)
    write_whole(path, "new")
    assert path.read_text() == "new"


def test_a_file_may_be_a_pipe_of_another_program() -> None:
    words = (
        "from pathlib import Path; from race_server.storage.whole_file import write_whole; "
        "write_whole(Path('/dev/stdout'), 'new')"
    )
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, check=False)
    assert (done.stdout, done.stderr) == (b"new", b"")


def test_a_race_that_ended_three_servers_is_not_resumed_by_the_fourth() -> None:
    assert MOST_FAILURES == 3
    assert not discards_race(Past(), fresh=False)
    assert discards_race(Past(), fresh=True)
    assert not discards_race(Past(ended=1), fresh=True)
    assert not discards_race(Past(ended=7, failures=2), fresh=False)
    assert discards_race(Past(ended=3, failures=3), fresh=False)
