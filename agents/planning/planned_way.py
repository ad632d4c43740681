"""What a parked vehicle is measured against: the planner's way for the same task.

It depends on the task alone, and takes longer than a policy drives it. So it is kept in the user's
cache, where the exams of other drivers find it.
"""

import contextlib
import hashlib
import json
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path
from typing import Any

from race_agents.planning.parking_plan import chart_of, driving_time, plan_to_slot
from race_agents.planning.planner_process import ask_apart
from race_agents.planning.way import Way
from race_server.core.free_space.footprint import Point, convert
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.jit import cache_root, source_digest
from race_server.core.messages import PlannedWay
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError
from race_server.kept_file import keep


def planned_way(vehicle: Vehicle, start: Floats, order: ParkingOrder) -> PlannedWay | None:
    """Return the plan of a task, None if none is found; the same one as before if it is kept.

    start: (4,), see `poses_of`.
    """
    path = _kept(vehicle, start, order)
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        words: Any = json.loads(path.read_text(encoding="utf-8"))["plan"]
        return PlannedWay(**words) if words is not None else None
    plan = _plan(vehicle, start, order)
    content = json.dumps({"plan": asdict(plan) if plan else None}).encode()
    keep(path, lambda file: file.write(content))
    return plan


def ask_planned_way(
    vehicle: Vehicle, start: Floats, order: ParkingOrder
) -> "Future[PlannedWay | None]":
    """Return `planned_way` of the same arguments, once another process has found it."""
    return ask_apart(planned_way, vehicle, start, order)


def _plan(vehicle: Vehicle, start: Floats, order: ParkingOrder) -> PlannedWay | None:
    """Return the plan of a task, None if none is found; arguments as for `planned_way`."""
    axle = Pose(*convert(start[:3], vehicle, Point.GRAVITY, Point.REAR_AXLE).tolist())
    try:
        path = plan_to_slot(vehicle, axle, order, chart_of(order), float(start[3]))
        track = Way(path, vehicle, vehicle.top_speed).track
    except PlanError:
        return None
    time_s = driving_time(track, vehicle) + order.level.hold_s
    return PlannedWay(time_s, path.length, path.changes)


def _kept(vehicle: Vehicle, start: Floats, order: ParkingOrder) -> Path:
    """Return the file that keeps a plan: by all that decides it, the planner's code included."""
    words = f"{source_digest()} {vehicle} {order.slot} {order.level}"
    digest = hashlib.sha256(words.encode())
    digest.update(Path(__file__).read_bytes())  # holds no kernel that the digest of sources knows
    for numbers in (start, order.walls, order.blocks):
        digest.update(f"{numbers.shape}".encode())
        digest.update(numbers.astype("<f8").tobytes())
    return cache_root() / "plans" / f"{digest.hexdigest()[:24]}.json"
