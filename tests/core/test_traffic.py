"""Right of way between vehicles that announce their ways."""

import math
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from race_server.core import codes
from race_server.core.box_rows import boxes_of, listed, touching
from race_server.core.state import BODY, Floats
from race_server.core.traffic import APART, AROUND, BESIDE, STRETCH, Traffic
from race_server.core.vehicle_presets import CAR, LORRY
from race_server.core.vehicles import vehicle_record
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world

# Vehicles of these tests are 4 m long and 2 m wide; places on a way are 0.1 m apart.
SPACING = 0.1


def box(x: float, y: float, heading: float = 0.0) -> Floats:
    """Return where a vehicle stands."""
    return np.array([x, y, math.cos(heading), math.sin(heading), 2.0, 1.0])


def straight(x0: float, y0: float, x1: float, y1: float) -> Floats:
    """Return a straight way."""
    count = round(math.hypot(x1 - x0, y1 - y0) / SPACING) + 1
    heading = math.atan2(y1 - y0, x1 - x0)
    places = zip(np.linspace(x0, x1, count), np.linspace(y0, y1, count), strict=True)
    return np.array([box(x, y, heading) for x, y in places])


def alone(way: Floats) -> Floats:
    """Return a way as that of a vehicle without a trailer."""
    return way[:, None]


def traffic_at(*boxes: Floats) -> Traffic:
    """Return the traffic of vehicles that stand at these places, on their way."""
    traffic = Traffic(len(boxes))
    traffic.boxes = np.stack([np.reshape(own, (-1, 6)) for own in boxes])
    traffic.is_there[:] = traffic.is_on_its_way[:] = True
    return traffic


def drive_all(traffic: Traffic, ways: dict[int, Floats]) -> bool:
    """Drive all vehicles on bit by bit; return whether all arrive. None may touch another."""
    at = dict.fromkeys(ways, 0)
    while any(at[number] < len(way) - 1 for number, way in ways.items()):
        before = dict(at)
        for number, way in ways.items():
            at[number] = min(at[number] + STRETCH, traffic.clear(number, at[number]))
            traffic.boxes[number] = way[at[number]]
        for one, other in combinations(range(len(traffic.boxes)), 2):
            assert not touching(traffic.boxes[one], traffic.boxes[other], 0.0).any()
        if at == before:
            return False
    return True


def test_boxes_touch_where_their_sides_meet() -> None:
    ones = np.array([box(0.0, 0.0)])
    others = np.array([box(3.9, 0.0), box(4.1, 0.0), box(0.0, 2.1), box(3.1, 0.0, math.pi / 2)])
    assert touching(ones, others, 0.0).tolist() == [[True, False, False, False]]
    assert touching(ones, others, 0.2).tolist() == [[True, True, True, True]]


def test_two_boxes_corner_to_corner_do_not_touch_although_their_discs_do() -> None:
    ones, others = np.array([box(0.0, 0.0)]), np.array([box(3.3, 2.2, math.pi / 4)])
    # Along the diagonal they are 3.89 m apart, and reach (2 + 1) / sqrt(2) + 2 = 4.12 m.
    assert touching(ones, others, 0.0).any()
    assert not touching(ones, np.array([box(3.6, 2.4, math.pi / 4)]), 0.0).any()


def test_at_a_crossing_one_waits_for_the_other_and_both_arrive() -> None:
    ways = {0: straight(0.0, 0.0, 20.0, 0.0), 1: straight(10.0, -10.0, 10.0, 10.0)}
    traffic = traffic_at(ways[0][0], ways[1][0])
    assert traffic.announce(0, alone(ways[0]))
    assert traffic.announce(1, alone(ways[1]))
    assert drive_all(traffic, ways)


def test_who_follows_keeps_behind() -> None:
    ways = {0: straight(5.0, 0.0, 25.0, 0.0), 1: straight(0.0, 0.0, 20.0, 0.0)}
    traffic = traffic_at(ways[0][0], ways[1][0])
    assert all(traffic.announce(number, alone(way)) for number, way in ways.items())
    # One metre is free between them, and 10 cm stay so: two stretches of 0.4 m.
    assert traffic.clear(1, 0) == 8
    assert drive_all(traffic, ways)


def test_of_two_that_come_face_to_face_only_the_first_announces_its_way() -> None:
    ways = {0: straight(0.0, 0.0, 20.0, 0.0), 1: straight(20.0, 0.0, 0.0, 0.0)}
    traffic = traffic_at(ways[0][0], ways[1][0])
    assert traffic.announce(0, alone(ways[0]))
    assert not traffic.announce(1, alone(ways[1]))
    # The first cannot pass it either, and knows what stands there.
    assert traffic.is_obstructed(0)
    assert traffic.clear(0, 0) < 160
    assert traffic.obstacles(0, all_goals=True)[0].tolist() == [
        *ways[1][0][:4],
        2.0 + AROUND,
        1.0 + AROUND,
    ]


