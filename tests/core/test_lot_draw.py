"""What is drawn for a round in a car park: by the seed alone, and clear of all that stands."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from race_server.core import codes
from race_server.core.lots import bytes_of
from race_server.core.messages import RayHit
from race_server.core.state import World, digest
from race_server.core.step import advance
from race_server.core.vehicle_presets import KART_13
from race_server.errors import ScenarioError
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.site import course_of_lot
from race_server.scenario.parking import LOT_RULES, parking_scenario
from race_server.scenario.race import Scenario, line_up_race, make_world, make_worlds
from race_server.scenario.track.course import Obstacle
from race_server.scenario.track.lot import Blocks, Lot, People, Zone
from race_server.scenario.track.polyline import corners_of_box
from support.lots import AHEAD, open_lot, park_world, wait

SEEDS = 200
KART = (2.06, 1.30)


def apart(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether a line along a side of one of two boxes, corners (4, 2), separates them."""
    for box in (one, other):
        for side in box[1:3] - box[:2]:
            normal = np.array([-side[1], side[0]])
            a, b = one @ normal, other @ normal
            if a.max() < b.min() or b.max() < a.min():
                return True
    return False


@pytest.fixture(scope="module")
def yards() -> World:
    """Return yards of 70 m, each with three karts."""
    return make_world(parking_scenario("yard-70", vehicles=3), seeds=range(SEEDS))


def starts_of(world: World) -> Iterator[tuple[int, np.ndarray]]:
    for w in range(SEEDS):
        for body in world.bodies[w]:
            x, y = body.x + AHEAD * np.cos(body.heading), body.y + AHEAD * np.sin(body.heading)
            yield w, corners_of_box(x, y, body.heading, *KART)


def slots_of(world: World) -> Iterator[tuple[int, np.ndarray]]:
    for w in range(SEEDS):
        for one in world.parking.parkers[w]:
            yield w, corners_of_box(one.x, one.y, one.heading, one.length, one.width)


def blocks_of(world: World, w: int) -> list[np.ndarray]:
    return [
        corners_of_box(one.x, one.y, one.heading, 2 * one.half_length, 2 * one.half_width)
        for one in world.parking.blocks[w]
        if one.kind != RayHit.NOTHING
    ]


# Blocks may stand in either of two slots; vehicles start in one and go to the other.
TWO_SLOTS = """
area = [0, 30, 0, 10]
from_slots = true
vehicle = "kart-13"
level = "report-a-1"
[[rows]]
at = [5, 5]
towards = 0
count = 2
pitch = 20
length = 3
width = 2
[[zones]]
role = "blocks"
x = [4, 26]
y = [4, 6]
[blocks]
count = [1, 1]
side = [1.0, 1.0]
"""


def test_no_start_touches_a_wall_or_a_block_or_another_start(yards: World) -> None:
    before: tuple[int, list[np.ndarray]] = (-1, [])
    for w, corners in starts_of(yards):
        assert ((corners > (-7.0, -15.0)) & (corners < (73.0, 15.0))).all()
        stands = before[1] if before[0] == w else blocks_of(yards, w)
        assert all(apart(corners, other) for other in stands)
        before = (w, [*stands, corners])


def test_every_slot_is_free_of_walls_blocks_and_other_slots(yards: World) -> None:
    before: tuple[int, list[np.ndarray]] = (-1, [])
    for w, corners in slots_of(yards):
        assert ((corners > (-7.0, -15.0)) & (corners < (73.0, 15.0))).all()
        stands = before[1] if before[0] == w else blocks_of(yards, w)
        assert all(apart(corners, other) for other in stands)
        before = (w, [*stands, corners])


