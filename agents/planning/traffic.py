"""Others on the way, in coordinates of the reference line: along it, and to its left."""

import math

from race_agents.planning.tactics import KARTS_X, SPEED
from race_server.core.kernel_driver import DECISION, STANDING, Cockpit
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import AHEAD, NEARBY, PART_NUMBERS, THINGS

LINE_X = PART_NUMBERS["line_ahead_x"]
LINE_Y = PART_NUMBERS["line_ahead_y"]
LEFT = PART_NUMBERS["line_left_ahead"]
RIGHT = PART_NUMBERS["line_right_ahead"]
OFFSET = PART_NUMBERS["line_offset"]
STEP = PART_NUMBERS["line_step"]
LIGHTS = PART_NUMBERS["lights"]
KARTS_Y = PART_NUMBERS["karts_y"]
KARTS_SPEED_X = PART_NUMBERS["karts_speed_x"]
KARTS_SPEED_Y = PART_NUMBERS["karts_speed_y"]
BOXES_X = PART_NUMBERS["boxes_x"]
BOXES_Y = PART_NUMBERS["boxes_y"]
HAZARDS_X = PART_NUMBERS["hazards_x"]
HAZARDS_Y = PART_NUMBERS["hazards_y"]

# Bodies this many widths apart, middle to middle, pass each other; nearer they may touch.
ABREAST = 1.45
# Widths from the middle of the kart to the edge of the asphalt at least.
EDGE = 0.75
# A hazard is passed at this many widths.
CLEAR_OF_HAZARD = 1.1
# A box is touched this many widths from its middle, and a little is left for errors.
BOX_REACH = 0.6
# How far ahead [s] a kart that is slower is made room for.
FORESIGHT_S = 1.2
# Steps of the line behind the other that must leave room, too.
ROOM_STEPS = 8
# How fast [m/s] another must be slower, to be overtaken.
SLOWER = 0.2
# How steeply a kart changes lanes.
SLOPE = 0.18
# Share of the time in a queue that does not count as being stuck.
WAITING = 0.8
NOWHERE = 1e3


@kernel
def is_alone(cockpit: Cockpit, lengths: float) -> bool:
    """Return whether no other kart is known within this number of lengths."""
    observation, offsets = cockpit.observation, cockpit.offsets
    if offsets[KARTS_X] < 0:
        return True
    for index in range(NEARBY):
        away = math.hypot(
            observation[offsets[KARTS_X] + index], observation[offsets[KARTS_Y] + index]
        )
        if away < lengths * cockpit.vehicle.length:
            return False
    return True


@large_kernel
def on_line(cockpit: Cockpit, x: float, y: float) -> tuple[float, float, float, float]:
    """Return where a point of the kart frame is: along the line and left of it [m].

    The last two numbers are the direction of the line there. Beyond its last sample the line goes
    on straight.
    """
    observation, offsets = cockpit.observation, cockpit.offsets
    nearest, best = 0, math.inf
    for index in range(AHEAD):
        dx, dy = x - observation[offsets[LINE_X] + index], y - observation[offsets[LINE_Y] + index]
        square = dx * dx + dy * dy
        if square < best:
            nearest, best = index, square
    first = min(nearest, AHEAD - 2)
    ux = observation[offsets[LINE_X] + first + 1] - observation[offsets[LINE_X] + first]
    uy = observation[offsets[LINE_Y] + first + 1] - observation[offsets[LINE_Y] + first]
    length = max(math.sqrt(ux * ux + uy * uy), 1e-6)
    ux, uy = ux / length, uy / length
    dx, dy = x - observation[offsets[LINE_X] + nearest], y - observation[offsets[LINE_Y] + nearest]
    return nearest * observation[offsets[STEP]] + dx * ux + dy * uy, dy * ux - dx * uy, ux, uy


@large_kernel
def leader(cockpit: Cockpit, lane: float, nose: float) -> tuple[float, float, float]:
    """Return the nearest kart ahead whose body lies in a lane `lane` [m] left of the line.

    nose: [m] that its middle must at least be ahead. Gap between the bodies [m], infinite if
    there is none; its speed along the line [m/s]; its offset [m].
    """
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    gap, pace, across = math.inf, 0.0, 0.0
    for index in range(NEARBY):
        x, y = observation[offsets[KARTS_X] + index], observation[offsets[KARTS_Y] + index]
        if x < NOWHERE - 1.0:
            along, offset, ux, uy = on_line(cockpit, x, y)
            space = along - vehicle.length
            if along > nose and space < gap:
                if abs(offset - lane) < 1.1 * vehicle.width:
                    gap, across = space, offset
                    pace = observation[offsets[KARTS_SPEED_X] + index] * ux
                    pace += observation[offsets[KARTS_SPEED_Y] + index] * uy
    return gap, pace, across


