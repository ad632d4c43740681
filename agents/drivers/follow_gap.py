"""Follow the gap: along the way through the opening that the scan tells of, and nothing else.

Needs a lidar alone. How the way is found: `race_agents.planning.gap_way`.
"""

import math

from race_agents.planning.gap_way import GAIN, GRIP_SCALE, YAW_RATE, find_way
from race_agents.planning.latency import STEERING, remember_command, take_up_play
from race_agents.planning.tactics import SPEED, finish_decision, press_pedals
from race_agents.planning.tracking import SPEED_CAP, spare_rear
from race_server.core.kernel_driver import Cockpit, Cockpits, KernelDriver, cockpit_at
from race_server.core.kernels.jit import kernel
from race_server.core.vehicle_presets import KARTS, TENTH
from race_server.core.vehicles import GRAVITY


@kernel
def follow(cockpit: Cockpit) -> None:
    """Take the path through the gap."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, memory, control = cockpit.vehicle, cockpit.memory, cockpit.control
    bend, target = find_way(cockpit)
    speed = max(observation[offsets[SPEED]], 0.0)
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    angle = take_up_play(memory, math.atan(bend * wheelbase), observation[offsets[STEERING]])
    control[0] = min(max(angle / vehicle.steering_limit, -1.0), 1.0)
    press_pedals(speed, min(target, observation[offsets[SPEED_CAP]]), GAIN, control)
    grip = max(vehicle.grip * GRAVITY * observation[offsets[GRIP_SCALE]], 0.1)
    spare_rear(vehicle, grip, abs(speed * observation[offsets[YAW_RATE]]) / grip, control)
    finish_decision(cockpit)
    remember_command(memory, control)


@kernel
def follow_all(cockpits: Cockpits) -> None:
    """Decide for many karts in one call."""
    for row in range(len(cockpits.seats)):
        follow(cockpit_at(cockpits, row))


class FollowGap(KernelDriver):
    """Drives through the gap in the scan on the path of least bending."""

    preset = "lidar"
    vehicles = (*TENTH, *KARTS)
    needs_walls = True
    decide = staticmethod(follow)
    decide_all = staticmethod(follow_all)
