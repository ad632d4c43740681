"""A sparring partner: keeps away from what is near, at a steady pace.

It does what the obstacle-avoiding cars of the 1/10 race's training track do: steer to the side
where there is more room.
"""

import math

import numpy as np

from agents.scan import Floats, ray_angles, repair
from agents.tactics import Tactics, throttle_for
from race_server.driver import Briefing
from race_server.messages import Control
from race_server.observe import Observation

PACE_SHARE = 0.2  # of the top speed


class Avoider:
    """Steers by the balance of free space on the left and on the right."""

    preset = "lidar"

    def reset(self, briefing: Briefing) -> None:
        """Take note of the vehicle."""
        self.vehicle = briefing.vehicle
        self.tactics = Tactics(briefing)
        self.field = briefing.lidar_field

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""
        ranges = repair(observation["lidar"], reach=8.0)
        angles = ray_angles(len(ranges), self.field)
        left = self._room(ranges, angles, 1.0)
        right = self._room(ranges, angles, -1.0)
        steering = float(np.clip(2.5 * (left - right) / (left + right), -1.0, 1.0))
        ahead = float(ranges[np.abs(angles) < math.radians(15.0)].min())
        length = self.vehicle.length
        pace = PACE_SHARE * self.vehicle.top_speed * min(max(ahead / (3.0 * length), 0.35), 1.0)
        throttle, brake = throttle_for(observation.scalar("speed"), pace, 2.0)
        return self.tactics.apply(observation, Control(steering, throttle, brake))

    def _room(self, ranges: Floats, angles: Floats, side: float) -> float:
        """Return the mean range [m] between 15° and 75° on one side; far away counts less."""
        towards = side * angles
        part = (towards > math.radians(15.0)) & (towards < math.radians(75.0))
        return float(np.minimum(ranges[part], 6.0 * self.vehicle.length).mean()) + 1e-3
