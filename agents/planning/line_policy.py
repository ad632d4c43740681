"""What a policy on the line is told and helped with beside its network, as drivers on the line are.

It is shown the line slower where it came too near to a border before, and what it will see once its
command acts, where commands act late. What it answers is turned further where the steering has
play, and gives way to the way out of a jam: no network here counts how long it has stood.
"""

from race_agents.planning.care import take_care
from race_agents.planning.delay_compensation import look_ahead
from race_agents.planning.latency import STEERING, remember_command, take_up_play
from race_agents.planning.tactics import FINISHED, LIGHTS, WRONG_WAY, escape
from race_agents.planning.traffic import wait_in_line
from race_server.core.kernel_driver import REVERSING, STANDING, Cockpits, cockpit_at
from race_server.core.kernels.jit import kernel


@kernel
def foresee_for_all(cockpits: Cockpits) -> None:
    """Replace the observations of many karts by those to decide on."""
    for row in range(len(cockpits.seats)):
        cockpit = cockpit_at(cockpits, row)
        take_care(cockpit)
        look_ahead(cockpit)


@kernel
def remember_for_all(cockpits: Cockpits) -> None:
    """Take up play, get karts free that are stuck, and remember what all are told to do."""
    for row in range(len(cockpits.seats)):
        cockpit = cockpit_at(cockpits, row)
        observation, offsets = cockpit.observation, cockpit.offsets
        control, limit = cockpit.control, cockpit.vehicle.steering_limit
        now = observation[offsets[STEERING]]
        steering = take_up_play(cockpit.memory, control[0] * limit, now) / limit
        control[0] = min(max(steering, -1.0), 1.0)
        must_stand = observation[offsets[LIGHTS]] > 0.0 or observation[offsets[FINISHED]] > 0.0
        if must_stand or observation[offsets[WRONG_WAY]] > 0.0:
            # A network that is turned round may turn back by itself.
            cockpit.memory[STANDING] = cockpit.memory[REVERSING] = 0.0
        else:
            wait_in_line(cockpit)
            escape(cockpit)
        remember_command(cockpit.memory, control)
