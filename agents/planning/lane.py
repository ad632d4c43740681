"""One decision of a driver on the reference line, once it knows in which lane it wants to be."""

from race_agents.planning.idm_model import behind_leader
from race_agents.planning.latency import remember_command
from race_agents.planning.tactics import ITEM, finish_decision
from race_agents.planning.tracking import acceleration_on_line, press_for, steering_on_line
from race_agents.planning.traffic import lane_over_box, lane_past_hazards, move_over, wait_in_line
from race_server.core.kernel_driver import (
    ASIDE,
    CLOSE,
    DASH,
    DECISION,
    FASTER,
    FETCH,
    SHIFT,
    URGENT,
)
from race_server.core.kernels.jit import kernel
from race_server.core.state import Floats, Ints, Record


@kernel
def drive_in_lane(
    seen: Floats,
    at: Ints,
    vehicle: Record,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    control: Floats,
    wanted: float,
) -> None:
    """Go over to a lane `wanted` [m] left of the line, round hazards and behind who is there.

    Advice shifts the lane, fetches boxes, scales the speed and says how closely to follow.
    """
    wanted += memory[ASIDE]
    if memory[FETCH] > URGENT and seen[at[ITEM]] < 0.5:
        wanted = lane_over_box(seen, at, vehicle, wanted)
    wanted = lane_past_hazards(seen, at, vehicle, wanted)
    lane = move_over(seen, at, vehicle, memory[SHIFT], wanted, gear[DECISION])
    memory[SHIFT] = lane
    acceleration = acceleration_on_line(seen, at, vehicle, gear, lane, memory[FASTER], memory[DASH])
    acceleration = min(acceleration, behind_leader(seen, at, vehicle, memory[CLOSE]))
    force = press_for(seen, at, vehicle, acceleration, control)
    control[0] = steering_on_line(seen, at, vehicle, lane, force)
    wait_in_line(seen, at, vehicle, gear, memory)
    finish_decision(seen, at, vehicle, gear, kinds, memory, control)
    remember_command(memory, control)
