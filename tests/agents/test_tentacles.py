"""Arcs that the lidar judges: their shapes, and which one is taken."""

import math

import numpy as np
import pytest

from race_agents.drivers import tentacle_search, tentacles, tentacles_report_b
from race_agents.drivers.tentacle_search import (
    find_nearest,
    free_along,
    place_points,
    slide_window,
    square_points,
    wall_along,
)
from race_agents.drivers.tentacles import clearance_of, flatness_of
from race_agents.drivers.tentacles_report_b import (
    ARCS,
    STRAIGHT,
    arc_curvature,
    arc_length,
    class_radius,
    free_length,
    longest,
    move_off,
)
from race_server.core.kernel_driver import KEPT, memory_size
from race_server.core.messages import Control
from race_server.core.observation import Observation, layout_of
from race_server.core.vehicle_presets import TT02
from race_server.core.vehicles import vehicle_record
from support.briefings import briefing

FIELD = math.radians(200.0)
RAYS = 201
CAR = vehicle_record(TT02)[0]

# The arcs of the report


def test_the_slowest_class_begins_at_the_turning_radius() -> None:
    assert class_radius(0, 1.0, 0.70) == pytest.approx(0.70)


def test_the_fastest_class_is_straight() -> None:
    assert math.isinf(class_radius(14, 1.0, 0.70))
    assert tentacles_report_b.class_length(14, 1.0) == pytest.approx(3.2 + 6.7)


def test_arc_0_is_hard_left_40_straight_and_80_hard_right() -> None:
    curvatures = [arc_curvature(arc, 0.5) for arc in range(ARCS)]
    assert curvatures[0] == 2.0
    assert curvatures[STRAIGHT] == 0.0
    assert curvatures[80] == -2.0
    assert curvatures == sorted(curvatures, reverse=True)


def test_straighter_arcs_are_longer() -> None:
    # e sqrt(10/40) is half of e = 2.7 m.
    assert arc_length(0, 3.2, 1.0) == pytest.approx(3.2)
    assert arc_length(10, 3.2, 1.0) == pytest.approx(3.2 + 1.35)
    assert arc_length(70, 3.2, 1.0) == pytest.approx(3.2 + 1.35)
    assert arc_length(STRAIGHT, 3.2, 1.0) == pytest.approx(5.9)


def test_the_straight_arc_ends_before_a_wall_ahead() -> None:
    # Points every 0.2 m; the last one within 1.5 m is at 1.4 m.
    assert free_length(np.full(RAYS, 1.5), 0, RAYS, FIELD, 0.0, 0.0, 4.0) == pytest.approx(1.4)


def test_a_half_circle_reaches_no_further_than_its_diameter() -> None:
    # Radius 0.5 m: it ends 1 m to the left, at 90°, where 1.1 m are free.
    half_circle = 0.5 * math.pi
    free = free_length(np.full(RAYS, 1.1), 0, RAYS, FIELD, 0.0, 2.0, half_circle)
    assert free == pytest.approx(half_circle)


def test_an_arc_that_leaves_the_lidars_field_ends_there() -> None:
    # The field ends at 100°, where an arc has turned by 200°: 10 of 18 points on a full circle.
    free = free_length(np.full(RAYS, 8.0), 0, RAYS, FIELD, 0.0, 2.0, math.pi)
    assert free == pytest.approx(math.pi * 11 / 20)


def test_of_equally_long_arcs_the_straightest_wins() -> None:
    lengths = np.ones(ARCS)
    assert longest(lengths, 0) == STRAIGHT
    lengths[[10, 60]] = 2.0
    assert longest(lengths, 0) == 60


def test_the_choice_moves_away_from_the_side_with_shorter_arcs() -> None:
    lengths = np.full(ARCS, 2.0)
    lengths[:STRAIGHT] = 1.0  # a wall along the left
    # Right of the last short one by three, no neighbour is short any more.
    assert move_off(lengths, 0, STRAIGHT, 0.1) == STRAIGHT + 3


