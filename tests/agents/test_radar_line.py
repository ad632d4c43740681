"""The driver that knows the line by a map and others by its radar."""

import numpy as np
import pytest

from race_agents.drivers.radar_line import RadarLine, moved, tracked
from race_server.core.messages import Control, RayHit
from race_server.core.observation import AHEAD, Observation, layout_of
from race_server.core.vehicle_presets import KART_30
from support.briefings import briefing

LAYOUT = layout_of("radar_line", 0)
STEP, PACE, MIDDLE = 1.0, 8.0, 4  # [m], [m/s], the ray straight ahead


def seen_at(tick: int, distance: float, kind: RayHit) -> Observation:
    """Return what a kart sees on a straight line at 8 m/s, with something straight ahead."""
    values = np.zeros(LAYOUT.size, np.float32)
    part = LAYOUT.slices
    ways = STEP * np.arange(AHEAD)
    for name, numbers in {
        "speed": PACE,
        "speed_cap": 20.0,
        "thrust_scale": 1.0,
        "grip_scale": 1.0,
        "line_step": STEP,
        "line_ahead_x": ways,
        "line_speed_ahead": PACE,
        "line_speed_held": PACE,
        "line_left_ahead": 1.5,
        "line_right_ahead": 1.5,
        "radar": 30.0,
        "radar_kind": float(RayHit.BORDER),
    }.items():
        values[part[name]] = numbers
    values[part["radar"].start + MIDDLE] = distance
    values[part["radar_kind"].start + MIDDLE] = float(kind)
    return Observation(tick, LAYOUT, values)


def driven(kind: RayHit) -> Control:
    """Return what the driver does after a second, 8 m before something that stands."""
    driver = RadarLine()
    driver.reset(briefing("radar_line", vehicle=KART_30))
    control = Control()
    for turn in range(20):
        distance = 16.0 - PACE * 0.05 * (turn - turn % 2)
        control = driver.act(seen_at(3 * turn, distance, kind))
    return control


def test_a_border_ahead_is_the_maps_business_and_a_person_is_braked_for() -> None:
    assert driven(RayHit.BORDER).brake < 0.3
    for kind in (RayHit.KART, RayHit.PERSON, RayHit.OBSTACLE):
        assert driven(kind).brake > 0.6


def test_what_stands_comes_nearer_at_the_speed_of_the_kart() -> None:
    ahead = np.array([[10.0, 0.0, 0.0, 0.0]])
    assert moved(ahead, 5.0, 0.0, 0.1)[0] == pytest.approx([9.5, 0.0, 0.0, 0.0])
    # A kart that turns left sees what was ahead to its right.
    assert moved(ahead, 0.0, 1.0, 0.1)[0][1] == pytest.approx(-1.0, abs=0.01)


def test_the_speed_of_another_is_found_from_scan_to_scan() -> None:
    seen = np.zeros((0, 4))
    for scan in range(12):  # it drives 4 m/s, this kart stands
        seen = tracked(np.array([[10.0 + 0.4 * scan, 1.0]]), moved(seen, 0.0, 0.0, 0.1))
    assert seen[0] == pytest.approx([14.4, 1.0, 4.0, 0.0], abs=0.05)
