"""Copies of recordings are whole or not there, and no recording has a gap."""

import time
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.errors import RecordingError
from race_server.net.wire.journal import StartFrame, decode_digest
from race_server.storage.recording import recorder as recorder_module
from race_server.storage.recording.channels import DIGEST
from race_server.storage.recording.excerpt import write_excerpt
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Line, read_lines
from race_server.storage.recording.recorder import Recorder

START = StartFrame(
    session="cup",
    epoch=1,
    pace="lockstep",
    decision_ticks=3,
    started_at="2026-01-01T00:00:00+00:00",
    versions="{}",
    setting="{}",
    arrays=b"",
    seats=(),
)


def digest_of(tick: int) -> str:
    return f"{tick:032x}"


def digested(path: Path) -> list[int]:
    """Return the ticks whose digests are in a recording."""
    lines = (line for line in read_lines(path) if isinstance(line, Line))
    return [decode_digest(line.data)[0] for line in lines if line.kind is DIGEST]


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A recording with a digest at each of 600 ticks."""
    path = tmp_path / "race.mcap"
    with path.open("wb") as file, Recorder(file, "cup", 10**18, print) as recorder:
        recorder.begin(START)
        for tick in range(600):
            recorder.record_digest(tick, digest_of(tick))
    return path


def test_a_copy_has_all_messages_however_few_may_wait_for_the_disk(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "COPIED_AT_ONCE", 8)
    monkeypatch.setattr(recorder_module, "MOST_WAITING", 10)
    part = tmp_path / "part.mcap"
    assert write_excerpt(recorded, part, 5.0) == 299
    assert digested(part) == list(range(300))


@pytest.mark.parametrize("written", [0, 1])
def test_of_a_copy_that_the_disk_does_not_take_nothing_is_left(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: int
) -> None:
    add, taken = Recorder._add, iter(range(10**6))

    def full(self: Recorder, key: str, at: int, content: recorder_module.Content) -> None:
        if next(taken) == written * 300:
            raise OSError(28, "No space left on device")
        add(self, key, at, content)

    monkeypatch.setattr(Recorder, "_add", full)
    with pytest.raises(RecordingError, match=r"part.mcap cannot be written \(.*No space left"):
        write_excerpt(recorded, tmp_path / "part.mcap", 5.0)
    assert [path.name for path in tmp_path.iterdir()] == ["race.mcap"]


def test_a_copy_takes_the_place_of_no_file(recorded: Path) -> None:
    before = recorded.read_bytes()
    with pytest.raises(RecordingError, match="File exists"):
        write_excerpt(recorded, recorded, 5.0)
    assert recorded.read_bytes() == before


def test_a_race_that_is_over_is_not_written_over_where_its_file_cannot_be_renamed(
    tmp_path: Path,
) -> None:
    said: list[str] = []
    away = tmp_path / "cup-20260101-000000-000.mcap"
    (away / "in the way").mkdir(parents=True)
    with Logbook(tmp_path, "cup", said.append) as book:
        first = book.begin(START)
        assert first is not None
        first.record_digest(7, digest_of(7))
        assert book.end(first, START) == book.journal
        assert book.begin(replace(START, started_at="2026-01-01T00:05:00+00:00")) is None
        assert digested(book.journal) == [7]
        assert "no other race is recorded until it can" in said[-1]
        away.rename(tmp_path / "elsewhere")
        second = book.begin(replace(START, started_at="2026-01-01T00:10:00+00:00"))
        assert second is not None
        second.close()
    assert digested(away) == [7]


def test_a_recording_whose_disk_stops_for_a_while_ends_there_and_has_no_gap(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder_module, "MOST_WAITING", 10)
    path, said = tmp_path / "race.mcap", list[str]()
    with path.open("wb") as file, Recorder(file, "cup", 10**18, said.append) as recorder:
        recorder.begin(START)
        assert recorder.flush().wait(5.0)
        monkeypatch.setattr(recorder._writer, "flush", lambda: time.sleep(0.5))
        for tick in range(30):
            recorder.record_digest(tick, digest_of(tick))
        assert recorder.flush().wait(5.0)
        recorder.record_digest(30, digest_of(30))
    assert digested(path) == list(range(10))
    (line,) = said
    assert line.endswith("(10 messages wait for the disk). The race goes on without it")
