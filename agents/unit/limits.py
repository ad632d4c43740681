"""What the reflex of a vehicle may count on, and where it draws the line."""

import math
from dataclasses import dataclass

from race_server.core.vehicles import GRAVITY, Vehicle

# Shares of what its figures promise that a kart does for certain, and as a rule.
CERTAIN, RACED = 0.7, 0.85


@dataclass(frozen=True)
class Limits:
    """What the reflex may count on, and where it draws the line."""

    braking: float  # [m/s²] that the kart reaches for certain
    promised: float  # [m/s²] that it reaches as a rule
    reaction_s: float  # until the brakes bite, with some to spare
    half_width: float  # [m] of the corridor that the body needs, with some to spare
    spare: float  # [m] of it that is no body
    berth: float  # [m] beside it that people get: an echo is one point of a wider person
    near: float  # [m] within which a person that comes into view has come from behind something
    nose: float  # [m] from the rear axle to the front bumper
    stand_off: float  # [m] that must be left
    restart: float  # [m] that must be free before a kart that braked for something drives on
    top_speed: float  # [m/s] never more, boost or not
    reverse_speed: float  # [m/s]
    sharpest: float  # [1/m] curvature at full lock
    grip: float  # [m/s²] across that the tyres hold for certain
    slow_speed: float  # [m/s] where something is wrong
    fence: float  # [m] beyond the kerb that are no danger yet
    coast_s: float = 0.3  # the driver's input is older: no motor
    let_go_s: float = 0.8  # … and older than this: stop
    game_coast_s: float = 0.1  # the program beside is silent: no motor
    game_stop_s: float = 0.15  # … and longer than this: stop
    most_valid_s: float = 2.0  # no word of the server holds longer, whatever it says

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Limits":
        """Return the limits for a vehicle: 70 % of the braking that its figures promise.

        People and things count on that. Borders and other karts are raced close to: there the
        reflex waits until 85 % are needed.
        """
        promised = min(vehicle.brake_force / vehicle.mass, vehicle.grip * GRAVITY)
        return cls(
            braking=CERTAIN * promised,
            promised=RACED * promised,
            reaction_s=0.2,
            half_width=0.55 * vehicle.width,
            spare=0.05 * vehicle.width,
            berth=0.35 * vehicle.width,
            near=15.0 * vehicle.length,
            nose=vehicle.rear_axle + vehicle.box_offset + 0.5 * vehicle.length,
            stand_off=0.25 * vehicle.length,
            restart=1.5 * vehicle.length,
            top_speed=1.25 * vehicle.top_speed,
            reverse_speed=vehicle.reverse_speed,
            sharpest=math.tan(vehicle.steering_limit) / vehicle.wheelbase,
            grip=CERTAIN * vehicle.grip * GRAVITY,
            slow_speed=0.15 * vehicle.top_speed,
            fence=0.5 * vehicle.length,
        )
