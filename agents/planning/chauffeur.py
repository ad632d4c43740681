"""Brings a vehicle into a slot: plans a way, follows it, and plans again where it has to."""

from concurrent.futures import Future

import numpy as np

from race_agents.planning.delay_compensation import angle_later, move_on
from race_agents.planning.latency import LATENCY
from race_agents.planning.parking_plan import chart_of, is_settled
from race_agents.planning.path import Path
from race_agents.planning.path_follower import STANDING
from race_agents.planning.planner_process import ask_plan
from race_agents.planning.unexpected import Chart
from race_agents.planning.way import Way, axle_of
from race_server.core.kernel_driver import Cockpit
from race_server.core.kernels.motion import Command, Motion
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError

# How long [s] a vehicle waits for what stands in its way, or for a way to be found: longer than
# people rest. Then it plans a way around what it sees, and takes that for a box of this half
# size [m] around each point.
PATIENCE_S, MARK = 4.0, 0.3
# How long [s] a vehicle that arrived stands before it plans another way to stand better.
SETTLED_S = 0.5
HOLD = Command(0.0, 0.0, 1.0)


class Chauffeur:
    """Carries out one order of one vehicle."""

    def __init__(
        self, vehicle: Vehicle, order: ParkingOrder, *, pace: float, decision_s: float
    ) -> None:
        """Take an order. pace: most speed [m/s]; decision_s: time between two commands."""
        self._vehicle, self._order, self._step_s = vehicle, order, decision_s
        self._pace = min(pace, vehicle.top_speed)
        self._chart = self.known = chart_of(order)
        self.plans = 0
        self._wait_s = 0.0
        self._forget_way()

    @property
    def has_arrived(self) -> bool:
        """Whether the vehicle has stood in its slot for a while, as far as it knows."""
        return self._arrived_s > SETTLED_S

    def command(
        self, cockpit: Cockpit, now: Motion, angle: float, points: Floats, count: int, seen: int
    ) -> Command:
        """Return what to do once the command acts.

        now: motion of the centre of gravity; angle: at the hitch [rad], 0 without a trailer;
        points: (N, 3) of what is on no map, see `unexpected_points`, of which the first `count`
        count and the first `seen` are seen now.
        """
        delay = int(cockpit.memory[LATENCY])
        later = move_on(cockpit, now, delay)
        if self._vehicle.trailers:
            angle = angle_later(cockpit, now, angle, delay)
        if self._way is None:
            self._wait_s = max(self._wait_s - self._step_s, 0.0)
            if abs(now.speed) > STANDING or abs(later.speed) > STANDING or self._wait_s > 0.0:
                return Command(now.steering / self._vehicle.steering_limit, 0.0, 1.0)
            self._plan(later, angle, points[:seen])
        if self._way is None:
            return HOLD
        way, record = self._way, cockpit.vehicle
        cap = way.safe_speed(record, points, count)
        command = way.command(record, later, angle, cap)
        self._judge(way, later, angle, is_blocked=cap <= 0.0)
        return command

    def _forget_way(self) -> None:
        self._way: Way | None = None
        self._asked: Future[Path] | None = None
        # Time since it arrived, since something is in the way, since no way was found [s].
        self._arrived_s = self._blocked_s = 0.0
        self._wait_s = 0.0

    def _plan(self, motion: Motion, angle: float, seen: Floats) -> None:
        """Plan a way from where the vehicle stands; without one it waits."""
        vehicle = self._vehicle
        if self._asked is None:
            self._mark(seen)
            axle = axle_of(motion, vehicle)
            self._asked = ask_plan(vehicle, axle, self._order, self.known, angle)
        if not self._asked.done():
            return
        answer = self._asked
        self._forget_way()
        try:
            self._way = Way(answer.result(), vehicle, self._pace)
            self.plans += 1
        except PlanError:
            # What stands there may walk on.
            self.known, self._wait_s = self._chart, PATIENCE_S

    def _mark(self, seen: Floats) -> None:
        """Put on the map what has stood in the way for long, of the points that are seen."""
        marks = np.zeros((len(seen) if self._blocked_s >= PATIENCE_S else 0, 6))
        marks[:, :2], marks[:, 2:] = seen[: len(marks), :2], (1.0, 0.0, MARK, MARK)
        self.known = Chart(self._chart.walls, np.concatenate([self._chart.boxes, marks]))

    def _judge(self, way: Way, motion: Motion, angle: float, *, is_blocked: bool) -> None:
        """Forget a way that leads nowhere any more: the vehicle stops and plans another one."""
        if way.is_lost(motion, angle):
            self._forget_way()
            return
        stands, step_s = abs(motion.speed) < STANDING, self._step_s
        self._blocked_s = self._blocked_s + step_s if is_blocked and stands else 0.0
        is_there = way.is_last and stands and not is_blocked
        self._arrived_s = self._arrived_s + step_s if is_there else 0.0
        if self._blocked_s >= PATIENCE_S:
            self._way = None
        elif self.has_arrived and not self.is_parked(motion, angle):
            self._forget_way()

    def is_parked(self, motion: Motion, angle: float) -> bool:
        """Return whether the vehicle stands in its slot as well as the order asks."""
        return is_settled(self._vehicle, self._order, motion, angle)
