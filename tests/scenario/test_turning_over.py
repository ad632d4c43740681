"""Lines that turn from one side to the other: as fast as a body can follow, and no slower."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from race_server.core.vehicle_presets import KART_60, TT02, vehicle_named
from race_server.core.vehicles import GRAVITY, Vehicle
from race_server.scenario.raceline.attach import line_of
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.raceline.bundled import read_bundled
from race_server.scenario.raceline.profile import braking, driving
from race_server.scenario.raceline.turning_over import (
    ASTRAY_WIDTHS,
    LAGS,
    followed,
    slowed,
    swiftness,
)
from race_server.scenario.track.load import load_course

SPACING = 0.05
BEND = 0.05  # [1/m]: at 10 m/s all the grip of the 1/10 car, 5 m/s²


def turning_over(bend: float, samples: int = 2000) -> np.ndarray:
    """Return the curvature of a line that turns over at once, once and back."""
    half = samples // 2
    return np.repeat([bend, -bend], half)


@pytest.mark.parametrize(("vehicle", "bend"), [(TT02, BEND), (KART_60, 0.01)])
def test_a_body_goes_astray_by_a_sixth_of_its_width_at_the_speed_that_is_left(
    vehicle: Vehicle, bend: float
) -> None:
    stiffness = vehicle.cornering * vehicle.mass * GRAVITY
    curvature = turning_over(bend)
    most = followed(np.full(2000, 10.0), curvature, SPACING, bounds_of(vehicle)).min()
    lag = LAGS * most * vehicle.yaw_inertia / (stiffness * vehicle.front_axle * vehicle.rear_axle)
    assert most**2 * (2.0 * bend) * lag**2 / 8.0 == pytest.approx(ASTRAY_WIDTHS * vehicle.width)


def test_tight_bends_that_turn_over_leave_a_quarter_of_the_grip() -> None:
    # A bend that takes all of 5 m/s² at 4 m/s: from side to side that is 10, and 7.5 are left.
    bend = TT02.grip * GRAVITY / 4.0**2
    most = followed(np.full(2000, 4.0), turning_over(bend), SPACING, bounds_of(TT02)).min()
    assert most**2 == pytest.approx(0.75 * 4.0**2)


def test_in_a_bend_that_stays_the_same_nothing_is_slowed() -> None:
    speed = np.full(400, 10.0)
    assert slowed(speed, np.full(400, BEND), SPACING, bounds_of(TT02)).tolist() == [10.0] * 400


def test_a_body_that_never_slips_follows_its_wheels_at_once() -> None:
    bounds, speed = bounds_of(vehicle_named("tt02-kinematic")), np.full(2000, 10.0)
    assert swiftness(1.0, 10.0, speed, bounds) == []
    assert slowed(speed, turning_over(BEND), SPACING, bounds).min() == 10.0


def test_a_slow_line_may_turn_over_at_once() -> None:
    speed = np.full(2000, 2.0)
    assert slowed(speed, turning_over(BEND), SPACING, bounds_of(TT02)).min() == 2.0


def test_where_a_fast_line_turns_over_at_once_it_is_slower_and_only_there() -> None:
    curvature = np.zeros(2000)
    curvature[950:1000], curvature[1000:1050] = BEND, -BEND
    now = slowed(np.full(2000, 10.0), curvature, SPACING, bounds_of(TT02))
    assert 7.0 < now[999] < 9.0
    assert now[700] == now[1900] == 10.0  # 15 m before, and 45 m behind it


@given(st.floats(5.0, 10.0))
def test_a_curvature_that_changes_as_fast_as_a_body_follows_is_not_slowed(speed: float) -> None:
    bounds, at = bounds_of(TT02), np.full(400, speed)
    (share,) = swiftness(1.0, speed, at, bounds)
    rate = 1.0 / share  # [1/(m s)]
    change = rate * SPACING / speed
    curvature = change * np.arange(400.0)
    assert followed(at, curvature, SPACING, bounds)[:200] == pytest.approx(at[:200])


def test_the_line_to_drive_turns_over_as_a_body_can_and_the_fastest_lap_does_not() -> None:
    course, bounds = load_course("covapsy-test-2023"), bounds_of(TT02)
    limit = read_bundled(course, bounds)
    assert limit is not None
    costs = []
    for lap in (limit.minimum_time, limit.with_room):
        line = line_of(course, lap)
        speeds = line.speed, slowed(line.speed, line.curvature, line.spacing, bounds)
        driven, at_best = (np.sum(1.0 / (now + np.roll(now, -1))) for now in speeds)
        costs.append(at_best / driven - 1.0)
    assert costs[0] > 0.005
    assert costs[1] < 0.001
    assert limit.with_room.time_s < 1.005 * limit.minimum_time.time_s


@given(st.floats(0.01, 0.4), st.floats(3.0, 10.0))
def test_brakes_and_motor_lead_from_each_sample_to_the_next(bend: float, speed: float) -> None:
    bounds, curvature = bounds_of(TT02), turning_over(bend, samples=400)
    now = slowed(np.full(400, speed), curvature, SPACING, bounds)
    for here in np.flatnonzero(now < speed).tolist():
        there = (here + 1) % 400
        square, bent = now[here] ** 2, (float(curvature[here]), float(curvature[there]))
        assert (
            now[there] ** 2 <= square + 2.0 * SPACING * driving(now[here], bent[0], bounds) + 1e-9
        )
        loss = 2.0 * SPACING * braking(now[there], bent[1], bounds)
        assert square <= now[there] ** 2 + loss + 1e-9
