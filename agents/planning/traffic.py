"""Others on the way, in coordinates of the reference line: along it, and to its left."""

import math

from race_agents.planning.tactics import KARTS_X, SPEED
from race_server.core.kernel_driver import DECISION, STANDING
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import AHEAD, NEARBY, PART_NUMBERS, THINGS
from race_server.core.state import Floats, Ints, Record

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


@large_kernel
def on_line(seen: Floats, at: Ints, x: float, y: float) -> tuple[float, float, float, float]:
    """Return where a point of the kart frame is: along the line and left of it [m].

    The last two numbers are the direction of the line there. Beyond what is seen of the line it
    goes on straight.
    """
    nearest, best = 0, math.inf
    for index in range(AHEAD):
        dx, dy = x - seen[at[LINE_X] + index], y - seen[at[LINE_Y] + index]
        square = dx * dx + dy * dy
        if square < best:
            nearest, best = index, square
    first = min(nearest, AHEAD - 2)
    ux = seen[at[LINE_X] + first + 1] - seen[at[LINE_X] + first]
    uy = seen[at[LINE_Y] + first + 1] - seen[at[LINE_Y] + first]
    length = max(math.sqrt(ux * ux + uy * uy), 1e-6)
    ux, uy = ux / length, uy / length
    dx, dy = x - seen[at[LINE_X] + nearest], y - seen[at[LINE_Y] + nearest]
    return nearest * seen[at[STEP]] + dx * ux + dy * uy, dy * ux - dx * uy, ux, uy


@large_kernel
def leader(
    seen: Floats, at: Ints, vehicle: Record, lane: float, nose: float
) -> tuple[float, float, float]:
    """Return the nearest kart ahead whose body lies in a lane `lane` [m] left of the line.

    nose: [m] that its middle must at least be ahead. Gap between the bodies [m], infinite if
    there is none; its speed along the line [m/s]; its offset [m].
    """
    gap, pace, across = math.inf, 0.0, 0.0
    for index in range(NEARBY):
        x, y = seen[at[KARTS_X] + index], seen[at[KARTS_Y] + index]
        if x < NOWHERE - 1.0:
            along, offset, ux, uy = on_line(seen, at, x, y)
            space = along - vehicle.length
            if along > nose and space < gap:
                if abs(offset - lane) < 1.1 * vehicle.width:
                    gap, across = space, offset
                    pace = seen[at[KARTS_SPEED_X] + index] * ux
                    pace += seen[at[KARTS_SPEED_Y] + index] * uy
    return gap, pace, across


@kernel
def wait_in_line(seen: Floats, at: Ints, vehicle: Record, gear: Floats, memory: Floats) -> None:
    """Let a kart that stands behind another one wait longer before it backs out."""
    gap, _, _ = leader(seen, at, vehicle, seen[at[OFFSET]], 0.3 * vehicle.length)
    if gap < vehicle.length:
        memory[STANDING] = max(memory[STANDING] - WAITING * gear[DECISION], 0.0)


@large_kernel
def is_free(seen: Floats, at: Ints, vehicle: Record, lane: float, reach: float) -> bool:
    """Return whether a lane is free beside the kart and as far ahead as `reach` [m]."""
    for index in range(NEARBY):
        x, y = seen[at[KARTS_X] + index], seen[at[KARTS_Y] + index]
        if x < NOWHERE - 1.0:
            along, offset, ux, uy = on_line(seen, at, x, y)
            pace = seen[at[KARTS_SPEED_X] + index] * ux + seen[at[KARTS_SPEED_Y] + index] * uy
            # Who comes from behind and is faster needs the lane as well.
            behind = 1.2 * vehicle.length + max(pace - seen[at[SPEED]], 0.0) * 0.5
            if -behind < along < reach and abs(offset - lane) < (ABREAST - 0.2) * vehicle.width:
                return False
    return True


@kernel
def room(seen: Floats, at: Ints, vehicle: Record, start: int, reach: float) -> float:
    """Return how far [m] the kart may move to one side as far ahead as `reach` [m].

    start: of the part that tells of that side's asphalt.
    """
    last = int(reach / max(seen[at[STEP]], 0.01)) + ROOM_STEPS
    free = math.inf
    for index in range(min(last + 1, AHEAD)):
        free = min(free, seen[start + index])
    return max(free - EDGE * vehicle.width, 0.0)


