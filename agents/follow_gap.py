"""Follow the gap: drive towards the deepest free direction that the body fits through.

Needs a lidar and nothing else. After Sezer and Gokasan (2012) and the disparity extender of
Otterness (2019).
"""

import math

import numpy as np

from agents.scan import Floats, ray_angles, repair, widen_edges
from agents.tactics import Tactics, throttle_for
from race_server.driver import Briefing
from race_server.messages import Control
from race_server.observe import Observation
from race_server.params import GRAVITY

# Directions further off than this [rad] are behind the shoulder.
SHOULDER = math.radians(80.0)


class FollowGap:
    """Steers to the deepest gap; as fast as it can stop or turn in the free space ahead."""

    preset = "lidar"

    def reset(self, briefing: Briefing) -> None:
        """Take note of the vehicle."""
        self.vehicle = briefing.vehicle
        self.tactics = Tactics(briefing)
        self.field = briefing.lidar_field
        self.angle = 0.0

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        ranges = repair(observation["lidar"], reach=8.0)
        angles = ray_angles(len(ranges), self.field)
        step = float(angles[1] - angles[0])
        half = 0.5 * self.vehicle.width + 0.25 * self.vehicle.width
        free = widen_edges(ranges, step, half, jump=0.5 * self.vehicle.length)
        angle, depth = self._deepest(free, angles)
        steering = self._steering(ranges, angles, angle)
        speed = observation.scalar("speed")
        target = self._speed(free, angles, depth, steering)
        throttle, brake = throttle_for(speed, target, 2.0)
        wanted = Control(steering / self.vehicle.steering_limit, throttle, brake)
        return self.tactics.apply(observation, wanted)

    def _deepest(self, free: Floats, angles: Floats) -> tuple[float, float]:
        """Return direction [rad] and depth [m] of the gap: the middle of all that is deep."""
        ahead = np.abs(angles) <= SHOULDER
        depth = float(free[ahead].max())
        deep = np.flatnonzero(ahead & (free >= 0.85 * depth))
        # Of several deep stretches the widest, and of equal ones the straightest.
        stretches = np.split(deep, np.flatnonzero(np.diff(deep) > 1) + 1)
        best = max(stretches, key=lambda s: len(s) - 0.2 * abs(float(angles[s].mean())))
        return float(angles[best].mean()), depth

    def _steering(self, ranges: Floats, angles: Floats, angle: float) -> float:
        """Return the steering angle [rad]: to the gap, but never into what is right beside."""
        limit = self.vehicle.steering_limit
        steering = angle
        beside = 0.9 * self.vehicle.width
        sides = np.abs(angles) > math.radians(60.0)
        left = float(ranges[sides & (angles > 0.0)].min(initial=8.0))
        right = float(ranges[sides & (angles < 0.0)].min(initial=8.0))
        if left < beside:
            steering = min(steering, 0.0) - 0.5 * limit * (1.0 - left / beside)
        if right < beside:
            steering = max(steering, 0.0) + 0.5 * limit * (1.0 - right / beside)
        return float(np.clip(steering, -limit, limit))

    def _speed(self, free: Floats, angles: Floats, depth: float, steering: float) -> float:
        """Return the speed [m/s] that the free space ahead and the bend allow."""
        narrow = np.abs(angles) < math.radians(12.0)
        front = float(free[narrow].min())
        grip = self.vehicle.grip * GRAVITY
        stop = math.sqrt(2.0 * 0.5 * grip * max(front - 0.6 * self.vehicle.length, 0.0))
        bend = math.tan(abs(steering)) / self.vehicle.wheelbase
        turn = math.sqrt(0.6 * grip / max(bend, 1e-3))
        return min(stop + 0.4, turn + 0.3 * depth, self.vehicle.top_speed)
