"""False brakes: ways past borders, echoes out of nowhere, and how a moment in a race ended."""

import math
from collections.abc import Iterator
from functools import partial
from itertools import islice

import numpy as np
import pytest

from race_agents.plant.hindsight import came_close, is_blocked, was_blocked
from race_agents.plant.raced import Frame, Raced, driven_races
from race_agents.plant.shadow import shadow
from race_agents.unit.ego import Ego
from race_agents.unit.limits import Limits
from race_agents.unit.objects import Objects, groups_of
from race_agents.unit.passage import leads_past
from race_agents.unit.safety import Echoes
from race_server.core import codes
from race_server.core.alert import DangerStage
from race_server.core.messages import Status
from race_server.core.vehicle_presets import KART_60, TT02
from race_server.net.wire.spectate import KART

LIMITS = Limits.of(KART_60)
# Walls 40 m to the left and right.
FAR = np.array([[-50.0, -40.0, 50.0, -40.0], [-50.0, 40.0, 50.0, 40.0]])


def test_no_way_leads_past_a_wall_across_the_road_and_one_past_a_wall_beside_it() -> None:
    y = np.arange(-10.0, 10.1, 0.5)
    assert not leads_past(np.full(len(y), 6.0), y, 10.0, LIMITS)
    assert leads_past(np.arange(0.0, 20.0, 0.5), np.full(40, 1.0), 10.0, LIMITS)


def test_the_way_through_a_chicane_is_two_arcs() -> None:
    # A kart 1.3 m wide passes to the right of the first wall, and to the left of the second.
    first, second = np.arange(-0.5, 3.0, 0.25), np.arange(-3.0, -0.9, 0.25)
    x = np.concatenate([np.full(len(first), 6.0), np.full(len(second), 9.0)])
    y = np.concatenate([first, second])
    assert leads_past(x, y, 9.0, LIMITS)
    # The second wall beside the first leaves 0.5 m.
    assert not leads_past(np.full(len(x), 6.0), y, 9.0, LIMITS)


def test_no_person_appears_where_the_radar_just_saw_the_wall_behind() -> None:
    def scan(*echoes: tuple[float, float, int]) -> Echoes:
        x, y, kinds = (np.array(column) for column in zip(*echoes, strict=True))
        return Echoes(x.astype(float), y.astype(float), np.zeros(len(x)), kinds.astype(np.uint8))

    wall, person = (20.0, 0.0, codes.BORDER), (8.0, 0.0, codes.PERSON)
    stands = Ego(0.0, 0.0, 0.0, 0.0)

    def seen(*scans: Echoes) -> int:
        objects = Objects()
        for each in scans:
            objects.look(each, stands, 0.05)
        return int(objects.seen.may_be_people.sum())

    open_view = [scan(wall)] * 3
    assert seen(*open_view, scan(person), scan(person)) == 0  # a mirrored echo does that
    assert seen(*open_view, scan(person), scan(person), scan(person)) == 1
    beside = (20.0, 5.0, codes.BORDER)  # there was no view of the place: a person stepped out
    assert seen(*[scan(beside)] * 3, scan(person), scan(person)) == 1


def test_what_was_seen_through_counts_from_where_the_radar_was_then() -> None:
    """At 16 m/s a place 1.3 m beside the way is at another bearing in each scan."""
    ego, first = Ego(0.8, 0.0, 0.0, 16.0), math.atan2(1.3, 10.0 - 1.6)
    objects = Objects(radar=1.6)

    def look(*echoes: tuple[float, float, float, int]) -> int:
        x, y, closing, kinds = (np.array(values) for values in zip(*echoes, strict=True))
        objects.look(Echoes(x, y, closing, kinds.astype(np.uint8)), ego, 0.05)
        return int(objects.seen.may_be_people.sum())

    # Each time the wall 30 m away is seen just behind the place, which comes nearer by 0.8 m.
    for place in (10.0, 9.2, 8.4):
        way = math.atan2(1.3, place - 1.6)
        wall = 1.6 + 30.0 * math.cos(way), 30.0 * math.sin(way), 16.0 * math.cos(way)
        look((*wall, codes.BORDER))
    assert way - first > 0.025  # so from here none of these walls lies behind it
    closing = 16.0 * math.cos(way)
    assert look((7.6, 1.3, closing, codes.OBSTACLE)) == 0
    assert look((6.8, 1.3, closing, codes.OBSTACLE)) == 0
    assert look((6.0, 1.3, closing, codes.OBSTACLE)) == 1