@large_kernel
def lane_past(
    seen: Floats, at: Ints, vehicle: Record, across: float, apart: float, reach: float, now: float
) -> float:
    """Return the lane [m] left of the line that passes something `across` [m] left of it.

    apart: [m] from its middle; reach: [m] along to it; now: the lane that is driven. The nearer
    one of both sides; NOWHERE if neither has room or is free.
    """
    best = NOWHERE
    for side in (1.0, -1.0):
        lane = across + side * apart
        # No further over than the line itself, if that already passes it.
        lane = max(lane, 0.0) if side > 0.0 else min(lane, 0.0)
        most = room(seen, at, vehicle, at[LEFT] if side > 0.0 else at[RIGHT], reach)
        if side * lane <= most and is_free(seen, at, vehicle, lane, reach):
            if abs(lane - now) < abs(best - now):
                best = lane
    return best


@large_kernel
def lane_past_hazards(seen: Floats, at: Ints, vehicle: Record, lane: float) -> float:
    """Return a lane [m] left of the line that goes round the nearest hazard in `lane`."""
    nearest, across = math.inf, 0.0
    for index in range(THINGS):
        x, y = seen[at[HAZARDS_X] + index], seen[at[HAZARDS_Y] + index]
        if x < NOWHERE - 1.0:
            along, offset, _, _ = on_line(seen, at, x, y)
            ahead = 0.0 < along < seen[at[SPEED]] + 2.0 * vehicle.length
            if ahead and along < nearest and abs(offset - lane) < vehicle.width:
                nearest, across = along, offset
    if nearest == math.inf:
        return lane
    apart = CLEAR_OF_HAZARD * vehicle.width
    past = lane_past(seen, at, vehicle, across, apart, nearest, lane)
    return lane if past == NOWHERE else past


@large_kernel
def lane_over_box(seen: Floats, at: Ints, vehicle: Record, lane: float) -> float:
    """Return the lane nearest to `lane` in which the kart drives over the next item box."""
    nearest, across = math.inf, 0.0
    for index in range(THINGS):
        x, y = seen[at[BOXES_X] + index], seen[at[BOXES_Y] + index]
        if x < NOWHERE - 1.0:
            along, offset, _, _ = on_line(seen, at, x, y)
            is_near = 0.0 < along < AHEAD * seen[at[STEP]] and along < nearest
            # Only what a change of lanes still reaches.
            if is_near and abs(offset - seen[at[OFFSET]]) < SLOPE * along + vehicle.width:
                nearest, across = along, offset
    if nearest == math.inf:
        return lane
    reach = BOX_REACH * vehicle.width
    return min(max(lane, across - reach), across + reach)


@large_kernel
def move_over(
    seen: Floats, at: Ints, vehicle: Record, lane: float, wanted: float, step: float
) -> float:
    """Return the lane [m] after one decision of `step` [s] on the way to another one.

    Before the start it is where the kart stands. Nobody moves into a kart beside it; a lane that
    ends is left at once, unless somebody is there.
    """
    if seen[at[LIGHTS]] > 0.0:
        return seen[at[OFFSET]]
    left = room(seen, at, vehicle, at[LEFT], 0.0)
    right = room(seen, at, vehicle, at[RIGHT], 0.0)
    side = 1.0 if wanted > lane else -1.0
    crowded = is_beside(seen, at, vehicle, side)
    if crowded:
        wanted = min(max(lane, -right), left)
    most = SLOPE * max(seen[at[SPEED]], 1.0) * step
    lane += min(max(wanted - lane, -most), most)
    return lane if crowded else min(max(lane, -right), left)


@kernel
def is_beside(seen: Floats, at: Ints, vehicle: Record, side: float) -> bool:
    """Return whether a kart is so close on one side (1 left, -1 right) that there is no way."""
    for index in range(NEARBY):
        x, y = seen[at[KARTS_X] + index], seen[at[KARTS_Y] + index]
        if abs(x) < 1.15 * vehicle.length and 0.0 < side * y < 1.6 * vehicle.width:
            return True
    return False
