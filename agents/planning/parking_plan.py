"""From an order to park to a path: the planner, asked for the pose of a parked body."""

import math
from contextlib import suppress
from functools import lru_cache

import numpy as np

from race_agents.planning.path import Path, path_of
from race_agents.planning.path_follower import CREEP, CURVATURE, LEFT, SPEED
from race_agents.planning.path_planner import ENDLESS, PathPlanner
from race_agents.planning.rig_moves import DOCKED, InLine
from race_agents.planning.shortcuts import cost_of
from race_agents.planning.towed_planner import TowedPlanner
from race_agents.planning.unexpected import Chart
from race_server.core.free_space.footprint import Point, convert
from race_server.core.free_space.prices import Prices
from race_server.core.free_space.rig import only_trailer
from race_server.core.kernels.geometry import Pose, along_arc
from race_server.core.kernels.motion import Motion
from race_server.core.level import Level
from race_server.core.lots import PARKER
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.core.rules.parking import ALIGNED_WITHIN, has_parked, judged_box, stand_of
from race_server.core.state import BODY, Floats
from race_server.core.vehicles import Vehicle, vehicle_record
from race_server.errors import PlanError

# Distances kept from obstacles [m]: the next one is tried where no path keeps the one before.
MARGINS = (0.05, 0.02)
# What a metre in reverse costs at least, as a multiple of one forward: little is seen behind.
BACK = 2.0
# How far [m] before a slot counts as reached a vehicle drives straight already; the cheaper way
# of several, where coming near the slot askew costs as much as this way [m].
STRAIGHTS = (0.3, 2.0)
ASKEW = 30.0
# Share of what a level allows that a plan of a vehicle with a trailer uses up: it is off its way.
PLANNED = 0.7


def chart_of(order: ParkingOrder) -> Chart:
    """Return walls and boxes of an order."""
    x, y, heading, length, width = order.blocks.T
    boxes = np.stack([x, y, np.cos(heading), np.sin(heading), length, width], axis=1)
    return Chart(np.ascontiguousarray(order.walls), boxes)


def box_in(slot: Slot, vehicle: Vehicle) -> Floats:
    """Return the box of a vehicle that stands in the middle of a slot: (6,), see `Chart`.

    It holds the trailers too.
    """
    cos, sin = math.cos(slot.heading), math.sin(slot.heading)
    half_length, half_width = 0.5 * vehicle.overall_length, 0.5 * vehicle.overall_width
    return np.array([slot.x, slot.y, cos, sin, half_length, half_width])


def is_settled(vehicle: Vehicle, order: ParkingOrder, motion: Motion, angle: float) -> bool:
    """Return whether a vehicle stands in its slot as well as an order asks, were it at rest.

    motion: of the centre of gravity; angle: at the hitch [rad], 0 without a trailer.
    """
    parker = np.zeros(1, PARKER).view(np.recarray)[0]
    order.level.fill(parker)
    for name, value in order.slot._asdict().items():
        parker[name] = value
    body, record = np.zeros(1, BODY).view(np.recarray)[0], vehicle_record(vehicle)[0]
    body.x, body.y, body.heading = motion.x, motion.y, motion.heading
    for trailer in body.trailers:
        trailer.heading = motion.heading - angle
    stand = stand_of(parker, record, body, judged_box(parker, record))
    return bool(has_parked(parker, record, body, stand))


def parked_pose(slot: Slot, vehicle: Vehicle) -> Pose:
    """Return the pose of the rear axle of a vehicle that stands in the middle of a slot."""
    middle = np.array([slot.x, slot.y, slot.heading])
    return Pose(*convert(middle, vehicle, Point.MIDDLE, Point.REAR_AXLE).tolist())


def parked_trailer_pose(slot: Slot, vehicle: Vehicle) -> Pose:
    """Return the pose of a trailer's axle, if all stands straight in the middle of a slot."""
    trailer = only_trailer(vehicle)
    front = vehicle.rear_axle + vehicle.box_offset + 0.5 * vehicle.length
    ahead = 0.5 * vehicle.overall_length - front - trailer.hitch - trailer.bar
    x = slot.x + ahead * math.cos(slot.heading)
    return Pose(x, slot.y + ahead * math.sin(slot.heading), slot.heading)


def plan_to_slot(
    vehicle: Vehicle,
    start: Pose,
    order: ParkingOrder,
    chart: Chart,
    angle: float = 0.0,
    steps: int = ENDLESS,
) -> Path:
    """Return a path of the rear axle from a pose of it into the slot of an order.

    chart: what stands there, that of the order and what was seen since; angle: at the hitch [rad];
    steps: most that the searches may take, see `PathPlanner.allow`.

    Raises:
        PlanError: no margin leaves a path, or the vehicle draws several trailers.
    """
    if vehicle.trailers:
        return _plan_towed(vehicle, start, angle, order, chart, steps)
    goal, refused = parked_pose(order.slot, vehicle), None
    for margin in MARGINS:
        planner = _planner(vehicle, margin)
        planner.allow(steps)
        straight = _straight_in(planner, start, goal, order.level, chart)
        if straight is not None:
            return straight
        try:
            return planner.plan(start, goal, chart.walls, chart.boxes)
        except PlanError as error:
            refused = error
        steps -= planner.steps
    assert refused is not None
    raise refused


