"""What corners cost: against whole laps that are solved again, and in sum."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from race_server.coaching.corners import Corner, corners_of
from race_server.coaching.counterfactual import Motion, joined_time
from race_server.coaching.lap import Lap, reference_lap
from race_server.coaching.losses import lap_loss
from race_server.core.clock import MICROSECONDS
from race_server.core.vehicle_presets import vehicle_named
from race_server.scenario.raceline.attach import reference_line
from race_server.scenario.raceline.bounds import Bounds, bounds_of
from race_server.scenario.raceline.profile import speeds_on
from race_server.scenario.track.load import load_course

KART = "kart-60"


@cache
def place() -> tuple[Lap, tuple[Corner, ...], Bounds]:
    """Return the lap of the limit of a kart, its corners and the kart's bounds."""
    course, vehicle = load_course("hangar-400"), vehicle_named(KART)
    bounds = bounds_of(vehicle)
    lap = reference_lap(course, reference_line(course, vehicle), bounds)
    return lap, corners_of(lap), bounds


@cache
def solved(*slow: int) -> Lap:
    """Return the fastest lap with the bends of some corners 20 % tighter than they are."""
    lap, corners, bounds = place()
    curvature, progress = lap.curvature.copy(), lap.progress
    for row in slow:
        inside = (progress > corners[row].entry) & (progress < corners[row].exit)
        curvature[inside] *= 1.2
    speed = speeds_on(lap.ways, curvature[:-1], bounds)
    speed = np.append(speed, speed[0])
    time = np.concatenate([[0.0], np.cumsum(2.0 * lap.ways / (speed[1:] + speed[:-1]))])
    time_us = round(time[-1] * MICROSECONDS)
    return replace(lap, speed=speed, curvature=curvature, time=time, time_us=time_us)


def seconds(*slow: int) -> float:
    return solved(*slow).time_us / MICROSECONDS


def test_a_lap_joined_to_itself_is_the_same_lap() -> None:
    lap, _, bounds = place()
    motion = Motion(lap, bounds)
    for at in (0, 100, 400, 800):
        assert joined_time(motion, motion, at) == pytest.approx(lap.time[-1], abs=1e-9)


def test_half_of_another_lap_is_worth_what_a_lap_solved_anew_says() -> None:
    # T1 and T4 are slow; a lap that is mended up to the middle of the straight before T3 keeps T4.
    _, corners, bounds = place()
    slow, fast = Motion(solved(0, 3), bounds), Motion(solved(), bounds)
    middle = round(corners[2].begin / solved().step)
    assert seconds(0, 3) - seconds(3) > 0.1
    assert joined_time(fast, slow, middle) == pytest.approx(seconds(3), abs=0.002)
    assert joined_time(slow, fast, middle) == pytest.approx(seconds(0), abs=0.002)


@pytest.mark.parametrize("row", range(5))
def test_one_slow_corner_costs_what_the_lap_loses_and_the_others_nothing(row: int) -> None:
    _, corners, bounds = place()
    loss = lap_loss(solved(row), solved(), corners, bounds)
    lost = seconds(row) - seconds()
    assert lost > 0.05
    for other, corner in enumerate(loss.corners):
        wanted = lost if other == row else 0.0
        # T5 ends on the straight with the timing line: what it costs behind it, the line costs.
        assert corner.total_us / MICROSECONDS == pytest.approx(wanted, abs=0.008)


def test_of_two_slow_corners_each_costs_what_laps_solved_anew_say() -> None:
    # The mean of mending it first and of mending it last.
    _, corners, bounds = place()
    loss = lap_loss(solved(1, 2), solved(), corners, bounds)
    first = 0.5 * (seconds(1, 2) - seconds(2) + seconds(1) - seconds())
    second = 0.5 * (seconds(1, 2) - seconds(1) + seconds(2) - seconds())
    assert loss.corners[1].total_us / MICROSECONDS == pytest.approx(first, abs=0.004)
    assert loss.corners[2].total_us / MICROSECONDS == pytest.approx(second, abs=0.004)


@pytest.mark.parametrize("slow", [(), (0,), (1, 2), (0, 1, 2, 3, 4)])
def test_costs_add_up_to_the_microsecond_in_both_directions(slow: tuple[int, ...]) -> None:
    _, corners, bounds = place()
    for lap, other in ((solved(*slow), solved()), (solved(), solved(*slow))):
        loss = lap_loss(lap, other, corners, bounds)
        assert loss.total_us == lap.time_us - other.time_us
        assert loss.line_us + sum(one.total_us for one in loss.corners) == loss.total_us


def test_a_lap_that_crosses_the_line_slower_pays_for_the_lap_before_at_the_line() -> None:
    # As after a corner before the line that was taken 1 m/s too slowly: this lap only accelerates.
    _, corners, bounds = place()
    lap = solved()
    first = int(np.argmax(lap.speed[:80] > lap.speed[0] + 1.0)) or 80
    slower = lap.speed.copy()
    slower[:first] = np.minimum(slower[:first], lap.speed[0] - 1.0 + np.arange(first) / first)
    time = np.concatenate([[0.0], np.cumsum(2.0 * lap.ways / (slower[1:] + slower[:-1]))])
    late = replace(lap, speed=slower, time=time, time_us=round(time[-1] * MICROSECONDS))
    loss = lap_loss(late, lap, corners, bounds)
    assert loss.total_us > 0
    assert loss.line_us > 0.3 * loss.total_us
    assert abs(sum(one.total_us for one in loss.corners[1:])) < 0.1 * loss.total_us


def test_what_is_lost_where_the_first_corner_begins_is_none_of_the_last_one() -> None:
    # T5 is in its bend until T1 begins, as where two bends have the timing line but no straight
    # between them.
    _, corners, bounds = place()
    meeting = (*corners[:-1], replace(corners[-1], exit=corners[-1].end))
    apart = lap_loss(solved(0), solved(), corners, bounds)
    loss = lap_loss(solved(0), solved(), meeting, bounds)
    assert apart.corners[0].approach_us > 10_000
    assert loss.corners[0] == apart.corners[0]
    assert loss.corners[-1].total_us == apart.corners[-1].total_us
    assert loss.line_us + sum(one.total_us for one in loss.corners) == loss.total_us


def test_corners_of_the_reference_meet() -> None:
    _, corners, _ = place()
    assert all(one.end == other.begin for one, other in pairwise(corners))
