"""Borders that a radar sees tell a kart where it is, and that its gyro is off."""

import math

import numpy as np
import pytest

from race_agents.unit.borders import BorderEchoes, Borders, Sighting
from race_agents.unit.ekf import KartFilter
from race_agents.unit.gyro_check import GyroCheck
from race_agents.unit.motion import SIZE, drive_on
from race_agents.unit.safety import Echoes
from race_server.core import codes
from race_server.core.vehicle_presets import KART_60

# A straight road to the east between walls at y = -3 and y = 3, in pieces of 1 m.
ALONG = np.arange(-20.0, 300.0)
ROAD = np.concatenate(
    [np.stack([ALONG, 0 * ALONG + y, ALONG + 1.0, 0 * ALONG + y], axis=1) for y in (-3.0, 3.0)]
)
BORDERS = Borders.of(ROAD)


def at(x: float, y: float, heading: float = 0.0, speed: float = 0.0) -> np.ndarray:
    state = np.zeros(SIZE)
    state[:4] = x, y, heading, speed
    return state


def walls_seen(state: np.ndarray, bearings: tuple[float, ...] = (-50, -30, 30, 50)) -> Echoes:
    """Return what a radar on the rear axle sees of both walls; bearings in degrees."""
    ways = np.radians(bearings)
    up = np.sin(ways + state[2])
    far = np.where(up > 0.0, 3.0 - state[1], -3.0 - state[1]) / up
    kinds = np.full(len(far), codes.BORDER, np.uint8)
    return Echoes(far * np.cos(ways), far * np.sin(ways), np.zeros(len(far)), kinds)


def seen_from(echoes: Echoes, state: np.ndarray) -> Sighting | None:
    used = BorderEchoes.of(echoes)
    return None if used is None else BORDERS.sighting(used, state)


def test_an_echo_of_a_wall_lies_on_the_wall_if_the_kart_is_where_it_is() -> None:
    truth = at(50.0, 1.0, 0.1)
    seen = seen_from(walls_seen(truth), truth)
    assert seen is not None
    assert seen.residuals(truth) == pytest.approx(np.zeros(4), abs=1e-9)
    # A kart that is a metre farther south sees both walls a metre farther south.
    assert np.abs(seen.residuals(at(50.0, 0.0, 0.1))) == pytest.approx(np.ones(4))
    assert np.abs(seen.residuals(at(57.0, 1.0, 0.1))) == pytest.approx(np.zeros(4), abs=1e-9)


def test_rows_are_the_derivatives_of_residuals() -> None:
    state = at(50.0, 0.7, 0.2)
    seen = seen_from(walls_seen(at(50.3, 0.9, 0.25)), state)
    assert seen is not None
    for column in range(3):
        ahead, behind = state.copy(), state.copy()
        ahead[column] += 1e-6
        behind[column] -= 1e-6
        slope = (seen.residuals(ahead) - seen.residuals(behind)) / 2e-6
        assert -slope == pytest.approx(seen.rows(state)[:, column], abs=1e-6)


def test_what_is_no_border_or_far_from_all_of_them_is_not_used() -> None:
    truth = at(50.0, 0.0)
    echoes = walls_seen(truth)
    people = Echoes(echoes.x, echoes.y, echoes.closing, np.full(4, codes.PERSON, np.uint8))
    assert seen_from(people, truth) is None
    assert seen_from(echoes, at(50.0, 40.0)) is None
    assert seen_from(Echoes.nothing(), truth) is None


def off_after(seconds: float, *, looks: bool, fix_at: tuple[float, float] | None = None) -> float:
    """Return how far aside of its way [m] a kart of 10 m/s takes itself to be.

    Its gyro tells 0.01 rad/s too much. fix_at: fixes lie so far ahead and aside from 3 s on.
    """
    truth, filtered = at(0.0, 0.0, 0.0, 10.0), KartFilter(0.0, 0.0, 0.0, lever=0.0)
    filtered.state[3] = 10.0
    filtered.covariance[:3, :3] = np.diag([1e-3, 1e-3, 1e-4])
    for turn in range(round(seconds * 50)):
        truth = drive_on(truth, 0.02)
        filtered.predict(0.02, push=(0.0, 0.0))
        filtered.see_speed(10.0, 0.05)
        filtered.see_yaw_rate(0.01, 0.012)
        if looks and turn % 5 == 0:
            seen = seen_from(walls_seen(truth), filtered.state)
            assert seen is not None
            filtered.see_borders(seen)
        if fix_at is not None and turn % 5 == 2:
            ahead, aside = fix_at if turn > 150 else (0.0, 0.0)
            filtered.see_position(truth[0] + ahead, truth[1] + aside, 0.02)
    return math.hypot(filtered.state[0] - truth[0], filtered.state[1] - truth[1])


def test_a_kart_without_fixes_stays_between_its_walls() -> None:
    assert off_after(10.0, looks=False) > 2.0
    assert off_after(10.0, looks=True) < 0.3


def test_a_fix_behind_the_wall_is_never_believed_and_one_along_the_road_is_in_the_end() -> None:
    aside, along = (0.0, 2.0), (2.0, 0.0)
    assert off_after(10.0, looks=True, fix_at=aside) < 0.3
    assert off_after(10.0, looks=False, fix_at=aside) == pytest.approx(2.0, abs=0.1)
    assert off_after(10.0, looks=True, fix_at=along) == pytest.approx(2.0, abs=0.1)


def test_a_place_that_all_borders_contradict_is_doubted() -> None:
    filtered = KartFilter(50.0, 1.2, 0.0, lever=0.0)
    filtered.covariance[:3, :3] = np.diag([1e-3, 1e-3, 1e-4])
    believed = []
    for _ in range(30):
        seen = seen_from(walls_seen(at(50.0, -1.2)), filtered.state)
        assert seen is not None
        believed.append(filtered.see_borders(seen))
    assert not any(believed[:10])
    assert believed[-1]
    assert filtered.state[1] == pytest.approx(-1.2, abs=0.2)


def found(turn: float, steering: float, felt: float, seconds: float = 1.0) -> float | None:
    """Return what the check finds within some time at 10 m/s."""
    check = GyroCheck(KART_60)
    told = (check.bias(turn, steering, (0.0, felt), 10.0, 0.01) for _ in range(int(100 * seconds)))
    return next((one for one in told if one is not None), None)


def test_a_gyro_that_turns_alone_is_off() -> None:
    assert found(0.2, 0.0, 0.0) == pytest.approx(0.2, abs=0.01)
    assert found(-0.2, 0.0, 0.0) == pytest.approx(-0.2, abs=0.01)
    assert found(0.05, 0.0, 0.0) is None
    assert found(0.2, 0.0, 0.0, seconds=0.2) is None


def test_a_gyro_that_another_one_agrees_with_is_right() -> None:
    wheels = math.atan(0.2 * KART_60.wheelbase / 10.0)
    assert found(0.2, wheels, 2.0) is None  # a bend
    assert found(0.2, wheels, 0.0) is None  # a slope pulls at the accelerometer
    assert found(0.2, 0.0, 2.0) is None  # the steering's angle is off


def test_a_kart_whose_tyres_work_hard_tells_nothing() -> None:
    assert found(1.5, 0.0, 0.6 * KART_60.grip * 9.81) is None
