"""A sparring partner: keeps away from what is near, at a steady pace.

It does what the obstacle-avoiding cars of the 1/10 race's training track do: steer to the side
where there is more room.
"""

import math

from race_agents.planning.scan import fill_dropouts, nearest, ray_angle
from race_agents.planning.tactics import SPEED, finish_decision, press_pedals
from race_server.core.kernel_driver import (
    FIELD,
    KEPT,
    REACH,
    Cockpit,
    Cockpits,
    KernelDriver,
    cockpit_at,
)
from race_server.core.kernels.jit import kernel
from race_server.core.observation import PART_NUMBERS
from race_server.core.state import Floats
from race_server.core.vehicle_presets import KARTS, TENTH
from race_server.core.vehicles import GRAVITY

LIDAR = PART_NUMBERS["lidar"]
# Its pace is what the tyres hold in a bend of this radius [body lengths]: 2 m/s for the 1/10 car.
BEND_LENGTHS = 1.78
INNER, OUTER = math.radians(15.0), math.radians(75.0)
FAR_LENGTHS = 6.0  # what is farther away [body lengths] does not matter
DEEP_GAIN = 2.0  # of the deeper side before a wall: the bend is near


@kernel
def avoid(cockpit: Cockpit) -> None:
    """Steer by the balance of free space on the left and on the right."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup = cockpit.vehicle, cockpit.setup
    memory, control = cockpit.memory, cockpit.control
    rays, field, length = offsets[-1], setup[FIELD], vehicle.length
    fill_dropouts(observation, offsets[LIDAR], rays, setup[REACH], memory, KEPT)
    far = FAR_LENGTHS * length
    left, right = (
        _room(memory, rays, field, 1.0, far),
        _room(memory, rays, field, -1.0, far),
    )
    ahead = nearest(memory, KEPT, rays, field, -INNER, INNER, setup[REACH])
    balance = (left - right) / (left + right)
    if ahead < far:
        # Before a wall across it is not the mean that tells where the way goes on.
        left, right = _depth(memory, rays, field, 1.0, far), _depth(memory, rays, field, -1.0, far)
        deeper = DEEP_GAIN * (left - right) / (left + right)
        balance += (1.0 - ahead / far) * (deeper - balance)
    control[0] = min(max(2.5 * balance, -1.0), 1.0)
    steady = min(math.sqrt(vehicle.grip * GRAVITY * BEND_LENGTHS * length), vehicle.top_speed)
    pace = steady * min(max(ahead / (3.0 * length), 0.35), 1.0)
    press_pedals(observation[offsets[SPEED]], pace, 2.0, control)
    finish_decision(cockpit)


@kernel
def _room(ranges: Floats, rays: int, field: float, side: float, far: float) -> float:
    """Return the mean range [m] between 15° and 75° on one side; beyond `far` counts as that."""
    total, count = 0.0, 0
    for ray in range(rays):
        if INNER < side * ray_angle(ray, rays, field) < OUTER:
            total += min(ranges[KEPT + ray], far)
            count += 1
    return total / max(count, 1) + 1e-3


@kernel
def _depth(ranges: Floats, rays: int, field: float, side: float, far: float) -> float:
    """Return the largest range [m] beyond 15° on one side, at most `far`."""
    depth = 1e-3
    for ray in range(rays):
        if side * ray_angle(ray, rays, field) > INNER:
            depth = max(depth, min(ranges[KEPT + ray], far))
    return depth


@kernel
def avoid_all(cockpits: Cockpits) -> None:
    """Decide for many karts in one call."""
    for row in range(len(cockpits.seats)):
        avoid(cockpit_at(cockpits, row))


class Avoider(KernelDriver):
    """Steers by the balance of free space on the left and on the right."""

    preset = "lidar"
    vehicles = (*TENTH, *KARTS)
    decide = staticmethod(avoid)
    decide_all = staticmethod(avoid_all)
