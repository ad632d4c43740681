"""What a policy on the line is told and helped with beside its network, as drivers on the line are.

It is shown the line slower where that takes the grip of a fast kart, and where it came too near to
a border or slid before, and what it will see once its command acts, where commands act late. What
it answers is turned further where the steering has play, and gives way to the way out of a jam: no
network here counts how long it has stood, and one that drives into the same wall again has no other
answer to it.
"""

import math

from race_agents.planning.care import take_care
from race_agents.planning.delay_compensation import look_ahead
from race_agents.planning.lane import drive_in_lane
from race_agents.planning.latency import STEERING, remember_command, take_up_play
from race_agents.planning.tactics import FINISHED, LIGHTS, WRONG_WAY, escape
from race_agents.planning.tracking import CURVATURE, JAM_LENGTHS, LINE_SPEED
from race_agents.planning.traffic import STEP, is_alone, wait_in_line
from race_server.core.kernel_driver import (
    ATTEMPTS,
    REVERSING,
    STANDING,
    Cockpit,
    Cockpits,
    cockpit_at,
)
from race_server.core.kernels.jit import kernel
from race_server.core.observation import AHEAD
from race_server.core.vehicles import GRAVITY

# Where a bend and the brakes take all the grip, the line is shown slower by up to this share, from
# nothing at the first of these shares of the top speed to all of it at the second: a network keeps
# to a line less exactly than its teacher does, and the faster it is the later its rear axle is
# caught.
SLOWER, FAST, FASTEST = 0.03, 0.4, 0.7
# From this attempt to get free on, until it is forgotten, a kart that is alone goes back to its
# line as `raceline` does.
HELPED_FROM = 2.0


@kernel
def keep_hold(cockpit: Cockpit) -> None:
    """Show the line slower where a bend and the brakes take the grip of a fast kart."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    step = max(observation[offsets[STEP]], 0.01)
    for index in range(AHEAD):
        speed = observation[offsets[LINE_SPEED] + index]
        bend = abs(observation[offsets[CURVATURE] + index])
        braking = 0.0
        if index + 1 < AHEAD:
            later = observation[offsets[LINE_SPEED] + index + 1]
            braking = max(speed * speed - later * later, 0.0) / (2.0 * step)
        needed = math.hypot(speed * speed * bend, braking)
        used = min(needed / (vehicle.grip * GRAVITY), 1.0)
        fast = min(max((speed / vehicle.top_speed - FAST) / (FASTEST - FAST), 0.0), 1.0)
        observation[offsets[LINE_SPEED] + index] *= 1.0 - SLOWER * fast * used


@kernel
def foresee_for_all(cockpits: Cockpits) -> None:
    """Replace the observations of many karts by those to decide on."""
    for row in range(len(cockpits.seats)):
        cockpit = cockpit_at(cockpits, row)
        take_care(cockpit)
        keep_hold(cockpit)
        look_ahead(cockpit)


@kernel
def remember_for_all(cockpits: Cockpits) -> None:
    """Take up play, get karts free that are stuck, and remember what all are told to do."""
    for row in range(len(cockpits.seats)):
        remember(cockpit_at(cockpits, row))


@kernel
def remember(cockpit: Cockpit) -> None:
    """Take up play, get a kart free that is stuck, and remember what it is told to do."""
    observation, offsets = cockpit.observation, cockpit.offsets
    memory, control, limit = cockpit.memory, cockpit.control, cockpit.vehicle.steering_limit
    steering = take_up_play(memory, control[0] * limit, observation[offsets[STEERING]]) / limit
    control[0] = min(max(steering, -1.0), 1.0)
    must_stand = observation[offsets[LIGHTS]] > 0.0 or observation[offsets[FINISHED]] > 0.0
    if must_stand or observation[offsets[WRONG_WAY]] > 0.0:
        # A network that is turned round may turn back by itself.
        memory[STANDING] = memory[REVERSING] = 0.0
    elif memory[ATTEMPTS] >= HELPED_FROM and is_alone(cockpit, JAM_LENGTHS):
        buttons = control[3]
        drive_in_lane(cockpit, 0.0)
        control[3] = buttons
        return
    else:
        wait_in_line(cockpit)
        escape(cockpit)
    remember_command(memory, control)
