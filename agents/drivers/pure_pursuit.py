"""Pure pursuit of the centre line, at the speed that the bends ahead allow.

Geometry: Coulter, Implementation of the Pure Pursuit Path Tracking Algorithm, 1992.
"""

import math

from race_agents.planning.tactics import SPEED, finish_decision, press_pedals
from race_server.core.kernel_driver import SHIFT, KernelDriver
from race_server.core.kernels.jit import kernel
from race_server.core.observation import AHEAD, NEARBY, PART_NUMBERS, THINGS
from race_server.core.state import Floats, Ints, Record, Records
from race_server.core.vehicles import GRAVITY

CURVATURE = PART_NUMBERS["curvature_ahead"]
PATH_X = PART_NUMBERS["path_ahead_x"]
PATH_Y = PART_NUMBERS["path_ahead_y"]
LEFT = PART_NUMBERS["left_ahead"]
RIGHT = PART_NUMBERS["right_ahead"]
LOOK_AHEAD = PART_NUMBERS["look_ahead"]
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
def pursue(
    seen: Floats,
    at: Ints,
    vehicle: Record,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    control: Floats,
) -> None:
    """Follow the centre line and drive around slower karts where there is room."""
    speed, step = seen[at[SPEED]], seen[at[LOOK_AHEAD]]
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    look = max(1.2 * wheelbase + LOOK_S * speed, 1.5 * step)
    place = min(max(look / step - 1.0, 0.0), AHEAD - 1.0)
    x, y = between(seen, at[PATH_X], place), between(seen, at[PATH_Y], place)
    index = int(place + 0.5)
    left, right = seen[at[LEFT] + index], seen[at[RIGHT] + index]
    wanted = way_around(seen, at, vehicle, left, right)
    memory[SHIFT] += 0.25 * (wanted - memory[SHIFT])
    control[0] = steering_to(x, y, memory[SHIFT], wheelbase) / vehicle.steering_limit
    control[0] = min(max(control[0], -1.0), 1.0)
    press_pedals(speed, speed_limit(seen, at, vehicle), 2.0, control)
    finish_decision(seen, at, vehicle, gear, kinds, memory, control)


@kernel
def between(seen: Floats, start: int, place: float) -> float:
    """Return the value at a place between two samples of a part that begins at `start`."""
    index = min(int(place), AHEAD - 2)
    share = place - index
    return seen[start + index] * (1.0 - share) + seen[start + index + 1] * share


@kernel
def way_around(seen: Floats, at: Ints, vehicle: Record, left: float, right: float) -> float:
    """Return the sideways shift [m] that passes whatever blocks the way ahead."""
    width, length, speed = vehicle.width, vehicle.length, seen[at[SPEED]]
    nearest, across = math.inf, 0.0
    for index in range(NEARBY):
        x, y = seen[at[KARTS_X] + index], seen[at[KARTS_Y] + index]
        slower = seen[at[KARTS_SPEED_X] + index] < speed + 0.3
        if slower and 0.0 < x < 2.5 * length + speed and abs(y) < 1.3 * width and x < nearest:
            nearest, across = x, y
    for index in range(THINGS):
        x, y = seen[at[HAZARDS_X] + index], seen[at[HAZARDS_Y] + index]
        if 0.0 < x < 2.0 * length + speed and abs(y) < width and x < nearest:
            nearest, across = x, y
    if nearest == math.inf:
        return 0.0
    # Pass on the side that leaves more room between the other and the edge.
    other = seen[at[OFFSET]] + across
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
def speed_limit(seen: Floats, at: Ints, vehicle: Record) -> float:
    """Return the speed [m/s] from which every bend ahead can still be taken."""
    grip = vehicle.grip * GRAVITY * seen[at[GRIP_SCALE]]
    step, speed = seen[at[LOOK_AHEAD]], seen[at[SPEED]]
    braking = BRAKE_SHARE * min(grip, vehicle.brake_force / vehicle.mass)
    limit = seen[at[SPEED_CAP]]
    for index in range(AHEAD):
        bend = max(abs(seen[at[CURVATURE] + index]), 1e-6)
        distance = max(step * index - 0.15 * speed, 0.0)
        limit = min(limit, math.sqrt(BEND_SHARE * grip / bend + 2.0 * braking * distance))
    return limit


@kernel
def pursue_all(
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
        pursue(seen[w, k], at, vehicles[w, k], gear, kinds, memory[w, k], controls[w, k])


class PurePursuit(KernelDriver):
    """Follows the centre line and drives around slower karts where there is room."""

    preset = "track"
    decide = staticmethod(pursue)
    decide_all = staticmethod(pursue_all)
