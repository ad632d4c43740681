"""A kart that has finished a race parks on request: a whole session, recorded and replayed."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from race_server.competition.launch import free_address
from race_server.core import codes
from race_server.core.driven import are_driven
from race_server.core.messages import Control, Ending, Event, EventKind, Status
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder
from race_server.core.vehicle_presets import KART_60, TT02
from race_server.errors import SeatError
from race_server.live.local_drivers import LocalDrivers
from race_server.live.server import LOCKSTEP, RaceResult, RaceServer
from race_server.live.server.counters import Counters
from race_server.live.server.hud import hud_of
from race_server.live.server.steward import Steward
from race_server.live.server.warm_up import warm_up
from race_server.live.server.wheels import Wheels
from race_server.live.suspects import Suspects
from race_server.net.transport import ServerLink
from race_server.net.wire.admin import Decision
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.load import load_course
from race_server.scenario.track.lot import Lot
from race_server.session.parking import goes_to_slot
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import read_recording
from race_server.storage.recording.rerun import Rerun
from support.lots import Beeline, lot_session, open_lot

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


class Faulty(Beeline):
    """Raises an error whenever it is asked."""

    def act(self, observation: Observation) -> Control:
        raise ValueError("out of order")


def home_car(
    monkeypatch: pytest.MonkeyPatch, valet: type[Beeline]
) -> tuple[Session, Wheels, list[Beeline]]:
    """Return a session in which a car is home, with two slots; also every valet that is made."""
    made: list[Beeline] = []

    def make(_: str) -> Beeline:
        made.append(valet())
        return made[-1]

    monkeypatch.setattr("race_server.live.server.wheels.driver_named", make)
    slots = np.array([(1.5, -1.5, 0.0, 1.0, 0.8), (3.5, -1.5, 0.0, 1.0, 0.8)])
    course = replace(load_course("oval"), lot=Lot(slots, level="goal"))
    session = Session("lap", Scenario(course, 1, (TT02,), Rules(laps=1, countdown_s=0.0)))
    session.join("one", "track")
    session.start()
    session.advance(1)
    session.world.bodies[0, 0].status = codes.FINISHED
    return session, wheels_of(session), made


def wheels_of(session: Session) -> Wheels:
    suspects = Suspects()
    drivers, counters = LocalDrivers(session, suspects), Counters(len(session.seats))
    return Wheels(session, drivers, counters, suspects, "valet")


def decide(session: Session, wheels: Wheels, times: int = 1) -> None:
    for _ in range(times):
        wheels.drive(lambda *_: None)
        session.advance(1)


def test_a_second_order_after_the_finish_leads_to_the_other_slot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    session, wheels, made = home_car(monkeypatch, Beeline)
    wheels.park(0, 0)
    decide(session, wheels)
    wheels.park(0, 1)
    decide(session, wheels)
    assert [valet.orders[-1].slot.x for valet in made] == [1.5, 3.5]


def test_who_takes_the_wheel_back_after_the_finish_keeps_it_until_the_next_order(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    session, wheels, _ = home_car(monkeypatch, Beeline)
    wheels.park(0)
    wheels.release(0)
    decide(session, wheels, 5)
    assert not session.seats[0].is_led
    wheels.park(0)
    assert session.seats[0].is_led


def test_a_request_to_park_may_be_taken_back_before_the_finish(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    session, wheels, _ = home_car(monkeypatch, Beeline)
    session.world.bodies[0, 0].status = codes.RACING
    wheels.park(0)
    assert goes_to_slot(session.world, 0)
    wheels.release(0)
    assert not goes_to_slot(session.world, 0)  # and no order is sent
    session.world.bodies[0, 0].status = codes.FINISHED
    decide(session, wheels, 5)
    assert not are_driven(session.world)[0]
    assert not session.seats[0].is_led


def test_a_parking_driver_that_raises_after_the_finish_is_asked_once_and_the_race_may_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    session, wheels, made = home_car(monkeypatch, Faulty)
    wheels.park(0)
    decide(session, wheels, 5)
    assert len(made) == 1
    assert not are_driven(session.world)[0]


def test_a_parked_kart_is_not_led_any_more_and_not_parked_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    session, wheels, _ = home_car(monkeypatch, Faulty)
    wheels.park(0)
    session.world.parking.parkers[0, 0].parked_tick = session.tick
    decide(session, wheels, 5)  # its driver, which would raise, is not asked
    assert session.seats[0].is_led
    assert goes_to_slot(session.world, 0)
    with pytest.raises(SeatError, match="the vehicle of seat 0 does not drive now"):
        wheels.park(0)


class Stubborn(Beeline):
    """Raises an error at its second order."""

    def park(self, order: ParkingOrder) -> None:
        super().park(order)
        if len(self.orders) > 1:
            raise ValueError("one is enough")


def test_a_driver_inside_that_raises_at_an_order_is_out_and_the_session_goes_on() -> None:
    session = lot_session(open_lot(2), 1)
    wheels = wheels_of(session)
    wheels._local_drivers.admit("stubborn", Stubborn(), 0)
    session.start()
    session.advance(1)
    with pytest.raises(SeatError, match="driver 'stubborn' raised ValueError: one is enough"):
        wheels.park(0)
    decide(session, wheels, 2)
    assert not session.seats[0].is_present


def test_what_parks_after_a_race_is_asked_before_it_so_that_no_tick_waits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    valet = Beeline()
    monkeypatch.setattr("race_server.live.server.warm_up.driver_named", lambda _: valet)
    session, _, _ = home_car(monkeypatch, Beeline)
    warm_up(session.scenario, ("valet",))
    assert [order.slot.x for order in valet.orders] == [1.5]


def test_all_are_told_to_park_but_those_for_whom_no_slot_is_free(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _, wheels, _ = home_car(monkeypatch, Beeline)
    session = Session("lap", replace(wheels._session.scenario, karts=3))
    for name in ("ada", "bea", "cleo"):
        session.join(name, "track")
    session.start()
    session.advance(1)
    session.world.bodies[0, 0].status = codes.FINISHED  # one is home, two race on
    wheels = wheels_of(session)
    steward = Steward(session, TOKEN, park=wheels.park)
    steward.decide(Decision(TOKEN, "park", -1, -1.0, steward.challenge))
    assert steward.lines[-1].endswith("seats 0, 1 park; not seat 2: no slot is free here")
    assert session.world.parking.parkers["slot"][0].tolist()[:2] == [0, 1]
    session.world.bodies[0, 1].status = codes.RETIRED  # its slot is free again
    steward.decide(Decision(TOKEN, "park", 2, -1.0, steward.challenge))
    assert steward.lines[-1].endswith("seat 2 parks")


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