def test_everything_is_drawn_in_its_zone(yards: World) -> None:
    bodies, parkers = yards.bodies, yards.parking.parkers
    blocks, walkers = yards.parking.blocks, yards.parking.walkers
    x = bodies["x"] + AHEAD * np.cos(bodies["heading"])
    assert (x.min(), x.max()) >= (0.0, 11.0)
    assert x.max() <= 12.0
    assert 52.0 <= parkers["x"].min() < 53.0 < 65.0 < parkers["x"].max() <= 66.0
    there = blocks[blocks["kind"] == RayHit.OBSTACLE]
    assert 16.0 <= there["x"].min() < 18.0 < 46.0 < there["x"].max() <= 48.0
    assert 0.5 <= there["half_length"].min() < 0.55 < 0.95 < there["half_length"].max() <= 1.0
    counts = (blocks["kind"] == RayHit.OBSTACLE).sum(axis=1)
    assert set(counts) == {6, 7, 8, 9, 10}
    assert 16.0 <= walkers["x"].min() < walkers["x"].max() <= 48.0
    # Headings all around.
    assert np.histogram(parkers["heading"], 4, (-np.pi, np.pi))[0].min() > SEEDS * 3 / 8


def test_no_person_begins_in_a_block_and_no_way_leads_through_one(yards: World) -> None:
    for w in range(SEEDS):
        (walker,) = yards.parking.walkers[w]
        share = np.linspace(0.0, 1.0, 200)[:, None]
        way = np.array([walker.x, walker.y]) + share * (walker.to_x - walker.x, 0.0)
        way[:, 1] += share[:, 0] * (walker.to_y - walker.y)
        for one in yards.parking.blocks[w]:
            if one.kind == RayHit.NOTHING:
                continue
            dx, dy = (way - (one.x, one.y)).T
            cos, sin = np.cos(one.heading), np.sin(one.heading)
            ahead = np.maximum(abs(dx * cos + dy * sin) - one.half_length, 0.0)
            aside = np.maximum(abs(dy * cos - dx * sin) - one.half_width, 0.0)
            assert np.hypot(ahead, aside).min() >= walker.radius - 1e-9


def test_people_do_not_walk_through_walls_and_blocks_do_not_stand_in_them() -> None:
    zones = [Zone("start", (-20.0, -20.0), (0.0, 0.0)), Zone("people", (-9.0, 9.0), (-9.0, 9.0))]
    zones.append(Zone("blocks", (-9.0, 9.0), (-9.0, 9.0)))
    slots = np.array([(20.0, 0.0, 0.0, 3.0, 2.0)])
    lot = Lot(slots, tuple(zones), people=People(count=1), blocks=Blocks((4, 4), (1.0, 1.0)))
    wall = Obstacle(0.0, 0.0, 0.0, 0.2, 30.0)
    course = course_of_lot("wall", "Wall", (-25.0, 25.0, -20.0, 20.0), (wall,), lot, "wall")
    for seed in range(20):
        world = park_world(course, seed=seed)
        (walker,) = world.parking.walkers[0]
        assert abs(walker.x) > 0.4
        assert walker.x * walker.to_x > 0.0
        for corners in blocks_of(world, 0):
            assert abs(corners[:, 0]).min() > 0.1
            assert abs(np.sign(corners[:, 0]).sum()) == 4


def test_people_walk_past_the_corners_of_what_is_fixed() -> None:
    # A post of 0.1 m stands in a yard of 4 m, turned by 45 degrees: it hides between two squares.
    zones = (
        Zone("start", (-8.0, -8.0), (0.0, 0.0)),
        Zone("people", (-2.0, 2.0), (-2.0, 2.0)),
    )
    lot = Lot(np.array([(8.0, 0.0, 0.0, 3.0, 2.0)]), zones, people=People(count=4, stops=0.0))
    post = Obstacle(0.0, 0.0, np.pi / 4.0, 0.1, 0.1)
    course = course_of_lot("post", "Post", (-10.0, 10.0, -5.0, 5.0), (post,), lot, "post")
    nearest = np.inf
    for seed in range(30):
        world = park_world(course, seed=seed)
        for _ in range(60):
            wait(world, 10)
            walkers = world.parking.walkers[0]
            along, across = walkers["x"] + walkers["y"], walkers["x"] - walkers["y"]
            aside = np.maximum(np.abs([along, across]) / np.sqrt(2.0) - 0.05, 0.0)
            nearest = min(nearest, np.hypot(*aside).min())
    assert 0.3 <= nearest < 0.35


