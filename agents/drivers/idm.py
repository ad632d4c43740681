"""Follows the kart ahead by the Intelligent Driver Model, and overtakes when it gains by that."""

from race_agents.planning.care import take_care
from race_agents.planning.delay_compensation import look_ahead
from race_agents.planning.lane import drive_in_lane
from race_agents.planning.tactics import SPEED
from race_agents.planning.tracking import speed_on_line
from race_agents.planning.traffic import ABREAST, NOWHERE, lane_past, leader
from race_agents.planning.tyre_slip import watch_slip
from race_server.core.kernel_driver import SHIFT, Cockpit, Cockpits, KernelDriver, cockpit_at
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.vehicle_presets import KARTS, TENTH

# How many lengths ahead another kart is followed, or passed.
NEAR_LENGTHS, NEAR_S = 3.0, 1.5
# What an overtaking must bring [m/s].
GAIN = 0.3


@kernel
def follow(cockpit: Cockpit) -> None:
    """Follow the line behind a slower kart, or in a lane past it."""
    memory = cockpit.memory
    take_care(cockpit)
    watch_slip(cockpit)
    look_ahead(cockpit)
    wanted = lane_to_gain(cockpit, memory[SHIFT])
    drive_in_lane(cockpit, wanted)


@large_kernel
def lane_to_gain(cockpit: Cockpit, now: float) -> float:
    """Return the lane [m] left of the line to be in: the line itself, or past a slower kart."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    gap, pace, across = leader(cockpit, 0.0, 0.3 * vehicle.length)
    speed = observation[offsets[SPEED]]
    if gap > NEAR_LENGTHS * vehicle.length + NEAR_S * max(speed - pace, 0.0):
        return 0.0
    if speed_on_line(cockpit, now, 0.0, 0.0) < pace + GAIN:
        return 0.0
    apart, reach = ABREAST * vehicle.width, gap + vehicle.length
    past = lane_past(cockpit, across, apart, reach, now)
    return 0.0 if past == NOWHERE else past


@kernel
def follow_all(cockpits: Cockpits) -> None:
    """Decide for many karts in one call."""
    for row in range(len(cockpits.seats)):
        follow(cockpit_at(cockpits, row))


class FollowAndPass(KernelDriver):
    """Drives the reference line, follows a slower kart at a distance and passes it."""

    preset = "line"
    vehicles = (*TENTH, *KARTS)
    takes_advice = True
    decide = staticmethod(follow)
    decide_all = staticmethod(follow_all)
