"""Sensors that fail, and what a kart then does."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_agents.plant.fault_drill import measure, names
from race_agents.unit.readings import Fix, Readings
from race_agents.unit.safety import Echoes
from race_agents.unit.sensor_watch import SensorWatch
from race_server.core.alert import Alert
from race_server.core.telemetry import Health, Sensor, SensorState, Telemetry
from race_server.core.vehicle_presets import KART_60
from race_server.net.wire.telemetry import TelemetryFrame, decode_telemetry, encode_telemetry

WELL, SILENT, STUCK = SensorState.WELL, SensorState.SILENT, SensorState.STUCK


def readings_at(turn: int) -> Readings:
    """Return what all sensors of a kart tell in one of 50 turns a second: no number twice."""
    noise = 0.001 * turn
    scan = Echoes(np.array([5.0 + noise]), np.zeros(1), np.zeros(1), np.ones(1, np.uint8))
    fix = Fix(0.2 * turn, 0.0, 0.02) if turn % 5 == 0 else None
    return Readings(0.02 * turn, 10.0 + noise, noise, noise, (noise, 0.0), fix, scan)


def watched(**changed: object) -> SensorWatch:
    """Return the watch of a kart at 10 m/s; from 1 s to 2 s some readings are others."""
    watch = SensorWatch(KART_60)
    for turn in range(100):
        told = readings_at(turn)
        used = watch.take(replace(told, **changed) if turn >= 50 else told, 10.0, told.steering)
    assert not any(map(math.isinf, (used.wheel_speed, used.yaw_rate)))
    return watch


def test_what_speaks_is_well_and_what_was_never_there_is_absent() -> None:
    watch = watched()
    states = dict(zip(Sensor, watch.states(), strict=True))
    absent = {Sensor.BEACONS, Sensor.LIDAR}
    assert {each for each in Sensor if states[each] is SensorState.ABSENT} == absent
    assert all(states[each] is WELL for each in set(Sensor) - absent)


@pytest.mark.parametrize(
    ("sensor", "changed", "state"),
    [
        (Sensor.WHEELS, {"wheel_speed": math.nan}, SILENT),
        (Sensor.WHEELS, {"wheel_speed": math.inf}, SILENT),
        (Sensor.WHEELS, {"wheel_speed": 9.0}, STUCK),
        (Sensor.GYRO, {"yaw_rate": 0.25}, STUCK),
        (Sensor.ACCELEROMETER, {"acceleration": None}, SILENT),
        (Sensor.FIXES, {"fix": None}, SILENT),
        (Sensor.FIXES, {"fix": Fix(7.0, 7.0, 0.02)}, STUCK),
        (Sensor.RADAR, {"echoes": None}, SILENT),
        (Sensor.RADAR, {"echoes": readings_at(0).echoes}, STUCK),
    ],
)
def test_a_sensor_that_fails_is_found_and_no_other(
    sensor: Sensor, changed: dict[str, object], state: SensorState
) -> None:
    watch = watched(**changed)
    assert watch.state(sensor) is state
    failed = {each for each in Sensor if watch.state(each) > WELL}
    assert failed == {sensor}
    assert watch.is_blind == (sensor is Sensor.RADAR)
    assert watch.is_lame == (sensor in {Sensor.WHEELS, Sensor.GYRO, Sensor.ACCELEROMETER})


def test_a_steering_that_stood_still_on_a_straight_is_stuck_half_a_second_after_it_lags() -> None:
    # Straight on for 2 s, to the last digit; then 0.1 rad is asked for, and nothing moves.
    watch, shown = SensorWatch(KART_60), []
    for turn in range(200):
        asked = 0.1 if turn >= 100 else 0.0
        watch.take(replace(readings_at(turn), steering=0.0), 10.0, asked)
        if watch.state(Sensor.STEERING) is STUCK:
            shown.append(0.02 * turn - 2.0)
    assert shown[0] == pytest.approx(0.5, abs=0.021)
    assert watch.is_lame
    # One that moves at last is well.
    watch.take(replace(readings_at(200), steering=0.05), 10.0, 0.1)
    assert watch.state(Sensor.STEERING) is WELL


@pytest.mark.parametrize(
    ("told", "used"), [(0.5, 0.5), (1.004, 1.0), (-0.01, 0.0), (math.nan, None), (None, None)]
)
def test_a_charge_that_cannot_be_takes_no_kart_off_the_pit_wall(
    told: float | None, used: float | None
) -> None:
    watch = SensorWatch(KART_60)
    charge = watch.take(replace(readings_at(0), battery=told), 0.0, 0.0).battery
    assert charge == used
    told_up = TelemetryFrame(1, 1, Telemetry.of(None, Alert(5), Health(battery=charge)))
    assert decode_telemetry(encode_telemetry(told_up)).telemetry.health.battery == used


def test_an_empty_place_looks_the_same_again_and_a_kart_without_a_radar_is_blind() -> None:
    assert not watched(echoes=Echoes.nothing()).is_blind
    watch = SensorWatch(KART_60)
    for turn in range(50):
        watch.take(replace(readings_at(turn), echoes=None), 0.0, 0.0)
    assert watch.is_blind


def test_a_place_that_stands_still_while_the_kart_drives_is_not_used() -> None:
    watch, fix = SensorWatch(KART_60), Fix(7.0, 7.0, 0.02)
    used = [
        watch.take(replace(readings_at(turn), fix=fix), speed, 0.0).fix
        for turn, speed in enumerate([0.0, 0.0, 10.0])
    ]
    assert used == [fix, fix, None]


def test_a_kart_whose_radar_hangs_stops_within_the_way_of_full_brakes() -> None:
    assert len(names()) == len(set(names())) > 30
    document = measure("hangar-400", KART_60, 1, "radar-hang", lambda _: None)
    (row,) = document["faults"]
    assert document["ok"], document["why"]
    assert row["speed"] == pytest.approx(50.0 / 3.6, abs=0.1)
    assert row["shown_after_s"] < 0.5
    # 1.1 · (13.9 · 0.2 + 13.9² / (2 · 5.15)) m
    assert row["way_m"] < row["most_way_m"] == pytest.approx(23.7, abs=0.2)
    assert "sensor" in row["causes"]
