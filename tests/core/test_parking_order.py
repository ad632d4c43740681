"""What a driver is told that is to park."""

import numpy as np
import pytest

from race_server.core.driver import driver_named, tell_to_park
from race_server.core.level import Level
from race_server.core.parking_order import order_of
from race_server.errors import DriverError
from race_server.scenario.level import LEVELS
from support.lots import one_slot, open_lot, park_world, put, wait


@pytest.mark.parametrize("name", LEVELS)
def test_tolerances_come_back_out_of_a_record(name: str) -> None:
    parker = park_world(one_slot(), level=name).parking.parkers[0, 0]
    assert Level.of(parker) == LEVELS[name]


def test_an_order_holds_the_slot_and_the_four_walls_of_the_area() -> None:
    order = order_of(park_world(one_slot(length=3.0)), 0, 0)
    assert order.slot == (0.0, 0.0, 0.0, 3.0, 2.0)
    assert order.level == LEVELS["parked"]
    assert np.hypot(*(order.walls[:, 2:] - order.walls[:, :2]).T).tolist() == [100.0] * 4
    assert order.blocks.shape == (0, 5)


def test_a_parked_vehicle_is_on_the_map_of_the_others_and_not_on_its_own() -> None:
    world = park_world(open_lot(), vehicles=2)
    slot = world.parking.parkers[0, 0]
    put(world, slot.x, slot.y, kart=0)
    put(world, -30.0, 30.0, kart=1)
    wait(world, 61)
    assert len(order_of(world, 0, 0).blocks) == 0
    assert order_of(world, 0, 1).blocks[0] == pytest.approx([slot.x, slot.y, 0.0, 1.03, 0.65])


def test_an_order_stays_as_it_is_while_the_world_goes_on() -> None:
    world = park_world(one_slot())
    order = order_of(world, 0, 0)
    world.walls.segments[:] = 0.0
    assert order.walls.any()


def test_a_driver_that_only_races_refuses_an_order_in_one_sentence() -> None:
    order = order_of(park_world(one_slot()), 0, 0)
    with pytest.raises(DriverError, match=r"'avoider' cannot park.*valet"):
        tell_to_park(driver_named("avoider"), "avoider", order)
    with pytest.raises(DriverError, match="without seeing a slot"):
        tell_to_park(driver_named("learned:race"), "learned:race", order)
