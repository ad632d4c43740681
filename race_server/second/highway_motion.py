"""highway-env's motion for the bodies of our worlds.

A body is handed over with its pose and speed, moved there by highway-env's own vehicle on its own
roads, and taken back, step by step. What contacts, rescues and resets do to it here is so known
there.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.motion import Allowance, Command, longitudinal_forces
from race_server.core.rules.effects import surface_roll
from race_server.core.stages.controls import take_controls
from race_server.core.state import Floats, Record, Records, World
from race_server.core.step import advance_world
from race_server.errors import ScenarioError
from race_server.scenario.highway import make_highway
from race_server.scenario.race import Scenario
from race_server.second.highway_network import network_for
from race_server.second.highway_options import NAME, HighwayOptions
from race_server.second.similarity import Similarity

STEP_S = 1.0 / 15.0  # of its physics
ACCELERATION = 5.0  # [m/s²] most of its `ContinuousAction`, both ways
STEERING = math.radians(45.0)  # the same of its wheels
AT_ONCE = 1e3  # [rad/s] at which wheels turn from lock to lock within a substep


class HighwayMotion:
    """Moves worlds on with highway-env's vehicles."""

    def __init__(self, scenarios: Sequence[Scenario], options: HighwayOptions) -> None:
        """Get ready. scenarios: in the order of their courses.

        Raises:
            ScenarioError: highway-env is not installed, or a vehicle draws a trailer.
        """
        self.options = options
        vehicles = [vehicle for scenario in scenarios for vehicle in scenario.vehicles]
        for vehicle in vehicles:
            if vehicle.trailers:
                raise ScenarioError(
                    f"vehicle {vehicle.name} draws a trailer: {NAME} has none; choose another"
                )
        self.similar = Similarity.of(vehicles)
        make_highway("racetrack-v0")
        lengths = self.similar.length
        self._networks = [network_for(scenario.course, lengths) for scenario in scenarios]
        self.step_ticks = 1 if options.steps == "ours" else ticks_in(STEP_S, self.similar)
        self._movers: dict[tuple[int, int], Any] = {}

    def __call__(self, world: World, controls: Floats, ticks: int) -> None:
        """Move every world on by `ticks` ticks under the same controls, (W, K, 4)."""
        for w in range(len(world.bodies)):
            take_controls(world.bodies[w], controls[w])
            if self.options.tyres == "ours":
                if self.options.actuators == "theirs":
                    _act_at_once(world.vehicles[w])
                advance_world(world, w, controls[w], ticks)
                continue
            left = ticks
            while left > 0:
                chunk = min(self.step_ticks, left)
                moves = [self._move(world, w, k, chunk) for k in range(world.bodies.shape[1])]
                for _ in range(chunk):
                    for k, move in enumerate(moves):
                        shift(world.bodies[w, k], move / chunk)
                    advance_world(world, w, controls[w], 1)
                left -= chunk

    def _move(self, world: World, w: int, k: int, ticks: int) -> Floats:
        """Move a body there, and return what changes: x, y, heading; (3,). Speeds are set."""
        body, vehicle = world.bodies[w, k], world.vehicles[w, k]
        if body.status == codes.ABSENT:
            return np.zeros(3)
        body.trust = codes.ELSEWHERE
        network = self._networks[world.rules[w].course]
        mover = self._mover(network, float(vehicle.front_axle + vehicle.rear_axle))
        dt = ticks * TICK_S
        angle, gain = self._actuate(body, vehicle, dt)
        # Its point is the middle between the axles, which moves at this angle to the body.
        ahead = 0.5 * float(vehicle.rear_axle - vehicle.front_axle)
        slip = math.atan(0.5 * math.tan(angle))
        heading, similar = float(body.heading), self.similar
        before = np.array([math.cos(heading), math.sin(heading)])
        mover.position = similar.length * (np.array([body.x, body.y]) - ahead * before)
        mover.heading, mover.speed = heading, similar.pace * float(body.speed) / math.cos(slip)
        mover.crashed = False
        mover.action = {"steering": angle, "acceleration": gain}
        mover.step(dt * similar.time)
        x, y, turned = take_from(body, vehicle, mover, similar)
        body.steering = angle
        return np.array([x - body.x, y - body.y, turned - heading])

    def _actuate(self, body: Record, vehicle: Record, dt: float) -> tuple[float, float]:
        """Return steering angle [rad] and acceleration [m/s²] during the next `dt` [s]."""
        throttle, brake = body.throttle, body.brake
        cap = float(body.speed_cap)
        if body.status != codes.RACING and not (body.status == codes.FINISHED and cap > 0.0):
            throttle, brake = 0.0, 1.0
        target, speed = float(body.steering_command * vehicle.steering_limit), float(body.speed)
        if self.options.actuators == "ours":
            turn = float(vehicle.steering_rate) * dt
            angle = float(body.steering) + min(max(target - float(body.steering), -turn), turn)
            roll = surface_roll(body.surface)
            allowed = Allowance(cap, body.thrust_scale, body.grip_scale, roll)
            command = Command(body.steering_command, throttle, brake)
            axles = longitudinal_forces(vehicle, body.speed, command, allowed, 1.0 / dt)
            air = float(vehicle.drag) * speed * abs(speed)
            return angle, (axles.front + axles.rear - air) / float(vehicle.mass)
        body.throttle, body.brake = throttle, brake
        return min(max(target, -STEERING), STEERING), pedal_gain(body, vehicle, dt)

    def _mover(self, network: Any, wheelbase: float) -> Any:
        """Return the vehicle of a network that moves as one of this wheelbase [m]."""
        key = id(network), round(1e6 * wheelbase)
        if key not in self._movers:
            from highway_env.road.road import Road
            from highway_env.vehicle.kinematics import Vehicle

            kind = type("Mover", (Vehicle,), {"LENGTH": self.similar.length * wheelbase})
            self._movers[key] = kind(Road(network), [0.0, 0.0])
        return self._movers[key]


