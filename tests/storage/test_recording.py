"""Recordings: a race driven again is the same race, and a killed one goes on."""

import json
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from typer.testing import CliRunner

from race_server.cli.main import app
from race_server.cli.recording import check
from race_server.competition.launch import free_address
from race_server.core.messages import Flag
from race_server.errors import RecordingError
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.live.server.resume import restore_session
from race_server.net.transport import ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.session.interventions import Intervention, InterventionKind
from race_server.session.journal_entries import Inputs
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording, read_recording
from race_server.storage.recording.rerun import Rerun
from race_server.storage.recording.scenario_codec import pack_scenario, unpack_scenario
from race_server.storage.results.keeper import Keeper
from race_server.storage.results.queries import all_laps, races
from race_server.storage.results.store import Store
from race_server.storage.results.writer import Writer
from support.courses import SMALL_RING

pytestmark = pytest.mark.live

DRIVERS = ("pure_pursuit", "avoider")


def scenario() -> Scenario:
    return Scenario(SMALL_RING, karts=3, seed=5, rules=Rules(laps=2, countdown_s=0.5))


@contextmanager
def logbook(folder: Path) -> Iterator[Logbook]:
    said: list[str] = []
    with Logbook(folder, "cup", said.append) as book:
        yield book
    assert said == []


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a whole race of three scripted drivers, with a flag and penalties in it."""
    folder = tmp_path_factory.mktemp("recordings")
    session, address = Session("cup", scenario()), free_address()
    with logbook(folder) as book, ServerLink(address, "cup", 3) as link:
        server = RaceServer(session, link, LOCKSTEP, DRIVERS, logbook=book)
        advance, ticks = session.advance, iter(range(10**6))

        def advance_and_flag(count: int = 1) -> object:
            if (turn := next(ticks)) in {100, 130}:
                session.race_control.show_flag(Flag.YELLOW if turn == 100 else Flag.GREEN)
                session.race_control.penalise(1, 2.5)
            return advance(count)

        session.advance = advance_and_flag  # type: ignore[method-assign, assignment]
        assert server.run(0) is not None
    (path,) = folder.glob("*.mcap")
    return path


def rerun_of(recording: Recording, *, is_blind: bool = False) -> Rerun:
    rerun = Rerun(recording, is_blind=is_blind)
    for _ in rerun.run():
        pass
    return rerun


def test_a_race_driven_again_has_the_same_digest_at_every_second(recorded: Path) -> None:
    recording = read_recording(recorded)
    rerun = rerun_of(recording)
    assert rerun.difference is None
    assert recording.is_complete
    assert rerun.compared == len(recording.digests) >= recording.last_tick // 60
    assert rerun.session.event_log.laps.times_us == {
        seat: [us for s, _, us, _ in recording.laps if s == seat] for seat in range(3)
    }


def test_a_race_is_driven_to_its_last_digest_in_steps_of_any_size(recorded: Path) -> None:
    # The server took three ticks in a step: the race is over within the last.
    recording = read_recording(recorded)
    for ticks in (1, 2, 7):
        rerun = Rerun(recording)
        for _ in rerun.run(ticks):
            pass
        assert (rerun.difference, rerun.compared) == (None, len(recording.digests))


def test_a_race_that_ends_before_the_recorded_one_is_another_race(recorded: Path) -> None:
    recording = read_recording(recorded)
    given_up = [Intervention(130, InterventionKind.WITHDRAW, kart, 0.0) for kart in range(3)]
    at = next(n for n, entry in enumerate(recording.entries) if entry.tick > 130)
    recording.entries[at:at] = given_up
    told, last = check(recording), recording.digests[-1][0]
    assert (told["ok"], told["digests"]) == (False, 2)  # those of ticks 60 and 120
    assert told["first_difference_tick"] == told["ticks"] < 180
    assert f"ended at tick {told['ticks']}, the recorded one went on to tick {last}" in told["why"]


def test_a_recording_without_a_digest_has_nothing_to_compare(recorded: Path) -> None:
    recording = read_recording(recorded)
    recording.digests.clear()
    told = check(recording)
    assert (told["ok"], told["first_difference_tick"]) == (False, None)
    assert told["why"].startswith("nothing to compare")


def test_a_blind_rerun_ends_in_the_same_world_and_with_the_same_scans(recorded: Path) -> None:
    recording = read_recording(recorded)
    seeing, blind = rerun_of(recording), rerun_of(recording, is_blind=True)
    assert blind.difference is None
    assert blind.compared == seeing.compared
    mine, theirs = seeing.session.world.sight, blind.session.world.sight
    assert any(ranges.any() for ranges in (mine.radar, mine.lidar))
    for name in ("radar", "radar_before", "lidar"):
        np.testing.assert_array_equal(getattr(mine, name), getattr(theirs, name))


def test_what_is_done_from_outside_is_recorded(recorded: Path) -> None:
    acts = [entry for entry in read_recording(recorded).entries if isinstance(entry, Intervention)]
    assert [(act.kind, act.value) for act in acts] == [
        (InterventionKind.FLAG, float(Flag.YELLOW)),
        (InterventionKind.PENALTY, 2.5),
        (InterventionKind.FLAG, float(Flag.GREEN)),
        (InterventionKind.PENALTY, 2.5),
    ]


def test_another_input_shows_at_the_next_digest(recorded: Path) -> None:
    recording = read_recording(recorded)
    at = next(n for n, e in enumerate(recording.entries) if isinstance(e, Inputs) and e.tick > 150)
    entry = recording.entries[at]
    assert isinstance(entry, Inputs)
    recording.entries[at] = replace(entry, controls=np.zeros_like(entry.controls))
    difference = rerun_of(recording).difference
    assert difference is not None
    assert 0 <= difference.tick - entry.tick <= 60


@pytest.mark.parametrize("share", [0.3, 0.51, 0.77, 0.999])
def test_a_recording_cut_anywhere_replays_to_its_last_whole_chunk(
    recorded: Path, tmp_path: Path, share: float
) -> None:
    data = recorded.read_bytes()
    path = tmp_path / "cut.mcap"
    path.write_bytes(data[: int(share * len(data))])
    recording = read_recording(path)
    assert rerun_of(recording).difference is None
    assert recording.last_tick > 0


def test_a_recording_without_its_beginning_makes_no_race(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(recorded.read_bytes()[:200])
    with pytest.raises(RecordingError, match="beginning of a race"):
        read_recording(path)


def place_in_a_chunk(data: bytes) -> int:
    """Return a place past the middle of a file that a check sum covers; indexes have none."""
    at = 8  # after the magic bytes come records: what it is, its length, its content
    while data[at] != 0x06 or at < len(data) // 2:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    return at + int.from_bytes(data[at + 1 : at + 9], "little") // 2


def test_damage_in_the_middle_ends_the_recording_there(recorded: Path, tmp_path: Path) -> None:
    data = bytearray(recorded.read_bytes())
    data[place_in_a_chunk(data)] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    recording = read_recording(path)
    assert recording.is_torn
    assert not recording.is_complete
    assert rerun_of(recording).difference is None


def test_a_file_that_is_no_recording_says_so(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_text("hello")
    with pytest.raises(RecordingError, match="is no recording"):
        read_recording(path)
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(tmp_path / "nowhere.mcap")


def test_a_setting_comes_back_whole() -> None:
    text, arrays = pack_scenario(scenario())
    back = unpack_scenario(text, arrays)
    assert replace(back, course=SMALL_RING) == scenario()
    assert np.array_equal(back.course.line, SMALL_RING.line)
    with pytest.raises(RecordingError, match="cannot be read"):
        unpack_scenario(text, arrays[:-40])


def test_a_killed_race_goes_on_and_keeps_its_laps(recorded: Path, tmp_path: Path) -> None:
    data = recorded.read_bytes()
    (tmp_path / "cup.journal.mcap").write_bytes(data[: int(0.8 * len(data))])
    results = tmp_path / "results.sqlite"
    with logbook(tmp_path) as book, Writer(Store(results), print) as writer:
        recording = book.unfinished()
        assert recording is not None
        keeper = Keeper(writer)
        session, events = restore_session(recording, keeper)
        assert session.tick == recording.last_tick
        with ServerLink(free_address(), "cup", 3) as link:
            server = RaceServer(session, link, LOCKSTEP, DRIVERS, keeper, book)
            outcome = server.resume(recording, events)
        assert book.unfinished() is None
    before = {(seat, number): us for seat, number, us, _ in recording.laps}
    assert len(before) >= 3
    after = {(r["seat"], r["lap"]): r["time_us"] for r in all_laps(results)}
    assert before.items() <= after.items()
    assert len(races(results)) == 1
    assert all(len(row.lap_times_us) == 2 for row in outcome.standings)
    (path,) = tmp_path.glob("cup-*.mcap")
    rerun = rerun_of(read_recording(path))
    assert rerun.difference is None
    assert rerun.session.digest() == outcome.digest


def test_an_exception_in_a_race_leaves_a_journal_that_is_resumed(tmp_path: Path) -> None:
    session, address = Session("cup", scenario()), free_address()
    with logbook(tmp_path) as book, ServerLink(address, "cup", 3) as link:
        advance, ticks = session.advance, iter(range(100))
        session.advance = lambda count=1: (next(ticks), advance(count))[1]  # type: ignore[method-assign]
        with pytest.raises(StopIteration):
            RaceServer(session, link, LOCKSTEP, DRIVERS, logbook=book).run(0)
    with logbook(tmp_path) as book:
        recording = book.unfinished()
        assert recording is not None
        assert not recording.is_complete
        resumed, _ = restore_session(recording, None)
    assert resumed.digest() == session.digest()


def test_two_servers_of_one_name_write_two_journals(tmp_path: Path) -> None:
    with logbook(tmp_path) as first, logbook(tmp_path) as second:
        assert first.journal != second.journal


def test_an_unreadable_journal_is_put_aside(tmp_path: Path) -> None:
    (tmp_path / "cup.journal.mcap").write_text("rubbish")
    said: list[str] = []
    with Logbook(tmp_path, "cup", said.append) as book:
        assert book.unfinished() is None
    assert "is no recording" in said[0]
    assert (tmp_path / "cup.journal.unreadable.mcap").exists()


def test_a_journal_that_is_put_aside_takes_the_place_of_no_other(tmp_path: Path) -> None:
    journal = tmp_path / "cup.journal.mcap"
    for race in (b"one", b"two", b"three"):
        for put_aside in (lambda book: book.put_aside("old"), Logbook.unfinished):
            journal.write_bytes(race)
            with Logbook(tmp_path, "cup", lambda _: None) as book:
                put_aside(book)
    for word in ("aside", "unreadable"):
        found = {path.name: path.read_bytes() for path in tmp_path.glob(f"*{word}*.mcap")}
        assert found == {
            f"cup.journal.{word}.mcap": b"one",
            f"cup.journal.{word}-2.mcap": b"two",
            f"cup.journal.{word}-3.mcap": b"three",
        }


def test_any_reader_of_mcap_finds_channels_with_their_schemas(recorded: Path) -> None:
    with recorded.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {channel.topic: channel for channel in summary.channels.values()}
    snapshot = summary.schemas[topics["race/cup/out/snapshot"].schema_id]
    assert snapshot.name == "race.spectate.Snapshot"
    assert snapshot.data[4:8] == b"BFBS"
    assert summary.schemas[topics["race/cup/scene"].schema_id].name == "foxglove.SceneUpdate"


def test_the_commands_tell_of_a_recording(recorded: Path, tmp_path: Path) -> None:
    run = CliRunner().invoke
    told = json.loads(run(app, ["replay", str(recorded), "--json"]).stdout)
    assert told["ok"]
    assert told["is_complete"]
    info = json.loads(run(app, ["recording", "info", str(recorded), "--json"]).stdout)
    assert info["drivers"] == {"0": "pure_pursuit", "1": "avoider", "2": "pure_pursuit"}
    assert len(info["laps"]) == 6
    lines = run(app, ["recording", "cat", str(recorded), "--json", "--channel", "laps"]).stdout
    assert [json.loads(line)["lap"] for line in lines.splitlines()].count(2) == 3
    narrow = run(app, ["recording", "info", str(recorded)], env={"COLUMNS": "40"}).stdout
    assert info["started_at"] in "".join(line.strip() for line in narrow.splitlines())
    assert narrow.count("pure_pursuit") == 2
    part = tmp_path / "part.mcap"
    run(app, ["recording", "cut", str(recorded), str(part), "--until", "3"])
    assert rerun_of(read_recording(part)).compared == 2
    shutil.copy(recorded, tmp_path / "copy.mcap")
    shown = run(app, ["replay", str(tmp_path / "copy.mcap"), "--play", "--speed", "1000"])
    assert "finishes" in shown.stdout
    both = run(app, ["replay", str(part), "--play", "--json"])
    assert both.stdout == ""
    assert "leave one of them out" in str(both.exception)


GUARD = """
import os, signal, sys
from race_server.live.server.supervisor import supervised
most = int(sys.argv[1])
def work(past):
    assert past.failures == (0 if sys.argv[2] == "kill" else past.ended)
    if past.ended < most:
        if sys.argv[2] == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        raise ValueError("driver \\x1b[2J")
    return 7
sys.exit(supervised(work, lambda text: print(text, flush=True)))
"""


@pytest.mark.parametrize(("kills", "status", "said"), [(2, 7, "again"), (99, 1, "in a row")])
@pytest.mark.parametrize("how", ["kill", "raise"])
def test_a_guard_starts_again_what_was_killed_or_failed_but_not_for_ever(
    kills: int, status: int, said: str, how: str
) -> None:
    # Forking wants a process without threads.
    command = [sys.executable, "-c", GUARD, str(kills), how]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == status
    assert said in done.stdout.splitlines()[-1]
    assert ("SIGKILL" if how == "kill" else "an exception") in done.stdout
    assert done.stderr.count("ValueError: driver \N{REPLACEMENT CHARACTER}[2J") == (
        0 if how == "kill" else min(kills, 5)
    )
