"""Brings a vehicle into a slot: plans a way, follows it, and plans again where it has to."""

import math
from concurrent.futures import Future, wait
from contextlib import suppress

import numpy as np

from race_agents.planning.delay_compensation import angle_later, move_on
from race_agents.planning.latency import LATENCY
from race_agents.planning.parking_plan import box_in, chart_of, is_settled
from race_agents.planning.path import Path
from race_agents.planning.path_follower import STANDING
from race_agents.planning.planner_process import ask_plan, get_ready
from race_agents.planning.turn_taking import Passage
from race_agents.planning.way import Way, axle_of
from race_server.core.kernel_driver import Cockpit
from race_server.core.kernels.motion import Command, Motion
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Floats
from race_server.core.traffic import Traffic
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError

# How long [s] a vehicle waits for what stands in its way, or for a way to be found: longer than
# people rest. Then it plans a way around what it sees, and takes that for a box of this half
# size [m] around each point.
PATIENCE_S, MARK = 4.0, 0.3
# Where no way was found and nothing has changed, it waits twice as long before the next plan, up to
# this many times.
MOST_DOUBLED = 5
# One plan takes at most this many steps, see `PathPlanner.allow`: without a trailer, and with one.
MOST_STEPS, MOST_TOWED_STEPS = 12_000, 100_000
# How long [s] a vehicle waits at least before it plans once more, and as long as nothing changed at
# most PATIENCE_S.
PAUSE_S = 1.0
# How long [s] a vehicle that arrived stands before it plans another way to stand better.
SETTLED_S = 0.5
# For this share of the time between two commands a vehicle that stands waits for its plan.
WAIT_SHARE = 0.8
HOLD = Command(0.0, 0.0, 1.0)