@pytest.mark.parametrize("ends", [(7.0, 10.0), (6.6, 7.5)])
def test_what_lies_on_the_line_of_a_wall_is_the_wall_until_it_is_seen_twice_more(
    ends: tuple[float, float],
) -> None:
    """Two stray echoes, a scan apart, on a wall: between two of its echoes, or 1 m beyond them."""
    stands = Ego(0.0, 0.0, 0.0, 0.0)

    def seen(aside: float, scans: int) -> int:
        objects = Objects()
        x, y = np.array([*ends, 8.5]), np.array([1.0, 1.0, aside])
        kinds = np.array([codes.BORDER, codes.BORDER, codes.OBSTACLE], np.uint8)
        for _ in range(scans):
            objects.look(Echoes(x, y, np.zeros(3), kinds), stands, 0.05)
        return int(objects.seen.may_be_people.sum())

    assert seen(1.1, scans=2) == 0
    assert seen(1.1, scans=3) == 1
    assert seen(0.2, scans=2) == 1  # a person on the way, 0.8 m from the wall


def scan_of(*echoes: tuple[float, float, float, int]) -> Echoes:
    """Return echoes of x, y, closing speed and kind."""
    x, y, closing, kinds = (np.array(column) for column in zip(*echoes, strict=True))
    return Echoes(x.astype(float), y.astype(float), closing.astype(float), kinds.astype(np.uint8))


@pytest.mark.parametrize(
    ("distance", "scans", "seen"),
    [(3.0, (1, 1), 1), (1.5, (1, 1), 0), (1.5, (1, 1, 1), 1), (3.0, (1, 0, 1), 0)],
)
def test_a_lone_echo_counts_that_the_last_scan_confirms_and_one_at_the_bumper_that_two_do(
    distance: float, scans: tuple[int, ...], seen: int
) -> None:
    # It comes by 12 m/s, or 0.6 m a scan: 1.5 m are an eighth of a second.
    objects, ego = Objects(), Ego(0.6, 0.0, 0.0, 12.0)
    for number, is_there in enumerate(scans):
        x = distance + 0.6 * (len(scans) - 1 - number)
        there = scan_of((x, 0.0, 12.0, codes.OBSTACLE))
        objects.look(there if is_there else Echoes.nothing(), ego, 0.05)
    assert objects.seen.may_be_people.sum() == seen


@pytest.mark.parametrize("pattern", ["1110101010101010", "111001001001001"])
def test_a_person_that_is_known_is_not_lost_where_scans_miss_it(pattern: str) -> None:
    objects, ego, seen = Objects(), Ego(0.5, 0.0, 0.0, 10.0), []
    for number, is_there in enumerate(pattern):
        person = scan_of((12.0 - 0.5 * number, 0.2, 10.0, codes.PERSON))
        objects.look(person if is_there == "1" else Echoes.nothing(), ego, 0.05)
        seen.append(bool(objects.seen.may_be_people.any()))
    assert seen[1:] == [is_there == "1" for is_there in pattern[1:]]


def test_a_small_car_needs_a_gap_of_about_its_width() -> None:
    limits, nose = Limits.of(TT02), Limits.of(TT02).nose

    def is_free(gap: float) -> bool:
        y = np.concatenate([np.arange(0.5 * gap, 2.0, 0.03), -np.arange(0.5 * gap, 2.0, 0.03)])
        return leads_past(np.full(len(y), nose + 0.5), y, 4.0, limits)

    assert not is_free(0.7 * TT02.width)
    assert is_free(1.2 * TT02.width)


def test_a_person_among_ten_times_as_many_echoes_of_a_kart_is_a_part_of_it() -> None:
    def seen(karts: int, people: int) -> int:
        objects, stands = Objects(), Ego(0.0, 0.0, 0.0, 0.0)
        rows = [(3.0 + 0.01 * row, 0.0, 1.0, codes.KART_HIT) for row in range(karts)]
        rows += [(3.0, 0.1 + 0.1 * row, 1.0, codes.OBSTACLE) for row in range(people)]
        for _ in range(4):
            objects.look(scan_of(*rows), stands, 0.05)
        return int(objects.seen.may_be_people.sum())

    assert seen(karts=12, people=1) == 0
    assert seen(karts=4, people=2) == 2  # a child who comes from behind a kart


def test_karts_that_touch_each_other_are_two() -> None:
    x, y = np.array([8.0, 8.0, 8.3, 8.3]), np.array([-0.8, -0.2, 0.4, 1.0])
    closing, kinds = np.array([6.0, 6.0, 1.0, 1.0]), np.full(4, codes.KART_HIT, np.uint8)
    assert [group.sum() for group in groups_of(Echoes(x, y, closing, kinds))] == [2, 2]