def _plan_towed(
    vehicle: Vehicle, start: Pose, angle: float, order: ParkingOrder, chart: Chart, steps: int
) -> Path:
    """Return a path of a vehicle with a trailer.

    Raises:
        PlanError: no margin leaves a path, or the vehicle draws several trailers.
    """
    goal, refused = parked_trailer_pose(order.slot, vehicle), None
    asked = _asked_by(order.level)
    for margin in MARGINS:
        planner = _towed_planner(vehicle, margin)
        planner.allow(steps)
        try:
            return planner.plan(start, angle, goal, chart.walls, chart.boxes, asked)
        except PlanError as error:
            refused = error
        steps -= planner.steps
    assert refused is not None
    raise refused


def _asked_by(level: Level) -> InLine:
    """Return how straight a way of a vehicle with a trailer has to end, for it to be parked."""
    if level.last or not level.turn:
        return DOCKED
    across = level.across or level.within or math.inf
    return DOCKED._replace(ahead_across=PLANNED * across, ahead_turn=PLANNED * level.turn)


def _straight_in(
    planner: PathPlanner, start: Pose, goal: Pose, level: Level, chart: Chart
) -> Path | None:
    """Return the cheaper path that ends straight, forward or back, where it is to end so and can.

    A vehicle that counts as parked wherever it comes near the middle of its slot does so before it
    is there: it has to be aligned until then.
    """
    if level.within == 0.0 or level.turn > 0.0:
        return None
    prices, radius = Prices(1.0, planner.back), planner.footprint.radius
    best, least = None, math.inf
    for longer in STRAIGHTS:
        for way in (level.within + longer, -level.within - longer):
            before = along_arc(goal, 0.0, -way)
            if not planner.is_free_straight(before, way, chart.walls, chart.boxes):
                continue
            with suppress(PlanError):
                into = planner.plan(start, before, chart.walls, chart.boxes)
                path = path_of(start, np.concatenate([into.arcs, [(0.0, way)]]))
                cost = cost_of(path.arcs, prices, radius)
                cost += ASKEW if _comes_askew(path, planner.vehicle, goal, level.within) else 0.0
                if cost < least:
                    best, least = path, cost
    return best


def _comes_askew(path: Path, vehicle: Vehicle, goal: Pose, near: float) -> bool:
    """Return whether a path comes near [m] the middle of a slot while the vehicle is not aligned.

    goal: of the rear axle.
    """
    middles = path.sampled(near / 3.0).of(vehicle, Point.MIDDLE)
    slot = convert(np.array(goal), vehicle, Point.REAR_AXLE, Point.MIDDLE)
    turns = np.abs((middles[:, 2] - slot[2] + math.pi) % (2.0 * math.pi) - math.pi)
    there = np.hypot(*(middles[:, :2] - slot[:2]).T) < near
    return bool((there & (turns > ALIGNED_WITHIN)).any())


@lru_cache(maxsize=4)
def _planner(vehicle: Vehicle, margin: float) -> PathPlanner:
    """Return the planner of a vehicle; its work space of some megabytes is made once."""
    back = max(BACK, vehicle.top_speed / vehicle.reverse_speed)
    return PathPlanner(vehicle, margin=margin, back=back)


@lru_cache(maxsize=4)
def _towed_planner(vehicle: Vehicle, margin: float) -> TowedPlanner:
    return TowedPlanner(vehicle, margin=margin)


def driving_time(track: Floats, vehicle: Vehicle) -> float:
    """Return how long [s] a vehicle takes along a track, from straight wheels on.

    track: (S, COLUMNS), see `path_follower`. Before each leg the wheels turn.
    """
    ways, speeds = -np.diff(track[:, LEFT]), track[1:, SPEED] + track[:-1, SPEED]
    inside = ways > 0.0
    # A leg of one step begins and ends at a stand: it is crept along.
    driven_s = float((2.0 * ways[inside] / np.maximum(speeds[inside], 2.0 * CREEP)).sum())
    angles = np.arctan(track[:, CURVATURE] * vehicle.wheelbase)
    starts = np.flatnonzero(np.append(True, ~inside))
    before = np.append(0.0, angles[starts[1:] - 1])
    turned = float(np.abs(angles[starts] - before).sum())
    return driven_s + turned / vehicle.steering_rate
