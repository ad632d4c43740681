"""Laps of recorded races."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from race_server.coaching.circumstances import Circumstances
from race_server.competition import recorded_laps as laps_of_recordings
from race_server.competition.lap_witness import gaps_ahead, gaps_behind
from race_server.competition.launch import free_address
from race_server.competition.recorded_laps import recorded_laps
from race_server.competition.time_trial.lap import BRAKE, PROGRESS, SPEED, THROTTLE, TIME
from race_server.core.messages import Event, EventKind
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.net.transport import ServerLink
from race_server.scenario.race import Rules, Scenario
from race_server.session.journal_entries import Inputs
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording, read_recording
from race_server.storage.recording.rerun import Rerun
from support.courses import SMALL_RING

DRIVERS = ("pure_pursuit", "avoider")


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A race of two drivers over two laps."""
    folder = tmp_path_factory.mktemp("recordings")
    rules = Rules(laps=2, countdown_s=0.5, items=False)
    session = Session("cup", Scenario(SMALL_RING, karts=2, seed=5, rules=rules))
    with (
        Logbook(folder, "cup", print) as book,
        ServerLink(free_address(), "cup", 2) as link,
    ):
        assert RaceServer(session, link, LOCKSTEP, DRIVERS, logbook=book).run(0) is not None
    (path,) = folder.glob("*.mcap")
    return read_recording(path)


@pytest.mark.live
def test_laps_of_a_recorded_race_have_their_recorded_times_and_their_traces(
    recording: Recording,
) -> None:
    found = recorded_laps(recording)

    assert found.remark == ""
    told = {(seat, number): time_us for seat, number, time_us, _ in recording.laps}
    assert {(one.seat, one.lap.number): one.lap.time_us for one in found.laps} == told
    assert len(told) == 4
    for one in found.laps:
        trace = one.lap.trace
        assert one.driver == DRIVERS[one.seat]
        assert one.circumstances.is_flying == (one.lap.number == 2)
        assert trace[PROGRESS, [0, -1]] == pytest.approx([0.0, SMALL_RING.length])
        assert trace[TIME, -1] == pytest.approx(one.lap.time_s)
        assert trace[[THROTTLE, BRAKE]].max() > 0.0
        # The first sample behind the line is as far from it as the kart came since.
        driven = trace[SPEED, 1] * trace[TIME, 1]
        assert one.lap.number == 1 or trace[PROGRESS, 1] == pytest.approx(driven, abs=0.03)


@pytest.mark.live
@pytest.mark.parametrize(("first", "second"), [(0, 1), (1, 0)])
def test_a_contact_is_one_of_both_karts(
    recording: Recording, monkeypatch: pytest.MonkeyPatch, first: int, second: int
) -> None:
    class Touching(Rerun):
        """The race as it was, with a contact at its begin."""

        def run(self, most_ticks: int = 60) -> Iterator[list[Event]]:
            touch = [Event(0, 1, EventKind.CONTACT_KART, first, second, 1000)]
            for events in super().run(most_ticks):
                yield touch + events
                touch = []

    monkeypatch.setattr(laps_of_recordings, "Rerun", Touching)
    contacts = {
        (one.seat, one.lap.number): one.circumstances.contacts
        for one in recorded_laps(recording).laps
    }
    assert contacts == {(0, 1): 1, (0, 2): 0, (1, 1): 1, (1, 2): 0}


@pytest.mark.live
def test_the_time_under_a_boost_counts_where_no_event_tells_of_a_hit(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Boosted(Rerun):
        """The race as it was; for a second the first kart is shown with an effect on it."""

        def run(self, most_ticks: int = 60) -> Iterator[list[Event]]:
            slot = self.session.world.players["effects"][0, 0, 0:1]
            for events in super().run(most_ticks):
                slot["source"] = 60 < self.session.tick <= 120
                yield events
                slot["source"] = 0

    monkeypatch.setattr(laps_of_recordings, "Rerun", Boosted)
    found = recorded_laps(recording)
    assert found.remark == ""
    told = {(one.seat, one.lap.number): one.circumstances.effect_s for one in found.laps}
    assert told == {(0, 1): pytest.approx(1.0), (0, 2): 0.0, (1, 1): 0.0, (1, 2): 0.0}


def with_inputs_at_every_tick(recording: Recording) -> Recording:
    """Return a recording in which each input is repeated at every tick until the next one."""
    inputs = {entry.tick: entry for entry in recording.entries if isinstance(entry, Inputs)}
    held = [inputs[max(tick for tick in inputs if tick <= now)] for now in range(max(inputs) + 1)]
    repeated = [replace(entry, tick=tick) for tick, entry in enumerate(held)]
    others = [entry for entry in recording.entries if not isinstance(entry, Inputs)]
    return replace(recording, entries=sorted([*others, *repeated], key=lambda entry: entry.tick))


@pytest.mark.live
def test_a_lap_is_the_same_however_often_inputs_came(recording: Recording) -> None:
    every = with_inputs_at_every_tick(recording)
    assert len(every.entries) > 2 * len(recording.entries)
    rarely, often = recorded_laps(recording), recorded_laps(every)
    assert often.remark == ""
    circumstances = [one.circumstances for one in rarely.laps]
    assert any(told.traffic_s > 1.0 for told in circumstances)
    assert [one.circumstances for one in often.laps] == circumstances
    for one, other in zip(rarely.laps, often.laps, strict=True):
        assert one.lap.jerk == other.lap.jerk
        assert one.lap.trace.tolist() == other.lap.trace.tolist()


def test_a_gap_is_the_time_to_where_the_next_kart_ahead_is() -> None:
    progress, speed = np.array([90.0, 5.0, 50.0]), np.array([5.0, 5.0, 10.0])
    racing = np.array([True, True, True])
    # From 90 m to 5 m behind the line it is 15 m; from 5 m to 50 m 45 m; from 50 m to 90 m 40 m.
    assert gaps_ahead(progress, speed, racing, 100.0) == pytest.approx([3.0, 9.0, 4.0])
    # At 10 m/s it is 4 s from 50 m to 90 m; at 5 m/s 3 s over the line, and 9 s to 50 m.
    assert gaps_behind(progress, speed, racing, 100.0) == pytest.approx([4.0, 3.0, 9.0])
    alone = np.array([True, False, False])
    assert gaps_behind(progress, speed, alone, 100.0) == pytest.approx([np.inf] * 3)
    assert gaps_ahead(progress, speed, alone, 100.0) == pytest.approx([np.inf] * 3)


@pytest.mark.parametrize(
    ("circumstances", "reason"),
    [
        (Circumstances(True, True), ""),
        (Circumstances(True, True, caution_s=0.4, traffic_s=0.4), ""),
        (Circumstances(False, True), "from the start"),
        (Circumstances(True, False, contacts=1), "not clean, touched a kart"),
        (Circumstances(True, True, hits=1), "hit by an item"),
        (Circumstances(True, True, effect_s=0.2), "0.2 s under an item's effect"),
        (Circumstances(True, True, traffic_s=3.0), "3.0 s in traffic"),
        (Circumstances(True, True, caution_s=2.5), "2.5 s under a flag"),
    ],
)
def test_a_lap_that_others_decided_is_not_compared(
    circumstances: Circumstances, reason: str
) -> None:
    assert circumstances.reason == reason