def test_between_two_like_sides_the_choice_stays() -> None:
    lengths = np.full(ARCS, 1.0)
    lengths[STRAIGHT] = 2.0
    assert move_off(lengths, 0, STRAIGHT, 0.1) == STRAIGHT


# The arcs of the paper


def test_the_papers_sharpest_arc_has_a_radius_of_four_metres() -> None:
    # 8 m over 0.6 pi.
    assert tentacles.class_length(0, 1.0) == pytest.approx(8.0)
    assert tentacles.class_radius(0, 1.0) == pytest.approx(4.244, abs=1e-3)


def test_the_faster_the_wider_and_the_longer() -> None:
    radii = [tentacles.class_radius(number, 1.0) for number in range(15)]
    assert radii == sorted(radii)
    assert tentacles.speed_class(0.0) == 0
    assert tentacles.speed_class(30.0) == 14


def test_clearance_is_half_at_its_half_length_and_none_on_a_free_arc() -> None:
    assert clearance_of(4.5, 9.0, 0.45) == pytest.approx(0.5)
    assert clearance_of(9.0, 9.0, 0.45) == 0.0
    assert clearance_of(0.0, 9.0, 0.45) == 1.0


def test_no_wall_is_flat() -> None:
    assert flatness_of(0.0, 0.45) == 0.0
    assert 0.9 < flatness_of(2.0, 0.45) < 1.0


def memory_of(ranges: np.ndarray) -> np.ndarray:
    memory = np.zeros(memory_size(RAYS))
    memory[KEPT : KEPT + RAYS] = ranges
    place_points(memory, RAYS, FIELD, 0.0, 0.0)
    square_points(memory, RAYS)
    return memory


def free_of(ranges: np.ndarray, arc: int, length: float, sharpest: float = 0.79) -> float:
    """Return how much [m] is free of one of the arcs whose sharpest have a radius [m]."""
    memory = memory_of(ranges)
    find_nearest(memory, RAYS, sharpest, CAR)
    arcs = KEPT + 4 * RAYS + tentacle_search.BENDS + arc
    bend, along, aside = memory[arcs : arcs + 3 * ARCS : ARCS]
    return free_along(abs(bend), along, aside, length, 0.5 * TT02.length)


def corridor(ahead: float, side: float) -> np.ndarray:
    """Return what is seen between two walls at `side` [m], with one `ahead` [m] across."""
    angles = np.radians(np.arange(-100.0, 101.0))
    with np.errstate(divide="ignore"):
        across = np.where(np.cos(angles) > 0.0, ahead / np.cos(angles), np.inf)
        return np.minimum(across, np.minimum(side / np.abs(np.sin(angles)), 8.0))


def test_a_wall_ahead_is_met_half_a_body_before_the_middle() -> None:
    assert free_of(corridor(2.0, 1.0), STRAIGHT, 3.0) == pytest.approx(2.0 - 0.225)


def test_walls_beside_are_in_the_support_area_but_do_not_stop() -> None:
    ranges = corridor(8.0, 0.3)
    assert free_of(ranges, STRAIGHT, 3.0) == 3.0
    memory = memory_of(ranges)
    wall = wall_along(memory, RAYS, math.radians(1.0), 1.0, 0.0, 3.0, math.inf, CAR)
    assert wall > 0.3
    assert slide_window(memory, KEPT + 4 * RAYS + tentacle_search.FIRST_BIN, TT02.width) < 0.5 / 3.0


def test_an_opening_to_the_left_is_taken() -> None:
    # A wall 0.8 m ahead, another on the right; to the left nothing.
    ranges = corridor(0.8, 1.0)
    ranges[101 + 20 :] = 8.0
    assert free_of(ranges, 0, 1.0) == 1.0
    assert free_of(ranges, ARCS - 1, 1.0) < 0.9


