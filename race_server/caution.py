"""How a driver's client drives whose network is slow: so that what it has not seen yet cannot hurt.

Between what a driver saw last and the moment in which its next control acts, its kart drives
blind. Where that takes long the client lets the kart go no further in this time than `REACH` of its
own lengths, whatever the driver asks for. On a good network it takes a few hundredths of a second
and nothing is touched.
"""

from dataclasses import dataclass, replace

from race_server.messages import Control
from race_server.params import GRAVITY, Vehicle

# So far may a kart drive blind [lengths].
REACH = 1.0
# A view that was never older than this needs no caution [s].
FRESH_S = 0.2
# A bad moment is remembered for so long [s]: it comes again.
MEMORY_S = 3.0
# Of a speed that is too high or too low half is to be mended within the delay: what is done now
# shows so much later, and whoever mends more in one go overshoots.
SHARE = 0.5


@dataclass
class Caution:
    """Holds a kart's speed to what the age of its driver's view allows."""

    vehicle: Vehicle
    late_s: float = 0.0  # age that a view reaches before the next one comes, of late

    def note(self, age_s: float, elapsed_s: float) -> None:
        """Take note of how old a view was when the next one came, `elapsed_s` after it."""
        kept = max(1.0 - elapsed_s / MEMORY_S, 0.0)
        self.late_s = max(age_s, age_s + kept * (self.late_s - age_s))

    def speed_limit(self) -> float:
        """Return the speed [m/s] at which the kart may drive, infinite where it sees well."""
        if self.late_s <= FRESH_S:
            return float("inf")
        return REACH * self.vehicle.length / self.late_s

    def temper(self, control: Control, speed: float) -> Control:
        """Return the control as it may be at a speed [m/s]; forwards or backwards, but slowly."""
        limit, vehicle = self.speed_limit(), self.vehicle
        if limit >= vehicle.top_speed:
            return control
        left = limit - abs(speed)
        pace = SHARE * left / self.late_s  # [m/s²]
        push = vehicle.motor_force / vehicle.mass
        most = min(max((pace + vehicle.rolling * GRAVITY) / push, 0.0), 1.0)
        brake = min(max(-pace * vehicle.mass / vehicle.brake_force, control.brake), 1.0)
        return replace(control, throttle=min(max(control.throttle, -most), most), brake=brake)
