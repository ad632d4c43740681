"""Speeds along a given line: what slip, grip, motor and brakes allow."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_server.core.kernels.motion import tyre_stiffness
from race_server.core.vehicle_presets import KART_60, TT02, TT02_FACTS, vehicle_named
from race_server.core.vehicles import GRAVITY, Vehicle
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.raceline.bundled import read_bundled
from race_server.scenario.raceline.profile import driving, speeds_on
from race_server.scenario.raceline.tyres import cornering_drag
from race_server.scenario.track.load import load_course


def slip_drag(lateral: float, force: float, vehicle: Vehicle) -> float:
    """Return the drag [m/s²] at a lateral acceleration in a bend of 100 m: wheels straight."""
    return cornering_drag(math.sqrt(lateral * 100.0), 0.01, force, bounds_of(vehicle))


def test_slip_brakes_as_it_does_in_the_simulator() -> None:
    weight, lateral = TT02.mass * GRAVITY, TT02.grip * GRAVITY
    limit, stiffness = weight * TT02.grip, weight * TT02.cornering
    for used in (0.2, 0.7, 0.99):
        slip = slip_drag(used * lateral, 0.0, TT02) / (used * lateral)
        assert slip * tyre_stiffness(slip, stiffness, limit) == pytest.approx(
            used * limit, rel=1e-3
        )
    # All the grip across: the whole contact patch slides at tan(a) = 3 · 0.51 / 8.
    assert slip_drag(5.0, 0.0, TT02) == pytest.approx(5.0 * 3.0 * (5.0 / GRAVITY) / 8.0, rel=1e-3)


def test_a_tyre_that_also_drives_slips_further() -> None:
    # 1.4 of 5 m/s² along leave 4.8 across.
    alone, driven = (slip_drag(4.75, force, TT02) for force in (0.0, 1.4))
    assert 1.1 * alone < driven < 1.4 * alone
    # The rear axle drives, so that the front one slips as before.
    alone, driven = (slip_drag(4.0, force, KART_60) for force in (0.0, 4.0))
    assert alone < driven < 2.0 * alone


def test_a_ring_is_driven_at_the_speed_where_the_motor_makes_up_for_slip() -> None:
    bounds = bounds_of(TT02)
    speeds = speeds_on(np.full(188, 0.1), np.full(188, 1.0 / 3.0), bounds)
    assert np.ptp(speeds) < 1e-3
    assert 0.96 < speeds[0] ** 2 / 3.0 / bounds.lateral < 0.98
    assert driving(speeds[0], 1.0 / 3.0, bounds) == pytest.approx(0.0, abs=0.01)


def test_turned_wheels_have_less_grip_and_slipping_ones_turn_less() -> None:
    # cos(arctan(0.257)) of 5 m/s² in a bend of 1 m.
    bounds = replace(bounds_of(TT02_FACTS), slide=1e-9)
    speeds = speeds_on(np.full(62, 0.1), np.ones(62), bounds)
    assert speeds.max() ** 2 == pytest.approx(5.0 * math.cos(math.atan(0.257)), rel=1e-3)
    limit = read_bundled(load_course("covapsy-train-2023"), bounds_of(TT02))
    assert limit is not None
    tightest = np.abs(limit.minimum_time.curvature).max() / bounds_of(TT02).curvature
    assert 0.9 < tightest < 0.97


def test_a_straight_between_bends_is_driven_with_all_the_motor_and_all_the_brakes() -> None:
    bounds = replace(bounds_of(TT02_FACTS), top_speed=100.0)
    curvature = np.where(np.arange(200) < 20, 1.0, 0.0)
    speeds = speeds_on(np.full(200, 0.1), curvature, bounds)
    assert speeds[:20] == pytest.approx(math.sqrt(5.0), abs=1e-3)
    gains = np.diff(speeds**2) / 0.2
    assert gains[30] == pytest.approx(3.0)
    assert gains[-5] == pytest.approx(-4.0)


def test_motor_power_decides_at_speed() -> None:
    bounds = replace(bounds_of(TT02_FACTS), power=6.0, top_speed=100.0, rolling=1.0)
    speeds = speeds_on(np.full(400, 1.0), np.zeros(400), bounds)
    assert speeds.max() <= 100.0
    curvature = np.where(np.arange(4000) < 20, 1.0, 0.0)
    # Power 6 W/kg against 1 m/s² of rolling resistance: never more than 6 m/s.
    fastest = speeds_on(np.full(4000, 0.1), curvature, bounds).max()
    assert 5.8 < fastest <= 6.0


def test_an_axle_that_drives_alone_passes_on_its_share_of_the_grip() -> None:
    bounds = bounds_of(KART_60)
    assert bounds.drive_grip == pytest.approx(0.6 * bounds.lateral, rel=1e-3)
    assert bounds_of(TT02).drive_grip == pytest.approx(bounds_of(TT02).lateral)


def test_a_vehicle_that_never_slips_has_no_grip_to_lose() -> None:
    assert bounds_of(vehicle_named("tt02-kinematic")).lateral > 100.0
