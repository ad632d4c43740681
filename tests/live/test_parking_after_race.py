"""A kart that has finished a race parks on request: a whole session, recorded and replayed."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from race_server.competition.launch import free_address
from race_server.core import codes
from race_server.core.messages import Ending, Event, EventKind, Status
from race_server.core.vehicle_presets import KART_60, TT02
from race_server.live.server import LOCKSTEP, RaceResult, RaceServer
from race_server.live.server.hud import hud_of
from race_server.net.transport import ServerLink
from race_server.net.wire.admin import Decision
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.load import load_course
from race_server.scenario.track.lot import Lot
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import read_recording
from race_server.storage.recording.rerun import Rerun
from support.lots import Beeline

pytestmark = pytest.mark.live

TOKEN = "steward one"


@pytest.fixture
def result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> RaceResult:
    """A lap of the oval by one car, which is told to park where it stands after its finish."""
    monkeypatch.setattr("race_server.live.server.wheels.driver_named", lambda _: Beeline())
    course = load_course("oval")
    lot = Lot(np.array([(1.5, -1.5, 0.0, 1.0, 0.8)]), level="goal")
    rules = Rules(laps=1, countdown_s=0.5, items=False, limit_s=120.0)
    scenario = Scenario(replace(course, lot=lot), 1, (TT02,), rules)
    session = Session("lap", scenario)
    with ServerLink(free_address(), "lap", 1) as link, Logbook(tmp_path, "lap", print) as book:
        server = RaceServer(session, link, LOCKSTEP, ("pure_pursuit",), logbook=book, token=TOKEN)
        _ask(server, when=request.param)
        outcome = server.run(0)
    assert outcome is not None
    return outcome


def _ask(
    server: RaceServer, *, when: Callable[[Session], bool], seats: Sequence[int] = (0,)
) -> None:
    """Let the steward ask for cars to be parked as soon as a condition holds."""
    session, advance, steward = server.session, server.session.advance, server._steward
    asked: list[bool] = []

    def advance_and_park(ticks: int = 1) -> list[Event]:
        events = advance(ticks)
        if not asked and when(session):
            asked.append(True)
            for seat in seats:
                steward.decide(Decision(TOKEN, "park", seat, -1.0, steward.challenge))
        return events

    session.advance = advance_and_park  # type: ignore[method-assign]


def _races(session: Session) -> bool:
    return session.tick > 60


@pytest.mark.parametrize("result", [_races], indirect=True)
def test_a_car_that_was_asked_during_its_race_finishes_it_and_parks(
    result: RaceResult, tmp_path: Path
) -> None:
    (row,) = result.standings
    assert (row.status, row.laps) == (Status.FINISHED, 1)
    assert row.parking is not None
    assert (row.parking.ending, row.parking.slot) == (Ending.PARKED, 0)
    kinds = [event.kind for event in result.events]
    assert kinds.index(EventKind.FINISH) < kinds.index(EventKind.PARKED)
    (path,) = tmp_path.glob("*.mcap")
    rerun = Rerun(read_recording(path))
    assert sum(map(len, rerun.run())) > 0
    assert rerun.difference is None
    assert rerun.session.digest() == result.digest
    assert int(rerun.session.world.bodies["status"][0, 0]) == codes.FINISHED


def test_the_valet_drives_two_karts_from_the_finish_to_slots_of_the_paddock(tmp_path: Path) -> None:
    rules = Rules(laps=1, countdown_s=0.5, items=False, limit_s=180.0)
    scenario = Scenario(load_course("paddock-280"), 2, (KART_60,), rules)
    session = Session("lap", scenario)
    with ServerLink(free_address(), "lap", 1) as link:
        server = RaceServer(session, link, LOCKSTEP, ("pure_pursuit",) * 2, token=TOKEN)
        _ask(server, when=_races, seats=(0, 1))
        outcome = server.run(0)
    assert outcome is not None
    ways = [row.parking for row in outcome.standings]
    assert [way.ending for way in ways if way is not None] == [Ending.PARKED] * 2
    assert outcome.refused == {}


def test_a_real_kart_is_told_to_stop_at_the_finish_unless_it_goes_to_a_slot() -> None:
    lot = Lot(np.array([(1.5, -1.5, 0.0, 1.0, 0.8)]), level="goal")
    course = replace(load_course("oval"), lot=lot)
    session = Session("lap", Scenario(course, 1, (TT02,), Rules(laps=1)))
    session.join("real", "track", tracked=True)
    session.start()
    body, parker = session.world.bodies[0, 0], session.world.parking.parkers[0, 0]
    body.status, body.speed_cap = codes.FINISHED, 5.0
    assert hud_of(session, session.seats[0]).speed_cap == 0.0
    parker.length = 1.0  # it was given a slot
    assert hud_of(session, session.seats[0]).speed_cap == 5.0
    parker.parked_tick = 600
    assert hud_of(session, session.seats[0]).speed_cap == 0.0
