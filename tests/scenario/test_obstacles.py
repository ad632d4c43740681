"""Obstacles: wherever chance puts them, a car can pass, and every part of the world knows them."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.competition.race_day.formats import Obstacles
from race_server.competition.race_day.obstacles import QUIET_LENGTHS, corners_of, with_obstacles
from race_server.core.messages import EventKind
from race_server.core.step import advance
from race_server.core.vehicle_presets import TT02
from race_server.errors import ScenarioError
from race_server.scenario.race import Rules, Scenario, make_world
from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.load import load_course
from race_server.scenario.track.polyline import is_inside, loops_of, nearest_on, segments_of
from support.courses import SMALL_RING, ring

PASSAGE = 2.4 * TT02.width
TRACKS = ("covapsy-base", "covapsy-train-2023", "covapsy-test-2023")
STEP = 0.06  # [m] of the raster


@cache
def raster_of(track: str) -> tuple[tuple[int, int], Floats, Floats]:
    """Return shape, points and distances to the borders of a raster, negative outside."""
    course = load_course(track)
    low, high = (getattr(course.borders.reshape(-1, 2), name)(axis=0) for name in ("min", "max"))
    columns, rows = (int(count) for count in np.ceil((high - low) / STEP))
    points = np.mgrid[:columns, :rows].T.reshape(-1, 2) * STEP + low
    loops = sorted(loops_of(course.borders), key=lambda loop: -np.ptp(loop[:, 0]))
    inside = is_inside(points, loops[0]) & ~is_inside(points, loops[1])
    distance = np.full(len(points), -1.0)
    distance[inside] = nearest_on(course.borders, points[inside])[0]
    return (rows, columns), points, distance


def can_lap(track: str, boxes: tuple[Obstacle, ...], width: float) -> bool:
    """Return whether a disc of a diameter fits round a track among boxes: a flood over a raster.

    The timing line is a wall that the flood must reach from behind.
    """
    course = load_course(track)
    shape, points, clear = raster_of(track)
    for box in boxes:
        sides = segments_of(corners_of(box))
        apart = np.where(is_inside(points, sides), -1.0, nearest_on(sides, points)[0])
        clear = np.minimum(clear, apart)
    # Half a cell's diagonal is what the raster may miss.
    free = clear >= 0.5 * width - 0.71 * STEP
    x, y, heading, _ = course.line[0]
    ahead = (points - (x, y)) @ (np.cos(heading), np.sin(heading))
    across = np.abs((points - (x, y)) @ (-np.sin(heading), np.cos(heading)))
    at_line = free & (across < course.half_widths[0].max())
    behind = at_line & (ahead > -2 * STEP) & (ahead <= -STEP)
    wall = at_line & (ahead > -STEP) & (ahead <= STEP)
    begin = at_line & (ahead > STEP) & (ahead <= 2 * STEP)
    room, rows = free & ~wall, shape[1]
    waiting = list(np.flatnonzero(begin))
    while waiting:  # the borders keep every cell off the edge of the raster
        cell = waiting.pop()
        if behind[cell]:
            return True
        for near in (cell - 1, cell + 1, cell - rows, cell + rows):
            if room[near]:
                room[near] = False
                waiting.append(near)
    return False


@settings(max_examples=20, deadline=None)
@given(st.sampled_from(TRACKS), st.integers(0, 10_000))
def test_every_placement_leaves_a_passage(track: str, seed: int) -> None:
    boxes = with_obstacles(load_course(track), Obstacles(), TT02, seed).obstacles
    assert can_lap(track, boxes, PASSAGE)


def test_the_flood_knows_a_blocked_track() -> None:
    course = load_course("covapsy-base")
    x, y, heading, _ = course.line[200]
    wall = Obstacle(float(x), float(y), float(heading) + np.pi / 2, 2.0, 0.19)
    assert can_lap("covapsy-base", (), PASSAGE)
    assert not can_lap("covapsy-base", (wall,), PASSAGE)


@settings(max_examples=30, deadline=None)
@given(st.sampled_from(TRACKS), st.integers(0, 10_000))
def test_none_stands_near_the_timing_line_or_the_starting_car(track: str, seed: int) -> None:
    course = load_course(track)
    quiet = QUIET_LENGTHS * TT02.length
    for box in with_obstacles(course, Obstacles(), TT02, seed).obstacles:
        for place in (course.line[0, :2], course.grid[0, :2]):
            assert np.hypot(*(place - (box.x, box.y))) > 0.5 * quiet


def test_the_same_seed_places_the_same_obstacles_and_another_one_others() -> None:
    course = load_course("covapsy-base")
    one, two, other = (with_obstacles(course, Obstacles(), TT02, seed) for seed in (1, 1, 2))
    assert one.obstacles == two.obstacles
    assert one.digest == two.digest
    assert other.digest not in {one.digest, course.digest}


def test_a_track_without_room_says_so() -> None:
    narrow = ring(radius=6.0, half_width=0.3)
    with pytest.raises(ScenarioError, match=r"ring has no room .* 0.46 m stay free"):
        with_obstacles(narrow, Obstacles(), TT02, 1)


def beside(course: Course, offset: float) -> Course:
    """Return a ring with a box 20° after the timing line, at an offset from its middle."""
    angle = np.radians(20.0)
    x, y = (6.0 - offset) * np.cos(angle), (6.0 - offset) * np.sin(angle)
    box = Obstacle(float(x), float(y), float(angle + np.pi / 2), TT02.length, TT02.width)
    return replace(course, obstacles=(box,))


def lap_quarter(course: Course) -> tuple[list[int], float, float]:
    """Return events, distance [m] and nearest lidar range [m] of a kart that follows the line."""
    rules = Rules(laps=0, countdown_s=0.6, items=False, stuck_s=0.0)
    world = make_world(Scenario(course, rules=rules, karts=1))
    kinds, nearest = [], 9.0
    for _ in range(140):
        racer = world.racers[0, 0]
        wanted = 0.044 - 0.5 * racer.lateral_offset - racer.heading_error
        steering = np.clip(wanted / 0.314, -1.0, 1.0)
        advance(world, np.array([[[steering, 0.3 if world.races[0].tick > 36 else 0.0, 0, 0]]]), 3)
        kinds += [int(row.kind) for row in world.events[0][: world.event_counts[0]]]
        world.event_counts[0] = 0
        ahead = world.sight.lidar[0, 0, 0]
        nearest = min(nearest, float(ahead[len(ahead) // 2 - 3 : len(ahead) // 2 + 4].min()))
    return kinds, float(world.racers[0, 0].distance), nearest


def test_a_kart_that_drives_into_an_obstacle_touches_it_and_stays_there() -> None:
    kinds, distance, nearest = lap_quarter(beside(SMALL_RING, 0.0))
    assert EventKind.CONTACT_WALL in kinds
    assert distance < 6.0 * np.radians(20.0)
    assert 0.0 < nearest < 0.5


def test_a_kart_that_drives_past_one_makes_its_way_like_on_an_empty_track() -> None:
    kinds, distance, _ = lap_quarter(beside(SMALL_RING, 0.5))
    assert EventKind.CONTACT_WALL not in kinds
    assert distance == pytest.approx(lap_quarter(SMALL_RING)[1])


def test_obstacles_need_no_other_machine_code() -> None:
    import numba

    courses = (SMALL_RING, beside(SMALL_RING, 0.5))
    worlds = [make_world(Scenario(course, karts=1)) for course in courses]
    assert len({numba.typeof(world) for world in worlds}) == 1
