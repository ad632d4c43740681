"""What the radar in a kart's nose tells of what is beside it, and what the kart makes of that."""

import math

import numpy as np
import pytest

from race_agents.plant.body import Body
from race_agents.plant.radar import Surroundings, scan
from race_agents.unit.confirmation import moved
from race_agents.unit.ego import EgoMotion
from race_agents.unit.limits import Limits
from race_agents.unit.objects import Objects
from race_agents.unit.readings import Readings
from race_agents.unit.safety import Echoes
from race_agents.unit.seen_motion import SeenMotion
from race_server.core import codes
from race_server.core.vehicle_presets import KART_60

LIMITS = Limits.of(KART_60)
SCAN_S = 0.05


def test_a_wall_beside_comes_nearer_to_a_radar_that_swings_towards_it() -> None:
    # It turns to the left on the spot at 1 rad/s; the radar is some 1 m ahead of the middle.
    ahead = LIMITS.nose - KART_60.rear_axle
    body = Body(KART_60, 0.0, 0.0, 0.0, yaw_rate=1.0)
    wall = np.array([[-20.0, 5.0, 20.0, 5.0]])
    echoes = scan(body, Surroundings(wall), np.random.default_rng(1))
    sin = echoes.y / np.hypot(echoes.x - LIMITS.nose, echoes.y)
    assert len(sin) > 10
    assert echoes.closing == pytest.approx(ahead * sin)


@pytest.mark.parametrize("runs", [-8.0, 0.0, 6.0])
@pytest.mark.parametrize(("speed", "turn"), [(0.0, 0.0), (6.0, 0.0), (4.0, 0.8), (6.0, -0.8)])
def test_how_a_kart_beside_the_bumper_moves_is_known(
    speed: float, turn: float, runs: float
) -> None:
    """After a second it is 1 m ahead of the bumper and 2 m to the right, and has driven along x."""
    objects, motion = Objects(LIMITS.nose), EgoMotion()
    x, y, heading = 0.0, 0.0, -turn  # of the rear axle, which will point along x
    ways = [(0.0, 0.0, heading)]
    for _ in range(20):
        middle = heading + 0.5 * turn * SCAN_S
        x, y = x + speed * math.cos(middle) * SCAN_S, y + speed * math.sin(middle) * SCAN_S
        heading += turn * SCAN_S
        ways.append((x, y, heading))
    thing = x + LIMITS.nose + 1.0 - runs, y - 2.0
    for step, (x, y, heading) in enumerate(ways):
        cos, sin = math.cos(heading), math.sin(heading)
        dx, dy = thing[0] + runs * step * SCAN_S - x, thing[1] - y + np.array([-0.1, 0.1])
        ahead, left = cos * dx + sin * dy, cos * dy - sin * dx
        from_radar = ahead - LIMITS.nose
        closes_ahead, closes_left = speed - runs * cos, LIMITS.nose * turn + runs * sin
        closing = (closes_ahead * from_radar + closes_left * left) / np.hypot(from_radar, left)
        echoes = Echoes(ahead, left, closing, np.full(2, codes.KART_HIT, np.uint8))
        objects.look(echoes, motion.take(speed, LIMITS.nose * turn), SCAN_S)
        motion.advance(speed, 0.0, turn, SCAN_S)
    (track,) = objects.tracks
    assert track.state[:2] == pytest.approx((LIMITS.nose + 1.0, -2.0), abs=0.1)
    assert track.state[2:] == pytest.approx((runs, 0.0), abs=0.3)


def test_an_echo_of_what_stands_is_found_where_it_was_when_the_kart_turns() -> None:
    # It drives on an arc of 5 m for a fifth of a second; something stands beside the bumper.
    speed, turn, dt, at = 5.0, 1.0, 0.2, np.array([3.0, 1.5])
    motion, rays = EgoMotion(), at - (LIMITS.nose, 0.0)
    closing = (speed * rays[0] + LIMITS.nose * turn * rays[1]) / np.hypot(*rays)
    for _ in range(20):
        motion.advance(speed, 0.0, turn, dt / 20)
    ego = motion.take(speed, LIMITS.nose * turn)
    there = Echoes(at[:1], at[1:], np.array([closing]), np.full(1, codes.OBSTACLE, np.uint8))
    later = moved(there, ego, dt, LIMITS.nose)
    ahead, left = at - (ego.ahead, ego.left)
    cos, sin = math.cos(ego.turned), math.sin(ego.turned)
    assert later.x[0] == pytest.approx(cos * ahead + sin * left, abs=0.1)
    assert later.y[0] == pytest.approx(cos * left - sin * ahead, abs=0.1)


def test_a_gyro_that_is_wrong_makes_no_kart_drive_that_stands() -> None:
    x, y, kinds = np.full(4, 9.0), np.full(4, 3.0), np.full(4, codes.BORDER, np.uint8)
    seen = SeenMotion(LIMITS.nose)
    seen.take(Readings(0.0, 0.0, -4.0, 0.0, echoes=Echoes(x, y, np.zeros(4), kinds)))
    assert seen.speed(0.0) == 0.0


def test_borders_tell_the_speed_of_a_kart_whose_radar_swings_aside() -> None:
    x, y = np.array([7.0, 8.0, 9.0, 10.0]), np.full(4, 3.0)
    far = np.hypot(x - LIMITS.nose, y)
    closing = (5.0 * (x - LIMITS.nose) + LIMITS.nose * 1.0 * y) / far
    echoes = Echoes(x, y, closing, np.full(4, codes.BORDER, np.uint8))
    seen = SeenMotion(LIMITS.nose)
    seen.take(Readings(0.0, 5.0, 1.0, 0.0, echoes=echoes))
    assert seen.speed(0.0) == pytest.approx(5.0)
