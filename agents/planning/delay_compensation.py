"""What a kart will see when its next command acts, where commands act late.

The driver knows its vehicle and what it commanded: the state is rolled on over the latency with
the model of motion that the world has as well, in coordinates of the reference line, and what is
seen is written down anew from there. Whoever decides by that need not know of the delay.
"""

import math

from race_agents.planning.latency import (
    COMMAND,
    COMMANDS,
    LATENCY,
    STEERING,
    THIRDS,
    age_at,
    estimate_latency,
)
from race_agents.planning.tactics import KARTS_X, LIGHTS, SPEED
from race_agents.planning.tracking import (
    CURVATURE,
    GRIP_SCALE,
    HEADING,
    LATERAL_SPEED,
    LINE_SPEED,
    OFFSET,
    SPEED_CAP,
    STEP,
    THRUST_SCALE,
    YAW_RATE,
    at_distance,
)
from race_agents.planning.traffic import (
    HAZARDS_X,
    HAZARDS_Y,
    KARTS_SPEED_X,
    KARTS_SPEED_Y,
    KARTS_Y,
    LEFT,
    LINE_X,
    LINE_Y,
    NOWHERE,
    RIGHT,
)
from race_server.core.kernel_driver import DECISION
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.motion import Allowance, Command, Motion, move
from race_server.core.observation import AHEAD, NEARBY, THINGS
from race_server.core.state import Floats, Ints, Record

# Steps of the model in a third of a decision: as fine as the world's own.
FINE = 2


@large_kernel
def look_ahead(seen: Floats, at: Ints, vehicle: Record, gear: Floats, memory: Floats) -> None:
    """Turn what is seen now into what will be seen when the command that is due acts."""
    estimate_latency(seen, at, vehicle, gear, memory)
    delay = int(memory[LATENCY])
    if delay == 0 or seen[at[LIGHTS]] > 0.0:
        return
    x, y, heading, along = roll_on(seen, at, vehicle, gear, memory, delay)
    follow_line(seen, at, along, x, y, heading)
    late_s = delay * gear[DECISION] / THIRDS
    cos, sin = math.cos(heading), math.sin(heading)
    for index in range(NEARBY):
        px, py = at[KARTS_X] + index, at[KARTS_Y] + index
        vx, vy = at[KARTS_SPEED_X] + index, at[KARTS_SPEED_Y] + index
        if seen[px] < NOWHERE - 1.0:
            seen[px] += late_s * seen[vx] - x
            seen[py] += late_s * seen[vy] - y
            turn_point(seen, px, py, cos, sin)
            turn_point(seen, vx, vy, cos, sin)
    for index in range(THINGS):
        px, py = at[HAZARDS_X] + index, at[HAZARDS_Y] + index
        if seen[px] < NOWHERE - 1.0:
            seen[px] -= x
            seen[py] -= y
            turn_point(seen, px, py, cos, sin)


@kernel
def turn_point(seen: Floats, px: int, py: int, cos: float, sin: float) -> None:
    """Turn the point at two places of what is seen into a frame that is itself turned."""
    x, y = seen[px], seen[py]
    seen[px], seen[py] = x * cos + y * sin, y * cos - x * sin


@large_kernel
def roll_on(
    seen: Floats, at: Ints, vehicle: Record, gear: Floats, memory: Floats, delay: int
) -> tuple[float, float, float, float]:
    """Move the kart that is seen on by `delay` thirds of a decision, under commands given before.

    Return where it will be in the frame that it has now, x, y [m] and heading [rad], and how far
    along the line [m].
    """
    # The newest command was given one decision ago.
    step_s = gear[DECISION] / (THIRDS * FINE)
    speed, sliding = seen[at[SPEED]], seen[at[LATERAL_SPEED]]
    motion = Motion(0.0, 0.0, 0.0, speed, sliding, seen[at[YAW_RATE]], seen[at[STEERING]])
    caps, scales = seen[at[SPEED_CAP]], seen[at[THRUST_SCALE]]
    allowance = Allowance(caps, scales, seen[at[GRIP_SCALE]], 0.0)
    offset, bearing = seen[at[OFFSET]], seen[at[HEADING]]
    along = 0.0
    for step in range(delay * FINE):
        place = COMMANDS + COMMAND * age_at(THIRDS + step // FINE, delay)
        command = Command(memory[place], memory[place + 1], memory[place + 2])
        motion = move(vehicle, motion, command, allowance, step_s)
        speed, sliding = motion.speed, motion.lateral_speed
        bend = at_distance(seen, at[CURVATURE], along / max(seen[at[STEP]], 0.01))
        cos, sin = math.cos(bearing), math.sin(bearing)
        forward = (speed * cos - sliding * sin) / max(1.0 - offset * bend, 0.3)
        offset += step_s * (speed * sin + sliding * cos)
        bearing += step_s * (motion.yaw_rate - bend * forward)
        along += step_s * forward
    seen[at[SPEED]], seen[at[LATERAL_SPEED]] = speed, sliding
    seen[at[YAW_RATE]], seen[at[STEERING]] = motion.yaw_rate, motion.steering
    seen[at[OFFSET]], seen[at[HEADING]] = offset, bearing
    return motion.x, motion.y, motion.heading, along


@large_kernel
def follow_line(seen: Floats, at: Ints, along: float, x: float, y: float, heading: float) -> None:
    """Let what is seen of the line begin `along` [m] further on, in the frame of a later pose.

    Beyond the last sample the line goes on straight, as wide and as fast as there.
    """
    shift = max(along / max(seen[at[STEP]], 0.01), 0.0)
    cos, sin = math.cos(heading), math.sin(heading)
    last = AHEAD - 1
    ux = seen[at[LINE_X] + last] - seen[at[LINE_X] + last - 1]
    uy = seen[at[LINE_Y] + last] - seen[at[LINE_Y] + last - 1]
    for index in range(AHEAD):
        place = index + shift
        px, py = at[LINE_X] + index, at[LINE_Y] + index
        beyond = max(place - last, 0.0)
        seen[px] = at_distance(seen, at[LINE_X], place) + beyond * ux - x
        seen[py] = at_distance(seen, at[LINE_Y], place) + beyond * uy - y
        turn_point(seen, px, py, cos, sin)
        seen[at[CURVATURE] + index] = at_distance(seen, at[CURVATURE], place)
        seen[at[LINE_SPEED] + index] = at_distance(seen, at[LINE_SPEED], place)
        seen[at[LEFT] + index] = at_distance(seen, at[LEFT], place)
        seen[at[RIGHT] + index] = at_distance(seen, at[RIGHT], place)
