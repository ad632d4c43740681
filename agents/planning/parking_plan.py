"""From an order to park to a path: the planner, asked for the pose of a parked body."""

import math
from functools import lru_cache

import numpy as np

from race_agents.planning.footprint import Point, convert
from race_agents.planning.path import Path
from race_agents.planning.path_follower import CURVATURE, LEFT, SPEED
from race_agents.planning.path_planner import PathPlanner
from race_agents.planning.unexpected import Chart
from race_server.core.kernels.geometry import Pose
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError

# Distances kept from obstacles [m]: the next one is tried where no path keeps the one before.
MARGINS = (0.05, 0.02)
# What a metre in reverse costs at least, as a multiple of one forward: little is seen behind.
BACK = 2.0


def chart_of(order: ParkingOrder) -> Chart:
    """Return walls and boxes of an order."""
    x, y, heading, length, width = order.blocks.T
    boxes = np.stack([x, y, np.cos(heading), np.sin(heading), length, width], axis=1)
    return Chart(np.ascontiguousarray(order.walls), boxes)


def parked_pose(slot: Slot, vehicle: Vehicle) -> Pose:
    """Return the pose of the rear axle of a vehicle that stands in the middle of a slot."""
    middle = np.array([slot.x, slot.y, slot.heading])
    return Pose(*convert(middle, vehicle, Point.MIDDLE, Point.REAR_AXLE).tolist())


def plan_to_slot(vehicle: Vehicle, start: Pose, slot: Slot, chart: Chart) -> Path:
    """Return a path of the rear axle from a pose of it into a slot.

    Raises:
        PlanError: no margin leaves a path.
    """
    goal = parked_pose(slot, vehicle)
    refused: PlanError | None = None
    for margin in MARGINS:
        try:
            return _planner(vehicle, margin).plan(start, goal, chart.walls, chart.boxes)
        except PlanError as error:
            refused = error
    assert refused is not None
    raise refused


@lru_cache(maxsize=4)
def _planner(vehicle: Vehicle, margin: float) -> PathPlanner:
    """Return the planner of a vehicle; its work space of some megabytes is made once."""
    back = max(BACK, vehicle.top_speed / vehicle.reverse_speed)
    return PathPlanner(vehicle, margin=margin, back=back)


def driving_time(track: Floats, vehicle: Vehicle) -> float:
    """Return how long [s] a vehicle takes along a track, from straight wheels on.

    track: (S, 8), see `path_follower`. Before each leg the wheels turn.
    """
    ways, speeds = -np.diff(track[:, LEFT]), track[1:, SPEED] + track[:-1, SPEED]
    inside = ways > 0.0
    driven_s = float((2.0 * ways[inside] / np.maximum(speeds[inside], 1e-3)).sum())
    angles = np.arctan(track[:, CURVATURE] * vehicle.wheelbase)
    starts = np.flatnonzero(np.append(True, ~inside))
    before = np.append(0.0, angles[starts[1:] - 1])
    turned = float(np.abs(angles[starts] - before).sum())
    return driven_s + turned / vehicle.steering_rate


def stands_in(slot: Slot, vehicle: Vehicle, axle: Pose) -> tuple[float, float, float]:
    """Return how far ahead [m], to the left [m] and turned [rad] a body stands in a slot.

    axle: the pose of the rear axle.
    """
    x, y, heading = convert(np.array(axle), vehicle, Point.REAR_AXLE, Point.MIDDLE).tolist()
    cos, sin, dx, dy = math.cos(slot.heading), math.sin(slot.heading), x - slot.x, y - slot.y
    turn = math.remainder(heading - slot.heading, 2.0 * math.pi)
    return dx * cos + dy * sin, dy * cos - dx * sin, turn
