"""The follower of paths, driven by the motion of the world at ten decisions a second."""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from race_agents.planning.parking_tasks import bay
from race_agents.planning.path import Path, path_of
from race_agents.planning.path_follower import (
    CURVATURE,
    GEAR,
    LEFT,
    SPEED,
    STANDING,
    follow,
    make_track,
)
from race_agents.planning.path_planner import PathPlanner
from race_agents.planning.way import Way
from race_server.core.free_space.footprint import Point, box_at, convert, footprint_of
from race_server.core.kernels.contacts import box_on_segment
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.motion import Allowance, Motion, move
from race_server.core.state import Floats
from race_server.core.vehicle_presets import CAR, KART_13
from race_server.core.vehicles import Vehicle, vehicle_record
from race_server.errors import PlanError

SUBSTEP = 1.0 / 120.0
DECISION = 12  # substeps
CRUISE = 2.0
ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Drive:
    """What happened at each decision."""

    poses: Floats  # (D, 3) of the rear axle
    speeds: Floats  # (D,) [m/s]
    angles: Floats  # (D,) [rad] of the wheels
    points: Floats  # (D,) number of the point passed last


def drive(
    path: Path, vehicle: Vehicle = CAR, *, seconds: float = 120.0, aside: float = 0.0
) -> Drive:
    """Return a drive along a path, from `aside` [m] to the left of its start."""
    track, progress = make_track(path, vehicle, CRUISE), np.zeros(1)
    record = vehicle_record(vehicle)[0]
    allowance = Allowance(vehicle.top_speed, 1.0, 1.0, 0.0)
    x, y, heading = convert(np.array(path.start), vehicle, Point.REAR_AXLE, Point.GRAVITY).tolist()
    x, y = x - aside * math.sin(heading), y + aside * math.cos(heading)
    motion = Motion(x, y, heading, 0.0, 0.0, 0.0, 0.0)
    rows = []
    for _ in range(round(seconds / SUBSTEP / DECISION)):
        command = follow(track, progress, record, motion, math.inf)
        for _ in range(DECISION):
            motion = move(record, motion, command, allowance, SUBSTEP)
        rows.append((*motion[:4], motion.steering, progress[0]))
        is_there = progress[0] >= len(track) - 2 and command.brake == 1.0
        if is_there and abs(motion.speed) < 1e-6 and len(rows) > 20:
            break
    log = np.array(rows)
    poses = convert(log[:, :3], vehicle, Point.GRAVITY, Point.REAR_AXLE)
    return Drive(poses, log[:, 3], log[:, 4], log[:, 5])


@cache
def parked() -> tuple[Path, Floats]:
    task = bay(width=2.5, aisle=6.0, forward=False)
    path = PathPlanner(CAR).plan(Pose(-6.0, 3.0, 0.0), task.goal(CAR), task.walls())
    return path, task.walls()


def test_the_car_drives_ten_metres_and_stands() -> None:
    done = drive(path_of(ORIGIN, np.array([[0.0, 10.0]])))
    assert done.poses[-1] == pytest.approx([10.0, 0.0, 0.0], abs=0.01)
    assert 1.9 < done.speeds.max() < CRUISE + 0.05
    # 2 m/s by 0.62 m/s² takes 3.2 s, braking by 0.5 m/s² 4 s; in both 2 m/s · t / 2 are driven.
    seconds = len(done.poses) * DECISION * SUBSTEP
    assert 7.0 < seconds < 12.0


def test_the_car_parks_backwards_to_within_a_centimetre() -> None:
    path, walls = parked()
    done = drive(path)
    goal = path.poses[-1]
    assert np.hypot(*(done.poses[-1] - goal)[:2]) < 0.01
    assert abs(math.remainder(done.poses[-1][2] - goal[2], 2.0 * math.pi)) < 0.01
    body = footprint_of(CAR, 0.03, 1.0)
    boxes = [box_at(body, Pose(*pose)) for pose in done.poses.tolist()]
    assert not any(box_on_segment(box, *wall)[0] > 0.0 for box in boxes for wall in walls.tolist())


