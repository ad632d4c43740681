"""What a vehicle with trailers observes: angles at its hitches, its slot, and its feelers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_server.core.messages import Status
from race_server.core.observation import layout_of, offsets_of
from race_server.core.stages.feelers import REACH
from race_server.core.stages.observe import observe
from race_server.core.state import World
from race_server.core.vehicle_presets import KART_13, LORRY
from race_server.core.vehicles import Feeler, Vehicle
from race_server.errors import VehicleError
from support.lots import one_slot, open_lot, park_world, put_axle, wait

# Order of the feelers: tractor ahead, 30, -30, 60, -60, 90, -90 degrees; trailer left and right in
# its middle, at its rear; backwards, 150, -150 degrees.
AHEAD, LEFT, RIGHT = 0, 5, 6
MIDDLE_LEFT, REAR_LEFT, BACKWARDS = 7, 9, 11


def seen(world: World, part: str) -> list[float]:
    """Return a part of what the first vehicle observes."""
    layout = layout_of((part,), 1)
    out = np.zeros(layout.size, np.float32)
    observe(world, 0, 0, offsets_of(layout), out)
    return [float(number) for number in out]


def lorry(x: float, y: float, heading: float = 0.0, *, bend: float = 0.0, people: int = 0) -> World:
    """Return a lorry in 100 m by 100 m, its rear axle at (x, y) [m]; its slot is in the middle."""
    world = park_world(one_slot(18.0, 4.0, people=people), vehicle=LORRY)
    put_axle(world, x, y, heading, bend=bend)
    return world


def test_in_the_open_no_feeler_feels_anything() -> None:
    assert seen(lorry(0.0, 0.0), "feelers") == [1.0] * 14


def test_a_feeler_tells_the_share_of_20_m_that_is_free() -> None:
    # The front is 5.10 m ahead of the axle: 5 m are left to the wall at 50 m, a quarter of 20 m.
    feelers = seen(lorry(50.0 - 5.10 - 5.0, 0.0), "feelers")
    assert feelers[AHEAD] == pytest.approx(0.25)
    # At 30 degrees the way is longer by 1 / cos 30.
    assert feelers[1:3] == pytest.approx([0.25 / math.cos(math.pi / 6.0)] * 2)
    assert feelers[LEFT:] == [1.0] * 9


def test_the_feelers_of_a_trailer_turn_with_it() -> None:
    # The trailer points north: its rear is 12 m south of the hitch, which is at y = -30 m.
    world = lorry(-0.60, -30.0, 0.0, bend=-0.5 * math.pi)
    feelers = seen(world, "feelers")
    assert feelers[BACKWARDS] == pytest.approx((50.0 - 42.0) / REACH)


def test_the_own_trailer_is_not_felt_and_another_vehicle_is() -> None:
    world = park_world(open_lot(2), vehicle=LORRY, vehicles=2)
    put_axle(world, 0.0, 0.0)
    # Sides of 1.275 m: of 6.55 m from middle to middle 4 m are left. It stands 1 m further ahead,
    # so that nothing is beside the rear of the trailer.
    put_axle(world, 1.0, 6.55, kart=1)
    feelers = seen(world, "feelers")
    assert [feelers[ray] for ray in (LEFT, MIDDLE_LEFT, REAR_LEFT)] == pytest.approx(
        # The ray of the tractor begins in its middle line.
        [(4.0 + 1.275) / REACH, 4.0 / REACH, 1.0]
    )
    assert feelers[RIGHT] == 1.0
    # It is felt as well once it stands as two blocks.
    world.bodies["status"][0, 1] = Status.RETIRED
    wait(world, 1)
    assert seen(world, "feelers") == pytest.approx(feelers, abs=1e-6)


def test_a_person_of_0_25_m_beside_the_trailer_is_felt() -> None:
    world = lorry(0.0, 0.0, people=1)
    walker = world.parking.walkers[0, 0]
    # The middle of the trailer's box is 4.60 m behind the axle.
    walker.x, walker.y, walker.radius = -4.60, 1.275 + 2.0, 0.25
    assert seen(world, "feelers")[MIDDLE_LEFT] == pytest.approx(1.75 / REACH)


def test_a_vehicle_without_feelers_has_ones() -> None:
    assert seen(park_world(one_slot(), vehicle=KART_13), "feelers") == [1.0] * 14


def test_a_feeler_on_a_box_that_is_not_there_is_refused() -> None:
    with pytest.raises(VehicleError, match="a feeler on box 2; give 0 to 1"):
        replace(LORRY, feelers=(Feeler(2, 0.0, 0.0, 0.0),))
    with pytest.raises(VehicleError, match="15 feelers: at most 14"):
        replace(LORRY, feelers=(Feeler(0, 0.0, 0.0, 0.0),) * 15)


# Hitches and slot


def test_a_hitch_is_positive_where_the_tractor_points_left_of_its_trailer() -> None:
    assert seen(lorry(0.0, 0.0, bend=0.5), "hitch") == pytest.approx([0.5])
    assert seen(park_world(one_slot(), vehicle=KART_13), "hitch") == [0.0]


def test_the_slot_is_where_the_tractor_is_to_be_when_all_stands_in_the_middle() -> None:
    # The middle of the tractor is 2.10 m ahead of its axle, and belongs 5.25 m ahead of the slot's.
    world = lorry(5.25 - 2.10 - 3.0, 4.0)
    assert seen(world, "goal_x") == pytest.approx([3.0])
    assert seen(world, "goal_y") == pytest.approx([-4.0])
    assert seen(world, "goal_distance") == pytest.approx([5.0])
    assert seen(world, "slot_x") == pytest.approx([5.25])


def test_the_errors_of_tractor_and_trailer_are_those_of_the_slot_against_them() -> None:
    world = lorry(0.0, 0.0, 0.3, bend=0.2)
    assert seen(world, "goal_turn") == pytest.approx([-0.3])
    assert seen(world, "trailer_error") == pytest.approx([-0.1])
    kart = park_world(one_slot(), vehicle=KART_13)
    kart.bodies["heading"][0, 0] = 0.3
    assert seen(kart, "trailer_error") == pytest.approx([-0.3])


def test_a_trailer_is_seen_from_where_it_is_to_stand() -> None:
    # All stands straight, 2 m ahead of its place and 1 m to the left: the trailer does, too.
    world = lorry(5.25 - 2.10 + 2.0, 1.0)
    assert seen(world, "trailer_along") == pytest.approx([2.0])
    assert seen(world, "trailer_across") == pytest.approx([1.0])
    # A kart has no trailer, so it is its body: the slot's middle is at the origin.
    kart = park_world(one_slot(), vehicle=KART_13)
    offset = KART_13.box_offset
    kart.bodies["x"][0, 0], kart.bodies["y"][0, 0] = 3.0 - offset, -4.0
    kart.bodies["heading"][0, 0] = 0.0
    assert seen(kart, "trailer_along") == pytest.approx([3.0])
    assert seen(kart, "trailer_across") == pytest.approx([-4.0])


def test_the_gear_is_the_direction_of_the_last_motion() -> None:
    world = lorry(0.0, 0.0)
    assert seen(world, "gear") == [0.0]
    world.bodies["speed"][0, 0] = -1.0
    wait(world, 1)
    assert seen(world, "gear") == [-1.0]
    world.bodies["speed"][0, 0] = 0.0
    assert seen(world, "gear") == [-1.0]


def test_the_observation_of_the_report_has_22_numbers() -> None:
    layout = layout_of("report_c", 1)
    assert layout.size == 22
    assert list(layout.slices) == [
        *("speed", "heading", "hitch", "steering", "feelers", "goal_proximity", "goal_bearing"),
        *("goal_turn", "trailer_error"),
    ]


def test_further_hitches_are_seen_behind_the_first() -> None:
    second = replace(LORRY.trailers[0], hitch=1.0)
    train = Vehicle(**{**vars(LORRY), "trailers": (*LORRY.trailers, second)})
    world = park_world(one_slot(40.0, 4.0), vehicle=train)
    world.bodies["heading"][0, 0] = 0.3
    world.bodies["trailers"]["heading"][0, 0] = (0.1, -0.4, 0.0)
    assert seen(world, "hitch") == pytest.approx([0.2])
    assert seen(world, "hitch_behind") == pytest.approx([0.5, 0.0])
