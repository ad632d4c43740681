"""Drives the reference line at its speeds and passes who is slower where there is room."""

from race_agents.planning.delay_compensation import look_ahead
from race_agents.planning.lane import drive_in_lane
from race_agents.planning.tactics import SPEED
from race_agents.planning.tracking import speed_on_line
from race_agents.planning.traffic import ABREAST, FORESIGHT_S, NOWHERE, SLOWER, lane_past, leader
from race_server.core.kernel_driver import SHIFT, KernelDriver
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats, Ints, Record, Records


@kernel
def race(
    seen: Floats,
    at: Ints,
    vehicle: Record,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    control: Floats,
) -> None:
    """Follow the line, or a lane beside it that passes whoever is slower."""
    look_ahead(seen, at, vehicle, gear, memory)
    wanted = open_lane(seen, at, vehicle, memory[SHIFT])
    drive_in_lane(seen, at, vehicle, gear, kinds, memory, control, wanted)


@large_kernel
def open_lane(seen: Floats, at: Ints, vehicle: Record, now: float) -> float:
    """Return the lane [m] left of the line to be in: the line itself, or past a slower kart."""
    speed = max(seen[at[SPEED]], 1.0)
    gap, pace, across = leader(seen, at, vehicle, 0.0, 0.3 * vehicle.length)
    could = speed_on_line(seen, at, vehicle, 0.0, 0.0, 0.0)
    reach = max(gap + vehicle.length, 0.0)
    slower = pace + SLOWER < max(speed, could)
    if gap > 2.0 * vehicle.length + FORESIGHT_S * max(speed - pace, 0.0) or not slower:
        return 0.0
    past = lane_past(seen, at, vehicle, across, ABREAST * vehicle.width, reach, now)
    return 0.0 if past == NOWHERE else past


@kernel
def race_all(
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
        race(seen[w, k], at, vehicles[w, k], gear, kinds, memory[w, k], controls[w, k])


class Raceline(KernelDriver):
    """Drives the reference line at its speeds and passes who is slower where there is room."""

    preset = "line"
    takes_advice = True
    decide = staticmethod(race)
    decide_all = staticmethod(race_all)
