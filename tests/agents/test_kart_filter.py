"""The filter that knows where a real kart is."""

import math

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from race_agents.unit import motion
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.ekf import KartFilter
from race_agents.unit.fence import CourseFence
from race_agents.unit.motion import antenna_at, antenna_jacobian, drive_on, jacobian_of
from race_agents.unit.readings import Fix, Readings
from race_server.core.vehicle_presets import KART_30
from support.plant_loop import Loop

LEVER = 0.4


def state_of(*values: float) -> np.ndarray:
    """Return a state that begins with these values; the others are 0."""
    state = np.zeros(motion.SIZE)
    state[: len(values)] = values
    return state


def simulated(
    seconds: float, seed: int = 3
) -> list[tuple[np.ndarray, float, float, np.ndarray | None]]:
    """Return truth, wheel speed, gyro and now and then a fix of a kart that swings about."""
    chance = np.random.default_rng(seed)
    state, rows = state_of(1.0, 2.0, 0.3, 5.0, 0.0, 0.05), []
    for turn in range(round(seconds * 50)):
        state = state.copy()
        state[4] = 0.8 * math.sin(0.02 * turn)
        state[3] = 5.0 + 2.0 * math.sin(0.011 * turn)
        state = drive_on(state, 0.02)
        fix = antenna_at(state, LEVER) + chance.normal(0.0, 0.3, 2) if turn % 5 == 0 else None
        speed, rate = state[3] + chance.normal(0.0, 0.1), state[4] + state[5]
        rows.append((state, float(speed), float(rate + chance.normal(0.0, 0.02)), fix))
    return rows


def wheels_told(state: np.ndarray) -> np.ndarray:
    return np.array([(1.0 + state[7]) * state[3]])


def wheels_row(state: np.ndarray) -> np.ndarray:
    row = state_of(0.0, 0.0, 0.0, 1.0 + state[7])[None]
    row[0, 7] = state[3]
    return row


def test_the_filter_is_that_of_filterpy() -> None:
    ours = KartFilter(1.0, 2.0, 0.2, lever=LEVER)
    ours.state[3] = 5.0
    theirs = ExtendedKalmanFilter(dim_x=motion.SIZE, dim_z=2)
    theirs.x, theirs.P = ours.state.copy(), ours.covariance.copy()
    # Tyres that do not slip do not soften.
    noise = motion.Agility(compliance_drift=0.0).noise(feels=False)
    rate_row = np.zeros((1, motion.SIZE))
    rate_row[0, 4] = rate_row[0, 5] = 1.0
    for _, speed, rate, fix in simulated(20.0):
        theirs.F = jacobian_of(theirs.x, 0.02)
        after, half = drive_on(theirs.x, 0.02), 0.01 * noise
        theirs.P = theirs.F @ (theirs.P + half) @ theirs.F.T + half
        theirs.x = after
        ours.predict(0.02)
        believed = ours.see_speed(speed, 0.1), ours.see_yaw_rate(rate, 0.02)
        # One in a thousand is not believed; filterpy has no gate.
        if believed[0]:
            theirs.update(np.array([speed]), wheels_row, wheels_told, R=np.array([[0.01]]))
        if believed[1]:
            theirs.update(
                np.array([rate]), lambda _: rate_row, lambda x: rate_row @ x, R=np.array([[4e-4]])
            )
        if fix is not None and ours.see_position(*fix, 0.3):
            theirs.update(
                fix,
                lambda x: antenna_jacobian(x, LEVER),
                lambda x: antenna_at(x, LEVER),
                R=np.eye(2) * 0.09,
            )
        turned = math.remainder(ours.state[2] - theirs.x[2], 2.0 * math.pi)
        assert turned == pytest.approx(0.0, abs=1e-9)
        theirs.x[2] = ours.state[2]
        assert ours.state == pytest.approx(theirs.x, abs=1e-8)
        assert ours.covariance == pytest.approx(theirs.P, abs=1e-8)


def test_the_jacobian_is_the_slope_of_the_motion() -> None:
    for rate in (-0.3, 0.7):
        state = state_of(1.0, 2.0, 0.5, 6.0, rate, 0.01, 0.8)
        slope = jacobian_of(state, 0.1)
        for column in range(motion.SIZE):
            nudge = np.zeros(motion.SIZE)
            nudge[column] = 1e-6
            ahead, behind = drive_on(state + nudge, 0.1), drive_on(state - nudge, 0.1)
            assert slope[:, column] == pytest.approx((ahead - behind) / 2e-6, abs=2e-4)


def test_the_jacobian_does_not_jump_where_bends_become_straight() -> None:
    flat, bent = (state_of(1.0, 2.0, 0.5, 6.0, rate, 0.0, 0.8) for rate in (0.9e-4, 1.1e-4))
    assert jacobian_of(flat, 0.1) == pytest.approx(jacobian_of(bent, 0.1), abs=1e-4)


def test_the_filter_knows_the_place_better_than_the_fixes_and_finds_the_bias() -> None:
    rows = simulated(40.0)
    filtered = KartFilter(1.0, 2.0, 0.2, lever=LEVER)  # at rest, as it believes
    errors = []
    for truth, speed, rate, fix in rows:
        filtered.predict(0.02)
        filtered.see_speed(speed, 0.1)
        filtered.see_yaw_rate(rate, 0.02)
        if fix is not None:
            filtered.see_position(*fix, 0.3)
        errors.append(math.hypot(*(filtered.state[:2] - truth[:2])))
    assert np.median(errors[500:]) < 0.15  # the fixes: 0.35 m
    assert filtered.state[5] == pytest.approx(0.05, abs=0.02)