def test_no_one_enters_a_lane_that_another_still_has_to_leave() -> None:
    lane = straight(0.0, 0.0, 20.0, 0.0)
    # The other comes out of the lane's end and turns away before its beginning.
    back = np.concatenate([straight(20.0, 0.0, 5.0, 0.0), straight(5.0, 0.1, 5.0, 10.0)])
    back[:, 2:4] = 1.0, 0.0
    ways = {0: np.concatenate([straight(-8.0, 0.0, -0.1, 0.0), lane]), 1: back}
    traffic = traffic_at(ways[0][0], ways[1][0])
    assert all(traffic.announce(number, alone(way)) for number, way in ways.items())
    assert drive_all(traffic, ways)


def test_a_corner_that_touches_another_between_the_ends_of_a_stretch_is_seen() -> None:
    # Both stand at 45°; corner passes corner at the place 22, in the middle of a stretch.
    middle, corner = 3.0 / math.sqrt(2.0), 1.0 / math.sqrt(2.0)
    stands = box(0.0, 0.0, math.pi / 4)
    way = straight(2.0 * middle, 2.0 * corner - 2.2, 2.0 * middle, 2.0 * corner + 2.2)
    way[:, 2:4] = stands[2:4]
    assert not touching(way[[20, 24]], stands[None], APART).any()
    traffic = traffic_at(way[0], stands)
    assert traffic.announce(0, alone(way))
    assert traffic.is_obstructed(0)
    assert traffic.clear(0, 0) == 20
    # So it is where the other has a way, and stands at its beginning.
    leaves = straight(0.0, 0.0, -20.0, 0.0)
    leaves[:, 2:4] = stands[2:4]
    assert traffic.announce(1, alone(leaves))
    assert traffic.clear(0, 0) == 20


def test_the_nearer_another_stands_the_less_a_plan_has_to_keep_away_from_it() -> None:
    # Free between the two: 0.3 m, 0.12 m, 0.05 m; a plan keeps 0.05 m at most besides.
    for gap, around in ((0.3, AROUND), (0.12, BESIDE), (0.05, 0.0)):
        traffic = traffic_at(box(0.0, 0.0), box(0.0, 2.0 + gap))
        obstacle = traffic.obstacles(0, all_goals=True)[0]
        assert obstacle[4:].tolist() == pytest.approx([2.0 + around, 1.0 + around])


def test_who_stands_close_beside_another_is_cleared_away_from_it_and_not_into_it() -> None:
    traffic = traffic_at(box(0.0, 0.0), box(0.0, 2.0 + 0.5 * BESIDE))
    assert traffic.announce(0, alone(straight(0.0, 0.0, 8.0, 0.0)))
    assert not traffic.is_obstructed(0)
    assert traffic.clear(0, 0) > 0
    into = straight(0.0, 0.0, 8.0, 0.0)
    into[1:, 1] += BESIDE
    assert traffic.announce(0, alone(into))
    assert traffic.is_obstructed(0)
    assert traffic.clear(0, 0) == 0


@pytest.mark.parametrize("seed", range(20))
def test_all_who_announced_a_way_arrive_and_none_touches_another(seed: int) -> None:
    chance = np.random.default_rng(seed)
    starts = [box(x, y, chance.uniform(-3.1, 3.1)) for x in (0, 12, 24) for y in (0, 12)]
    traffic, ways = traffic_at(*starts), {}
    for number in chance.permutation(len(starts)).tolist():
        x, y, cos, sin = starts[number][:4]
        way = chance.uniform(15.0, 40.0)
        ways[number] = straight(x, y, x + way * cos, y + way * sin)
        if not traffic.announce(number, alone(ways[number])):
            del ways[number]
    # Those that announced none stand where they are, and may be in the way.
    moving = {n: w for n, w in ways.items() if not traffic.is_obstructed(n)}
    for number in set(ways) - set(moving):
        traffic.withdraw(number)
    moving = {n: w for n, w in moving.items() if not traffic.is_obstructed(n)}
    if len(moving) == len(traffic._ways):
        assert drive_all(traffic, moving)


def test_who_stands_without_a_way_is_seen_in_advance_and_who_drives_without_one_is_not() -> None:
    traffic = traffic_at(box(0.0, 0.0), box(9.0, 0.0), box(18.0, 0.0))
    traffic.speeds[:] = 0.0, 0.0, 2.0
    assert traffic.expected(0)[:, 0].tolist() == [9.0]
    assert traffic.announce(2, alone(straight(18.0, 0.0, 30.0, 0.0)))
    # 0.1 m for noise, and what 2 m/s make in the 0.15 s of a scan.
    assert traffic.expected(0)[:, 4].tolist() == pytest.approx([2.1, 2.4])


