"""A real kart that parks on order: which driver decides, what it sees, and what waits."""

import math
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from race_agents.onboard.crew import Crew
from race_agents.onboard.parker import Parker, observation_of
from race_agents.plant.body import Body
from race_agents.plant.radar import Person, Surroundings, scan_all_around
from race_agents.unit.control_unit import STOP, ControlUnit
from race_agents.unit.ekf import SPEED
from race_agents.unit.fence import LotFence
from race_agents.unit.readings import Fix, Readings
from race_server.core.driver import Briefing, Driver
from race_server.core.level import Level
from race_server.core.messages import Control
from race_server.core.observation import Observation, layout_of
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.core.vehicle_presets import KART_13
from race_server.errors import DriverError
from race_server.net.wire.drive import EFFECT, HudFrame
from race_server.net.wire.parking import OrderFrame

RAYS = 5
AREA = LotFence((-10.0, -10.0), (10.0, 10.0))
BRIEFING = Briefing(0, KART_13, 0, "track", 0.05)
HUD = HudFrame(1, 60, 3.0, 1.0, 1.0, 0, 0.0, np.zeros(0, EFFECT), valid_s=0.5)


class Parking:
    """Answers with what it was told last, once it may."""

    preset = "lot_lidar"

    def __init__(self) -> None:
        self.may_answer = threading.Event()
        self.may_answer.set()
        self.orders: list[ParkingOrder] = []
        self.seen: list[Observation] = []

    def reset(self, briefing: Briefing) -> None:
        assert briefing.preset == self.preset

    def park(self, order: ParkingOrder) -> None:
        self.orders.append(order)

    def act(self, observation: Observation) -> Control:
        self.may_answer.wait()
        self.seen.append(observation)
        return Control(throttle=0.25)


class Racing:
    """Drives at full throttle."""

    preset = "track"

    def reset(self, briefing: Briefing) -> None:
        pass

    def act(self, observation: Observation) -> Control:
        return Control(throttle=1.0)


def order(sequence: int, epoch: int = 1) -> OrderFrame:
    slot = Slot(4.0, float(sequence), 0.0, 3.0, 2.0)
    empty = ParkingOrder(slot, Level(), np.zeros((0, 4)), np.zeros((0, 5)))
    return OrderFrame(epoch, sequence, empty)


def placed_unit(heading: float | None = math.pi / 2.0) -> ControlUnit:
    """Return the unit of a kart whose centre of gravity stands at (2, 3)."""
    unit = ControlUnit.of(KART_13, AREA)
    unit.sense(Readings(0.0, 0.0, 0.0, 0.0, fix=Fix(2.0, 3.0, 0.02, heading=heading)))
    unit.ranges = np.arange(float(RAYS))
    unit.hear(HUD, 0.0)
    return unit


def parker_of(driver: Driver) -> Parker:
    return Parker(driver, "named", BRIEFING, RAYS)


def answered(crew: Crew, unit: ControlUnit, now_s: float) -> Control | None:
    """Return the answer to what is asked now."""
    crew.act(None, None, unit, now_s)
    assert crew.parker is not None
    for _ in range(200):
        if control := crew.parker.act(unit, now_s):
            return control
        time.sleep(0.005)
    return None


def test_a_kart_in_a_lot_knows_its_heading_by_two_antennas_or_does_not_move() -> None:
    assert placed_unit(heading=None).pose() is None
    told = placed_unit().pose()
    assert told is not None
    assert told.heading == pytest.approx(math.pi / 2.0)


def test_a_lot_ends_at_its_sides() -> None:
    assert AREA.beyond(0.0, 0.0) == -10.0
    assert AREA.beyond(9.0, -12.0) == 2.0
    assert AREA.heading_at(0.0, 0.0) is None


