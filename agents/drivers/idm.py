"""Follows the kart ahead by the Intelligent Driver Model, and overtakes when it gains by that."""

from race_agents.planning.delay_compensation import look_ahead
from race_agents.planning.lane import drive_in_lane
from race_agents.planning.tactics import SPEED
from race_agents.planning.tracking import speed_on_line
from race_agents.planning.traffic import ABREAST, NOWHERE, lane_past, leader
from race_server.core.kernel_driver import SHIFT, KernelDriver
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats, Ints, Record, Records

# How many lengths ahead another kart is followed, or passed.
NEAR_LENGTHS, NEAR_S = 3.0, 1.5
# What an overtaking must bring [m/s].
GAIN = 0.3


@kernel
def follow(
    seen: Floats,
    at: Ints,
    vehicle: Record,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    control: Floats,
) -> None:
    """Follow the line behind a slower kart, or in a lane past it."""
    look_ahead(seen, at, vehicle, gear, memory)
    wanted = lane_to_gain(seen, at, vehicle, memory[SHIFT])
    drive_in_lane(seen, at, vehicle, gear, kinds, memory, control, wanted)


@large_kernel
def lane_to_gain(seen: Floats, at: Ints, vehicle: Record, now: float) -> float:
    """Return the lane [m] left of the line to be in: the line itself, or past a slower kart."""
    gap, pace, across = leader(seen, at, vehicle, 0.0, 0.3 * vehicle.length)
    speed = seen[at[SPEED]]
    if gap > NEAR_LENGTHS * vehicle.length + NEAR_S * max(speed - pace, 0.0):
        return 0.0
    if speed_on_line(seen, at, vehicle, now, 0.0, 0.0) < pace + GAIN:
        return 0.0
    apart, reach = ABREAST * vehicle.width, gap + vehicle.length
    past = lane_past(seen, at, vehicle, across, apart, reach, now)
    return 0.0 if past == NOWHERE else past


@kernel
def follow_all(
    seats: Ints,
    seen: Floats,
    at: Ints,
    vehicles: Records,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    controls: Floats,
) -> None:
    """Decide for many karts: row n of `seats` is a world and a kart in it."""
    for row in range(len(seats)):
        w, k = seats[row, 0], seats[row, 1]
        follow(seen[w, k], at, vehicles[w, k], gear, kinds, memory[w, k], controls[w, k])


class FollowAndPass(KernelDriver):
    """Drives the reference line, follows a slower kart at a distance and passes it."""

    preset = "line"
    takes_advice = True
    decide = staticmethod(follow)
    decide_all = staticmethod(follow_all)