@kernel
def wait_in_line(cockpit: Cockpit) -> None:
    """Make a kart that stands behind another one wait longer before it backs out."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup, memory = cockpit.vehicle, cockpit.setup, cockpit.memory
    gap, _, _ = leader(cockpit, observation[offsets[OFFSET]], 0.3 * vehicle.length)
    if gap < vehicle.length:
        memory[STANDING] = max(memory[STANDING] - WAITING * setup[DECISION], 0.0)


@large_kernel
def is_free(cockpit: Cockpit, lane: float, reach: float) -> bool:
    """Return whether a lane is free beside the kart and as far ahead as `reach` [m]."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    for index in range(NEARBY):
        x, y = observation[offsets[KARTS_X] + index], observation[offsets[KARTS_Y] + index]
        if x < NOWHERE - 1.0:
            along, offset, ux, uy = on_line(cockpit, x, y)
            pace = (
                observation[offsets[KARTS_SPEED_X] + index] * ux
                + observation[offsets[KARTS_SPEED_Y] + index] * uy
            )
            # A faster kart from behind needs the lane as well.
            behind = 1.2 * vehicle.length + max(pace - observation[offsets[SPEED]], 0.0) * 0.5
            if -behind < along < reach and abs(offset - lane) < (ABREAST - 0.2) * vehicle.width:
                return False
    return True


@kernel
def room(cockpit: Cockpit, start: int, reach: float) -> float:
    """Return how far [m] the kart may move to one side as far ahead as `reach` [m].

    start: place of the part with that side's distances to the edge of the asphalt [m].
    """
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    last = int(reach / max(observation[offsets[STEP]], 0.01)) + ROOM_STEPS
    free = math.inf
    for index in range(min(last + 1, AHEAD)):
        free = min(free, observation[start + index])
    return max(free - EDGE * vehicle.width, 0.0)


@large_kernel
def lane_past(cockpit: Cockpit, across: float, apart: float, reach: float, now: float) -> float:
    """Return the lane [m] left of the line that passes something `across` [m] left of it.

    apart: [m] from its middle; reach: [m] along to it; now: the lane that is driven. The nearer
    one of both sides; NOWHERE if neither has room or is free.
    """
    offsets = cockpit.offsets
    best = NOWHERE
    for side in (1.0, -1.0):
        lane = across + side * apart
        # No further over than the line itself, if that already passes it.
        lane = max(lane, 0.0) if side > 0.0 else min(lane, 0.0)
        most = room(cockpit, offsets[LEFT] if side > 0.0 else offsets[RIGHT], reach)
        if side * lane <= most and is_free(cockpit, lane, reach):
            if abs(lane - now) < abs(best - now):
                best = lane
    return best


@large_kernel
def lane_past_hazards(cockpit: Cockpit, lane: float) -> float:
    """Return a lane [m] left of the line that goes round the nearest hazard in `lane`."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    nearest, across = math.inf, 0.0
    for index in range(THINGS):
        x, y = observation[offsets[HAZARDS_X] + index], observation[offsets[HAZARDS_Y] + index]
        if x < NOWHERE - 1.0:
            along, offset, _, _ = on_line(cockpit, x, y)
            ahead = 0.0 < along < observation[offsets[SPEED]] + 2.0 * vehicle.length
            if ahead and along < nearest and abs(offset - lane) < vehicle.width:
                nearest, across = along, offset
    if nearest == math.inf:
        return lane
    apart = CLEAR_OF_HAZARD * vehicle.width
    past = lane_past(cockpit, across, apart, nearest, lane)
    return lane if past == NOWHERE else past


@large_kernel
def lane_over_box(cockpit: Cockpit, lane: float) -> float:
    """Return the lane nearest to `lane` in which the kart drives over the next item box."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    nearest, across = math.inf, 0.0
    for index in range(THINGS):
        x, y = observation[offsets[BOXES_X] + index], observation[offsets[BOXES_Y] + index]
        if x < NOWHERE - 1.0:
            along, offset, _, _ = on_line(cockpit, x, y)
            is_near = 0.0 < along < AHEAD * observation[offsets[STEP]] and along < nearest
            # Only what a change of lanes still reaches.
            if (
                is_near
                and abs(offset - observation[offsets[OFFSET]]) < SLOPE * along + vehicle.width
            ):
                nearest, across = along, offset
    if nearest == math.inf:
        return lane
    reach = BOX_REACH * vehicle.width
    return min(max(lane, across - reach), across + reach)


@large_kernel
def move_over(cockpit: Cockpit, lane: float, wanted: float, step: float) -> float:
    """Return the lane [m] after one decision of `step` [s] on the way to another one.

    lane: present lane [m] left of the line; wanted: the other one [m]. Before the start it is where
    the kart stands. A kart does not move into one beside it; a lane that ends is left at once,
    unless another kart is there.
    """
    observation, offsets = cockpit.observation, cockpit.offsets
    if observation[offsets[LIGHTS]] > 0.0:
        return observation[offsets[OFFSET]]
    left = room(cockpit, offsets[LEFT], 0.0)
    right = room(cockpit, offsets[RIGHT], 0.0)
    side = 1.0 if wanted > lane else -1.0
    crowded = is_beside(cockpit, side)
    if crowded:
        wanted = min(max(lane, -right), left)
    most = SLOPE * max(observation[offsets[SPEED]], 1.0) * step
    lane += min(max(wanted - lane, -most), most)
    return lane if crowded else min(max(lane, -right), left)


@kernel
def is_beside(cockpit: Cockpit, side: float) -> bool:
    """Return whether a kart is so close on one side (1 left, -1 right) that there is no way."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    for index in range(NEARBY):
        x, y = observation[offsets[KARTS_X] + index], observation[offsets[KARTS_Y] + index]
        if abs(x) < 1.15 * vehicle.length and 0.0 < side * y < 1.6 * vehicle.width:
            return True
    return False
