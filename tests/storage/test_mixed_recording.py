"""Recordings of races with real karts: driven again, cut, and taken up after the server died."""

import random
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from race_server.core.messages import Event, EventKind, Flag, Phase, Trust
from race_server.credentials import key_of
from race_server.errors import RecordingError, SeatError, WireError
from race_server.live.server.journal import Journal
from race_server.live.server.publisher import snapshot_of
from race_server.live.server.resume import restore_session
from race_server.net.wire import topics
from race_server.net.wire.placement import PLACED, decode_placements, encode_placements
from race_server.net.wire.spectate import SnapshotWriter
from race_server.scenario.race import Rules, Scenario
from race_server.session.interventions import InterventionKind
from race_server.session.replay_guard import Granted
from race_server.session.session import Session
from race_server.session.tracked.karts import Placements
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording, read_recording
from race_server.storage.recording.rerun import Rerun
from support.tracked import COURSE, TICK_US, Real, drive

STARTED_AT = "2026-01-02T03:04:05.678+00:00"
SECRETS = (11, 12, 13)


def grant(session: Session, secret: int, serial: int) -> None:
    """Record a request as granted, as the server does."""
    key = key_of(secret)
    session.replay_guard.record(key, serial)
    session.journal.add(Granted(session.tick, key, serial))


class Recorded:
    """A race on a ring of a real kart and two simulated ones, written down."""

    def __init__(self, book: Logbook) -> None:
        rules = Rules(laps=1, countdown_s=0.5)
        self.session = Session("cup", Scenario(COURSE, karts=4, rules=rules))
        for number, secret in enumerate(SECRETS):
            self.session.join(f"d{number}", "track", secret=secret, tracked=number == 0)
            grant(self.session, secret, 7)
        self.session.race_control.close_seat(3)
        self.session.start()
        self.book = book
        self.journal = Journal.of_new_race(self.book, self.session, "real", STARTED_AT, ())
        self.real = Real(self.session)
        self.real.speed = 0.0
        self.snapshots = SnapshotWriter()
        self.run(31)
        self.real.speed = 3.0

    def run(self, ticks: int, *, silent: bool = False) -> None:
        """Let ticks pass as the server does."""
        for _ in range(ticks):
            before, seen = self.session.tick, len(self.session.event_log.recent)
            drive(self.session, self.real, 1, silent=silent)
            self.journal.record(before, list(self.session.event_log.recent)[seen:])
            frame = snapshot_of(self.session)
            self.journal.publish(topics.SNAPSHOT, self.snapshots.write(frame))
            if frame.tick % 20 == 0:
                self._wait()  # as in real time, where a chunk holds a few ticks

    def _wait(self) -> None:
        assert self.journal.flush().wait(10.0)

    def kill(self) -> Path:
        """Leave the journal as a server leaves it that was killed a moment later."""
        self._wait()
        path = self.book.journal.with_name("killed.mcap")
        path.write_bytes(self.book.journal.read_bytes())
        return path


@pytest.fixture
def raced(tmp_path: Path) -> Iterator[Recorded]:
    with Logbook(tmp_path, "cup", print) as book:
        race = Recorded(book)
        yield race
        race.journal.close()


def rerun_of(recording: Recording) -> Rerun:
    rerun = Rerun(recording)
    for _ in rerun.run():
        pass
    return rerun


def test_a_race_with_a_real_kart_driven_again_has_equal_digests(raced: Recorded) -> None:
    raced.run(120)
    raced.session.race_control.show_flag(Flag.YELLOW)
    raced.run(60, silent=True)  # doubtful for a while
    raced.run(60)
    raced.journal.close()
    (path,) = raced.book.folder.glob("cup-*.mcap")
    recording = read_recording(path)
    rerun = rerun_of(recording)
    assert rerun.difference is None
    assert rerun.compared == len(recording.digests) == 5
    assert rerun.session.digest() == raced.session.digest()
    trusts = {int(e.rows[0, 1]) for e in recording.entries if isinstance(e, Placements)}
    assert trusts == {Trust.TRUSTED, Trust.DOUBTFUL}


def test_another_place_shows_at_the_next_digest(raced: Recorded) -> None:
    raced.run(120)
    recording = read_recording(raced.kill())
    placed = [n for n, e in enumerate(recording.entries) if isinstance(e, Placements)]
    entry = recording.entries[placed[40]]
    assert isinstance(entry, Placements)
    rows = entry.rows + np.eye(10)[3] * 1e-3  # a millimetre to the east
    recording.entries[placed[40]] = replace(entry, rows=rows)
    difference = rerun_of(recording).difference
    assert difference is not None
    assert 0 < difference.tick - entry.tick <= 60