def plainly_free(ranges: np.ndarray, curvature: float, length: float) -> float:
    """Return the free length [m] of an arc by asking every point for its place along it."""
    angles, free = np.radians(np.arange(-100.0, 101.0)), length
    for x, y in zip(ranges * np.cos(angles), ranges * np.sin(angles), strict=True):
        along, lateral = x, abs(y)
        if curvature:
            to_left, bend = math.copysign(1.0, curvature) * y, abs(curvature)
            along = math.atan2(bend * x, 1.0 - bend * to_left) / bend
            lateral = abs(math.hypot(bend * x, 1.0 - bend * to_left) - 1.0) / bend
        if 0.0 <= along <= length + 0.225 and lateral < 0.6 * TT02.width:
            free = min(free, max(along - 0.225, 0.0))
    return free


@pytest.mark.parametrize("seed", range(4))
def test_every_arc_ends_where_its_first_point_is(seed: int) -> None:
    ranges = np.random.default_rng(seed).uniform(0.05, 3.0, RAYS)
    for arc in range(ARCS):
        curvature = tentacle_search.arc_curvature(arc, 0.79)
        length = tentacle_search.arc_length(arc, 0.72, 0.09)
        plain = plainly_free(ranges, curvature, length)
        assert free_of(ranges, arc, length) == pytest.approx(plain, abs=1e-9)


# Steering, throttle and brake that the search of every arc for every point decided on.
DECIDED = [
    (3.0, 0.6, 2.0, (-0.09858203543733496, 1.0, 0.0)),
    (1.2, 0.6, 1.5, (0.09475107936880046, 1.0, 0.0)),
    (6.0, 0.8, 4.0, (-0.08359321320423724, 1.0, 0.0)),
    (2.0, 0.25, 1.0, (0.336825302223019, 1.0, 0.0)),
    (0.5, 0.2, 6.0, (0.11362833334701977, 0.0, 1.0)),
    (1.0, 0.5, 8.0, (-0.06393448284558681, 0.0, 1.0)),
]


@pytest.mark.parametrize(("ahead", "side", "speed", "decided"), DECIDED)
def test_arcs_that_cannot_win_are_left_out_and_the_choice_stays(
    ahead: float, side: float, speed: float, decided: tuple[float, float, float]
) -> None:
    control = decision(ahead, side, speed)
    assert (control.steering, control.throttle, control.brake) == pytest.approx(decided, abs=1e-9)


def decision(ahead: float, side: float, speed: float) -> Control:
    """Return what is decided in a corridor that is wider on the right, with a box in it."""
    ranges = corridor(ahead, side)
    ranges[:100] *= 1.7
    ranges[70:78] = np.minimum(ranges[70:78], 0.9)
    layout = layout_of("lidar", RAYS)
    values = np.zeros(layout.size, np.float32)
    values[layout.slices["lidar"]] = ranges
    told = {"speed": speed, "steering": 0.1, "yaw_rate": 0.3 * speed, "speed_cap": 20.0}
    for part, value in {**told, "grip_scale": 1.0}.items():
        values[layout.slices[part]] = value
    driver = tentacles.Tentacles()
    driver.reset(briefing("lidar", lidar_field=FIELD))
    return driver.act(Observation(0, layout, values))


def test_a_car_that_turned_round_nothing_steers_back_fully_and_slowly() -> None:
    layout = layout_of("lidar", RAYS)
    values = np.zeros(layout.size, np.float32)
    values[layout.slices["lidar"]] = 8.0
    told = {"speed": 1.8, "yaw_rate": 2.0, "speed_cap": 20.0, "grip_scale": 1.0}
    for part, value in told.items():
        values[layout.slices[part]] = value
    driver = tentacles.Tentacles()
    driver.reset(briefing("lidar", lidar_field=FIELD))
    decided = [driver.act(Observation(tick, layout, values)) for tick in range(0, 75, 3)]
    # 0.1 rad a decision to the left: beyond 115° with the 21st.
    assert decided[19].steering > -1.0
    assert decided[21].steering == -1.0
    assert decided[21].throttle == 0.0
    assert decided[21].brake > 0.0  # 1.8 m/s are more than 3.5 lengths a second
