"""What a policy that drives by a scan is helped with beside its network, where its file says so.

It brakes where it is faster than what the scan shows allows, which a network learns last: that it
cannot see behind a bend. What it answers is turned further where the steering has play.
"""

from race_agents.planning.gap_way import GAIN, find_way
from race_agents.planning.latency import STEERING, remember_command, take_up_play
from race_agents.planning.tactics import SPEED, press_pedals
from race_server.core.kernel_driver import Cockpits, cockpit_at
from race_server.core.kernels.jit import kernel


@kernel
def limit_all(cockpits: Cockpits, share: float) -> None:
    """Let many karts drive no faster than a share of what `follow_gap` would.

    share: of that speed, 1 or more for a policy that looks farther than one scan.
    """
    for row in range(len(cockpits.seats)):
        cockpit = cockpit_at(cockpits, row)
        control, limit = cockpit.control, cockpit.vehicle.steering_limit
        seen = cockpit.observation
        steering, throttle, brake = control[0], control[1], control[2]
        _, fastest = find_way(cockpit)
        press_pedals(max(seen[cockpit.offsets[SPEED]], 0.0), share * fastest, GAIN, control)
        control[1], control[2] = min(throttle, control[1]), max(brake, control[2])
        now = seen[cockpit.offsets[STEERING]]
        steering = take_up_play(cockpit.memory, steering * limit, now) / limit
        control[0] = min(max(steering, -1.0), 1.0)
        remember_command(cockpit.memory, control)
