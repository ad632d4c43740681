"""How a driver's client drives whose network is slow: so that what it has not seen yet cannot hurt.

Between what a driver saw last and the moment in which its next control acts, its kart drives
blind. Where that takes long the client lets the kart go no further in this time than `REACH` of its
own lengths, whatever the driver asks for. On a good network it takes a few hundredths of a second
and nothing is touched.
"""

from dataclasses import dataclass, replace

from race_server.core.messages import Control
from race_server.core.vehicles import GRAVITY, Vehicle

# So far may a kart drive blind [lengths].
REACH = 2.0
# A view that was never older than this needs no caution [s].
FRESH_S = 0.2
# What is not seen for longer is not driven blind: the server lets the kart coast and brake [s].
LATEST_S = 1.0
# Ages are averaged over about so long [s].
MEMORY_S = 3.0


@dataclass
class LatencyLimiter:
    """Holds a kart's speed to what the age of its driver's view allows."""

    vehicle: Vehicle
    late_s: float = 0.0  # age of what the driver sees, on average of late

    def note(self, age_s: float, elapsed_s: float) -> None:
        """Take note of how old a view was when the next one came, `elapsed_s` after it."""
        mean = min(age_s - 0.5 * elapsed_s, LATEST_S)
        self.late_s += min(elapsed_s / MEMORY_S, 1.0) * (mean - self.late_s)

    @property
    def is_needed(self) -> bool:
        """Whether the network is so slow that anything is to be done about it."""
        return self.late_s > FRESH_S

    def speed_limit(self) -> float:
        """Return the speed [m/s] at which the kart may drive, infinite where it sees well."""
        return REACH * self.vehicle.length / self.late_s if self.is_needed else float("inf")

    def temper(self, control: Control, speed: float) -> Control:
        """Return the control as it may be at a speed [m/s]; forwards or backwards, but slowly."""
        limit, vehicle = self.speed_limit(), self.vehicle
        if limit >= vehicle.top_speed:
            return control
        left = limit - abs(speed)
        # What is done now shows so much later; whoever mends it sooner overshoots.
        pace = left / self.late_s  # [m/s²]
        push = vehicle.motor_force / vehicle.mass
        most = min(max((pace + vehicle.rolling * GRAVITY) / push, 0.0), 1.0)
        brake = min(max(-pace * vehicle.mass / vehicle.brake_force, control.brake), 1.0)
        return replace(control, throttle=min(max(control.throttle, -most), most), brake=brake)
