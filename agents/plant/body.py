"""The body of a kart that is not the simulation's: other figures, other tyres, slow actuators."""

import math
import random
from dataclasses import dataclass, replace

from race_server.core.vehicles import GRAVITY, Vehicle

STEP_S = 0.005
# A battery lasts this long [s] at all the motor's power.
LASTS_S = 1200.0
CREEP = 0.05  # [m/s] below this the wheels' own speed is no divisor


@dataclass(frozen=True)
class Lags:
    """How slowly actuators follow, as time constants [s]."""

    steering: float = 0.04
    motor: float = 0.1
    brake: float = 0.05


def as_built(vehicle: Vehicle, chance: random.Random) -> Vehicle:
    """Return the kart that was built from these figures: heavier, weaker, each one different."""

    def about(value: float, share: float, spread: float = 0.03) -> float:
        return value * share * chance.uniform(1.0 - spread, 1.0 + spread)

    return replace(
        vehicle,
        mass=about(vehicle.mass, 1.08),
        yaw_inertia=about(vehicle.yaw_inertia, 1.1),
        motor_force=about(vehicle.motor_force, 0.95),
        motor_power=about(vehicle.motor_power, 0.95),
        brake_force=about(vehicle.brake_force, 0.95),
        grip=about(vehicle.grip, 0.95),
        cornering=about(vehicle.cornering, 0.9),
        rolling=about(vehicle.rolling, 1.2),
        steering_rate=about(vehicle.steering_rate, 0.9),
    )


@dataclass
class Body:
    """Where a kart really is and how it moves. SI units; (x, y) is its centre of gravity."""

    vehicle: Vehicle
    x: float
    y: float
    heading: float
    speed: float = 0.0
    lateral_speed: float = 0.0
    yaw_rate: float = 0.0
    steering: float = 0.0
    motor: float = 0.0  # [-1, 1] what the motor gives
    brake: float = 1.0  # [0, 1] what the brakes give
    lags: Lags = Lags()
    owed: float = 0.0  # [s] that are still to be moved on, less than a step
    charge: float = 1.0  # [0, 1] of the battery

    def advance(self, seconds: float, steering: float, throttle: float, brake: float) -> None:
        """Move on under a command; shares as in a control."""
        self.owed += seconds
        while self.owed >= STEP_S:
            self.owed -= STEP_S
            self._step(steering, throttle, brake)

    def _step(self, steering: float, throttle: float, brake: float) -> None:
        vehicle, dt = self.vehicle, STEP_S
        turn = (steering * vehicle.steering_limit - self.steering) / self.lags.steering
        self.steering += max(-vehicle.steering_rate, min(turn, vehicle.steering_rate)) * dt
        self.motor += (throttle - self.motor) * dt / self.lags.motor
        self.brake += (brake - self.brake) * dt / self.lags.brake
        along = self._force_along()
        rolls_s, slips_s = self._rolling(along), self._slipping(along)
        low, high = vehicle.kinematic_below, vehicle.dynamic_above
        share = min(max((abs(self.speed) - low) / (high - low), 0.0), 1.0)
        self.speed, self.lateral_speed, self.yaw_rate = (
            (1.0 - share) * rolls + share * slips
            for rolls, slips in zip(rolls_s, slips_s, strict=True)
        )
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        self.x += (self.speed * cos - self.lateral_speed * sin) * dt
        self.y += (self.speed * sin + self.lateral_speed * cos) * dt
        self.heading = math.remainder(self.heading + self.yaw_rate * dt, 2.0 * math.pi)

    def _force_along(self) -> float:
        """Return motor, brakes, rolling and drag within the grip [N]."""
        vehicle, speed = self.vehicle, self.speed
        ahead = self.motor * speed >= 0.0
        drive = self.motor * vehicle.motor_force
        if abs(drive * speed) > vehicle.motor_power and ahead:
            drive = math.copysign(vehicle.motor_power / abs(speed), drive)
        most = vehicle.top_speed if self.motor > 0.0 else vehicle.reverse_speed
        if ahead and abs(speed) > most:
            drive = 0.0
        hold = self.brake * vehicle.brake_force + vehicle.rolling * vehicle.mass * GRAVITY
        hold = min(hold, vehicle.mass * abs(speed) / STEP_S)
        drag = vehicle.drag * speed * abs(speed)
        used = max(drive * speed, 0.0) / vehicle.motor_power
        self.charge = max(self.charge - used * STEP_S / LASTS_S, 0.0)
        limit = vehicle.grip * vehicle.mass * GRAVITY
        return max(-limit, min(drive - math.copysign(hold, speed) - drag, limit))

    def _rolling(self, along: float) -> tuple[float, float, float]:
        """Return speed, lateral speed and yaw rate after a step without slip."""
        vehicle = self.vehicle
        speed = self.speed + along / vehicle.mass * STEP_S
        if self.motor == 0.0 and speed * self.speed < 0.0:
            speed = 0.0
        rate = speed * math.tan(self.steering) / vehicle.wheelbase
        return speed, vehicle.rear_axle * rate, rate

    def _slipping(self, along: float) -> tuple[float, float, float]:
        """Return the same after a step on tyres whose force saturates as a hyperbolic tangent."""
        vehicle, u, v, r = self.vehicle, self.speed, self.lateral_speed, self.yaw_rate
        a, b, pace = vehicle.front_axle, vehicle.rear_axle, max(abs(self.speed), CREEP)
        front_slip = math.atan2(v + a * r, pace) - (self.steering if u >= 0.0 else -self.steering)
        rear_slip = math.atan2(v - b * r, pace)
        used = along / (vehicle.grip * vehicle.mass * GRAVITY)
        left = vehicle.grip * math.sqrt(max(1.0 - used * used, 0.05))
        weight = vehicle.mass * GRAVITY / vehicle.wheelbase
        front = -left * b * weight * math.tanh(vehicle.cornering * front_slip / left)
        rear = -left * a * weight * math.tanh(vehicle.cornering * rear_slip / left)
        cos, sin = math.cos(self.steering), math.sin(self.steering)
        return (
            u + ((along - front * sin) / vehicle.mass + v * r) * STEP_S,
            v + ((front * cos + rear) / vehicle.mass - u * r) * STEP_S,
            r + (a * front * cos - b * rear) / vehicle.yaw_inertia * STEP_S,
        )
