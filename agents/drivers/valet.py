"""Parks: plans a way to its slot on the map, drives it, and stops before what is on no map."""

import math
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

import numpy as np

from race_agents.planning.delay_compensation import move_on
from race_agents.planning.footprint import Point, convert
from race_agents.planning.latency import LATENCY, estimate_latency, remember_command
from race_agents.planning.parking_plan import box_in, chart_of
from race_agents.planning.path import Path
from race_agents.planning.path_follower import HEADING, STANDING, X, Y, follow, make_track
from race_agents.planning.planner_process import ask_plan, get_ready
from race_agents.planning.scan import age_of_scan
from race_agents.planning.turn_taking import Passage
from race_agents.planning.unexpected import (
    WALK,
    Eye,
    chart_around,
    keep_in_mind,
    safe_speed,
    unexpected_points,
)
from race_server.core.driver import Briefing
from race_server.core.kernel_driver import Cockpit, cockpit_for
from race_server.core.kernels.boxes import Hull
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.jit import INTERPRET
from race_server.core.kernels.motion import Command, Motion
from race_server.core.lots import PARKER
from race_server.core.messages import Control
from race_server.core.observation import PART_NUMBERS, Observation
from race_server.core.parking_order import ParkingOrder
from race_server.core.rules.parking import is_parked, stand_in
from race_server.core.state import Floats
from race_server.core.traffic import Traffic
from race_server.core.vehicles import Vehicle
from race_server.errors import DriverError, PlanError

LIDAR = PART_NUMBERS["lidar"]

# A vehicle that has left its way by more than this, to the side [m] or turned [rad], plans again.
LOST, TURNED_AWAY = 0.3, 0.3
# How long [s] a vehicle waits for what stands in its way, or for a way to be found: longer than
# people rest. Then it plans a way around what it sees, and takes that for a box of this half
# size [m] around each point.
PATIENCE_S, MARK = 4.0, 0.3
# One plan takes at most this many steps, see `PathPlanner.allow`.
MOST_STEPS = 12_000
# How long [s] a vehicle waits at least before it plans once more, and as long as nothing changed at
# most PATIENCE_S.
PAUSE_S = 1.0
# How long [s] a vehicle that arrived stands before it plans another way to stand better.
SETTLED_S = 0.5
# Things farther away than a stop from the top speed and this [m] do not matter yet.
BEYOND = 2.0
HOLD = Command(0.0, 0.0, 1.0)