def karts(*rows: tuple[float, float, float, float]) -> np.ndarray:
    """Return karts of x, y, heading, speed."""
    found = np.zeros(len(rows), KART)
    for seat, (kart, row) in enumerate(zip(found, rows, strict=True)):
        kart["seat"], kart["status"] = seat, Status.RACING
        kart["x"], kart["y"], kart["heading"], kart["speed"] = row
    return found


def test_a_corner_close_to_a_border_is_close_where_the_middle_is_not() -> None:
    # Turned by 45° a corner reaches out further than the side.
    reach = 0.5 * KART_60.width + 0.15
    border = np.array([[-50.0, reach, 50.0, reach]])
    near = partial(came_close, seat=0, vehicle=KART_60, borders=border)
    assert not near([Frame(0, karts((0.0, 0.0, 0.0, 5.0)))])
    assert near([Frame(0, karts((0.0, 0.0, 0.8, 5.0)))])


@pytest.mark.parametrize(
    ("other", "is_in_the_way"),
    [
        ((12.0, 0.0, 0.0, 2.0), True),  # slow, ahead
        ((12.0, 0.0, 0.0, 9.0), False),  # as fast
        ((12.0, 6.0, 0.0, 2.0), False),  # slow, on another lane
        ((12.0, 6.0, -1.57, 6.0), True),  # comes across in a second
    ],
)
def test_who_is_slower_and_gets_in_the_way_is_braked_for_rightly(
    other: tuple[float, float, float, float], is_in_the_way: bool
) -> None:
    row = karts((0.0, 0.0, 0.0, 10.0))[0]
    x, y, heading, speed = other
    others = np.array([[x, y, heading, speed * np.cos(heading), speed * np.sin(heading)]])
    assert is_blocked(row, others, KART_60, LIMITS) is is_in_the_way


def drives_towards(place: float, stops_at: float) -> Iterator[Frame]:
    """Yield a kart that drives 15 m/s up to a place, and another one that stands."""
    for number in range(120):
        x = min(0.75 * number, stops_at)
        speed = 15.0 if x < stops_at else 0.0
        yield Frame(3 * number, karts((x, 0.0, 0.0, speed), (place, 0.0, 0.0, 0.0)))


def test_shadow_mode_finds_the_brake_for_a_kart_that_stands_and_calls_it_right() -> None:
    race = Raced("one", FAR, (KART_60, KART_60), drives_towards(40.0, 38.0))
    found = shadow([race])
    assert found.count(DangerStage.FULL) >= 1
    assert found.count_needless(DangerStage.FULL) == found.count_false(DangerStage.FULL) == 0
    assert found.metres == pytest.approx(38.0, abs=1.0)
    # It is met after 2.5 s, at the 50th frame: a race that ends before shows no end of it.
    until = Raced("one", FAR, (KART_60, KART_60), islice(drives_towards(40.0, 38.0), 48))
    assert shadow([until]).count(DangerStage.FULL) == 0


def test_races_are_driven_by_eight_karts_and_the_same_again_under_the_same_seed() -> None:
    def last(seed: int) -> Frame:
        race = next(driven_races(KART_60, seed))
        return list(islice(race.frames, 60))[-1]

    frame = last(3)
    assert frame.tick == 180
    assert (frame.karts["speed"] > 3.0).all()  # three seconds after the lights
    assert np.array_equal(frame.karts, last(3).karts)
    assert not np.array_equal(frame.karts, last(4).karts)


def test_a_brake_is_not_false_where_the_way_is_blocked_by_when_it_bites() -> None:
    def frames(*speeds: float) -> list[Frame]:
        """Return moments 0.05 s apart: a kart at 10 m/s, and one 8 m ahead at these speeds."""
        return [
            Frame(3 * n, karts((0.0, 0.0, 0.0, 10.0), (8.0, 0.0, 0.0, speed)))
            for n, speed in enumerate(speeds)
        ]

    blocked = partial(was_blocked, seat=0, vehicle=KART_60, limits=LIMITS)
    assert LIMITS.reaction_s == 0.2
    assert not blocked(frames(9.0, 9.0, 9.0, 9.0, 9.0, 9.0))
    assert blocked(frames(9.0, 9.0, 9.0, 9.0, 6.0, 6.0))  # 0.2 s later, slower by 4 m/s
    assert not blocked(frames(9.0, 9.0, 9.0, 9.0, 9.0, 6.0))


def test_a_kart_that_spins_goes_no_tighter_arc_than_tyres_hold() -> None:
    """At 15 m/s the tyres hold a bend of 26 m, which is 3.5 m aside 13 m ahead."""
    row = karts((0.0, 0.0, 0.0, 15.0))[0]
    row["yaw_rate"] = 3.0  # as on a circle of 5 m
    assert is_blocked(row, np.array([[13.0, 3.0, 0.0, 1.0, 0.0]]), KART_60, LIMITS)