def test_a_fix_ten_metres_off_is_refused_and_a_row_of_them_is_believed_in_the_end() -> None:
    filtered = KartFilter(0.0, 0.0, 0.0, lever=0.0)
    for _ in range(50):
        filtered.predict(0.1)
        filtered.see_speed(0.0, 0.05)
        filtered.see_position(0.0, 0.0, 0.1)
    assert not filtered.see_position(10.0, 0.0, 0.1)
    believed = [filtered.see_position(10.0, 0.0, 0.1) for _ in range(10)]
    assert not any(believed[:3])
    assert believed[-1]
    assert filtered.state[0] == pytest.approx(10.0, abs=0.3)


def test_a_kart_that_felt_no_blow_is_not_carried_off_by_fixes_until_it_has_slowed_down() -> None:
    filtered = KartFilter(0.0, 0.0, 0.0, lever=0.0)
    for _ in range(50):
        filtered.predict(0.1, push=(0.0, 0.0))
        filtered.see_speed(0.0, 0.05)
        filtered.see_position(0.0, 0.0, 0.1)
    believed = [filtered.see_position(10.0, 0.0, 0.1) for _ in range(30)]
    assert believed == [False] * 26 + [True] * 4


def driven(
    *, until_s: float, push: float, blow: float
) -> tuple[KartFilter, list[float], list[bool]]:
    """Drive east at 8 m/s; two seconds on the kart is pushed `push` m to the left within 0.1 s.

    Returns the filter, how far it was off each 0.02 s since, and which fixes it believed.
    """
    filtered, chance = KartFilter(0.0, 0.0, 0.0, lever=LEVER), np.random.default_rng(2)
    errors, believed = [], []
    for turn in range(1, round(50 * until_s)):
        time_s = turn * 0.02
        x, y = 8.0 * time_s, push * min(max((time_s - 2.0) / 0.1, 0.0), 1.0)
        filtered.predict(0.02, blow=blow if 2.0 < time_s < 2.12 else 0.0)
        filtered.see_speed(8.0, 0.1)
        filtered.see_yaw_rate(0.0, 0.02)
        if turn % 5 == 0:
            fix = np.array([x, y]) + chance.normal(0.0, 0.02, 2)
            believed.append(filtered.see_position(*fix, 0.02))
        if time_s > 2.0:
            errors.append(math.hypot(*(antenna_at(filtered.state, LEVER) - (x, y))))
    return filtered, errors, believed


def test_after_a_blow_the_next_fix_is_believed_and_puts_the_place_right() -> None:
    filtered, errors, believed = driven(until_s=4.0, push=0.7, blow=30.0)
    assert all(believed[20:])
    assert max(errors[10:]) < 0.15
    assert abs(filtered.state[2]) < 0.05


def test_a_place_that_was_lost_without_a_blow_does_not_turn_the_heading_over() -> None:
    filtered, errors, believed = driven(until_s=4.0, push=0.7, blow=0.0)
    assert not all(believed[20:])
    assert max(errors) < 0.8  # never further off than it was pushed
    assert max(errors[-25:]) < 0.1
    assert abs(filtered.state[2]) < 0.05


def test_a_blow_is_what_no_tyre_can_have_caused() -> None:
    unit = Loop("kart").run(4.0).unit
    assert unit.fusion is not None
    assert unit.fusion.blow((-6.5, 7.2)) == 0.0
    assert unit.fusion.blow((-24.0, 7.0)) == pytest.approx(25.0)
    assert unit.fusion.blow(None) == 0.0


def test_a_spin_does_not_lose_the_place() -> None:
    # East at 8 m/s, and from 2 s on the kart turns, faster and faster, and slides straight on.
    line = np.stack([np.arange(80.0), np.zeros(80), np.zeros(80), np.zeros(80)], axis=1)
    unit = ControlUnit.of(KART_30, CourseFence(line, np.full((80, 2), 8.0), 0.5))
    chance, errors = np.random.default_rng(4), []
    for turn in range(160):
        time_s = turn * 0.02
        rate = max(time_s - 2.0, 0.0)
        heading = 0.5 * rate * rate
        fix = None
        if turn % 5 == 0:
            x, y = chance.normal((8.0 * time_s, 0.0), 0.02)
            fix = Fix(float(x), float(y), 0.02)
        wobble = 1e-4 * (-1) ** turn  # a number that never changes is of a sensor that hangs
        speed, felt = 8.0 * math.cos(heading) + wobble, (wobble, 0.0)
        unit.sense(Readings(time_s, speed, rate + wobble, 0.0, felt, fix))
        assert fix is None or time_s < 1.0 or unit._fix_s == time_s  # none is refused
        told = unit.pose()
        assert told is not None
        errors.append(math.hypot(told.x - 8.0 * time_s, told.y))
    assert max(errors[50:]) < 0.15
    assert told.speed == pytest.approx(8.0 * math.cos(0.708), abs=0.3)
    assert told.lateral_speed == pytest.approx(-8.0 * math.sin(0.708), abs=0.5)


def test_the_heading_is_wrapped_where_it_turns_over() -> None:
    filtered = KartFilter(0.0, 0.0, 3.1, lever=0.0)
    filtered.state[4] = 1.0
    filtered.predict(0.1)
    assert filtered.state[2] == pytest.approx(3.2 - 2.0 * math.pi)
