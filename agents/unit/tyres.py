"""How far the rear axle runs aside under load.

The force on the rear tyres is that of the rear axle's acceleration across, since the axle lies near
the centre of percussion of the front one. Tyres yield in proportion to it at first, and more near
their limit (a force that saturates as a hyperbolic tangent; Pacejka, Tyre and Vehicle Dynamics,
gives the shape).
"""

import math
from dataclasses import dataclass

from race_agents.unit.ekf import KartFilter
from race_agents.unit.motion import COMPLIANCE, SPEED, YAW_RATE
from race_server.core.vehicles import GRAVITY, Vehicle

# A load nearer to the limit than this tells nothing of the slip any more.
MOST_LOAD = 0.9
# Deviation [m/s²] of the acceleration of the rear axle: accelerometer, and the gyro's change.
FELT, GUESSED = 0.45, 1.5
# Slip angles [rad] that are not explained, at no load and at the limit, which last for some tenths
# of a second and so count more than noise of this size; and a slide at a crawl [m/s].
SLIP, LOADED_SLIP, CRAWL = 0.003, 0.035, 0.02


@dataclass(frozen=True)
class Tyres:
    """The rear tyres, as far as they can be known."""

    hold: float  # [m/s²] across at their limit

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Tyres":
        """Return the tyres of a vehicle."""
        return cls(vehicle.grip * GRAVITY)

    def see(self, filtered: KartFilter, across: float | None) -> None:
        """Tell a filter what slide to expect.

        across: acceleration of the rear axle to the left [m/s²], None where none is felt.
        """
        state = filtered.state
        speed, noise = float(state[SPEED]), FELT
        turning = speed * float(state[YAW_RATE])
        if across is None:
            across, noise = turning, GUESSED
        share = min(abs(across) / self.hold, MOST_LOAD)
        yields = float(state[COMPLIANCE]) * noise / (1.0 - share * share)
        unexplained = SLIP + LOADED_SLIP * share * share
        deviation = math.hypot(CRAWL, abs(speed) * math.hypot(yields, unexplained))
        filtered.see_grip(self._load(across), self._load(turning), deviation)

    def _load(self, across: float) -> float:
        """Return an acceleration across, times by how much more the tyres yield to it."""
        share = min(abs(across) / self.hold, MOST_LOAD)
        return across * math.atanh(share) / share if share > 1e-3 else across