def test_the_rear_axle_keeps_within_two_centimetres_of_its_path() -> None:
    path, _ = parked()
    line = path.sampled(0.01).poses[:, :2]
    apart = [np.hypot(*(line - pose[:2]).T).min() for pose in drive(path).poses]
    assert max(apart) < 0.02


def test_a_leg_begins_once_the_wheels_have_turned() -> None:
    # Full lock to the left ahead, full lock to the right back: 1.5 rad at 0.5 rad/s take 3 s.
    bend = 0.95 / CAR.turning_radius
    path = path_of(ORIGIN, np.array([[bend, 3.0], [-bend, -3.0]]))
    track, done = make_track(path, CAR, CRUISE), drive(path)
    second = int(np.flatnonzero(track[:, GEAR] < 0.0)[0])
    stands = (np.abs(done.speeds) < STANDING) & (done.points == second)
    angle = math.atan(bend * CAR.wheelbase)
    assert 2.0 * angle / CAR.steering_rate == pytest.approx(stands.sum() / 10.0, abs=0.3)
    backing = done.speeds < -STANDING
    assert done.angles[backing][0] == pytest.approx(-angle, abs=0.05)
    assert (done.points[backing] >= second).all()


def test_nowhere_must_the_wheels_turn_faster_than_they_can() -> None:
    path, _ = parked()
    track = make_track(path, CAR, CRUISE)
    angles, steps = np.arctan(track[:, CURVATURE] * CAR.wheelbase), -np.diff(track[:, LEFT])
    inside = steps > 0.0
    turning = np.abs(np.diff(angles))[inside] / steps[inside]
    fastest = np.maximum(track[1:, SPEED], track[:-1, SPEED])[inside]
    assert (turning * fastest).max() <= 0.7 * CAR.steering_rate + 1e-9


def test_legs_begin_and_end_at_a_stand() -> None:
    path, _ = parked()
    track = make_track(path, CAR, CRUISE)
    ends = track[:, LEFT] == 0.0
    assert ends[-1]
    assert (track[ends, SPEED] == 0.0).all()
    assert track[0, SPEED] == 0.0
    assert np.count_nonzero(ends) > path.changes


@pytest.mark.parametrize("way", [8.0, -8.0])
def test_a_kart_that_begins_beside_its_path_comes_back_to_it(way: float) -> None:
    # Critically damped over about a metre: after 8 m nothing of 10 cm is left.
    done = drive(path_of(ORIGIN, np.array([[0.0, way]])), KART_13, aside=0.1)
    assert abs(done.poses[-1][1]) < 0.01
    assert abs(done.poses[-1][2]) < 0.01
    assert done.poses[-1][0] == pytest.approx(way, abs=0.02)


def test_at_the_end_the_brakes_hold() -> None:
    path = path_of(ORIGIN, np.array([[0.0, 1.0]]))
    track, progress = make_track(path, CAR, CRUISE), np.array([19.0])
    there = Motion(1.0 + CAR.rear_axle, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    command = follow(track, progress, vehicle_record(CAR)[0], there, math.inf)
    assert (command.throttle, command.brake) == (0.0, 1.0)


def test_a_path_without_arcs_is_refused() -> None:
    with pytest.raises(PlanError, match="the vehicle is at its goal"):
        make_track(path_of(ORIGIN, np.zeros((0, 2))), CAR, CRUISE)


def test_a_way_is_shown_by_the_middle_of_the_body_with_its_cusps() -> None:
    # 4 m ahead and 2 m back along x: the middle is ahead of the rear axle all the while.
    way = Way(path_of(ORIGIN, np.array([(0.0, 4.0), (0.0, -2.0)])), KART_13, CRUISE)
    ahead = KART_13.rear_axle + KART_13.box_offset
    x, y = way.middles(7).T
    assert len(x) <= 7
    assert (x[0], x.max(), x[-1]) == pytest.approx((ahead, 4.0 + ahead, 2.0 + ahead), abs=1e-6)
    assert y == pytest.approx(0.0, abs=1e-9)
