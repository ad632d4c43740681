"""Notice that a car has turned round, and turn it back, by its yaw rate and its lidar alone.

Every bend goes round something: a border lies within the circle that the car drives. A turn round
nothing, in a wide place or after a blow, is no bend, and leads back. Its angle is added up until
the way goes round something again, or straight on.
"""

import math

from race_agents.planning.tactics import LIGHTS, RESCUE_OFFERED, SPEED, WRONG_WAY
from race_server.core.kernel_driver import DECISION, KEPT, REACH, TURNED, Cockpit
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import PART_NUMBERS
from race_server.core.state import Floats

YAW_RATE = PART_NUMBERS["yaw_rate"]
# Places in a driver's memory: the angle turned round nothing [rad], left positive; the time left to
# turn back [s], zero for none; the side of it, 1 for left; the time in which race control's word of
# a wrong way is still about the past [s].
TURN, TURNING, SIDE, HEEDED = range(TURNED, TURNED + 4)

# A turn beyond ROUND [rad] leads back; one is over that faces the old way within FACING [rad].
ROUND, FACING = math.radians(115.0), math.radians(50.0)
# In turning radii: a wider arc is no turn, on which the angle fades away over the way FADING; what
# lies nearer beside the car leaves no room to turn there.
WIDE, FADING, ROOM = 2.0, 4.0, 1.3
MOST_S = 6.0  # of turning back
HEED_S = 1.5
ECHO = 0.98  # of the reach: from there on a range tells of nothing


@kernel
def lies_within(memory: Floats, rays: int, reach: float, side: float, radius: float) -> bool:
    """Return whether the scan shows anything within the circle that a car drives.

    memory: (M,) of the driver, with the points of its scan, see `move_scan`; reach: of the lidar
    [m]; side: of the circle, 1 for left, -1 for right; radius: [m].
    """
    xs, ys = KEPT + 2 * rays, KEPT + 3 * rays
    for ray in range(rays):
        x, y = memory[xs + ray], memory[ys + ray]
        if memory[KEPT + ray] < reach and x * x + y * y < 2.0 * radius * side * y:
            return True
    return False


@large_kernel
def has_turned_round(cockpit: Cockpit, rays: int) -> bool:
    """Add up the turn since the last decision; return whether the car is to turn back.

    Until it has, and shortly after, the observation is rid of race control's word of a wrong way,
    at which a driver stands.
    """
    observation, offsets, memory = cockpit.observation, cockpit.offsets, cockpit.memory
    step = cockpit.setup[DECISION]
    if observation[offsets[LIGHTS]] > 0.0 or observation[offsets[RESCUE_OFFERED]] > 0.0:
        memory[TURN] = memory[TURNING] = memory[HEEDED] = 0.0
        return False
    memory[TURN] = wrap_angle(memory[TURN] + step * observation[offsets[YAW_RATE]])
    memory[HEEDED] = max(memory[HEEDED] - step, 0.0)
    if memory[TURNING] > 0.0:
        memory[TURNING] -= step
        if abs(memory[TURN]) < FACING or memory[TURNING] <= 0.0:
            memory[TURN], memory[TURNING], memory[HEEDED] = 0.0, 0.0, HEED_S
    else:
        if observation[offsets[WRONG_WAY]] > 0.0 and memory[HEEDED] <= 0.0:
            memory[TURN] = -math.pi
        else:
            forget(cockpit, rays)
        if abs(memory[TURN]) > ROUND:
            memory[TURNING], memory[SIDE] = MOST_S, side_to_turn(cockpit, rays)
    if memory[TURNING] > 0.0 or memory[HEEDED] > 0.0:
        observation[offsets[WRONG_WAY]] = 0.0
    return memory[TURNING] > 0.0


@kernel
def forget(cockpit: Cockpit, rays: int) -> None:
    """Forget a turn that goes round something, and one that lies behind bit by bit."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    memory, setup = cockpit.memory, cockpit.setup
    tightest = (vehicle.front_axle + vehicle.rear_axle) / math.tan(vehicle.steering_limit)
    yaw, speed = observation[offsets[YAW_RATE]], abs(observation[offsets[SPEED]])
    if speed > WIDE * tightest * abs(yaw):
        memory[TURN] *= max(1.0 - speed * setup[DECISION] / (FADING * tightest), 0.0)
        return
    radius, side = speed / max(abs(yaw), 1e-3), 1.0 if yaw > 0.0 else -1.0
    if lies_within(memory, rays, ECHO * setup[REACH], side, radius):
        memory[TURN] = 0.0


@kernel
def side_to_turn(cockpit: Cockpit, rays: int) -> float:
    """Return the side to turn back to: the shorter way, or the one with room if there is one."""
    vehicle, memory = cockpit.vehicle, cockpit.memory
    reach = ECHO * cockpit.setup[REACH]
    radius = ROOM * (vehicle.front_axle + vehicle.rear_axle) / math.tan(vehicle.steering_limit)
    side = -1.0 if memory[TURN] > 0.0 else 1.0
    is_narrow = lies_within(memory, rays, reach, side, radius)
    if is_narrow and not lies_within(memory, rays, reach, -side, radius):
        return -side
    return side
