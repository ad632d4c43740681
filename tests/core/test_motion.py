"""Motion of the vehicles against what their figures promise."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.core.kernels.motion import Allowance, Command, Motion, move, tyre_stiffness
from race_server.core.vehicle_presets import KART_60, TT02, TT02_DRIFT, VEHICLES, vehicle_named
from race_server.core.vehicles import GRAVITY, Vehicle, vehicle_record
from race_server.errors import VehicleError

DT = 1.0 / 120.0
REST = Motion(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
X, Y, HEADING, SPEED, LATERAL, YAW_RATE, STEERING = range(7)


def drive(
    vehicle: Vehicle,
    seconds: float,
    *,
    steering: float = 0.0,
    throttle: float = 0.0,
    brake: float = 0.0,
    state: Motion = REST,
    cap: float | None = None,
    grip: float = 1.0,
) -> Motion:
    record = vehicle_record(vehicle)[0]
    limit = vehicle.top_speed if cap is None else cap
    command, allowance = Command(steering, throttle, brake), Allowance(limit, 1.0, grip, 0.0)
    for _ in range(round(seconds / DT)):
        state = move(record, state, command, allowance, DT)
    return state


def test_a_kart_at_rest_stays_at_rest() -> None:
    assert drive(KART_60, 5.0) == REST


def test_the_rental_kart_reaches_50_km_h_in_about_three_seconds() -> None:
    assert drive(KART_60, 3.2, throttle=1.0)[SPEED] * 3.6 == pytest.approx(50.0, rel=0.15)


@pytest.mark.parametrize("vehicle", VEHICLES.values(), ids=lambda vehicle: vehicle.name)
def test_no_vehicle_goes_faster_than_its_top_speed(vehicle: Vehicle) -> None:
    assert 0.9 < drive(vehicle, 60.0, throttle=1.0)[SPEED] / vehicle.top_speed <= 1.001


def test_brakes_stop_the_kart_and_never_push_it_back() -> None:
    moving = drive(KART_60, 5.0, throttle=1.0)
    assert drive(KART_60, 5.0, brake=1.0, state=moving)[SPEED] == pytest.approx(0.0, abs=1e-9)


def test_the_braking_distance_follows_from_the_grip_of_both_axles() -> None:
    start = Motion(0.0, 0.0, 0.0, 15.0, 0.0, 0.0, 0.0)
    stopped = drive(KART_60, 6.0, brake=1.0, state=start)
    hardest = KART_60.grip * GRAVITY
    assert 15.0**2 / (2.0 * hardest) < stopped[X] < 2.0 * 15.0**2 / (2.0 * hardest)


def test_reverse_is_as_fast_as_the_controller_allows() -> None:
    assert drive(KART_60, 5.0, throttle=-1.0)[SPEED] == pytest.approx(-1.5, abs=0.05)


def test_at_walking_pace_the_rear_axle_turns_on_the_kinematic_circle() -> None:
    state = drive(TT02, 4.0, steering=1.0, throttle=1.0, cap=0.4)
    assert state[SPEED] / state[YAW_RATE] == pytest.approx(TT02.turning_radius, rel=1e-6)


def test_the_drift_kit_lets_the_car_turn_more_tightly() -> None:
    assert math.degrees(TT02.steering_limit) == pytest.approx(18.0, abs=0.01)
    assert TT02_DRIFT.turning_radius == pytest.approx(0.257 / math.tan(math.radians(30.0)))
    state = drive(TT02_DRIFT, 4.0, steering=1.0, throttle=1.0, cap=0.4)
    assert state[SPEED] / state[YAW_RATE] == pytest.approx(0.445, abs=0.001)


def test_grip_bounds_the_lateral_acceleration() -> None:
    state = Motion(0.0, 0.0, 0.0, 8.0, 0.0, 0.0, 0.0)
    most = 0.0
    for _ in range(240):
        state = drive(TT02, DT, steering=1.0, throttle=1.0, state=state)
        most = max(most, abs(state[SPEED] * state[YAW_RATE]))
    assert state[SPEED] * state[YAW_RATE] <= TT02.grip * GRAVITY * 1.05


def test_less_grip_makes_a_wider_bend() -> None:
    start = Motion(0.0, 0.0, 0.0, 6.0, 0.0, 0.0, 0.0)
    dry = drive(TT02, 0.5, steering=1.0, throttle=0.3, state=start)
    oily = drive(TT02, 0.5, steering=1.0, throttle=0.3, state=start, grip=0.4)
    assert abs(oily[HEADING]) < 0.7 * abs(dry[HEADING])


def test_a_lower_cap_slows_a_kart_down_to_it() -> None:
    moving = drive(KART_60, 8.0, throttle=1.0)
    assert drive(KART_60, 4.0, throttle=1.0, state=moving, cap=5.0)[SPEED] == pytest.approx(
        5.0, abs=0.3
    )


def test_the_tyre_force_rises_with_its_stiffness_and_saturates_at_its_limit() -> None:
    assert tyre_stiffness(1e-9, 100.0, 10.0) == pytest.approx(100.0)
    assert tyre_stiffness(3.0, 100.0, 10.0) * 3.0 == pytest.approx(10.0)


@given(st.floats(1e-6, 10.0), st.floats(1e-6, 10.0))
def test_more_slip_never_gives_less_force(slip: float, more: float) -> None:
    before = tyre_stiffness(slip, 100.0, 10.0) * slip
    after = tyre_stiffness(slip + more, 100.0, 10.0) * (slip + more)
    assert after >= before - 1e-9
    assert after <= 10.0 + 1e-9


controls = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1))


@settings(max_examples=30, deadline=None)
@given(
    st.sampled_from(sorted(VEHICLES)), st.lists(controls, min_size=1, max_size=20), st.floats(0, 1)
)
def test_no_control_makes_the_motion_blow_up(
    name: str, inputs: list[tuple[float, float, float]], grip: float
) -> None:
    vehicle = VEHICLES[name]
    state = Motion(0.0, 0.0, 0.0, vehicle.top_speed, 0.0, 0.0, 0.0)
    # Its centre of gravity moves faster than its rear axle where wheels that never slip are turned.
    share = vehicle.rear_axle / vehicle.wheelbase * math.tan(vehicle.steering_limit)
    most = 1.05 * vehicle.top_speed * math.hypot(1.0, share if vehicle.kinematic_below > 40 else 0)
    for steering, throttle, brake in inputs:
        state = drive(
            vehicle, 0.25, steering=steering, throttle=throttle, brake=brake, state=state, grip=grip
        )
        speed = math.hypot(state[SPEED], state[LATERAL])
        assert all(math.isfinite(value) for value in state)
        assert speed <= most


def test_without_slip_the_rear_axle_drives_the_circle_of_the_steering_angle() -> None:
    vehicle = vehicle_named("tt02-kinematic")
    state = drive(vehicle, 6.0, steering=1.0, throttle=0.6)
    # yaw rate = speed of the rear axle / turning radius, however fast it goes
    assert state[SPEED] > 2.0
    assert state[YAW_RATE] == pytest.approx(state[SPEED] / vehicle.turning_radius, rel=1e-3)


def test_an_unknown_vehicle_names_those_that_exist() -> None:
    with pytest.raises(
        VehicleError, match=r"'kart-90' is unknown; choose one of car, car-trailer, highway-car"
    ):
        vehicle_named("kart-90")