def test_cut_at_any_byte_it_replays_to_its_last_whole_chunk(raced: Recorded) -> None:
    raced.run(200)
    data, chance = raced.kill().read_bytes(), random.Random(4)
    path = raced.book.folder / "cut.mcap"
    compared = 0
    for _ in range(8):
        path.write_bytes(data[: chance.randrange(len(data) // 2, len(data))])
        rerun = rerun_of(read_recording(path))
        assert rerun.difference is None
        compared += rerun.compared
    assert compared > 0


def test_a_killed_server_takes_up_a_race_with_a_real_kart(raced: Recorded) -> None:
    raced.run(150)
    before = raced.session.tracked_karts.orders(0)
    session, _ = restore_session(read_recording(raced.kill()), None)
    assert session.digest() == raced.session.digest()
    assert session.seats[0].is_tracked
    session.tracked_karts.resume(session.world, 5_000_000)
    orders = session.tracked_karts.orders(0)
    assert orders.sequence > before.sequence
    assert not orders.is_unheard(6_000_000)
    real = raced.real
    real.session = session
    clock_us = 5_000_000 - session.tick * TICK_US  # ours is another than before
    events: list[Event] = []
    for _ in range(40):
        now_us = round(session.tick * TICK_US + clock_us)
        real.angle += real.speed / 10.0 / 60.0
        real.send(real.pose(now_us))
        session.follow(now_us)
        events += session.advance(1)
    assert session.tracked_karts.trackers[0].trust is Trust.TRUSTED
    assert not [event for event in events if event.kind is EventKind.POSE]
    assert session.world.racers["lap_clean"][0, 0] == raced.session.world.racers["lap_clean"][0, 0]


def test_a_real_kart_that_was_out_of_favour_stays_so(raced: Recorded) -> None:
    raced.run(60)
    raced.run(40, silent=True)
    session, _ = restore_session(read_recording(raced.kill()), None)
    session.tracked_karts.resume(session.world, 0)
    assert session.tracked_karts.trackers[0].trust is Trust.DOUBTFUL
    session.follow(2_100_000)
    assert session.tracked_karts.trackers[0].trust is Trust.SUSPENDED


def test_a_real_kart_that_does_not_come_back_is_doubtful_a_second_later(raced: Recorded) -> None:
    raced.run(60)
    session, _ = restore_session(read_recording(raced.kill()), None)
    session.tracked_karts.resume(session.world, 0)
    session.follow(900_000)
    assert session.world.bodies["trust"][0, 0] == Trust.TRUSTED
    session.follow(1_100_000)
    assert session.world.bodies["trust"][0, 0] == Trust.DOUBTFUL


def test_a_real_kart_that_was_home_is_not_missed_after_the_kill(raced: Recorded) -> None:
    raced.run(60)
    raced.session.race_control.intervene(InterventionKind.WITHDRAW, 0)
    raced.run(2)
    session, _ = restore_session(read_recording(raced.kill()), None)
    session.tracked_karts.resume(session.world, 0)
    session.follow(30_000_000)
    assert session.world.bodies["trust"][0, 0] == Trust.TRUSTED
    assert session.world.racers["yellow"][0].sum() == 0


def test_copies_of_what_was_taken_before_the_kill_are_refused_after_it(raced: Recorded) -> None:
    raced.run(150)
    grant(raced.session, SECRETS[1], 9)
    raced.run(1)
    session, _ = restore_session(read_recording(raced.kill()), None)
    real = raced.real
    real.session, real.sequence = session, real.sequence - 1
    with pytest.raises(WireError, match="again"):
        real.send(real.pose(0))
    for secret, serial in zip(SECRETS, (7, 9, 7), strict=True):
        key = session.seats[SECRETS.index(secret)].key
        with pytest.raises(SeatError, match="this is a copy"):
            session.replay_guard.check(key, serial)
        session.replay_guard.check(key, serial + 1)


def test_seats_that_were_closed_and_drivers_sent_away_stay_so(raced: Recorded) -> None:
    raced.run(30)
    raced.session.race_control.exclude(2)
    raced.run(30)
    session, _ = restore_session(read_recording(raced.kill()), None)
    assert session.seats.closed == raced.session.seats.closed
    assert set(session.seats.closed) == {2, 3}
    with pytest.raises(SeatError, match="seat 2 is closed: the steward sent its driver away"):
        session.join("d2", "track", wanted=2, secret=SECRETS[2])
    assert session.join("d1", "track", secret=SECRETS[1]).number == 1


def test_a_clock_that_stood_stands(raced: Recorded) -> None:
    raced.run(30)
    raced.session.race_control.pause()
    raced.journal.record(raced.session.tick, [])
    session, _ = restore_session(read_recording(raced.kill()), None)
    assert session.race_control.is_paused
    assert session.phase is Phase.COUNTDOWN or session.phase is Phase.RUNNING


def test_placements_survive_the_wire_and_nonsense_does_not() -> None:
    rows = np.zeros(2, PLACED)
    rows["x"], rows["seat"], rows["orders"], rows["trust"] = 1.25, (0, 3), 5, Trust.TRUSTED
    tick, back = decode_placements(encode_placements(77, rows))
    assert tick == 77
    assert (back == rows).all()
    for name, value in (("y", np.nan), ("trust", 9), ("fault", 200)):
        bad = rows.copy()
        bad[name] = value
        with pytest.raises(WireError):
            decode_placements(encode_placements(77, bad))


def test_a_kart_that_is_not_in_the_race_cannot_be_placed(raced: Recorded) -> None:
    raced.run(40)
    recording = read_recording(raced.kill())
    at = next(n for n, e in enumerate(recording.entries) if isinstance(e, Placements))
    entry = recording.entries[at]
    assert isinstance(entry, Placements)
    recording.entries[at] = replace(entry, rows=entry.rows + np.eye(10)[0] * 60)
    with pytest.raises(RecordingError, match="seat 60 is not in a race of 4"):
        Rerun(recording)
