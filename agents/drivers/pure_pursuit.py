"""Pure pursuit of the centre line, at the speed that the bends ahead allow.

Geometry: Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, 1992.
"""

import math

from race_agents.planning.tactics import SPEED, finish_decision, press_pedals
from race_agents.planning.tracking import spare_rear
from race_server.core.kernel_driver import SHIFT, Cockpit, Cockpits, KernelDriver, cockpit_at
from race_server.core.kernels.jit import kernel
from race_server.core.observation import AHEAD, NEARBY, PART_NUMBERS, THINGS
from race_server.core.state import Floats
from race_server.core.vehicle_presets import KARTS, TENTH
from race_server.core.vehicles import GRAVITY

CURVATURE = PART_NUMBERS["curvature_ahead"]
PATH_X = PART_NUMBERS["path_ahead_x"]
PATH_Y = PART_NUMBERS["path_ahead_y"]
LEFT = PART_NUMBERS["left_ahead"]
RIGHT = PART_NUMBERS["right_ahead"]
LOOK_AHEAD = PART_NUMBERS["look_ahead"]
YAW_RATE = PART_NUMBERS["yaw_rate"]
OFFSET = PART_NUMBERS["lateral_offset"]
KARTS_X = PART_NUMBERS["karts_x"]
KARTS_Y = PART_NUMBERS["karts_y"]
KARTS_SPEED_X = PART_NUMBERS["karts_speed_x"]
HAZARDS_X = PART_NUMBERS["hazards_x"]
HAZARDS_Y = PART_NUMBERS["hazards_y"]
SPEED_CAP = PART_NUMBERS["speed_cap"]
GRIP_SCALE = PART_NUMBERS["grip_scale"]

# Shares of the grip that this driver dares to use in bends and under braking.
BEND_SHARE = 0.75
BRAKE_SHARE = 0.6
LOOK_S = 0.35  # looks so far ahead in time


@kernel
def pursue(cockpit: Cockpit) -> None:
    """Follow the centre line and drive around slower karts where there is room."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, memory, control = cockpit.vehicle, cockpit.memory, cockpit.control
    speed, step = observation[offsets[SPEED]], observation[offsets[LOOK_AHEAD]]
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    look = max(1.2 * wheelbase + LOOK_S * speed, 1.5 * step)
    place = min(max(look / step - 1.0, 0.0), AHEAD - 1.0)
    x, y = (
        between(observation, offsets[PATH_X], place),
        between(observation, offsets[PATH_Y], place),
    )
    index = int(place + 0.5)
    left, right = observation[offsets[LEFT] + index], observation[offsets[RIGHT] + index]
    wanted = way_around(cockpit, left, right)
    memory[SHIFT] += 0.25 * (wanted - memory[SHIFT])
    control[0] = steering_to(x, y, memory[SHIFT], wheelbase) / vehicle.steering_limit
    control[0] = min(max(control[0], -1.0), 1.0)
    press_pedals(speed, speed_limit(cockpit), 2.0, control)
    grip = vehicle.grip * GRAVITY * observation[offsets[GRIP_SCALE]]
    spare_rear(vehicle, grip, abs(speed * observation[offsets[YAW_RATE]]) / max(grip, 0.1), control)
    finish_decision(cockpit)


@kernel
def between(observation: Floats, start: int, place: float) -> float:
    """Return the value at a place between two samples of a part that begins at `start`."""
    index = min(int(place), AHEAD - 2)
    share = place - index
    return observation[start + index] * (1.0 - share) + observation[start + index + 1] * share


@kernel
def way_around(cockpit: Cockpit, left: float, right: float) -> float:
    """Return the sideways shift [m] that passes whatever blocks the way ahead."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    width, length, speed = vehicle.width, vehicle.length, observation[offsets[SPEED]]
    nearest, across = math.inf, 0.0
    for index in range(NEARBY):
        x, y = observation[offsets[KARTS_X] + index], observation[offsets[KARTS_Y] + index]
        slower = observation[offsets[KARTS_SPEED_X] + index] < speed + 0.3
        if slower and 0.0 < x < 2.5 * length + speed and abs(y) < 1.3 * width and x < nearest:
            nearest, across = x, y
    for index in range(THINGS):
        x, y = observation[offsets[HAZARDS_X] + index], observation[offsets[HAZARDS_Y] + index]
        if 0.0 < x < 2.0 * length + speed and abs(y) < width and x < nearest:
            nearest, across = x, y
    if nearest == math.inf:
        return 0.0
    # Pass on the side that leaves more room between the other and the edge.
    other = observation[offsets[OFFSET]] + across
    side = 1.0 if left - other > right + other else -1.0
    margin = 0.6 * width
    return min(max(other + side * 1.4 * width, -(right - margin)), left - margin)


@kernel
def steering_to(x: float, y: float, shift: float, wheelbase: float) -> float:
    """Return the steering angle [rad] towards a point in the kart frame, shifted to the left."""
    distance = math.sqrt(x * x + y * y)
    if distance > 0.0:  # the shift is across the way to the point
        x, y = x - shift * y / distance, y + shift * x / distance
    distance = max(math.sqrt(x * x + y * y), 0.1)
    return math.atan2(2.0 * wheelbase * y / distance, distance)


@kernel
def speed_limit(cockpit: Cockpit) -> float:
    """Return the speed [m/s] from which every bend ahead can still be taken."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    grip = vehicle.grip * GRAVITY * observation[offsets[GRIP_SCALE]]
    step, speed = observation[offsets[LOOK_AHEAD]], observation[offsets[SPEED]]
    braking = BRAKE_SHARE * min(grip, vehicle.brake_force / vehicle.mass)
    limit = observation[offsets[SPEED_CAP]]
    for index in range(AHEAD):
        bend = max(abs(observation[offsets[CURVATURE] + index]), 1e-6)
        distance = max(step * index - 0.15 * speed, 0.0)
        limit = min(limit, math.sqrt(BEND_SHARE * grip / bend + 2.0 * braking * distance))
    return limit


@kernel
def pursue_all(cockpits: Cockpits) -> None:
    """Decide for many karts in one call."""
    for row in range(len(cockpits.seats)):
        pursue(cockpit_at(cockpits, row))


class PurePursuit(KernelDriver):
    """Follows the centre line and drives around slower karts where there is room."""

    preset = "track"
    vehicles = (*TENTH, *KARTS)
    decide = staticmethod(pursue)
    decide_all = staticmethod(pursue_all)
