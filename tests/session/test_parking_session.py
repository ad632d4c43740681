"""The life of a session in a car park, without a network."""

from dataclasses import replace

import pytest

from race_server.core.driver import Driver
from race_server.core.messages import Control, Ending, EventKind, Phase, RayHit
from race_server.core.observation import Observation
from race_server.errors import SeatError
from race_server.scenario.track.lot import Zone
from race_server.session.interventions import InterventionKind
from race_server.session.parking import check_slot, free_slot
from race_server.session.session import Session
from support.lots import Beeline, lot_session, one_slot, open_lot
from support.sessions import session_on_ring

FULL = Control(throttle=1.0)


def started(session: Session) -> Session:
    for seat in session.seats:
        session.join(f"driver {seat.number}", "lot", wanted=seat.number)
        seat.is_ready = True
    session.start()
    return session


def drive(session: Session, control: Control, seconds: float, seat: int = 0) -> None:
    for _ in range(round(20 * seconds)):
        sequence = session.seats[seat].sequence + 1
        session.receive_control(seat, session.epoch, sequence, session.tick, control)
        session.advance(session.decision_ticks)


def let(driver: Driver, session: Session, seconds: float) -> None:
    """Let a driver drive seat 0 until the round is over, at most for some time."""
    for _ in range(round(20 * seconds)):
        session.observe()
        layout = session.layout(driver.preset)
        control = driver.act(Observation(session.tick, layout, session.view(0).copy()))
        drive(session, control, 0.05)
        if not session.is_on:
            return


def ending_of(session: Session, seat: int = 0) -> Ending:
    parking = session.table()[seat].parking
    assert parking is not None
    return parking.ending


def test_vehicles_stand_until_the_lights_are_out() -> None:
    session = started(lot_session(one_slot()))
    drive(session, FULL, 0.45)
    assert session.phase is Phase.COUNTDOWN
    assert session.world.parking.parkers[0, 0].way == 0.0
    drive(session, FULL, 0.55)
    assert session.phase is Phase.RUNNING
    assert session.world.parking.parkers[0, 0].way > 0.1


def test_a_vehicle_that_stands_in_its_slot_has_parked_and_the_session_is_over() -> None:
    session = started(lot_session(one_slot()))
    let(Beeline(), session, 30.0)
    (row,) = session.standings()
    assert session.phase is Phase.FINISHED
    assert row.parking is not None
    assert (row.parking.ending, row.parking.slot, row.parking.moves) == (Ending.PARKED, 0, 0)
    assert row.parking.way == pytest.approx(20.0, abs=0.6)  # the start is 20 m from the slot
    assert row.race_time_us > 10_000_000  # at 2 m/s at most


def test_a_vehicle_at_a_wall_is_out_and_the_rest_goes_on() -> None:
    session = started(lot_session(open_lot(2), 2))
    session.world.bodies["heading"][0, 0] = 3.14159  # the wall is 30 m behind it at most
    for _ in range(20 * 20):
        drive(session, FULL, 0.05)
        if ending_of(session) is not Ending.OPEN:
            break
    assert ending_of(session) is Ending.WALL
    assert ending_of(session, 1) is Ending.OPEN
    assert session.phase is Phase.RUNNING


def test_time_that_runs_out_ends_the_session() -> None:
    session = started(lot_session(one_slot(), limit_s=2.0))
    drive(session, Control(brake=1.0), 2.6)
    assert session.phase is Phase.FINISHED
    assert ending_of(session) is Ending.LATE


def test_a_driver_that_leaves_has_withdrawn() -> None:
    session = started(lot_session(open_lot(2), 2))
    session.leave(1)
    assert ending_of(session, 1) is Ending.WITHDREW


def test_the_seed_decides_the_round_and_each_race_of_a_session_has_the_same() -> None:
    def starts(session: Session) -> list[float]:
        return [float(x) for x in session.world.bodies["x"][0]]

    one, same, other = (started(lot_session(open_lot(3), 3, seed=seed)) for seed in (1, 1, 2))
    assert starts(one) == starts(same) != starts(other)
    before = starts(one)
    one.reopen()
    one.start()
    assert starts(one) == before


