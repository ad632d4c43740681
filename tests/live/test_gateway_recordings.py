"""Recordings that a gateway lists, opens and plays."""

import asyncio
import json
import os
from collections.abc import AsyncIterator, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from race_server.competition.launch import free_address
from race_server.errors import GatewayError, RecordingError
from race_server.live.gateway.audience import Outbox, Viewer
from race_server.live.gateway.library import Library
from race_server.live.gateway.limits import GatewayLimits, GatewayTiming
from race_server.live.gateway.playback import Player
from race_server.net.wire.line import decode_line
from race_server.net.wire.lobby import decode_course
from race_server.net.wire.spectate import (
    decode_events,
    decode_snapshot,
    decode_standings,
)
from race_server.storage.recording.channels import EVENTS, SNAPSHOTS, STANDINGS
from race_server.storage.recording.reader import read_lines, read_recording
from race_server.storage.recording.recorder import Recorder
from race_server.storage.recording.seekable import SeekableRecording
from support.browsers import Browser
from support.courses import SMALL_RING
from support.served_race import ServedRace, ask, gated, record_race


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_race(tmp_path_factory.mktemp("recordings"))


@pytest.fixture(scope="module")
def served(recording: Path) -> Iterator[ServedRace]:
    """A gateway without a race, before a folder with one recording."""
    with gated(free_address(), recordings=recording.parent) as served:
        yield served