def test_no_person_begins_in_a_vehicle() -> None:
    # With 0.3 m around it, the kart takes 5 of the 36 m² of the zone.
    zones = (Zone("start", (0.0, 0.0), (0.0, 0.0)), Zone("people", (-3.0, 3.0), (-3.0, 3.0)))
    lot = Lot(np.array([(8.0, 0.0, 0.0, 3.0, 2.0)]), zones, people=People(count=1))
    course = course_of_lot("crowd", "Crowd", (-10.0, 10.0, -5.0, 5.0), (), lot, "crowd")
    for seed in range(30):
        (walker,) = park_world(course, seed=seed).parking.walkers[0]
        aside = max(abs(walker.x) - 0.5 * KART[0], 0.0), max(abs(walker.y) - 0.5 * KART[1], 0.0)
        assert np.hypot(*aside) >= walker.radius


def test_the_same_seed_gives_the_same_lot_and_another_seed_another(yards: World) -> None:
    scenario = parking_scenario("yard-70", vehicles=3)
    alone = make_world(scenario, seeds=[17])
    assert bytes_of(alone.parking, 0) == bytes_of(yards.parking, 17)
    assert digest(alone) == digest(yards, 17)
    assert len({digest(yards, w) for w in range(SEEDS)}) == SEEDS


def test_a_round_leaves_nothing_behind_for_the_next() -> None:
    yard, zone = parking_scenario("yard-70"), parking_scenario("zone-30")
    world = make_worlds([yard, zone], [5, 5])
    fresh = digest(world, 1)
    used = world._replace(rules=world.rules.copy())
    used.rules[1] = world.rules[0]
    line_up_race(used, 1, yard, 6)
    used.rules[1] = world.rules[1]
    line_up_race(used, 1, zone, 5)
    assert digest(used, 1) == fresh


def test_eight_worlds_evolve_like_each_alone() -> None:
    scenario = parking_scenario("yard-70", vehicles=2)
    batch = make_world(scenario, seeds=range(8))
    rng = np.random.default_rng(1)
    controls = rng.uniform(-1.0, 1.0, (20, 8, 2, 4))
    controls[..., 2:] = 0.0
    for command in controls:
        advance(batch, command, 6)
    for w in (0, 5, 7):
        alone = make_world(scenario, seeds=[w])
        for command in controls:
            advance(alone, command[w : w + 1], 6)
        assert digest(alone) == digest(batch, w)


def test_as_many_vehicles_as_slots_have_one_each() -> None:
    for seed in range(20):
        world = park_world(open_lot(8), vehicles=8, seed=seed)
        assert sorted(world.parking.parkers["slot"][0]) == list(range(8))


def test_the_share_of_slots_that_hold_a_vehicle_is_that_of_the_lot() -> None:
    course = load_lot("aisle-90")
    assert course.lot is not None
    world = make_world(parking_scenario("aisle-90"), seeds=range(50))
    blocks, parkers = world.parking.blocks, world.parking.parkers
    taken = (blocks["kind"] == RayHit.KART).sum() / (50 * (len(course.lot.slots) - 1))
    # 1550 slots: a standard deviation of 0.012.
    assert taken == pytest.approx(course.lot.taken.share, abs=0.04)
    # The slot of the vehicle that drives is never taken.
    for w in range(50):
        for block in blocks[w][blocks["kind"][w] == RayHit.KART]:
            assert np.hypot(block.x - parkers["x"][w, 0], block.y - parkers["y"][w, 0]) > 1.0


# Starts with trailers


