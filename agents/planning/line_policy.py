"""What a policy on the line is told and helped with beside its network, as drivers on the line are.

It is shown the line slower where it came too near to a border before, and what it will see once its
command acts, where commands act late. What it answers is damped where it is fast, turned further
where the steering has play, and gives way to the way out of a jam: no network here counts how long
it has stood, and one that drives into the same wall again has no other answer to it.
"""

from race_agents.planning.care import take_care
from race_agents.planning.delay_compensation import look_ahead
from race_agents.planning.lane import drive_in_lane
from race_agents.planning.latency import STEERING, remember_command, take_up_play
from race_agents.planning.tactics import FINISHED, LIGHTS, SPEED, WRONG_WAY, escape
from race_agents.planning.tracking import DELAY_S, JAM_LENGTHS, excess_yaw_rate, yaw_damping
from race_agents.planning.traffic import is_alone, wait_in_line
from race_server.core.kernel_driver import (
    ATTEMPTS,
    REVERSING,
    STANDING,
    Cockpit,
    Cockpits,
    cockpit_at,
)
from race_server.core.kernels.jit import kernel

# The damping of the yaw rate grows from nothing at the first of these shares of the top speed to
# TIMES that of the line's own controller at the second. Few places of a training are as fast, and
# there a network lets the rear axle slide further than it can catch it.
FAST, FASTEST, TIMES = 0.5, 0.65, 1.5
# From this attempt to get free on, until it is forgotten, a kart that is alone goes back to its
# line as `raceline` does.
HELPED_FROM = 2.0


@kernel
def foresee_for_all(cockpits: Cockpits) -> None:
    """Replace the observations of many karts by those to decide on."""
    for row in range(len(cockpits.seats)):
        cockpit = cockpit_at(cockpits, row)
        take_care(cockpit)
        look_ahead(cockpit)


@kernel
def fast_damping(cockpit: Cockpit) -> float:
    """Return the steering [rad] against the yaw rate that a fast kart has more than its bend."""
    vehicle, speed = cockpit.vehicle, cockpit.observation[cockpit.offsets[SPEED]]
    share = (speed / vehicle.top_speed - FAST) / (FASTEST - FAST)
    if share <= 0.0:
        return 0.0
    turning = excess_yaw_rate(cockpit, speed, DELAY_S)
    return min(share, 1.0) * TIMES * yaw_damping(vehicle, speed) * turning


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
    angle = control[0] * limit - fast_damping(cockpit)
    steering = take_up_play(memory, angle, observation[offsets[STEERING]]) / limit
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
