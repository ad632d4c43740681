"""Drives the reference line at its speeds and passes slower karts where there is room."""

from race_agents.planning.care import take_care
from race_agents.planning.delay_compensation import look_ahead
from race_agents.planning.lane import drive_in_lane
from race_agents.planning.tactics import SPEED
from race_agents.planning.tracking import speed_on_line
from race_agents.planning.traffic import ABREAST, FORESIGHT_S, NOWHERE, SLOWER, lane_past, leader
from race_agents.planning.tyre_slip import watch_slip
from race_server.core.kernel_driver import SHIFT, Cockpit, Cockpits, KernelDriver, cockpit_at
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.vehicle_presets import KARTS, TENTH


@kernel
def race(cockpit: Cockpit) -> None:
    """Follow the line, or a lane beside it that passes a slower kart."""
    memory = cockpit.memory
    take_care(cockpit)
    watch_slip(cockpit)
    look_ahead(cockpit)
    wanted = open_lane(cockpit, memory[SHIFT])
    drive_in_lane(cockpit, wanted)


@large_kernel
def open_lane(cockpit: Cockpit, now: float) -> float:
    """Return the lane [m] left of the line to be in: the line itself, or past a slower kart."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    speed = max(observation[offsets[SPEED]], 1.0)
    gap, pace, across = leader(cockpit, 0.0, 0.3 * vehicle.length)
    could = speed_on_line(cockpit, 0.0, 0.0, 0.0)
    reach = max(gap + vehicle.length, 0.0)
    slower = pace + SLOWER < max(speed, could)
    if gap > 2.0 * vehicle.length + FORESIGHT_S * max(speed - pace, 0.0) or not slower:
        return 0.0
    past = lane_past(cockpit, across, ABREAST * vehicle.width, reach, now)
    return 0.0 if past == NOWHERE else past


@kernel
def race_all(cockpits: Cockpits) -> None:
    """Decide for many karts in one call."""
    for row in range(len(cockpits.seats)):
        race(cockpit_at(cockpits, row))


class Raceline(KernelDriver):
    """Drives the reference line at its speeds and passes slower karts where there is room."""

    preset = "line"
    vehicles = (*TENTH, *KARTS)
    takes_advice = True
    decide = staticmethod(race)
    decide_all = staticmethod(race_all)
