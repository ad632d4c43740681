"""Trailers in the world: what they touch, what touches them, where they are put, who sees them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.core.kernels.boxes import (
    box_count,
    box_of,
    hull_of,
    push,
    reach_of,
    velocity_at,
    yielding,
)
from race_server.core.kernels.motion import Motion, Rates, integrate
from race_server.core.kernels.trailers import lead_trailers, place_in_line
from race_server.core.messages import Ending, Retirement, Status
from race_server.core.parking_order import order_of
from race_server.core.rules.parking import ending_of
from race_server.core.stages.hitches import lies_on
from race_server.core.state import BODY, Record, World, digest
from race_server.core.step import advance, place_karts
from race_server.core.vehicle_presets import CAR_TRAILER, KART_13, KART_CART, LORRY, LORRY_OFF_AXLE
from race_server.core.vehicles import Trailer, Vehicle, vehicle_record
from race_server.scenario.track.course import Course
from support.lots import one_slot, open_lot, park_world, put_axle, roll, wait

SECOND = Trailer(hitch=1.0, bar=5.0, ahead=-1.0, behind=2.0, width=2.5, limit=1.0)
TRAIN = Vehicle(**{**vars(LORRY), "trailers": (*LORRY.trailers, SECOND)})
HALF_WIDTH = 1.275  # [m] of tractor and trailer
OUT = Status.RETIRED


def lorry_world(
    x: float = 0.0,
    y: float = 0.0,
    *,
    bend: float = 0.0,
    course: Course | None = None,
    vehicle: Vehicle = LORRY,
    vehicles: int = 1,
    level: str = "parked",
    bump: bool = False,
) -> World:
    """Return a lorry in 100 m by 100 m, its rear axle at (x, y) [m], facing east.

    bend: at its hitch [rad]. The slot in the middle is 18 m long and 4 m wide.
    """
    place = course or one_slot(18.0, 4.0)
    world = park_world(place, vehicle=vehicle, vehicles=vehicles, level=level, bump=bump)
    put_axle(world, x, y, bend=bend)
    return world


def bent_body(first: float, second: float) -> tuple[Record, Record]:
    """Return a body with two trailers at the origin, and its vehicle."""
    body = np.zeros(1, BODY).view(np.recarray)[0]
    body.trailers["heading"] = (-first, -first - second, 0.0)
    return body, vehicle_record(TRAIN)[0]


def drive(world: World, throttle: float, ticks: int, steering: float = 0.0) -> None:
    controls = np.zeros((*world.bodies.shape, 4))
    controls[..., 0], controls[..., 1] = steering, throttle
    advance(world, controls, ticks)


def status(world: World, kart: int = 0) -> tuple[Status, int]:
    return Status(int(world.bodies["status"][0, kart])), int(world.racers["retired_for"][0, kart])


# Boxes


def test_a_straight_lorry_has_its_trailer_from_0_35_to_minus_13_25_m() -> None:
    world = lorry_world(-1.85)  # the centre of gravity at the origin
    body, vehicle = world.bodies[0, 0], world.vehicles[0, 0]
    assert box_count(vehicle) == 2
    box = box_of(hull_of(vehicle, body, 1))
    assert (box.x, box.y) == pytest.approx((-6.45, 0.0))
    assert (2.0 * box.half_length, 2.0 * box.half_width) == pytest.approx((13.6, 2.55))


def test_the_boxes_of_a_straight_lorry_lie_5_25_m_ahead_and_1_45_m_behind_its_middle() -> None:
    # From 3.25 to -13.25 m: the middle is at -5 m, those of the boxes at 0.25 and -6.45 m.
    record = vehicle_record(LORRY)[0]
    assert place_in_line(record, 0) == pytest.approx(5.25)
    assert place_in_line(record, 1) == pytest.approx(-1.45)
    assert place_in_line(vehicle_record(KART_13)[0], 0) == 0.0
    assert LORRY.overall_length == pytest.approx(16.5)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
@settings(max_examples=30, deadline=None)
def test_no_corner_lies_beyond_the_reach_however_a_train_is_bent(a: float, b: float) -> None:
    body, vehicle = bent_body(a, b)
    for number in range(3):
        box = box_of(hull_of(vehicle, body, number))
        for u in (-box.half_length, box.half_length):
            for v in (-box.half_width, box.half_width):
                x, y = box.x + u * box.cos - v * box.sin, box.y + u * box.sin + v * box.cos
                assert math.hypot(x, y) <= reach_of(vehicle)


def test_the_boxes_of_a_vehicle_are_those_of_the_kernels() -> None:
    body, vehicle = bent_body(0.3, -0.5)
    places = TRAIN.boxes_at(body.x, body.y, body.heading, body.trailers["heading"].tolist())
    for number, place in enumerate(places):
        box = box_of(hull_of(vehicle, body, number))
        sizes = (2.0 * box.half_length, 2.0 * box.half_width)
        assert place == pytest.approx((box.x, box.y, math.atan2(box.sin, box.cos), *sizes))


# Blows


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.2, 0.2), st.floats(-1.5, 1.5))
@settings(max_examples=20, deadline=None)
def test_a_point_of_a_trailer_moves_as_its_velocity_says(
    first: float, second: float, curvature: float, pace: float
) -> None:
    body, vehicle = bent_body(first, second)
    body.speed, body.yaw_rate = pace, pace * curvature
    body.lateral_speed = TRAIN.rear_axle * body.yaw_rate
    after, dt = body.copy(), 1e-6
    rates = Rates(body.speed, body.lateral_speed, body.yaw_rate)
    moved = integrate(Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), rates, 0.0, dt)
    lead_trailers(after, vehicle, moved, dt)
    after.x, after.y, after.heading = moved.x, moved.y, moved.heading
    for number in (1, 2):
        hull = hull_of(vehicle, body, number)
        box, later = box_of(hull), box_of(hull_of(vehicle, after, number))
        expected = velocity_at(body, vehicle, box, box.x - hull.x, box.y - hull.y)
        velocity = ((later.x - box.x) / dt, (later.y - box.y) / dt)
        assert velocity == pytest.approx(expected, abs=1e-5)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_an_impulse_changes_the_velocity_by_as_much_as_the_part_yields(
    first: float, second: float, direction: float
) -> None:
    nx, ny = math.cos(direction), math.sin(direction)
    for number in (0, 1, 2):
        body, vehicle = bent_body(first, second)
        box = box_of(hull_of(vehicle, body, number))
        px, py = 2.0 * box.cos - box.sin, 2.0 * box.sin + box.cos
        moved, turned = yielding(body, vehicle, box, px, py, nx, ny)
        push(body, vehicle, box, px, py, 1000.0 * nx, 1000.0 * ny)
        vx, vy = velocity_at(body, vehicle, box, px, py)
        assert vx * nx + vy * ny == pytest.approx(1000.0 * (moved + turned), abs=1e-6)


def test_a_straight_trailer_yields_along_itself_as_the_whole_and_at_its_axle_not_aside() -> None:
    body, vehicle = bent_body(0.0, 0.0)
    box = box_of(hull_of(vehicle, body, 1))
    assert sum(yielding(body, vehicle, box, 0.0, 0.0, 1.0, 0.0)) == pytest.approx(1.0 / 15_000.0)
    assert sum(yielding(body, vehicle, box, 0.0, 0.0, 0.0, 1.0)) < 1e-9


# Walls, blocks, people, others


def test_a_trailer_that_is_reversed_into_a_wall_is_a_crash() -> None:
    # The rear is 11.40 m behind the rear axle, and the wall 50 m from the middle.
    world = lorry_world(-50.0 + 11.40 + 0.5)
    drive(world, -1.0, 60)
    assert status(world) == (Status.RACING, 0)
    drive(world, -1.0, 60)
    assert status(world) == (OUT, Retirement.CRASH)


@pytest.mark.parametrize("steering", [0.0, 0.3])
def test_where_a_touch_is_no_crash_a_trailer_stops_the_lorry_and_does_not_enter_the_wall(
    steering: float,
) -> None:
    world = lorry_world(-50.0 + 11.40 + 0.5, bump=True)
    deepest = 0.0
    for _ in range(120):
        drive(world, -1.0, 2, steering)
        box = box_of(hull_of(world.vehicles[0, 0], world.bodies[0, 0], 1))
        reach = box.half_length * abs(box.cos) + box.half_width * abs(box.sin)
        deepest = max(deepest, -50.0 - (box.x - reach))
    assert deepest < 0.01
    assert status(world) == (Status.RACING, 0)


def test_a_lorry_that_hits_a_standing_one_with_its_trailer_takes_both_out() -> None:
    world = lorry_world(course=open_lot(2), vehicles=2)
    # 11.40 m behind the axle ends the trailer; the other's front is 5.10 m ahead of its axle.
    put_axle(world, -11.40 - 5.10 - 0.3, 0.0, kart=1)
    controls = np.zeros((1, 2, 4))
    controls[0, 0, 1] = -1.0
    advance(world, controls, 120)
    assert status(world, 0) == (OUT, Retirement.CRASH)
    assert status(world, 1) == (OUT, Retirement.CRASH)


def test_a_lorry_that_is_out_stands_as_two_blocks_which_are_no_obstacles_to_itself() -> None:
    world = lorry_world(course=open_lot(2), vehicles=2)
    put_axle(world, 0.0, 20.0, kart=1)
    world.bodies["status"][0, 0] = OUT
    wait(world, 1)
    blocks = world.parking.blocks[0]
    assert np.flatnonzero(blocks["kind"]).tolist() == [0, 2]
    assert blocks["half_length"][[0, 2]] == pytest.approx([3.0, 6.8])
    assert len(order_of(world, 0, 0).blocks) == 0
    assert len(order_of(world, 0, 1).blocks) == 2


def test_a_person_whom_a_rolling_trailer_touches_is_hit() -> None:
    world = lorry_world(course=one_slot(18.0, 4.0, people=1))
    walker = world.parking.walkers[0, 0]
    walker.x = walker.to_x = -8.0
    walker.y = walker.to_y = HALF_WIDTH + 0.2
    walker.rest_ticks, walker.rest_at = 100, 1.0
    world.bodies["speed"][0, 0] = 1.0
    roll(world, 2)
    assert status(world) == (OUT, Retirement.HIT_PERSON)


# Hitches


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_lorry_is_out_once_its_hitch_is_bent_by_more_than_90_degrees(side: float) -> None:
    for degrees, expected in ((89.0, (Status.RACING, 0)), (91.0, (OUT, Retirement.JACK_KNIFE))):
        world = lorry_world(bend=side * math.radians(degrees))
        wait(world, 1)
        assert status(world) == expected


def test_a_trailer_that_touches_what_draws_it_is_an_end_of_another_kind() -> None:
    # The car's rear corner, 0.97 m beside and 0.27 m ahead of the ball, lies 0.97 sin b
    # - 0.27 cos b along a trailer bent by b: 0.5 m, where the box begins, at 45.3 degrees.
    near = Trailer(**{**vars(CAR_TRAILER.trailers[0]), "ahead": -0.5})
    vehicle = Vehicle(**{**vars(CAR_TRAILER), "trailers": (near,)})
    for degrees, expected in ((44.0, (Status.RACING, 0)), (47.0, (OUT, Retirement.OWN_BODY))):
        world = lorry_world(bend=math.radians(degrees), vehicle=vehicle)
        wait(world, 1)
        assert status(world) == expected
    assert ending_of(OUT, Retirement.OWN_BODY, 0) == Ending.OWN_BODY
    assert ending_of(OUT, Retirement.JACK_KNIFE, 0) == Ending.JACK_KNIFE


@pytest.mark.parametrize("vehicle", [LORRY, LORRY_OFF_AXLE, CAR_TRAILER, KART_CART])
def test_at_the_limit_of_its_hitch_no_trailer_touches_what_draws_it(vehicle: Vehicle) -> None:
    world = lorry_world(bend=0.999 * vehicle.trailers[0].limit, vehicle=vehicle)
    wait(world, 1)
    assert status(world) == (Status.RACING, 0)
    # A semitrailer lies on its tractor, where no box tells whether they touch.
    assert bool(lies_on(vehicle_record(vehicle)[0], 0)) is (vehicle is LORRY)


# Where it is put


def test_a_tracked_vehicle_has_its_trailer_straight_behind_it() -> None:
    world = lorry_world(bend=0.5)
    place_karts(world, 0, np.array([[0.0, 0.0, 0.0, 3.0, 4.0, 0.7, 0.0, 0.0, 0.0, 0.0]]))
    assert world.bodies[0, 0].trailers[0].heading == pytest.approx(0.7)


def test_the_digest_holds_the_heading_of_a_trailer_and_nothing_of_one_that_is_not_there() -> None:
    for vehicle, changes in ((LORRY, True), (KART_13, False)):
        world = lorry_world(vehicle=vehicle)
        before = digest(world)
        world.bodies["trailers"]["heading"][0, 0, 0] += 1e-9
        assert bool(digest(world) != before) is changes


# In its slot


def parked(level: str, along: float, bend_degrees: float, width: float = 4.0) -> Status:
    """Return the status of a lorry that stood for 61 ticks in a slot of 18 m.

    along: of the tractor's rear axle [m] from where it is when all stands in the middle.
    """
    # The middle of the whole is 5 m behind the centre of gravity, and the axle 1.85 m.
    place, bend = one_slot(18.0, width), math.radians(bend_degrees)
    world = lorry_world(5.0 - 1.85 + along, course=place, level=level, bend=bend)
    wait(world, 61)
    return status(world)[0]


def test_a_lorry_in_the_middle_of_its_slot_is_parked_and_not_with_6_degrees_at_its_hitch() -> None:
    assert parked("parked", 0.0, 0.0) is Status.FINISHED
    assert parked("parked", 0.29, 0.0) is Status.FINISHED
    assert parked("parked", 0.31, 0.0) is Status.RACING
    assert parked("parked", 0.0, 4.9, width=6.0) is Status.FINISHED
    assert parked("parked", 0.0, 5.1, width=6.0) is Status.RACING


def test_a_lorry_whose_trailer_reaches_out_of_the_slot_is_not_parked() -> None:
    # A width of 3 m leaves 0.225 m on each side; 12 m behind the hitch a degree makes 0.21 m.
    assert parked("parked", 0.0, 1.0, width=3.0) is Status.FINISHED
    assert parked("parked", 0.0, 1.2, width=3.0) is Status.RACING


@pytest.mark.parametrize(("short", "expected"), [(0.14, "FINISHED"), (0.16, "RACING")])
def test_at_a_dock_the_trailer_counts_and_not_the_tractor(short: float, expected: str) -> None:
    world, bend = lorry_world(level="dock"), math.radians(40.0)
    # The trailer points east, the tractor is turned; put by the middle of the trailer's box.
    put_axle(world, 0.0, 0.0, bend, bend=bend)
    box = box_of(hull_of(world.vehicles[0, 0], world.bodies[0, 0], 1))
    world.bodies["x"][0, 0] += -1.45 + short - box.x
    world.bodies["y"][0, 0] -= box.y
    wait(world, 1)
    assert status(world)[0].name == expected


def test_the_report_asks_for_the_tractor_within_a_metre_whatever_the_trailer_does() -> None:
    assert parked("report-c", 0.9, 30.0) is Status.FINISHED
    assert parked("report-c", 1.1, 0.0) is Status.RACING