@pytest.mark.live
def test_a_tape_holds_what_the_recording_holds(recording: Path) -> None:
    kinds = (SNAPSHOTS, EVENTS, STANDINGS)
    lines = [line for line in read_lines(recording) if line is not None and line.kind in kinds]
    with SeekableRecording(recording) as opened:
        shown = opened.between(-1, opened.last_tick)
        assert [(m.kind, m.data) for m in shown] == [(line.kind, line.data) for line in lines]
        assert opened.is_finished()
        middle = opened.newest(SNAPSHOTS, opened.last_tick // 2)
        assert middle is not None
        assert decode_snapshot(middle.data).tick == middle.tick <= opened.last_tick // 2
        assert opened.newest(STANDINGS, -5) is None


@pytest.mark.live
def test_a_tape_that_was_cut_short_ends_with_its_last_whole_chunk(
    recording: Path, tmp_path: Path
) -> None:
    data = recording.read_bytes()
    short = tmp_path / "short.mcap"
    short.write_bytes(data[: len(data) * 2 // 3])
    with SeekableRecording(short) as opened, SeekableRecording(recording) as whole:
        assert 0 < opened.last_tick < whole.last_tick
        assert not opened.is_finished()
    for damaged in (b"", b"rubbish" * 50, data[:300]):
        short.write_bytes(damaged)
        with pytest.raises(RecordingError, match=r"short.mcap"):
            SeekableRecording(short)


@pytest.mark.live
def test_only_recordings_of_the_folder_are_listed_and_opened(
    recording: Path, tmp_path: Path
) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside.mcap"
    inside.mkdir()
    data = recording.read_bytes()
    outside.write_bytes(data)
    (inside / "cup.mcap").write_bytes(data)
    (inside / "cup.journal.mcap").write_bytes(data)
    (inside / "rubbish.mcap").write_bytes(b"rubbish")
    (inside / "link.mcap").symlink_to(outside)
    library = Library(inside, GatewayLimits())
    assert [(title["name"], title["karts"]) for title in library.titles()] == [("cup", 3)]
    opened, events = library.open("cup")
    # The first event of a race, its countdown, comes before the recording begins.
    assert [event.sequence for event in events] == list(range(2, len(events) + 2))
    opened.close()
    names = ("../outside", "link", "cup.journal", "", ".", "cup.mcap", str(outside), "rubbish")
    for name in names:
        with pytest.raises(GatewayError) as caught:
            library.open(name)
        assert caught.value.code == "no-recording"
    assert Library(None, GatewayLimits()).titles() == []
    assert Library(tmp_path / "nowhere", GatewayLimits()).titles() == []


def forged(path: Path, honest: Path, setting: str) -> None:
    """Write a recording that begins as another one, with another setting."""
    with path.open("wb") as file:
        recorder = Recorder(file, "cup", 10**18, print)
        recorder.begin(replace(read_recording(honest).start, setting=setting))
        recorder.record_digest(0, "digest")
        recorder.close()


@pytest.mark.live
def test_a_recording_with_a_name_or_a_setting_that_is_no_text_takes_the_list_from_none(
    recording: Path, tmp_path: Path
) -> None:
    for name in (b"cup.mcap", b"ete\xe9.mcap"):
        (tmp_path / os.fsdecode(name)).write_bytes(recording.read_bytes())
    forged(tmp_path / "half.mcap", recording, r'{"course": {"name": "x\ud800"}}')
    forged(tmp_path / "deep.mcap", recording, "[" * 200_000)
    with gated(free_address(), recordings=tmp_path) as served:
        status, _, text = ask(served, "recordings")
    assert status == 200
    courses = {title["name"]: title["course"] for title in json.loads(text)}
    assert courses == {"cup": SMALL_RING.name, "half": "x\N{REPLACEMENT CHARACTER}"}


@pytest.mark.live
def test_a_recording_that_vanishes_while_the_list_is_made_is_left_out(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cup.mcap").write_bytes(recording.read_bytes())
    paths = [tmp_path / "gone.mcap", *tmp_path.iterdir()]
    monkeypatch.setattr(Path, "iterdir", lambda _: iter(paths))
    monkeypatch.setattr(Path, "is_file", lambda _: True)
    library = Library(tmp_path, GatewayLimits())
    assert [title["name"] for title in library.titles()] == ["cup"]
    with pytest.raises(GatewayError, match="no recording is called"):
        library.open("gone")


@pytest.mark.live
def test_a_recording_is_played_sought_and_stepped(served: ServedRace, recording: Path) -> None:
    source = {"source": f"recording:{recording.stem}", "rate": 60}
    with Browser(served.base, source) as browser:
        assert browser.word("welcome")["session"] == "cup"
        assert decode_course(browser.frame(b"RCRS")).name == "ring"
        assert decode_line(browser.frame(b"RLIN")).lap == 0.0
        begin = browser.word("position")
        assert (begin["tick"], begin["playing"], begin["sought"]) == (0, False, True)
        last = begin["last"]
        browser.send({"type": "seek", "tick": last // 2})
        assert browser.word("position")["tick"] == last // 2
        assert decode_standings(browser.frame(b"RSTD")).tick <= last // 2
        _, events = decode_events(browser.frame(b"REVT"))
        assert events[0].sequence == 2
        assert max(event.tick for event in events) <= last // 2
        snapshot = decode_snapshot(browser.frame(b"RSNP"))
        assert 0 <= last // 2 - snapshot.tick < 3
        browser.send({"type": "step", "ticks": -30})
        assert browser.word("position")["tick"] == last // 2 - 30
        earlier = decode_snapshot(browser.frame(b"RSNP")).tick
        assert earlier < snapshot.tick
        browser.send({"type": "follow", "seat": 1, "rays": True})
        assert browser.frame(b"RRAY")
        browser.send({"type": "play", "speed": 8})
        ticks = [decode_snapshot(browser.frame(b"RSNP")).tick for _ in range(5)]
        assert ticks == sorted(ticks)
        assert ticks[0] > earlier
        browser.send({"type": "seek", "tick": last - 30})
        end = browser.until(lambda h: isinstance(h, dict) and h.get("tick") == last)
        assert not end["playing"]


class Line:
    """A connection that can be cut for a while."""

    def __init__(self) -> None:
        self.is_open = self.is_writable = True
        self.on_writable: Callable[[], None] | None = None
        self.sent: list[bytes] = []

    def put(self, frame: bytes) -> None:
        self.sent.append(frame)

    def on_admitted(self) -> None:
        pass

    def go_on(self) -> None:
        self.sent.clear()
        self.is_writable = True
        assert self.on_writable is not None
        self.on_writable()


@asynccontextmanager
async def playing(recording: Path, line: Line) -> AsyncIterator[Player]:
    opened, events = Library(recording.parent, GatewayLimits()).open(recording.stem)
    viewer = Viewer(Outbox(line, GatewayLimits(), unread_s=10.0), rate=60.0)
    with ThreadPoolExecutor(1) as pool:
        player = Player(viewer, opened, events, pool, GatewayTiming())
        task = asyncio.create_task(player.run())
        yield player
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def positions(frames: list[bytes]) -> list[int]:
    texts = [frame[frame.index(b"{") :] for frame in frames if b'"position"' in frame]
    return [json.loads(text)["tick"] for text in texts]


@pytest.mark.live
def test_nothing_of_the_place_before_comes_after_a_seek_on_a_slow_line(recording: Path) -> None:
    async def play() -> list[bytes]:
        line = Line()
        async with playing(recording, line) as player:
            player.handle({"type": "play", "speed": 4.0})
            await asyncio.sleep(0.5)
            line.is_writable = False
            await asyncio.sleep(0.3)
            player.handle({"type": "pause"})
            player.handle({"type": "seek", "tick": 10})
            await asyncio.sleep(0.3)
            line.go_on()
            return list(line.sent)

    sent = asyncio.run(play())
    assert positions(sent)[-1] == 10
    shown = [frame[frame.index(b"RSNP") - 4 :] for frame in sent if b"RSNP" in frame[:16]]
    assert max(decode_snapshot(data).tick for data in shown) <= 10


@pytest.mark.live
def test_a_step_counts_from_the_place_that_is_sought(recording: Path) -> None:
    async def play() -> list[bytes]:
        line = Line()
        async with playing(recording, line) as player:
            await asyncio.sleep(0.3)
            player.handle({"type": "seek", "tick": 100})
            while player._sought is not None:
                await asyncio.sleep(0)
            player.handle({"type": "step", "ticks": 1})
            await asyncio.sleep(0.3)
            return list(line.sent)

    assert positions(asyncio.run(play()))[-1] == 101


@pytest.mark.live
def test_a_pause_is_confirmed_at_once(served: ServedRace, recording: Path) -> None:
    with Browser(served.base, {"source": f"recording:{recording.stem}", "rate": 60}) as browser:
        browser.word("position")
        browser.send({"type": "play", "speed": 1})
        browser.frame(b"RSNP")
        browser.send({"type": "pause"})
        while browser.word("position")["playing"]:
            pass
        browser.send({"type": "play", "speed": 0.5})
        assert browser.word("position")["playing"]


@pytest.mark.live
def test_words_for_recordings_mean_nothing_to_a_live_race(served: ServedRace) -> None:
    with Browser(served.base, {"role": "spectate"}) as browser:
        browser.send({"type": "seek", "tick": 1})
        assert browser.refusal() == ("malformed", 4400)


@pytest.mark.live
@pytest.mark.parametrize("changed", [{"name": 5}, {"title": "\ud800"}, {"spacing": "wide"}])
def test_a_recording_with_words_of_another_kind_in_its_course_is_refused(
    recording: Path, tmp_path: Path, changed: dict[str, object]
) -> None:
    setting = json.loads(read_recording(recording).start.setting)
    setting["course"] |= changed
    forged(tmp_path / "cup.mcap", recording, json.dumps(setting))
    with (
        gated(free_address(), recordings=tmp_path) as served,
        Browser(served.base, {"source": "recording:cup"}) as browser,
    ):
        assert browser.refusal() == ("no-recording", 4404)