def test_the_orders_are_known_in_the_lobby_as_they_are_in_the_round() -> None:
    session = lot_session(open_lot(3), 3)
    slots = [order.slot for order in session.standing_orders]
    started(session)
    parkers = session.world.parking.parkers[0]
    assert [slot.y for slot in slots] == [float(y) for y in parkers["y"]]
    assert len({slot.y for slot in slots}) == 3


def test_a_race_on_a_track_has_no_orders_and_no_figures_of_parking() -> None:
    session = session_on_ring("test", 1)
    assert session.standing_orders == []
    assert session.table()[0].parking is None
    session.join("me", "track")
    with pytest.raises(SeatError, match="there is no car park here; serve one with --lot"):
        session.race_control.park(0)


def test_an_order_sends_a_vehicle_to_another_slot_and_is_in_the_journal() -> None:
    session = started(lot_session(open_lot(3), 2))
    session.journal.is_recorded = True
    slots = {int(parker.slot) for parker in session.world.parking.parkers[0]}
    (free,) = {0, 1, 2} - slots
    session.race_control.park(0, free)
    parker = session.world.parking.parkers[0, 0]
    assert (parker.slot, parker.y) == (free, 10.0 * free)
    (act,) = session.journal.drain()
    assert (act.kind, act.kart, act.value) == (InterventionKind.PARK, 0, free)  # type: ignore[union-attr]
    assert session.seats[0].orders == 1


def test_a_slot_of_another_vehicle_and_one_that_does_not_exist_are_refused() -> None:
    session = started(lot_session(open_lot(2), 2))
    theirs = int(session.world.parking.parkers[0, 1].slot)
    with pytest.raises(SeatError, match=f"slot {theirs} is that of another vehicle"):
        session.race_control.park(0, theirs)
    with pytest.raises(SeatError, match="slot 7 does not exist; choose 0 to 1, or -1"):
        session.race_control.park(0, 7)


def test_a_slot_with_a_car_halfway_in_it_is_taken_and_one_beside_a_car_is_free() -> None:
    world = lot_session(open_lot(3), 1).world
    world.parking.parkers["slot"] = 2
    car = world.parking.blocks[0, 0]
    car.kind, car.half_length, car.half_width = RayHit.KART, 2.0, 1.0
    # Slot 0 reaches from -1.5 to 1.5 m: half of it is under a car whose middle lies outside.
    car.x, car.y = 2.0, 0.0
    assert free_slot(world, 0) == 1
    with pytest.raises(SeatError, match="slot 0 is taken: a vehicle stands there"):
        check_slot(world, 0, 0)
    car.x = 3.46  # 0.04 m over the line
    assert free_slot(world, 0) == 0
    check_slot(world, 0, 0)


def test_a_driver_without_the_wheel_is_heard_but_does_not_drive() -> None:
    session = started(lot_session(one_slot()))
    drive(session, FULL, 0.5)
    session.race_control.hand_wheel(0, to_server=True)
    session.seats[0].lead(Control(brake=1.0), session.tick)
    before = session.seats[0].sequence
    drive(session, FULL, 0.2)
    assert session.seats[0].sequence == before + 4
    assert session.acting(0).tolist() == [0.0, 0.0, 1.0, 0.0]
    session.race_control.hand_wheel(0, to_server=False)
    drive(session, FULL, 0.05)
    assert session.acting(0).tolist() == [0.0, 1.0, 0.0, 0.0]


def test_a_parked_vehicle_is_told_as_an_event_with_its_slot() -> None:
    session = started(lot_session(one_slot()))
    let(Beeline(), session, 30.0)
    told = [event for event in session.event_log.recent if event.kind is EventKind.PARKED]
    assert [(event.kart, event.other) for event in told] == [(0, 0)]


def test_who_stands_in_the_own_slot_from_the_start_on_has_parked_after_no_time() -> None:
    course = one_slot()
    assert course.lot is not None
    there = Zone("start", (0.0, 0.0), (0.0, 0.0))
    course = replace(course, lot=replace(course.lot, zones=(there, *course.lot.zones[1:])))
    session = started(lot_session(course))
    drive(session, Control(brake=1.0), 4.0)
    assert ending_of(session) is Ending.PARKED
    assert session.table()[0].race_time_us == 0
