"""What a parked vehicle is measured against: the planner's way for the same task."""

from dataclasses import dataclass

from race_agents.planning.parking_plan import chart_of, driving_time, plan_to_slot
from race_agents.planning.way import Way
from race_server.core.free_space.footprint import Point, convert
from race_server.core.kernels.geometry import Pose
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError


@dataclass(frozen=True)
class PlannedWay:
    """How a task is planned, without anything that moves."""

    time_s: float  # along the path at its speeds, and until the vehicle counts as parked
    path_m: float
    direction_changes: int


def planned_way(vehicle: Vehicle, start: Floats, order: ParkingOrder) -> PlannedWay | None:
    """Return the plan of a task, None if none is found.

    start: (3,) x [m], y [m], heading [rad] of the centre of gravity; a trailer stands in line.
    """
    axle = convert(start, vehicle, Point.GRAVITY, Point.REAR_AXLE)
    try:
        path = plan_to_slot(vehicle, Pose(*axle.tolist()), order, chart_of(order))
        track = Way(path, vehicle, vehicle.top_speed).track
    except PlanError:
        return None
    time_s = driving_time(track, vehicle) + order.level.hold_s
    return PlannedWay(time_s, path.length, path.changes)
