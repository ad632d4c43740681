"""A driver that knows everything: takes a body round a course at a share of its grip."""

import math
from dataclasses import dataclass

import numpy as np

from race_agents.plant.body import Body
from race_agents.plant.radar import Floats
from race_agents.unit.safety import Command
from race_server.core.vehicles import GRAVITY, Vehicle

# The point that is steered to lies this far ahead: [m], and seconds of way.
AHEAD_M, AHEAD_S = 1.5, 0.25
# Share of the grip for bends that is used to brake before them, and share of the top speed.
BRAKES, FASTEST = 0.7, 0.97
THROTTLE, BRAKE = 0.8, 0.35  # shares per m/s of speed that is wrong


@dataclass
class Chauffeur:
    """Follows a line with known speeds."""

    line: Floats  # (N, 4) x, y [m], heading [rad], curvature [1/m]; closed, equal steps
    speeds: Floats  # (N,) [m/s]
    spacing: float  # [m]
    scale: float = 1.0  # of the speeds

    @classmethod
    def of(cls, line: Floats, vehicle: Vehicle, grip_share: float) -> "Chauffeur":
        """Return a driver of this line that uses a share of the grip on it."""
        hold = grip_share * vehicle.grip * GRAVITY
        spacing = float(np.hypot(*(line[1] - line[0])[:2]))
        bends = np.maximum(np.abs(line[:, 3]), 1e-6)
        speeds = np.minimum(np.sqrt(hold / bends), FASTEST * vehicle.top_speed)
        slows = 2.0 * BRAKES * hold * spacing
        for _ in range(2):  # twice round: the line is closed
            for number in range(len(speeds) - 1, -1, -1):
                after = speeds[(number + 1) % len(speeds)]
                speeds[number] = min(speeds[number], math.sqrt(after**2 + slows))
        return cls(line, speeds, spacing)

    def act(self, body: Body) -> Command:
        """Return what this driver does now."""
        off = np.hypot(self.line[:, 0] - body.x, self.line[:, 1] - body.y)
        nearest = int(np.argmin(off))
        ahead = AHEAD_M + AHEAD_S * abs(body.speed)
        point = self.line[(nearest + round(ahead / self.spacing)) % len(self.line)]
        dx, dy = point[0] - body.x, point[1] - body.y
        aside = dy * math.cos(body.heading) - dx * math.sin(body.heading)
        curvature = 2.0 * aside / max(dx * dx + dy * dy, 1e-6)
        vehicle = body.vehicle
        angle = math.atan(vehicle.wheelbase * curvature) / vehicle.steering_limit
        soon = (nearest + round(0.2 * abs(body.speed) / self.spacing)) % len(self.line)
        missing = self.scale * float(self.speeds[soon]) - body.speed
        steering = max(-1.0, min(angle, 1.0))
        if missing >= 0.0:
            return Command(steering, min(THROTTLE * missing, 1.0), 0.0)
        return Command(steering, 0.0, min(-BRAKE * missing, 1.0))