def test_the_kart_shows_its_driver_where_it_believes_to_be() -> None:
    seen = observation_of(placed_unit(), layout_of("lot_lidar", RAYS))
    assert seen is not None
    # It faces north, and the middle of its body lies ahead of its centre of gravity.
    place = seen.scalar("position_x"), seen.scalar("position_y")
    assert place == pytest.approx((2.0, 3.0 + KART_13.box_offset), abs=1e-5)
    assert seen["lidar"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert (seen.scalar("speed_cap"), seen.scalar("finished")) == (3.0, 0.0)


def test_a_kart_that_is_told_to_stand_shows_that_all_is_over() -> None:
    unit = placed_unit()
    unit.hear(replace(HUD, speed_cap=0.0), 0.0)
    seen = observation_of(unit, layout_of("lot_lidar", RAYS))
    assert seen is not None
    assert seen.scalar("finished") == 1.0


@pytest.mark.parametrize(("speed", "told"), [(-0.04, 0.0), (-0.06, -0.06)])
def test_a_kart_slower_than_5_cm_a_second_tells_that_it_stands(speed: float, told: float) -> None:
    unit = placed_unit()
    assert unit.fusion is not None
    unit.fusion.state[SPEED] = speed
    pose = unit.pose()
    assert pose is not None
    assert pose.speed == pytest.approx(told)


def test_without_a_lidar_no_driver_is_asked() -> None:
    unit = placed_unit()
    unit.ranges = None
    assert observation_of(unit, layout_of("lot_lidar", RAYS)) is None


def test_a_kart_that_parks_on_request_stands_until_the_order_comes() -> None:
    driver, unit = Parking(), placed_unit()
    crew = Crew(None, parker_of(driver), races_first=False)
    assert crew.act(None, None, unit, 0.0) is STOP
    crew.act(None, order(1), unit, 0.1)
    assert answered(crew, unit, 0.2) == Control(throttle=0.25)
    assert [told.slot.y for told in driver.orders] == [1.0]
    crew.close()


def test_an_order_that_is_sent_again_is_taken_once_and_a_newer_one_replaces_it() -> None:
    driver, unit = Parking(), placed_unit()
    crew = Crew(None, parker_of(driver), races_first=False)
    for number, frame in enumerate([order(1), order(1), order(3), order(2)]):
        crew.act(None, frame, unit, 0.1 * number)
        answered(crew, unit, 0.1 * number + 0.05)
    assert [told.slot.y for told in driver.orders] == [1.0, 3.0]
    crew.close()


def test_an_order_is_of_its_race_and_one_from_the_start_of_every_race() -> None:
    for stands, wanted in ((False, STOP), (True, Control(throttle=0.25))):
        unit = placed_unit()
        crew = Crew(None, parker_of(Parking()), races_first=False)
        assert crew.parker is not None
        crew.parker.take(order(1, epoch=HUD.epoch), stands=stands)
        assert answered(crew, unit, 0.0) == Control(throttle=0.25)
        unit.hear(replace(HUD, epoch=HUD.epoch + 1, sequence=0), 0.1)
        told = crew.act(None, None, unit, 0.2)
        assert (told or answered(crew, unit, 0.3)) == wanted
        crew.close()


def test_an_order_in_a_race_waits_for_the_finish() -> None:
    unit, layout = placed_unit(), layout_of("track", RAYS)
    crew = Crew(Racing(), parker_of(Parking()))
    racing = Observation(1, layout, np.zeros(layout.size, np.float32))
    assert crew.act(racing, order(1), unit, 0.0) == Control(throttle=1.0)
    done = np.zeros(layout.size, np.float32)
    done[layout.slices["finished"]] = 1.0
    crew.act(Observation(2, layout, done), None, unit, 0.1)
    assert answered(crew, unit, 0.2) == Control(throttle=0.25)
    crew.close()


def test_the_control_loop_does_not_wait_for_a_driver_that_thinks_and_the_kart_stands() -> None:
    driver, unit = Parking(), placed_unit()
    driver.may_answer.clear()
    crew = Crew(None, parker_of(driver), races_first=False)
    unit.drive(Control(throttle=1.0), 0.0)
    begun = time.perf_counter()
    for turn in range(50):  # a second of the kart's clock
        assert crew.act(None, order(1), unit, 0.02 * turn) is None
    assert time.perf_counter() - begun < 0.5
    unit.hear(HUD, 1.0)
    command = unit.decide(1.0)  # the dead man's handle: no answer for a second
    assert (command.throttle, command.brake) == (0.0, 0.6)
    driver.may_answer.set()
    crew.close()


def test_the_driver_is_asked_as_often_as_it_decides() -> None:
    driver, unit = Parking(), placed_unit()
    crew = Crew(None, parker_of(driver), races_first=False)
    crew.act(None, order(1), unit, 0.0)
    assert crew.parker is not None
    for turn in range(25):  # half a second: 20 decisions a second
        crew.parker.act(unit, 0.02 * turn)
        time.sleep(0.004)
    assert 8 <= len(driver.seen) <= 11
    crew.close()


def test_a_driver_that_fails_ends_the_program_with_its_reason() -> None:
    driver, unit = Parking(), placed_unit()

    def fail(_: Observation) -> Control:
        raise ValueError("no way")

    driver.act = fail  # type: ignore[method-assign]
    parker = parker_of(driver)
    crew = Crew(None, parker, races_first=False)
    parker.take(order(1))
    with pytest.raises(DriverError, match="'named' failed in act: ValueError: no way"):
        answered(crew, unit, 0.1)
    crew.close()


def test_a_driver_that_takes_no_order_cannot_park_a_kart() -> None:
    with pytest.raises(DriverError, match="driver 'named' takes no order"):
        parker_of(Racing())


def test_the_lidar_of_a_plant_sees_walls_and_people_as_far_as_it_reaches() -> None:
    # A wall 5 m to the east of the kart, which faces north; a person 3 m to the west.
    walls = np.array([[5.0, -9.0, 5.0, 9.0], [-20.0, 40.0, 20.0, 40.0]])
    around = Surroundings(walls, people=[Person(-3.0, 0.0, 0.5)])
    body = Body(KART_13, 0.0, 0.0, math.pi / 2.0)
    angles = np.radians([-90.0, 0.0, 90.0])
    seen = scan_all_around(body, around, angles, 30.0)
    assert seen == pytest.approx([5.0, 0.0, 2.5])
