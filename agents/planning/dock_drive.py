"""Drives into docks along its own plans, while what it measures and what it moves are not exact.

The vehicle moves as in the world: `move` and `lead_trailers`. The driver is that of `valet`; it
knows the map, and its vehicle as the data sheet has it.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from race_agents.planning.chauffeur import Chauffeur
from race_agents.planning.dock_tasks import DockTask
from race_agents.planning.latency import estimate_latency, remember_command
from race_agents.planning.towed_path import behind
from race_agents.planning.way import axle_of
from race_server.core.clock import SUBSTEP_S
from race_server.core.driver import Briefing
from race_server.core.free_space.obstacles import Obstacles, touches
from race_server.core.free_space.rig import only_trailer
from race_server.core.kernel_driver import Cockpit, cockpit_for
from race_server.core.kernels.boxes import Box, Hull, box_of
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import Pose, clip
from race_server.core.kernels.jit import INTERPRET, large_kernel
from race_server.core.kernels.motion import Allowance, Command, Motion, move
from race_server.core.kernels.trailers import hitch_angle, lead_trailers
from race_server.core.level import Level
from race_server.core.observation import PART_NUMBERS, layout_of
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.core.state import BODY, Floats, Record
from race_server.core.vehicles import Vehicle, vehicle_record

# Docked: the trailer's axle within this of its place [m], and its heading [rad].
WITHIN, TURN = 0.15, 0.1
# Substeps of the world in a decision, and the longest drive [s].
DECISION, LIMIT_S = 12, 180.0
PRESET = "lot_lidar"


@dataclass(frozen=True)
class Trouble:
    """What is not as the driver takes it to be."""

    name: str
    noise: float = 0.0  # [m] of measured places, standard deviation along x and y
    delay_s: float = 0.0  # from a measurement to the command that follows from it
    hitch: float = 1.0  # true distance from axle to hitch, as a multiple of that of the data sheet
    play: float = 0.0  # [rad] in the steering: so far the wheels lag behind on the way back


NOISY = Trouble("noise 0.05 m, delay 0.1 s", noise=0.05, delay_s=0.1)
TROUBLES = (
    Trouble("none"),
    NOISY,
    replace(NOISY, name="and hitch offset +10 %", hitch=1.1),
    replace(NOISY, name="and hitch offset -10 %", hitch=0.9),
    replace(NOISY, name="and delay 0.2 s", delay_s=0.2),
    replace(NOISY, name="and steering play 2°", play=math.radians(2.0)),
)


@dataclass(frozen=True)
class Drive:
    """How a drive ended."""

    ending: str  # docked, jack-knife, contact, late, off: stands elsewhere and plans no more
    time_s: float
    plans: int
    along: float  # [m] of the trailer's axle from its place
    across: float  # [m]
    turn: float  # [rad]
    angle: float  # [rad] at the hitch
    trace: Floats  # (D, 4) rear axle x, y [m], heading, angle at the hitch [rad] at each decision


def dock_order(task: DockTask, vehicle: Vehicle) -> ParkingOrder:
    """Return the order to stand in the bay of a task."""
    goal, length = task.goal(vehicle), vehicle.overall_length
    y = goal.y - only_trailer(vehicle).behind + 0.5 * length
    boxes = task.boxes()
    blocks = np.column_stack([boxes[:, :2], np.arctan2(boxes[:, 3], boxes[:, 2]), boxes[:, 4:]])
    slot = Slot(goal.x, y, goal.heading, length, task.pitch)
    return ParkingOrder(slot, Level(within=WITHIN, turn=TURN, last=True), task.walls(), blocks)


@large_kernel
def roll_on(
    body: Record, vehicle: Record, wheels: float, play: float, command: Command, top_speed: float
) -> float:
    """Move a body by a substep; return the angle of the steering [rad], `wheels` before.

    body: BODY; vehicle: VEHICLE; play: between the steering and the wheels [rad].
    """
    turn, limit = vehicle.steering_rate * SUBSTEP_S, vehicle.steering_limit
    wheels += clip(command.steering * limit - wheels, -turn, turn)
    angle = clip(body.steering, wheels - 0.5 * play, wheels + 0.5 * play)
    angle = clip(angle, -limit, limit)
    speeds = (body.speed, body.lateral_speed, body.yaw_rate)
    motion = Motion(body.x, body.y, body.heading, speeds[0], speeds[1], speeds[2], angle)
    held = Command(angle / limit, command.throttle, command.brake)
    moved = move(vehicle, motion, held, Allowance(top_speed, 1.0, 1.0, 0.0), SUBSTEP_S)
    lead_trailers(body, vehicle, moved, SUBSTEP_S)
    body.x, body.y, body.heading = moved.x, moved.y, moved.heading
    body.speed, body.lateral_speed = moved.speed, moved.lateral_speed
    body.yaw_rate, body.steering = moved.yaw_rate, moved.steering
    return wheels


class Yard:
    """A vehicle in the yard of a dock, and its driver."""

    def __init__(
        self, vehicle: Vehicle, task: DockTask, start: tuple[Pose, float], trouble: Trouble
    ) -> None:
        """Put the vehicle at its start."""
        self._task, self._trouble = task, trouble
        trailer = only_trailer(vehicle)
        true = replace(trailer, hitch=trouble.hitch * trailer.hitch)
        self._vehicle, self._true = vehicle, replace(vehicle, trailers=(true,))
        self._record = vehicle_record(self._true)[0]
        self._body = body = np.zeros(1, BODY).view(np.recarray)[0]
        pose, angle = start
        ahead = vehicle.rear_axle
        body.heading = pose.heading
        body.x = pose.x + ahead * math.cos(pose.heading)
        body.y = pose.y + ahead * math.sin(pose.heading)
        body.trailers[0].heading = pose.heading - angle
        self._wheels = 0.0  # [rad] where the steering stands; the wheels lag behind it
        nowhere = Grid(0.0, 0.0, 1.0, 0, 0)
        self._obstacles = Obstacles(nowhere, np.zeros((0, 0)), task.walls(), task.boxes())
        decision_s = DECISION * SUBSTEP_S
        layout = layout_of(PRESET, lidar_rays=1)
        self._cockpit: Cockpit = cockpit_for(Briefing(0, vehicle, 0, PRESET, decision_s), layout)
        order = dock_order(task, vehicle)
        self._driver = Chauffeur(vehicle, order, pace=math.inf, decision_s=decision_s)
        self._late = [Command(0.0, 0.0, 1.0)] * round(trouble.delay_s / SUBSTEP_S)
        self._points = np.zeros((0, 3))

    def drive(self, random: np.random.Generator) -> Drive:
        """Drive until the vehicle stands in the bay, or the drive has failed."""
        trace = []
        for decision in range(round(LIMIT_S / (DECISION * SUBSTEP_S))):
            command = self._decide(random)
            for _ in range(DECISION):
                self._late.append(command)
                self._wheels = roll_on(
                    self._body,
                    self._record,
                    self._wheels,
                    self._trouble.play,
                    self._late.pop(0),
                    self._vehicle.top_speed,
                )
            axle, angle = axle_of(self._motion(), self._true), float(hitch_angle(self._body, 0))
            trace.append((*axle, angle))
            ending = self._failure(angle) or ("docked" if self._driver.has_arrived else "")
            if ending:
                return self._report(ending, decision, trace)
        return self._report("late", decision, trace)

    def _motion(self) -> Motion:
        body = self._body
        speeds = (body.speed, body.lateral_speed, body.yaw_rate, self._wheels)
        return Motion(*(float(value) for value in (body.x, body.y, body.heading, *speeds)))

    def _decide(self, random: np.random.Generator) -> Command:
        """Return what the driver asks for, from what it measures."""
        noise = random.normal(0.0, 1.0, 2) * self._trouble.noise
        true, cockpit = self._motion(), self._cockpit
        now = true._replace(x=true.x + noise[0], y=true.y + noise[1])
        seen, offsets = cockpit.observation, cockpit.offsets
        for name, value in (
            ("speed", now.speed),
            ("steering", now.steering),
            ("speed_cap", self._vehicle.top_speed),
            ("thrust_scale", 1.0),
            ("grip_scale", 1.0),
        ):
            seen[offsets[PART_NUMBERS[name]]] = value
        estimate_latency(cockpit)
        angle = float(hitch_angle(self._body, 0))
        command = self._driver.command(cockpit, now, angle, self._points, 0, 0)
        cockpit.control[:3] = list(command) if INTERPRET else command
        remember_command(cockpit.memory, cockpit.control)
        return command

    def _boxes(self) -> list[Box]:
        axle = axle_of(self._motion(), self._true)
        trailer, vehicle = self._true.trailers[0], self._true
        place = behind(np.array(axle), np.array(float(hitch_angle(self._body, 0))), trailer)
        ahead = vehicle.rear_axle + vehicle.box_offset
        x, y, heading = place.tolist()
        length, width = 0.5 * trailer.length, 0.5 * trailer.width
        hulls = (
            Hull(*axle, ahead, 0.5 * vehicle.length, 0.5 * vehicle.width, 0),
            Hull(x, y, heading, trailer.box_offset, length, width, 1),
        )
        return [box_of(hull) for hull in hulls]

    def _failure(self, angle: float) -> str:
        """Return what has failed, nothing if all is well."""
        if abs(angle) > self._true.trailers[0].limit:
            return "jack-knife"
        is_clear = not any(touches(self._obstacles, box) for box in self._boxes())
        return "" if is_clear else "contact"

    def _report(self, ending: str, decision: int, trace: list[Any]) -> Drive:
        """Return how the drive ended; docked only where the trailer stands as it is to stand."""
        goal, rows = self._task.goal(self._vehicle), np.array(trace)
        place = behind(rows[-1, :3], rows[-1, 3], self._true.trailers[0])
        dx, dy = place[0] - goal.x, place[1] - goal.y
        cos, sin = math.cos(goal.heading), math.sin(goal.heading)
        along, across = float(dx * cos + dy * sin), float(dy * cos - dx * sin)
        turn = math.remainder(float(place[2]) - goal.heading, 2.0 * math.pi)
        if ending == "docked" and (math.hypot(along, across) >= WITHIN or abs(turn) > TURN):
            ending = "off"
        time_s = (decision + 1) * DECISION * SUBSTEP_S
        plans = self._driver.plans
        return Drive(ending, time_s, plans, along, across, turn, float(rows[-1, 3]), rows)
