"""How to follow the kart ahead: the Intelligent Driver Model."""

import math

from race_agents.planning.tactics import SPEED
from race_agents.planning.tracking import OFFSET
from race_agents.planning.traffic import leader
from race_server.core.kernel_driver import Cockpit
from race_server.core.kernels.jit import kernel, large_kernel

# The model's figures, for a race instead of a road: time gap [s], gap when standing in lengths,
# shares of motor and brakes that are comfortable.
TIME_GAP_S = 0.35
STANDING_GAP = 0.3
COMFORT = 0.6


@kernel
def follow_acceleration(
    speed: float,
    wanted: float,
    gap: float,
    approach: float,
    most: float,
    comfort: float,
    standing: float,
) -> float:
    """Return the acceleration [m/s²] of the Intelligent Driver Model behind another kart.

    a (1 - (v / v0)⁴ - (s* / s)²) with the wanted gap s* = s0 + max(0, v T + v dv / (2 √(a b))):
    Treiber, Hennecke and Helbing, Congested traffic states in empirical observations and
    microscopic simulations, Physical Review E 62, 1805 (2000). speed: v; wanted: v0, both [m/s];
    gap: s [m] between the bodies; approach: dv [m/s], how much slower the other is; most: a
    [m/s²] of the motor; comfort: b [m/s²] of the brakes; standing: s0 [m].
    """
    dynamic = speed * TIME_GAP_S + speed * approach / (2.0 * math.sqrt(most * comfort))
    distance = (standing + max(dynamic, 0.0)) / max(gap, 0.05 * standing)
    share = speed / max(wanted, 0.1)
    return most * (1.0 - share**4 - distance * distance)


@large_kernel
def behind_leader(cockpit: Cockpit, closer: float) -> float:
    """Return the model's acceleration [m/s²] behind the kart ahead, infinite if there is none.

    closer: share of the distance that is given up; at 1 nothing holds the kart back.
    """
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    gap, pace, _ = leader(cockpit, observation[offsets[OFFSET]], 0.5 * vehicle.length)
    if gap == math.inf or closer >= 1.0:
        return math.inf
    gap /= 1.0 - closer
    speed = max(observation[offsets[SPEED]], 0.0)
    most = COMFORT * vehicle.motor_force / vehicle.mass
    comfort = COMFORT * vehicle.brake_force / vehicle.mass
    wanted = 1.2 * vehicle.top_speed
    standing = STANDING_GAP * vehicle.length
    return follow_acceleration(speed, wanted, gap, speed - pace, most, comfort, standing)
