"""One decision of a driver on the reference line, given the lane that it wants."""

from race_agents.planning.clearance import keep_clear
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
    Cockpit,
)
from race_server.core.kernels.jit import kernel


@kernel
def drive_in_lane(cockpit: Cockpit, wanted: float) -> None:
    """Change to a lane `wanted` [m] left of the line, round hazards and behind karts ahead.

    Advice shifts the lane, fetches boxes, scales the speed and sets the distance to follow at.
    """
    observation, offsets = cockpit.observation, cockpit.offsets
    setup, memory, control = cockpit.setup, cockpit.memory, cockpit.control
    wanted += memory[ASIDE]
    if memory[FETCH] > URGENT and observation[offsets[ITEM]] < 0.5:
        wanted = lane_over_box(cockpit, wanted)
    wanted = lane_past_hazards(cockpit, wanted)
    lane = move_over(cockpit, memory[SHIFT], wanted, setup[DECISION])
    memory[SHIFT] = lane
    acceleration = acceleration_on_line(cockpit, lane, memory[FASTER], memory[DASH])
    acceleration = min(acceleration, behind_leader(cockpit, memory[CLOSE]))
    force = press_for(cockpit, acceleration)
    control[0] = steering_on_line(cockpit, lane + keep_clear(cockpit, lane), force)
    wait_in_line(cockpit)
    finish_decision(cockpit)
    remember_command(memory, control)