class Valet:
    """Drives to a slot on a planned way; waits for people, and plans again where it stays blocked.

    ``valet:1.5`` drives at most 1.5 m/s, otherwise as fast as the vehicle can and its way lets it.
    """

    preset = "lot_lidar"

    def __init__(self, pace: str = "") -> None:
        """Set the most speed [m/s], that of the vehicle where it is empty.

        Raises:
            DriverError: it is no positive number.
        """
        try:
            self._pace = float(pace) if pace else math.inf
        except ValueError:
            self._pace = math.nan
        if not self._pace > 0.0:
            raise DriverError(f"valet:{pace}: give a speed above zero in m/s, such as valet:1.5")

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race; without an order the vehicle stands."""
        self._briefing = briefing
        self._cockpit: Cockpit | None = None
        self._order: ParkingOrder | None = None
        self._traffic: Traffic | None = None
        self._passage: Passage | None = None
        self._forget_way()

    def join(self, traffic: Traffic) -> None:
        """Share ways with other vehicles: announce them, and drive as far as is cleared."""
        self._traffic = traffic

    def park(self, order: ParkingOrder) -> None:
        """Drive to a slot from the next observation on, and stay there."""
        self._order = order
        get_ready(self._briefing.vehicle, order)
        self._parker = np.zeros(1, PARKER).view(np.recarray)[0]
        order.level.fill(self._parker)
        for name, value in order.slot._asdict().items():
            self._parker[name] = value
        self._chart = self._known = chart_of(order)
        self._failures, self._changes = 0, -1
        self._forget_way()
        if self._traffic is not None:
            self._traffic.aim(self._briefing.seat, box_in(order.slot, self._briefing.vehicle))

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        cockpit = self._cockpit or self._prepare(observation)
        values: Any = observation.values
        cockpit.observation[:] = values.tolist() if INTERPRET else values
        estimate_latency(cockpit)
        command = self._command(observation, cockpit)
        cockpit.control[:3] = command
        remember_command(cockpit.memory, cockpit.control)
        return Control(float(command.steering), float(command.throttle), float(command.brake))

    def _prepare(self, observation: Observation) -> Cockpit:
        self._cockpit = cockpit = cockpit_for(self._briefing, observation.layout)
        rays = int(cockpit.offsets[-1])
        # Points seen now and in the decision before, and how many of each.
        self._points, self._before = np.zeros((2, 2 * rays, 3))
        self._count = 0
        self._box = np.zeros(6)
        return cockpit

    def _forget_way(self) -> None:
        self._asked: Future[Path] | None = None
        self._progress = np.zeros(1)
        # Time since it arrived, since something is in the way, since no way was found [s].
        self._arrived_s = self._blocked_s = 0.0
        self._wait_s = 0.0
        self._give_way_up()

    def _give_way_up(self) -> None:
        """Stop, and let others know."""
        self._track: Floats | None = None
        self._obstructed_s = 0.0
        if self._passage is not None:
            self._passage.close()
            self._passage = None

    def _command(self, observation: Observation, cockpit: Cockpit) -> Command:
        """Return what to do once the command acts."""
        # After a race a kart may drive on to its slot.
        is_done = observation.scalar("finished") > 0.0 and observation.scalar("speed_cap") <= 0.0
        must_stand = is_done or observation.scalar("lights") > 0.0
        if self._order is None or must_stand:
            return HOLD
        vehicle, step_s = self._briefing.vehicle, self._briefing.decision_s
        now = motion_of(observation, vehicle)
        seen = self._look(observation, cockpit, now)
        later = move_on(cockpit, now, int(cockpit.memory[LATENCY]))
        if self._track is None:
            self._wait_s = max(self._wait_s - step_s, 0.0)
            moves = abs(now.speed) > STANDING or abs(later.speed) > STANDING
            if moves or not self._may_plan():
                return Command(now.steering / vehicle.steering_limit, 0.0, 1.0)
            self._plan(later, seen)
        if self._track is None:
            return HOLD
        record = cockpit.vehicle
        safe = safe_speed(self._track, self._progress, record, self._points, self._count, self._box)
        passage = self._passage
        cleared = passage.speed(int(self._progress[0]), vehicle) if passage else math.inf
        command = follow(self._track, self._progress, record, later, min(safe, cleared))
        self._judge(later, step_s, is_blocked=safe <= 0.0, is_held=cleared <= 0.0)
        return command

    def _look(self, observation: Observation, cockpit: Cockpit, now: Motion) -> int:
        """Find what is on no map; return how many points of it are seen now."""
        briefing, start = self._briefing, int(cockpit.offsets[LIDAR])
        rays, vehicle = int(cockpit.offsets[-1]), briefing.vehicle
        age = age_of_scan(cockpit.observation, start, rays, briefing.decision_s, cockpit.memory)
        turn = now.heading - 0.5 * age * now.yaw_rate
        back = age * now.speed
        eye = Eye(
            now.x - back * math.cos(turn),
            now.y - back * math.sin(turn),
            now.heading - age * now.yaw_rate,
            briefing.lidar_field,
            briefing.lidar_reach,
            vehicle.width,
        )
        brakes = vehicle.brake_force / vehicle.mass
        stop_s = abs(now.speed) / brakes + 0.5
        far = 0.5 * stop_s * abs(now.speed) + WALK * stop_s + vehicle.length + BEYOND
        self._points, self._before, before = self._before, self._points, self._count
        known = self._known
        if self._traffic is not None:
            known = known.beside(self._traffic.expected(briefing.seat))
        points, near = self._points, chart_around(known, now.x, now.y, far + BEYOND)
        seen = unexpected_points(near, eye, cockpit.observation, start, rays, far, points)
        elapsed_s = briefing.decision_s
        self._count = keep_in_mind(eye, self._before, before, elapsed_s, points, seen)
        return seen

    def _may_plan(self) -> bool:
        """Return whether it is time to plan: sooner where other vehicles have come or gone."""
        traffic = self._traffic
        if self._asked is not None or traffic is None:
            return self._wait_s <= 0.0
        rested = self._wait_s <= PATIENCE_S - PAUSE_S and traffic.changes != self._changes
        return (rested or self._wait_s <= 0.0) and traffic.may_plan()

    def _plan(self, motion: Motion, seen: int) -> None:
        """Plan a way from where the vehicle stands; without one it waits."""
        assert self._order is not None
        vehicle = self._briefing.vehicle
        if self._asked is None:
            self._mark(seen)
            axle = _axle_of(motion, vehicle)
            chart = self._known
            if self._traffic is not None:
                self._changes = self._traffic.changes
                # Where no way leads around all slots that others go to, this vehicle is first.
                all_goals = self._failures % 2 == 0
                standing = self._traffic.obstacles(self._briefing.seat, all_goals=all_goals)
                chart = chart.beside(standing)
            self._asked = ask_plan(vehicle, axle, self._order, chart, MOST_STEPS)
        if not self._asked.done():
            return
        answer, pace = self._asked, min(self._pace, vehicle.top_speed)
        self._forget_way()
        with suppress(PlanError):
            track = make_track(answer.result(), vehicle, pace)
            if self._take(track):
                self._track, self._failures = track, 0
                return
        # What stands there may walk on, or drive.
        self._known, self._wait_s = self._chart, PATIENCE_S
        self._failures += 1
        if self._traffic is not None and self._failures % 2:
            self._wait_s = 0.0

    def _take(self, track: Floats) -> bool:
        """Announce a way; False where it would block other vehicles."""
        if self._traffic is None:
            return True
        passage = Passage(self._traffic, self._briefing.seat, track, self._briefing.vehicle)
        if not passage.open():
            return False
        self._passage = passage
        return True

    def _mark(self, seen: int) -> None:
        """Put on the map what has stood in the way for long, of the points that are seen."""
        marks = np.zeros((seen if self._blocked_s >= PATIENCE_S else 0, 6))
        marks[:, :2], marks[:, 2:] = self._points[: len(marks), :2], (1.0, 0.0, MARK, MARK)
        self._known = self._chart.beside(marks)

    def _judge(self, motion: Motion, step_s: float, *, is_blocked: bool, is_held: bool) -> None:
        """Forget a way that leads nowhere any more: the vehicle stops and plans another one."""
        assert self._track is not None
        vehicle, point = self._briefing.vehicle, int(self._progress[0])
        axle = _axle_of(motion, vehicle)
        x, y, heading = (float(self._track[point, column]) for column in (X, Y, HEADING))
        cos, sin = math.cos(heading), math.sin(heading)
        aside = (axle.y - y) * cos - (axle.x - x) * sin
        turn = math.remainder(axle.heading - heading, 2.0 * math.pi)
        if abs(aside) > LOST or abs(turn) > TURNED_AWAY:
            self._forget_way()
            return
        stands = abs(motion.speed) < STANDING
        self._blocked_s = self._blocked_s + step_s if is_blocked and stands else 0.0
        is_last = point + 2 >= len(self._track)
        is_there = is_last and stands and not (is_blocked or is_held)
        self._arrived_s = self._arrived_s + step_s if is_there else 0.0
        passage = self._passage
        is_obstructed = is_held and stands and passage is not None and passage.is_obstructed()
        self._obstructed_s = self._obstructed_s + step_s if is_obstructed else 0.0
        if max(self._blocked_s, self._obstructed_s) >= PATIENCE_S:
            self._give_way_up()
        elif self._arrived_s > SETTLED_S and not self._is_parked(motion):
            self._forget_way()

    def _is_parked(self, motion: Motion) -> bool:
        """Return whether the vehicle stands in its slot as well as the order asks."""
        vehicle, parker = self._briefing.vehicle, self._parker
        sizes = (vehicle.box_offset, 0.5 * vehicle.length, 0.5 * vehicle.width)
        hull = Hull(motion.x, motion.y, motion.heading, *sizes, 0)
        return is_parked(parker, hull, stand_in(parker, hull), 0.0)


def motion_of(observation: Observation, vehicle: Vehicle) -> Motion:
    """Return the motion of the centre of gravity that a vehicle observes."""
    middle = np.array(
        [observation.scalar(name) for name in ("position_x", "position_y", "heading")]
    )
    pose = convert(middle, vehicle, Point.MIDDLE, Point.GRAVITY).tolist()
    names = ("speed", "lateral_speed", "yaw_rate", "steering")
    return Motion(*pose, *(observation.scalar(name) for name in names))


def _axle_of(motion: Motion, vehicle: Vehicle) -> Pose:
    place = np.array([motion.x, motion.y, motion.heading])
    return Pose(*convert(place, vehicle, Point.GRAVITY, Point.REAR_AXLE).tolist())
