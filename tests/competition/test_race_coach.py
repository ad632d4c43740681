"""The coach of a race that is on, fed with the messages that spectators receive."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_server.coaching.lesson import Coach
from race_server.competition.live_coach import RaceCoach, Said
from race_server.core.messages import Cleanness, Event, EventKind, Flag, Phase, Standing, Status
from race_server.core.vehicle_presets import vehicle_named
from race_server.net.wire import topics
from race_server.net.wire.spectate import (
    HAZARD,
    KART,
    SnapshotFrame,
    SnapshotWriter,
    StandingsFrame,
    encode_events,
    encode_standings,
)
from race_server.net.wire.topics import Topic
from race_server.scenario.track.load import load_course

LAPS = 2
ADA = Standing(0, "Ada", 1, 0, Status.RACING, 0, 0, 0, 0, 0, 0, 0)
TABLE = StandingsFrame(1, 0, 0, Phase.RUNNING, Flag.GREEN, LAPS, "Hangar", (ADA,))
WRITER = SnapshotWriter()
Message = tuple[Topic, bytes]


@pytest.fixture(scope="module")
def coach() -> Coach:
    return Coach(load_course("hangar-400"), vehicle_named("kart-60"), solve=True)


def table(**changes: object) -> Message:
    return topics.STANDINGS, encode_standings(replace(TABLE, **changes))  # type: ignore[arg-type]


def snapshot(coach: Coach, tick: int, slower: float, epoch: int = 1) -> Message:
    """Return a kart on the limit's lap, that takes longer for each part of it by a share."""
    lap, row = coach.limit, np.zeros(1, KART)
    seconds = tick / 60.0 / (1.0 + slower)
    along = float(np.interp(seconds % lap.time[-1], lap.time, lap.progress))
    row["status"], row["progress"] = Status.RACING, along
    row["x"], row["y"] = lap.at(lap.x, along), lap.at(lap.y, along)
    row["speed"] = lap.at(lap.speed, along) / (1.0 + slower)
    frame = SnapshotFrame(
        *(0, epoch, tick, 0.0, Phase.RUNNING, Flag.GREEN, row),
        *(np.zeros(0, np.uint8), np.zeros(0, HAZARD)),
    )
    return topics.SNAPSHOT, WRITER.write(frame)


def lap_event(coach: Coach, number: int, slower: float) -> Message:
    lap_s = float(coach.limit.time[-1]) * (1.0 + slower)
    event = Event(
        *(number, math.floor(60.0 * number * lap_s), EventKind.LAP, 0),
        *(number, round(1e6 * lap_s), Cleanness.CLEAN),
    )
    return topics.EVENTS, encode_events(1, [event])


def raced(coach: Coach, slower: float = 0.0) -> tuple[RaceCoach, list[Said]]:
    """Return a coach that saw two laps, and what it said."""
    race = RaceCoach([coach])
    messages = [table()]
    ends = int(60.0 * LAPS * coach.limit.time[-1] * (1.0 + slower)) + 6
    messages += [snapshot(coach, tick, slower) for tick in range(ends)]
    messages += [lap_event(coach, number, slower) for number in (1, 2)]
    return race, [said for message in messages for said in race.receive(*message)]


def test_who_drives_the_limit_is_told_that_nothing_was_wrong(coach: Coach) -> None:
    race, (first, second) = raced(coach)
    assert (first.driver, first.hint.lap, first.words) == ("Ada", 1, "from the start")
    assert (second.driver, second.hint.lap, second.words) == ("Ada", 2, "")
    assert (first.hint.behind_us, first.hint.reason) == (None, "from the start")
    assert second.hint.behind_us == pytest.approx(0, abs=1000)
    assert not race.is_over


def test_a_coach_ends_with_its_race_though_the_next_one_begins_at_once(coach: Coach) -> None:
    race, _ = raced(coach, slower=0.1)
    for message in (
        table(phase=Phase.FINISHED),
        table(phase=Phase.LOBBY, rows=()),
        table(epoch=2, rows=(replace(ADA, driver="Ben"),)),
        snapshot(coach, 0, 0.0, epoch=2),
    ):
        assert not list(race.receive(*message))
    assert race.is_over
    (lesson,) = race.lessons().values()
    assert lesson.driver == "Ada"
    assert [one.number for one in lesson.laps] == [1, 2]


def test_a_race_that_begins_again_without_an_end_keeps_what_was_seen(coach: Coach) -> None:
    race, _ = raced(coach)
    assert not list(race.receive(*table(epoch=2)))
    assert race.is_over
    assert len(race.lessons()) == 1


def test_a_coach_that_comes_after_the_end_waits_for_the_next_race(coach: Coach) -> None:
    race = RaceCoach([coach])
    assert not list(race.receive(*table(phase=Phase.FINISHED)))
    assert not race.is_over
    assert race.lessons() == {}


def test_a_damaged_message_is_nothing_to_say(coach: Coach) -> None:
    race, _ = raced(coach)
    for topic in (topics.SNAPSHOT, topics.EVENTS, topics.STANDINGS):
        assert not list(race.receive(topic, b"\x00" * 40))
    assert len(race.lessons()) == 1
