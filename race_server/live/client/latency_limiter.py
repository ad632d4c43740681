"""The limit that a driver's client sets to the speed of its kart on a slow network.

Between the newest observation and the moment in which the answer to it acts, a kart drives blind.
Where that takes long the client limits the speed, so that the kart covers at most `REACH` lengths
in this time, whatever the driver asks for. On a good network it takes a few hundredths of a second
and no control is changed.
"""

from dataclasses import dataclass, replace

from race_server.core.messages import Control
from race_server.core.vehicles import GRAVITY, Vehicle

# How far a kart may drive blind [lengths].
REACH = 2.0
# Observations that are no older than this [s] on average need no limit.
FRESH_S = 0.2
# A kart is not driven blind for longer [s]: the server lets it coast and brake.
MAX_BLIND_S = 1.0
# Ages are averaged over about this time [s].
MEMORY_S = 3.0


@dataclass
class LatencyLimiter:
    """Holds a kart's speed to what the age of its driver's observations allows."""

    vehicle: Vehicle
    late_s: float = 0.0  # age [s] of what the driver sees, averaged over the last seconds

    def record(self, age_s: float, elapsed_s: float) -> None:
        """Record how old an observation was when the next one came, `elapsed_s` after it."""
        mean = min(age_s - 0.5 * elapsed_s, MAX_BLIND_S)
        self.late_s += min(elapsed_s / MEMORY_S, 1.0) * (mean - self.late_s)

    @property
    def is_needed(self) -> bool:
        """Whether the network is slow enough to need a limit."""
        return self.late_s > FRESH_S

    def speed_limit(self) -> float:
        """Return the speed limit [m/s], infinite on a good network."""
        return REACH * self.vehicle.length / self.late_s if self.is_needed else float("inf")

    def limit(self, control: Control, speed: float) -> Control:
        """Return the control as it may be at a speed [m/s]; the kart may go either way, slowly."""
        limit, vehicle = self.speed_limit(), self.vehicle
        if limit >= vehicle.top_speed:
            return control
        left = limit - abs(speed)
        # The effect shows only `late_s` later; a quicker correction would overshoot.
        pace = left / self.late_s  # [m/s²]
        push = vehicle.motor_force / vehicle.mass
        most = min(max((pace + vehicle.rolling * GRAVITY) / push, 0.0), 1.0)
        brake = min(max(-pace * vehicle.mass / vehicle.brake_force, control.brake), 1.0)
        return replace(control, throttle=min(max(control.throttle, -most), most), brake=brake)