def test_the_goals_of_others_are_planned_around() -> None:
    traffic = traffic_at(box(0.0, 0.0), box(9.0, 0.0))
    traffic.aim(1, box(40.0, 5.0))
    assert traffic.obstacles(0, all_goals=True)[:, 0].tolist() == [9.0, 40.0]
    assert traffic.obstacles(0, all_goals=False)[:, 0].tolist() == [9.0]
    assert traffic.announce(1, alone(straight(9.0, 0.0, 40.0, 0.0)))
    assert traffic.obstacles(0, all_goals=False)[:, 0].tolist() == [40.0]


def test_a_decision_of_all_takes_the_time_of_one_plan() -> None:
    traffic = Traffic(2)
    assert traffic.may_plan()
    assert not traffic.may_plan()


def test_who_is_parked_has_no_way_any_more() -> None:
    world = make_world(parking_scenario("gate", vehicles=2), seeds=[3])
    traffic = Traffic(2)
    traffic.watch(world, 0)
    car, parker = world.bodies[0, 0], world.parking.parkers[0, 0]
    assert traffic.is_on_its_way.all()
    x, y = traffic.boxes[0, 0, :2]
    assert math.hypot(x - car.x, y - car.y) == pytest.approx(abs(world.vehicles[0, 0].box_offset))
    assert traffic.announce(0, alone(straight(x, y, x + 5.0, y)))
    world.bodies["status"][0, 0] = codes.FINISHED
    before = traffic.changes
    traffic.watch(world, 0)
    assert traffic.changes > before
    assert len(traffic.obstacles(1, all_goals=True)) == 1
    assert parker.slot >= 0


# Trailers


def test_the_boxes_of_a_lorry_and_of_a_car_beside_it_are_theirs() -> None:
    bodies, vehicles = np.zeros(2, BODY), np.concatenate(list(map(vehicle_record, (LORRY, CAR))))
    bodies["x"], bodies["y"], bodies["heading"] = (3.0, 40.0), (4.0, 0.0), (0.5, -1.0)
    bodies["trailers"]["heading"][0, 0] = 0.2
    boxes = boxes_of(bodies, vehicles)
    for number, box_at in enumerate(LORRY.boxes_at(3.0, 4.0, 0.5, [0.2])):
        x, y, heading, length, width = box_at
        wanted = [x, y, math.cos(heading), math.sin(heading), 0.5 * length, 0.5 * width]
        assert boxes[0, number].tolist() == pytest.approx(wanted)
    assert np.isnan(boxes[1, 1]).all()
    assert len(listed(boxes)) == 3


def test_the_boxes_of_two_trailers_follow_one_another() -> None:
    (trailer,) = LORRY.trailers
    second = replace(trailer, hitch=1.5, bar=5.0)
    train = replace(LORRY, trailers=(trailer, second))
    bodies = np.zeros(1, BODY)
    bodies["trailers"]["heading"][0, :2] = 0.3, -0.4
    found = boxes_of(bodies, vehicle_record(train))[0]
    for own, box_at in zip(found, train.boxes_at(0.0, 0.0, 0.0, [0.3, -0.4]), strict=True):
        x, y, heading, length, width = box_at
        wanted = [x, y, math.cos(heading), math.sin(heading), 0.5 * length, 0.5 * width]
        assert own.tolist() == pytest.approx(wanted)


def with_trailer(way: Floats) -> Floats:
    """Return a straight way as that of a vehicle that draws a trailer 5 m behind it."""
    drawn = way.copy()
    drawn[:, :2] -= 5.0 * way[:, 2:4]
    return np.stack([way, drawn], axis=1)


def test_at_a_crossing_one_waits_until_the_trailer_of_the_other_is_past() -> None:
    ways = {
        0: with_trailer(straight(-5.0, 0.0, 20.0, 0.0)),
        1: with_trailer(straight(10.0, -14.0, 10.0, 14.0)),
    }
    traffic = traffic_at(ways[0][0], ways[1][0])
    assert all(traffic.announce(number, way) for number, way in ways.items())
    assert drive_all(traffic, ways)


def test_a_trailer_that_stands_is_an_obstacle_as_its_vehicle_is() -> None:
    rig = with_trailer(straight(0.0, 0.0, 5.0, 0.0))[0]
    nothing = np.full(6, np.nan)
    traffic = traffic_at(np.stack([box(0.0, 20.0), nothing]), rig)
    assert traffic.obstacles(0, all_goals=True)[:, 0].tolist() == [0.0, -5.0]
    assert traffic.expected(0)[:, 0].tolist() == [0.0, -5.0]