class Chauffeur:
    """Carries out one order of one vehicle."""

    def __init__(
        self,
        vehicle: Vehicle,
        order: ParkingOrder,
        *,
        pace: float,
        decision_s: float,
        traffic: Traffic | None = None,
        seat: int = 0,
    ) -> None:
        """Take an order.

        pace: most speed [m/s]; decision_s: time between two commands; traffic: where to announce
        ways, as the vehicle of a seat.
        """
        get_ready(vehicle, order)
        self._vehicle, self._order, self._step_s = vehicle, order, decision_s
        self._pace = min(pace, vehicle.top_speed)
        self._chart = self.known = chart_of(order)
        self.plans = 0
        self._traffic, self._seat = traffic, seat
        self._passage: Passage | None = None
        self._failures, self._changes = 0, -1
        self._wait_s = 0.0
        self._forget_way()
        if traffic is not None:
            traffic.aim(seat, box_in(order.slot, vehicle))

    @property
    def has_arrived(self) -> bool:
        """Whether the vehicle has stood in its slot for a while, as far as it knows."""
        return self._arrived_s > SETTLED_S

    def way_ahead(self, most: int) -> Floats:
        """Return the way that the vehicle is on, (N, 2) of the middle of its body [m], or none."""
        return self._way.middles(most) if self._way is not None else np.zeros((0, 2))

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
        stop = Command(now.steering / self._vehicle.steering_limit, 0.0, 1.0)
        if self._passage is not None and not self._passage.is_open:
            # It has just been parked, or is out, and does not observe so before the next tick.
            self._give_way_up()
            return stop
        if self._way is None:
            self._wait_s = max(self._wait_s - self._step_s, 0.0)
            moves = abs(now.speed) > STANDING or abs(later.speed) > STANDING
            if moves or not self._may_plan():
                return stop
            self._plan(later, angle, points[:seen])
        if self._way is None:
            return HOLD
        way, record = self._way, cockpit.vehicle
        safe, passage = way.safe_speed(record, points, count), self._passage
        cleared = passage.speed(int(way.progress[0]), self._vehicle) if passage else math.inf
        command = way.command(record, later, angle, min(safe, cleared))
        self._judge(way, later, angle, is_blocked=safe <= 0.0, is_held=cleared <= 0.0)
        return command

    def _forget_way(self) -> None:
        self._asked: Future[Path] | None = None
        # Time since it arrived, since something is in the way, since no way was found [s].
        self._arrived_s = self._blocked_s = 0.0
        self._wait_s = 0.0
        self._give_way_up()

    def _give_way_up(self) -> None:
        """Stop, and let others know."""
        self._way: Way | None = None
        self._obstructed_s = 0.0
        if self._passage is not None:
            self._passage.close()
            self._passage = None

    def _may_plan(self) -> bool:
        """Return whether it is time to plan: sooner where other vehicles have come or gone."""
        traffic = self._traffic
        if self._asked is not None or traffic is None:
            return self._wait_s <= 0.0
        rested = self._wait_s <= PATIENCE_S - PAUSE_S and traffic.changes != self._changes
        return (rested or self._wait_s <= 0.0) and traffic.may_plan()

    def _plan(self, motion: Motion, angle: float, seen: Floats) -> None:
        """Plan a way from where the vehicle stands; without one it waits."""
        vehicle = self._vehicle
        if self._asked is None:
            self._mark(seen)
            axle, chart = axle_of(motion, vehicle), self.known
            if self._traffic is not None:
                self._changes = self._traffic.changes
                # Where no way leads around all slots that others go to, this vehicle is first.
                all_goals = self._failures % 2 == 0
                chart = chart.beside(self._traffic.obstacles(self._seat, all_goals=all_goals))
            steps = MOST_TOWED_STEPS if vehicle.trailers else MOST_STEPS
            self._asked = ask_plan(vehicle, axle, self._order, chart, angle, steps)
        # A race in lock-step goes on with each answer: while a vehicle stands it may wait for one.
        if not wait([self._asked], WAIT_SHARE * self._step_s).done:
            return
        answer = self._asked
        self._forget_way()
        with suppress(PlanError):
            way = Way(answer.result(), vehicle, self._pace)
            if self._take(way.track):
                self._way, self._failures = way, 0
                self.plans += 1
                return
        # What stands there may walk on, or drive.
        self.known, self._wait_s = self._chart, PATIENCE_S
        if self._traffic is None:
            self._wait_s *= 2 ** min(self._failures, MOST_DOUBLED)
        self._failures += 1
        if self._traffic is not None and self._failures % 2:
            self._wait_s = 0.0

    def _take(self, track: Floats) -> bool:
        """Announce a way; False where it would block other vehicles."""
        if self._traffic is None:
            return True
        passage = Passage(self._traffic, self._seat, track, self._vehicle)
        if not passage.open():
            return False
        self._passage = passage
        return True

    def _mark(self, seen: Floats) -> None:
        """Put on the map what has stood in the way for long, of the points that are seen."""
        marks = np.zeros((len(seen) if self._blocked_s >= PATIENCE_S else 0, 6))
        marks[:, :2], marks[:, 2:] = seen[: len(marks), :2], (1.0, 0.0, MARK, MARK)
        self.known = self._chart.beside(marks)

    def _judge(
        self, way: Way, motion: Motion, angle: float, *, is_blocked: bool, is_held: bool
    ) -> None:
        """Forget a way that leads nowhere any more: the vehicle stops and plans another one."""
        if way.is_lost(motion, angle):
            self._forget_way()
            return
        stands, step_s = abs(motion.speed) < STANDING, self._step_s
        self._blocked_s = self._blocked_s + step_s if is_blocked and stands else 0.0
        is_there = way.is_last and stands and not (is_blocked or is_held)
        self._arrived_s = self._arrived_s + step_s if is_there else 0.0
        passage = self._passage
        is_obstructed = is_held and stands and passage is not None and passage.is_obstructed()
        self._obstructed_s = self._obstructed_s + step_s if is_obstructed else 0.0
        if max(self._blocked_s, self._obstructed_s) >= PATIENCE_S:
            self._give_way_up()
        elif self.has_arrived and not self.is_parked(motion, angle):
            self._forget_way()

    def is_parked(self, motion: Motion, angle: float) -> bool:
        """Return whether the vehicle stands in its slot as well as the order asks."""
        return is_settled(self._vehicle, self._order, motion, angle)
