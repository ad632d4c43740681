"""Pure pursuit of the centre line, at the speed that the bends ahead allow.

Geometry: Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, 1992.
"""

import math

import numpy as np

from agents.tactics import Tactics, throttle_for
from race_server.driver import Briefing
from race_server.messages import Control
from race_server.observe import Observation
from race_server.params import GRAVITY

# Shares of the grip that this driver dares to use in bends and under braking.
BEND_SHARE = 0.75
BRAKE_SHARE = 0.6
LOOK_S = 0.35  # looks so far ahead in time


class PurePursuit:
    """Follows the centre line and drives around slower karts where there is room."""

    preset = "track"

    def reset(self, briefing: Briefing) -> None:
        """Take note of the vehicle."""
        self.vehicle = briefing.vehicle
        self.tactics = Tactics(briefing)
        self.shift = 0.0

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        speed = observation.scalar("speed")
        target, shift = self._target(observation, speed)
        throttle, brake = throttle_for(speed, self._speed_limit(observation, speed), 2.0)
        wanted = Control(self._steering(target, shift), throttle, brake)
        return self.tactics.apply(observation, wanted)

    def _target(self, observation: Observation, speed: float) -> tuple[tuple[float, float], float]:
        """Return the point to drive to in the kart frame and the sideways shift [m]."""
        step = observation.scalar("look_ahead")
        look = max(1.2 * self.vehicle.wheelbase + LOOK_S * speed, 1.5 * step)
        place = min(look / step - 1.0, 15.0)
        xs, ys = observation["path_ahead_x"], observation["path_ahead_y"]
        numbers = np.arange(len(xs))
        point = float(np.interp(place, numbers, xs)), float(np.interp(place, numbers, ys))
        index = round(place)
        room_left = float(observation["left_ahead"][index])
        room_right = float(observation["right_ahead"][index])
        wanted = self._way_around(observation, room_left, room_right)
        self.shift += 0.25 * (wanted - self.shift)
        return point, self.shift

    def _way_around(self, observation: Observation, left: float, right: float) -> float:
        """Return the sideways shift [m] that passes whatever blocks the way ahead."""
        width, length = self.vehicle.width, self.vehicle.length
        margin = 0.6 * width
        here = observation.scalar("lateral_offset")
        speed = observation.scalar("speed")
        things = [
            (x, y, vx)
            for x, y, vx in zip(
                observation["karts_x"],
                observation["karts_y"],
                observation["karts_speed_x"],
                strict=True,
            )
            if 0.0 < x < 2.5 * length + speed and abs(y) < 1.3 * width and vx < speed + 0.3
        ]
        things += [
            (x, y, 0.0)
            for x, y in zip(observation["hazards_x"], observation["hazards_y"], strict=True)
            if 0.0 < x < 2.0 * length + speed and abs(y) < width
        ]
        if not things:
            return 0.0
        _, y, _ = min(things)
        # Pass on the side that leaves more room between the other and the edge.
        other = here + y
        free_left, free_right = left - other, right + other
        side = 1.0 if free_left > free_right else -1.0
        shift = other + side * 1.4 * width
        return float(np.clip(shift, -(right - margin), left - margin))

    def _steering(self, point: tuple[float, float], shift: float) -> float:
        x, y = point
        distance = math.hypot(x, y)
        if distance > 0.0:  # the shift is across the way to the point
            x, y = x - shift * y / distance, y + shift * x / distance
        distance = max(math.hypot(x, y), 0.1)
        angle = math.atan2(2.0 * self.vehicle.wheelbase * y / distance, distance)
        return float(np.clip(angle / self.vehicle.steering_limit, -1.0, 1.0))

    def _speed_limit(self, observation: Observation, speed: float) -> float:
        """Return the speed [m/s] from which every bend ahead can still be taken."""
        grip = self.vehicle.grip * GRAVITY * observation.scalar("grip_scale")
        step = observation.scalar("look_ahead")
        bends = np.abs(observation["curvature_ahead"]).astype(np.float64)
        corner = np.sqrt(BEND_SHARE * grip / np.maximum(bends, 1e-6))
        distance = np.maximum(step * np.arange(1, len(bends) + 1) - 0.15 * speed - step, 0.0)
        braking = BRAKE_SHARE * min(grip, self.vehicle.brake_force / self.vehicle.mass)
        allowed = np.sqrt(corner**2 + 2.0 * braking * distance)
        # A bend tighter than the kart can turn is taken at walking pace.
        return float(min(allowed.min(), observation.scalar("speed_cap")))
