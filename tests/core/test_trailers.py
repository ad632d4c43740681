"""Trailers against closed forms: arcs, circles, straight ways, and what must not matter."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.core.kernels.motion import Motion, integrate
from race_server.core.kernels.motion import Rates as Speeds
from race_server.core.kernels.trailers import axle_pose, hitch_angle, lead_trailers, straighten
from race_server.core.state import BODY, Record
from race_server.core.vehicle_presets import CAR, CAR_TRAILER, KART_CART, LORRY
from race_server.core.vehicles import TRAILERS, Trailer, Vehicle, vehicle_of, vehicle_record
from race_server.errors import VehicleError

STEP = 0.025  # [m] driven in a substep
DRAWN = (LORRY, CAR_TRAILER, KART_CART)


def body_behind(vehicle: Vehicle, angle: float = 0.0) -> Record:
    """Return a body at the origin whose first hitch has an angle [rad]."""
    body = np.zeros(1, BODY).view(np.recarray)[0]
    straighten(body, vehicle_record(vehicle)[0])
    for trailer in body.trailers:
        trailer.heading = -angle
    return body


def drive(vehicle: Vehicle, body: Record, curvature: float, way: float, pace: float = 1.0) -> None:
    """Drive a body without slip on an arc of the rear axle. way: [m], negative in reverse."""
    steps = max(1, round(abs(way) / STEP))
    speed = math.copysign(pace, way)
    dt = abs(way) / steps / pace
    record = vehicle_record(vehicle)[0]
    rates = Speeds(speed, vehicle.rear_axle * speed * curvature, speed * curvature)
    for _ in range(steps):
        motion = Motion(body.x, body.y, body.heading, 0.0, 0.0, 0.0, 0.0)
        moved = integrate(motion, rates, 0.0, dt)
        lead_trailers(body, record, moved, dt)
        body.x, body.y, body.heading = moved.x, moved.y, moved.heading


def exact_angle(trailer: Trailer, curvature: float, way: float, start: float) -> float:
    """Return the hitch angle [rad] after a way [m] on an arc, in closed form."""
    k, d, length = curvature, trailer.hitch, trailer.bar
    phi = math.atan(k * d)
    a = c = 0.5 * k
    b = -math.sqrt(1.0 + k * k * d * d) / length
    square = 0.25 * b * b - a * c
    root = math.sqrt(abs(square))
    if square > 0.0:
        even, odd = math.cosh(root * way), math.sinh(root * way) / root
    else:
        even, odd = math.cos(root * way), math.sin(root * way) / root
    u = math.tan(0.5 * (start - phi))
    u = (u * (even + 0.5 * odd * b) + odd * c) / (even - 0.5 * odd * b - odd * a * u)
    return phi + 2.0 * math.atan(u)


@pytest.mark.parametrize("vehicle", DRAWN)
@pytest.mark.parametrize(("steering", "way"), [(0.3, 10.0), (-0.2, 25.0), (0.1, -3.0), (0.0, 5.0)])
def test_the_hitch_angle_on_an_arc_is_that_of_the_closed_form(
    vehicle: Vehicle, steering: float, way: float
) -> None:
    curvature = math.tan(steering) / vehicle.wheelbase
    body = body_behind(vehicle, 0.1)
    drive(vehicle, body, curvature, way)
    expected = exact_angle(vehicle.trailers[0], curvature, way, 0.1)
    # Steps of 2.5 cm against bars of 7.7, 3.6 and 1.2 m: of the second order.
    tolerance = 5e-7 * (7.7 / vehicle.trailers[0].bar) ** 3
    assert hitch_angle(body, 0) == pytest.approx(expected, abs=tolerance)


def test_half_the_step_leaves_a_quarter_of_the_error() -> None:
    curvature = math.tan(0.3) / KART_CART.wheelbase
    errors = []
    for scale in (1.0, 2.0):
        body = body_behind(KART_CART, 0.1)
        # A larger cart on a larger arc is the same with smaller steps.
        large = Trailer(0.35 * scale, 1.2 * scale, 0.0, 0.5, 1.1, 1.0)
        vehicle = Vehicle(**{**vars(KART_CART), "trailers": (large,)})
        drive(vehicle, body, curvature / scale, 3.0 * scale)
        errors.append(
            abs(hitch_angle(body, 0) - exact_angle(large, curvature / scale, 3.0 * scale, 0.1))
        )
    assert errors[1] == pytest.approx(errors[0] / 4.0, rel=0.1)


def test_a_lorry_on_a_circle_of_10_137_m_settles_at_45_92_degrees() -> None:
    body = body_behind(LORRY)
    drive(LORRY, body, 1.0 / 10.137, 200.0)
    assert math.degrees(hitch_angle(body, 0)) == pytest.approx(45.92, abs=0.01)
    # The middle of the circle lies 10.137 m to the left of the rear axle.
    rear = axle_pose(body, vehicle_record(LORRY)[0], 0)
    middle_x = rear.x - 10.137 * math.sin(rear.heading)
    middle_y = rear.y + 10.137 * math.cos(rear.heading)
    axle = axle_pose(body, vehicle_record(LORRY)[0], 1)
    assert math.hypot(axle.x - middle_x, axle.y - middle_y) == pytest.approx(6.621, abs=0.001)


def test_on_a_straight_way_the_tangent_of_half_the_angle_decays_by_e_in_a_bar_length() -> None:
    forward, back = body_behind(LORRY, 0.4), body_behind(LORRY, 0.1)
    drive(LORRY, forward, 0.0, 7.7)
    drive(LORRY, back, 0.0, -7.7)
    assert math.tan(0.5 * hitch_angle(forward, 0)) == pytest.approx(
        math.tan(0.2) / math.e, rel=1e-5
    )
    assert math.tan(0.5 * hitch_angle(back, 0)) == pytest.approx(math.tan(0.05) * math.e, rel=1e-5)


@pytest.mark.parametrize(("vehicle", "degrees"), [(CAR_TRAILER, 73.9), (KART_CART, 52.8)])
def test_beyond_the_point_of_no_return_full_lock_no_longer_straightens_in_reverse(
    vehicle: Vehicle, degrees: float
) -> None:
    # Reversing to the left, the trailer to the left of the vehicle: the lock that would help.
    curvature = 1.0 / vehicle.turning_radius
    for angle, is_lost in ((degrees - 0.5, False), (degrees + 0.5, True)):
        body = body_behind(vehicle, math.radians(angle))
        drive(vehicle, body, curvature, -0.05)
        assert bool(hitch_angle(body, 0) > math.radians(angle)) is is_lost


@given(st.floats(-0.5, 0.5), st.floats(-0.6, 0.6), st.floats(0.1, 4.0))
@settings(max_examples=30, deadline=None)
def test_mirrored_ways_give_mirrored_trailers(curvature: float, angle: float, way: float) -> None:
    left, right = body_behind(CAR_TRAILER, angle), body_behind(CAR_TRAILER, -angle)
    drive(CAR_TRAILER, left, curvature, -way)
    drive(CAR_TRAILER, right, -curvature, -way)
    assert hitch_angle(left, 0) == -hitch_angle(right, 0)


@given(st.floats(-0.2, 0.2), st.floats(-0.6, 0.6), st.floats(0.1, 4.0))
@settings(max_examples=30, deadline=None)
def test_a_way_and_back_again_leaves_the_angle_as_it_was(
    curvature: float, angle: float, way: float
) -> None:
    body = body_behind(CAR_TRAILER, angle)
    drive(CAR_TRAILER, body, curvature, way)
    drive(CAR_TRAILER, body, curvature, -way)
    assert hitch_angle(body, 0) == pytest.approx(angle, abs=1e-5)


def test_the_way_decides_and_not_the_pace() -> None:
    slow, fast = body_behind(LORRY, 0.2), body_behind(LORRY, 0.2)
    drive(LORRY, slow, 0.05, -6.0, pace=1.0)
    drive(LORRY, fast, 0.05, -6.0, pace=2.0)
    assert hitch_angle(slow, 0) == pytest.approx(hitch_angle(fast, 0), abs=1e-12)


def test_no_axle_slides_sideways() -> None:
    two = Vehicle(
        **{**vars(LORRY), "trailers": (LORRY.trailers[0], Trailer(1.0, 5.0, 0, 2, 2.5, 1.0))}
    )
    body, record = body_behind(two, 0.3), vehicle_record(two)[0]
    for number in (1, 2):
        before = axle_pose(body, record, number)
        way = 1e-5
        drive(two, body, 0.08, way)
        after = axle_pose(body, record, number)
        heading = 0.5 * (before.heading + after.heading)
        across = (after.y - before.y) * math.cos(heading) - (after.x - before.x) * math.sin(heading)
        assert abs(across) < 1e-9 * way / 1e-5


def test_a_second_trailer_with_hardly_a_bar_changes_nothing_for_the_first() -> None:
    one = LORRY
    two = Vehicle(
        **{**vars(LORRY), "trailers": (*LORRY.trailers, Trailer(1.0, 3.0, 0, 2, 2.5, 1.0))}
    )
    alone, followed = body_behind(one, 0.3), body_behind(two, 0.3)
    drive(one, alone, 0.08, 9.0)
    drive(two, followed, 0.08, 9.0)
    assert hitch_angle(alone, 0) == hitch_angle(followed, 0)
    # It follows the axle ahead: the forward way has nearly closed its angle to that of a circle.
    assert 0.0 < hitch_angle(followed, 1) < 0.6


def test_a_lorry_is_16_5_m_long_and_its_trailer_clears_the_cab() -> None:
    trailer = LORRY.trailers[0]
    front_to_hitch = 1.40 + LORRY.wheelbase + trailer.hitch
    assert front_to_hitch + trailer.bar + trailer.behind == pytest.approx(16.50)
    # The front corners of the trailer turn on a circle of 2.046 m around the kingpin.
    assert math.hypot(trailer.ahead, 0.5 * trailer.width) == pytest.approx(2.046, abs=0.001)
    assert trailer.length == pytest.approx(13.6)


def test_a_record_gives_back_its_vehicle() -> None:
    for vehicle in (*DRAWN, CAR):
        assert vars(vehicle_of(vehicle_record(vehicle)[0])) == {**vars(vehicle), "name": ""}


def test_more_trailers_than_there_is_room_for_are_refused() -> None:
    with pytest.raises(VehicleError, match=f"'train' draws {TRAILERS + 1} trailers: at most"):
        Vehicle(**{**vars(LORRY), "name": "train", "trailers": LORRY.trailers * (TRAILERS + 1)})