def ticks_in(seconds: float, similar: Similarity) -> int:
    """Return how many ticks here are about as long as some seconds there: one or more."""
    return max(round(seconds / similar.time / TICK_S), 1)


def take_from(body: Record, vehicle: Record, mover: Any, similar: Similarity) -> Floats:
    """Set a body's speeds to those of a vehicle there; return its x, y [m] and heading, (3,)."""
    # Its point is the middle between the axles, which moves at this angle to the body.
    ahead = 0.5 * float(vehicle.rear_axle - vehicle.front_axle)
    slip = math.atan(0.5 * math.tan(float(mover.action["steering"])))
    towards = np.array([math.cos(mover.heading), math.sin(mover.heading)])
    x, y = mover.position / similar.length + ahead * towards
    speed = mover.speed / similar.pace
    body.yaw_rate = 2.0 * mover.speed * math.sin(slip) / mover.LENGTH * similar.time
    body.speed = speed * math.cos(slip)
    body.lateral_speed = speed * math.sin(slip) + ahead * body.yaw_rate
    return np.array([x, y, mover.heading])


def pedal_gain(body: Record, vehicle: Record, dt: float) -> float:
    """Return the acceleration [m/s²] that a body's pedals ask for during the next `dt` [s]."""
    cap, speed = float(body.speed_cap), float(body.speed)
    push = float(body.throttle * vehicle.motor_force * body.thrust_scale / vehicle.mass)
    hold = float(body.brake * vehicle.brake_force / vehicle.mass)
    wanted = speed + dt * push
    wanted = min(wanted, max(cap, speed - ACCELERATION * dt)) if push >= 0.0 else wanted
    wanted = max(wanted, -min(float(vehicle.reverse_speed), cap)) if push < 0.0 else wanted
    # Brakes do no more than stop it.
    wanted = math.copysign(max(abs(wanted) - dt * hold, 0.0), wanted)
    return min(max((wanted - speed) / dt, -ACCELERATION), ACCELERATION)


def _act_at_once(vehicles: Records) -> None:
    """Let vehicles of ours do at once what is asked for, up to what its action can. vehicles: (K,).

    A reset brings their own figures back.
    """
    vehicles["steering_rate"] = AT_ONCE
    vehicles["steering_limit"] = np.minimum(vehicles["steering_limit"], STEERING)
    vehicles["drag"] = 0.0
    for name in ("motor_force", "brake_force"):
        vehicles[name] = np.minimum(vehicles[name], ACCELERATION * vehicles["mass"])


def shift(body: Record, move: Floats) -> None:
    """Move a body by x, y [m] and heading [rad]."""
    body.x += move[0]
    body.y += move[1]
    body.heading = wrap_angle(body.heading + move[2])
