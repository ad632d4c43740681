"""Bodies and walls alone, as a world without laps has them: a car park of four walls."""

import math

import numpy as np
import pytest

from race_server.core import codes
from race_server.core.clock import SUBSTEPS, TICKS_PER_SECOND
from race_server.core.kernels.boxes import box_count, box_of, hull_of
from race_server.core.kernels.contacts import Material
from race_server.core.kernels.rays import cast_ray
from race_server.core.lots import BLOCK, ROOM
from race_server.core.stages.blocks import Standing
from race_server.core.stages.contacts import Blow, find_contact_pairs, is_blow, next_body_blow
from race_server.core.stages.controls import take_controls
from race_server.core.stages.motion import move_bodies
from race_server.core.stages.wall_contacts import next_wall_blow
from race_server.core.state import BODY, Records
from race_server.core.vehicle_presets import TT02
from race_server.core.vehicles import vehicle_record
from race_server.scenario.track.polyline import segments_of
from race_server.scenario.track.walls import Fence, pack_walls

SIDE = 6.0  # [m] of the car park, around the origin
CORNERS = 0.5 * SIDE * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
SIDES = segments_of(CORNERS)  # counter-clockwise: the inside is on the left
KINDS = np.full(len(SIDES), codes.BORDER, np.uint8)
WALLS = pack_walls([Fence(SIDES, KINDS, 0.5)])
NOTHING_STANDS = Standing(np.zeros(0, BLOCK), np.zeros(0, ROOM))
MATERIAL = Material(0.3, 0.3)


def parked(*places: tuple[float, float, float]) -> tuple[Records, Records]:
    """Return bodies at rest at x, y [m], heading [rad], and their vehicles."""
    bodies = np.zeros(len(places), BODY)
    for body, place in zip(bodies, places, strict=True):
        body.x, body.y, body.heading = place
        body.status = codes.RACING
        body.speed_cap, body.thrust_scale, body.grip_scale = TT02.top_speed, 1.0, 1.0
    return bodies, np.concatenate([vehicle_record(TT02)] * len(places))


def drive(bodies: Records, vehicles: Records, controls: np.ndarray, seconds: float) -> list[Blow]:
    """Drive for some seconds and return all blows."""
    take_controls(bodies, controls)
    blows = []
    for tick in range(round(seconds * TICKS_PER_SECOND)):
        find_contact_pairs(bodies, vehicles, np.arange(len(bodies)))
        for _ in range(SUBSTEPS):
            move_bodies(bodies, vehicles)
            cursor = 0
            while cursor >= 0:
                blow = next_body_blow(
                    bodies, vehicles, np.arange(len(bodies)), tick, MATERIAL, cursor
                )
                cursor = blow.cursor
                blows += [blow] if is_blow(blow) else []
            cursor = 0
            while cursor >= 0:
                walls = (WALLS, WALLS.sites[0], NOTHING_STANDS, MATERIAL, 0.0)
                blow = next_wall_blow(bodies, vehicles, *walls, cursor)
                cursor = blow.cursor
                blows += [blow] if is_blow(blow) else []
    return blows


def test_a_body_that_drives_at_a_wall_tells_of_the_blow_and_stays_inside() -> None:
    bodies, vehicles = parked((0.0, 0.0, 0.3))
    first, *_ = drive(bodies, vehicles, np.array([[0.0, 1.0, 0.0, 0.0]]), 3.0)
    assert (first.first, first.second) == (0, -1)
    assert (first.nx, first.ny) == pytest.approx((-1.0, 0.0))
    assert first.closing > 1.0
    assert abs(bodies["x"][0]) < 0.5 * SIDE
    assert abs(bodies["y"][0]) < 0.5 * SIDE


def test_a_blow_between_two_bodies_keeps_their_momentum() -> None:
    bodies, vehicles = parked((-0.5, 0.0, 0.0), (0.0, 0.0, 0.0))
    bodies["speed"][0] = 2.0
    find_contact_pairs(bodies, vehicles, np.arange(len(bodies)))
    bodies["x"][0] = -0.95 * TT02.length
    blow = next_body_blow(bodies, vehicles, np.arange(len(bodies)), 0, MATERIAL, 0)
    assert (blow.first, blow.second, blow.closing) == (0, 1, pytest.approx(2.0))
    assert blow.impulse == pytest.approx(1.3 * 2.0 * 0.5 * TT02.mass)
    assert bodies["speed"].sum() == pytest.approx(2.0)
    assert bodies["speed"][1] - bodies["speed"][0] == pytest.approx(0.3 * 2.0)
    assert blow.first_approach == pytest.approx(2.0)
    assert blow.second_approach == pytest.approx(0.0)


def test_every_pair_of_a_heap_is_told_once_and_in_order() -> None:
    bodies, vehicles = parked(*((0.9 * TT02.length * n, 0.0, 0.0) for n in range(4)))
    bodies["speed"] = (3.0, 2.0, 1.0, 0.0)
    find_contact_pairs(bodies, vehicles, np.arange(len(bodies)))
    pairs, cursor = [], 0
    while cursor >= 0:
        blow = next_body_blow(bodies, vehicles, np.arange(len(bodies)), 0, MATERIAL, cursor)
        cursor = blow.cursor
        pairs += [(blow.first, blow.second)] if is_blow(blow) else []
    assert pairs == [(0, 1), (1, 2), (2, 3)]


def test_a_body_that_others_drive_through_meets_no_other() -> None:
    bodies, vehicles = parked((0.0, 0.0, 0.0), (0.9 * TT02.length, 0.0, 0.0))
    bodies["speed"][0], bodies["ghost_until"][0] = 2.0, 10
    find_contact_pairs(bodies, vehicles, np.arange(len(bodies)))
    assert not is_blow(next_body_blow(bodies, vehicles, np.arange(len(bodies)), 9, MATERIAL, 0))
    assert is_blow(next_body_blow(bodies, vehicles, np.arange(len(bodies)), 10, MATERIAL, 0))


def test_the_box_of_a_vehicle_lies_ahead_of_its_centre_of_gravity() -> None:
    bodies, vehicles = parked((1.0, 2.0, 0.5 * math.pi))
    assert box_count(vehicles[0]) == 1
    box = box_of(hull_of(vehicles[0], bodies[0], 0))
    assert (box.x, box.y) == pytest.approx((1.0, 2.0 + vehicles[0].box_offset))
    assert (box.half_length, box.half_width) == (0.5 * TT02.length, 0.5 * TT02.width)


def test_a_ray_in_a_car_park_needs_walls_only() -> None:
    distance, wall = cast_ray(WALLS, WALLS.sites[0], 0.0, 0.0, 1.0, 0.0, 10.0)
    assert (distance, wall) == (pytest.approx(0.5 * SIDE), 1)
