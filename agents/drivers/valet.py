"""Parks: plans a way to its slot on the map, drives it, and stops before what is on no map."""

import math
from concurrent.futures import Future
from typing import Any

import numpy as np

from race_agents.planning.chauffeur import HOLD, Chauffeur
from race_agents.planning.latency import estimate_latency, remember_command
from race_agents.planning.planned_way import ask_planned_way
from race_agents.planning.scan import age_of_scan
from race_agents.planning.unexpected import (
    WALK,
    Chart,
    Eye,
    chart_around,
    keep_in_mind,
    unexpected_points,
)
from race_server.core.driver import MOST_POINTS, Briefing
from race_server.core.free_space.footprint import Point, convert
from race_server.core.kernel_driver import Cockpit, cockpit_for
from race_server.core.kernels.jit import INTERPRET
from race_server.core.kernels.motion import Command, Motion
from race_server.core.messages import Control, PlannedWay
from race_server.core.observation import PART_NUMBERS, Observation
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Floats
from race_server.core.traffic import Traffic
from race_server.core.vehicles import Vehicle
from race_server.errors import DriverError

LIDAR = PART_NUMBERS["lidar"]

# Things farther away than a stop from the top speed and this [m] do not matter yet.
BEYOND = 2.0


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
        self._chauffeur: Chauffeur | None = None
        self._traffic: Traffic | None = None

    def join(self, traffic: Traffic) -> None:
        """Share ways with other vehicles: announce them, and drive as far as is cleared."""
        self._traffic = traffic

    def park(self, order: ParkingOrder) -> None:
        """Drive to a slot from the next observation on, and stay there."""
        briefing = self._briefing
        self._chauffeur = Chauffeur(
            briefing.vehicle,
            order,
            pace=self._pace,
            decision_s=briefing.decision_s,
            traffic=self._traffic,
            seat=briefing.seat,
        )

    def way_ahead(self) -> Floats:
        """Return the way that it is on, (N, 2): x, y [m] of the middle of the body, or none."""
        chauffeur = self._chauffeur
        return chauffeur.way_ahead(MOST_POINTS) if chauffeur is not None else np.zeros((0, 2))

    def ask_plan(
        self, vehicle: Vehicle, start: Floats, order: ParkingOrder
    ) -> "Future[PlannedWay | None]":
        """Return how a task is planned, once another process has found that; None for no way."""
        return ask_planned_way(vehicle, start, order)

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
        return cockpit

    def _command(self, observation: Observation, cockpit: Cockpit) -> Command:
        """Return what to do once the command acts."""
        # After a race a kart may drive on to its slot.
        is_done = observation.scalar("finished") > 0.0 and observation.scalar("speed_cap") <= 0.0
        must_stand = is_done or observation.scalar("lights") > 0.0
        if self._chauffeur is None or must_stand:
            return HOLD
        now = motion_of(observation, self._briefing.vehicle)
        seen = self._look(observation, cockpit, now, self._chauffeur.known)
        angle = observation.scalar("hitch")
        return self._chauffeur.command(cockpit, now, angle, self._points, self._count, seen)

    def _look(self, observation: Observation, cockpit: Cockpit, now: Motion, chart: Chart) -> int:
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
        self._points, self._before, known = self._before, self._points, self._count
        if self._traffic is not None:
            chart = chart.beside(self._traffic.expected(briefing.seat))
        points, near = self._points, chart_around(chart, now.x, now.y, far + BEYOND)
        seen = unexpected_points(near, eye, cockpit.observation, start, rays, far, points)
        elapsed_s = briefing.decision_s
        self._count = keep_in_mind(eye, self._before, known, elapsed_s, points, seen)
        return seen


def motion_of(observation: Observation, vehicle: Vehicle) -> Motion:
    """Return the motion of the centre of gravity that a vehicle observes."""
    middle = np.array(
        [observation.scalar(name) for name in ("position_x", "position_y", "heading")]
    )
    pose = convert(middle, vehicle, Point.MIDDLE, Point.GRAVITY).tolist()
    names = ("speed", "lateral_speed", "yaw_rate", "steering")
    return Motion(*pose, *(observation.scalar(name) for name in names))