def test_who_starts_in_a_slot_stands_straight_in_one_that_none_goes_to_and_none_stands_in() -> None:
    world = make_world(parking_scenario("grid-150", vehicles=3), seeds=range(10))
    course = load_lot("grid-150")
    assert course.lot is not None
    for w in range(10):
        parkers, blocks = world.parking.parkers[w], world.parking.blocks[w]
        began = parkers["began"].tolist()
        assert len({*began, *parkers["slot"].tolist()}) == 6
        standing = blocks[blocks["kind"] == RayHit.KART]
        for k, slot in enumerate(course.lot.slots[began]):
            body = world.bodies[w, k]
            assert np.hypot(standing["x"] - slot[0], standing["y"] - slot[1]).min() > 1.0
            assert body.heading == body.trailers[0].heading == slot[2]
            # The centre of gravity of a straight lorry lies 5 m ahead of its middle.
            ahead = (slot[0] + 5.0 * np.cos(slot[2]), slot[1] + 5.0 * np.sin(slot[2]))
            assert (body.x, body.y) == pytest.approx(ahead)


def test_hitches_are_bent_at_the_start_as_far_as_the_zone_says() -> None:
    world = make_world(parking_scenario("dock-35"), seeds=range(30))
    bodies = world.bodies[:, 0]
    angles = np.degrees(bodies["heading"] - bodies["trailers"]["heading"][:, 0])
    angles = (angles + 180.0) % 360.0 - 180.0
    assert -10.0 <= angles.min() < -5.0
    assert 5.0 < angles.max() <= 10.0


def test_more_vehicles_than_pairs_of_slots_to_start_in_and_to_go_to_are_refused() -> None:
    with pytest.raises(ScenarioError, match=r"55 vehicles .* each needs one to start in"):
        make_world(parking_scenario("grid-150", vehicles=55))


def halls(*, as_polygons: bool) -> World:
    """Return 50 yards of 60 by 40 m in which a hall of 16 by 16 m fills half of each zone."""
    halls = [Obstacle(x, 20.0, 0.3, 16.0, 16.0) for x in (15.0, 45.0)]
    corners = [corners_of_box(one.x, one.y, one.heading, 16.0, 16.0)[::-1] for one in halls]
    area = (0.0, 60.0, 0.0, 40.0)
    zones = tuple(
        Zone(role, *zone)
        for role, zone in (
            ("start", ((3.0, 27.0), (8.0, 32.0))),
            ("goal", ((33.0, 57.0), (8.0, 32.0))),
            ("blocks", ((0.0, 60.0), (0.0, 40.0))),
            ("people", ((0.0, 60.0), (0.0, 40.0))),
        )
    )
    lot = Lot(np.zeros((0, 5)), zones, blocks=Blocks((9, 9), (0.5, 1.0)), people=People(8))
    fixed = () if as_polygons else tuple(halls)
    course = course_of_lot("h", "H", area, fixed, lot, "h", corners if as_polygons else ())
    return make_world(Scenario(course, karts=1, vehicles=(KART_13,), rules=LOT_RULES), range(50))


@pytest.mark.parametrize("as_polygons", [False, True])
def test_nothing_is_drawn_inside_of_what_is_solid(as_polygons: bool) -> None:
    world = halls(as_polygons=as_polygons)
    blocks = world.parking.blocks[world.parking.blocks["kind"] == RayHit.OBSTACLE]
    assert len(blocks) == 50 * 9
    for drawn in (world.bodies, world.parking.parkers, blocks, world.parking.walkers):
        for x in (15.0, 45.0):
            dx, dy = drawn["x"] - x, drawn["y"] - 20.0
            ahead, aside = dx * np.cos(0.3) + dy * np.sin(0.3), dy * np.cos(0.3) - dx * np.sin(0.3)
            assert (np.maximum(np.abs(ahead), np.abs(aside)) > 8.0).all()


def test_no_block_stands_in_the_slot_that_a_vehicle_starts_in(tmp_path: Path) -> None:
    file = tmp_path / "two.toml"
    file.write_text(TWO_SLOTS)
    world = make_world(parking_scenario(file, vehicle="kart-13"), seeds=list(range(40)))
    for w in range(40):
        body, block = world.bodies[w, 0], world.parking.blocks[w, 0]
        assert world.parking.parkers[w, 0].began >= 0
        if block.kind != codes.NOTHING:
            assert abs(block.x - body.x) > 2.0
