"""Corners of an oval that can be worked out by hand: two straights of 60 m, two bends of 10 m."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from race_server.coaching.corners import Corner, corners_of
from race_server.coaching.lap import Lap, reference_lap
from race_server.core.vehicle_presets import vehicle_named
from race_server.scenario.raceline.attach import reference_line
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.track.load import load_course

STRAIGHT, RADIUS = 60.0, 10.0
BEND = np.pi * RADIUS
LENGTH = 2.0 * (STRAIGHT + BEND)
# In a bend 9 m/s; out of it with 3 m/s², and with 6 m/s² on the brakes: 40 m and then 20 m.
SLOWEST, DRIVE, BRAKE = 9.0, 3.0, 6.0
BRAKED = STRAIGHT * DRIVE / (DRIVE + BRAKE)  # m on the brakes


def oval(*, start: float = 0.5 * STRAIGHT, slowest: float = SLOWEST, step: float = 0.1) -> Lap:
    """Return a lap whose timing line lies `start` [m] before the first bend."""
    count = round(LENGTH / step)
    progress = np.linspace(0.0, LENGTH, count + 1)
    since = (progress - start + STRAIGHT) % (STRAIGHT + BEND)  # from the exit of a bend
    squares = np.minimum(since * DRIVE, (STRAIGHT - since) * BRAKE)
    on_straight = since < STRAIGHT
    speed = np.sqrt(slowest**2 + 2.0 * np.where(on_straight, squares, 0.0))
    nothing = np.zeros(count + 1)
    return Lap(
        name="oval",
        time_us=1,
        progress=progress,
        time=nothing,
        x=nothing,
        y=nothing,
        offset=nothing,
        speed=speed,
        curvature=np.where(on_straight, 0.0, 1.0 / RADIUS),
        throttle=np.where(on_straight & (since < STRAIGHT - BRAKED), 1.0, 0.0),
        brake=np.where(on_straight & (since >= STRAIGHT - BRAKED), 0.8, 0.0),
    )


def test_an_oval_has_two_corners_with_their_apexes_in_the_middle_of_the_bends() -> None:
    first, second = corners_of(oval())
    assert [first.name, second.name] == ["T1", "T2"]
    assert first.brake == pytest.approx(30.0 - 20.0, abs=0.2)
    assert first.entry == pytest.approx(30.0, abs=0.2)
    assert first.apex == pytest.approx(30.0 + 0.5 * BEND, abs=0.3)
    assert first.exit == pytest.approx(30.0 + BEND, abs=0.2)
    assert second.apex - first.apex == pytest.approx(STRAIGHT + BEND, abs=0.3)


def test_a_corner_begins_half_way_down_the_straight_before_its_brakes() -> None:
    first, second = corners_of(oval())
    # 40 m of full throttle before the brakes, half of them behind the timing line.
    assert first.begin == pytest.approx(10.0 - 20.0, abs=0.2)
    assert first.end == second.begin
    assert second.end == pytest.approx(first.begin + LENGTH, abs=1e-9)


def test_corners_are_the_same_wherever_the_timing_line_is() -> None:
    moved = 0.5 * STRAIGHT + 0.25 * BEND  # in the middle of a straight, and in a bend
    one, other = corners_of(oval()), corners_of(oval(start=0.5 * STRAIGHT - moved))
    apexes = sorted((corner.apex + moved) % LENGTH for corner in other)
    assert apexes == pytest.approx(sorted(corner.apex for corner in one), abs=0.3)


def test_a_bend_to_the_right_is_known_as_one() -> None:
    lap = oval()
    assert [corner.side for corner in corners_of(lap)] == [1, 1]
    other = replace(lap, curvature=-lap.curvature)
    assert [corner.side for corner in corners_of(other)] == [-1, -1]


def test_a_bend_may_be_tightest_behind_the_timing_line_with_its_apex_before_it() -> None:
    # The line lies two thirds into a bend, which is tightest in its last 5 m.
    lap = oval(start=STRAIGHT + BEND / 3.0)
    tighter = np.where(lap.progress < 5.0, 2.0, 1.0)
    for side in (1, -1):
        corners = corners_of(replace(lap, curvature=side * tighter * lap.curvature))
        assert [corner.side for corner in corners] == [side, side]
        assert corners[-1].apex == pytest.approx(LENGTH - BEND / 6.0, abs=0.3)


def test_a_lap_that_never_slows_by_3_percent_has_no_corner() -> None:
    lap = oval()
    assert corners_of(replace(lap, speed=np.full(len(lap.speed), 9.0))) == ()
    assert corners_of(replace(lap, speed=9.0 + 0.01 * lap.speed)) == ()


def test_a_corner_without_brakes_is_prepared_from_its_turn_in_on() -> None:
    lap = oval()
    corners = corners_of(replace(lap, brake=np.zeros(len(lap.brake))))
    assert [corner.brake for corner in corners] == [corner.entry for corner in corners]
    assert [corner.is_braked for corner in corners] == [False, False]
    assert [corner.is_braked for corner in corners_of(lap)] == [True, True]


@pytest.mark.parametrize(
    ("track", "vehicle", "count"), [("hangar-400", "kart-60", 5), ("oval", "tt02", 2)]
)
def test_corners_of_a_course_follow_one_another_and_fill_the_lap(
    track: str, vehicle: str, count: int
) -> None:
    course, driven = load_course(track), vehicle_named(vehicle)
    lap = reference_lap(course, reference_line(course, driven), bounds_of(driven))
    corners = corners_of(lap)
    assert len(corners) == count
    for corner in corners:
        assert corner.begin <= min(corner.brake, corner.entry)
        assert max(corner.brake, corner.entry) <= corner.apex <= corner.exit <= corner.end
    follow(corners, course.length)


def follow(corners: tuple[Corner, ...], length: float) -> None:
    for corner, after in pairwise(corners):
        assert corner.end == after.begin
    assert corners[-1].end == pytest.approx(corners[0].begin + length)
