"""Predict the observation at the time when the next command acts, where commands act late.

The driver knows its vehicle and its commands: it integrates the state over the latency with the
world's model of motion, in coordinates of the reference line, and replaces the observation by the
one expected there. The decision that follows need not know of the latency.
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
    steering_play,
)
from race_agents.planning.tactics import KARTS_X, LIGHTS, SPEED, STANDSTILL
from race_agents.planning.tracking import (
    CURVATURE,
    HEADING,
    LINE_SPEED,
    OFFSET,
    SPEED_CAP,
    STEP,
    THRUST_SCALE,
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
from race_agents.planning.tyre_slip import GRIP_SCALE, LATERAL_SPEED, YAW_RATE
from race_server.core.kernel_driver import DECISION, Cockpit
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.motion import Allowance, Command, Motion, move
from race_server.core.kernels.trailers import turning_of
from race_server.core.observation import AHEAD, NEARBY, THINGS
from race_server.core.state import Floats

# Steps of the model in a third of a decision: as fine as the world's own.
FINE = 2


@large_kernel
def look_ahead(cockpit: Cockpit) -> None:
    """Replace the observation by the one expected when the next command acts."""
    observation, offsets = cockpit.observation, cockpit.offsets
    setup, memory = cockpit.setup, cockpit.memory
    estimate_latency(cockpit)
    delay = int(memory[LATENCY])
    if delay == 0 or observation[offsets[LIGHTS]] > 0.0:
        return
    if abs(observation[offsets[SPEED]]) < STANDSTILL:
        return  # it may stand at a wall, of which the model has none
    x, y, heading, along = roll_on(cockpit, delay)
    follow_line(cockpit, along, x, y, heading)
    late_s = delay * setup[DECISION] / THIRDS
    cos, sin = math.cos(heading), math.sin(heading)
    for index in range(NEARBY):
        px, py = offsets[KARTS_X] + index, offsets[KARTS_Y] + index
        vx, vy = offsets[KARTS_SPEED_X] + index, offsets[KARTS_SPEED_Y] + index
        if observation[px] < NOWHERE - 1.0:
            observation[px] += late_s * observation[vx] - x
            observation[py] += late_s * observation[vy] - y
            turn_point(observation, px, py, cos, sin)
            turn_point(observation, vx, vy, cos, sin)
    for index in range(THINGS):
        px, py = offsets[HAZARDS_X] + index, offsets[HAZARDS_Y] + index
        if observation[px] < NOWHERE - 1.0:
            observation[px] -= x
            observation[py] -= y
            turn_point(observation, px, py, cos, sin)


@kernel
def turn_point(observation: Floats, px: int, py: int, cos: float, sin: float) -> None:
    """Convert a vector of the observation into a frame that is turned to the left.

    observation: (size,), changed in place; px, py: places of x and y in it, [m] or [m/s]; cos, sin:
    of the angle by which the frame is turned.
    """
    x, y = observation[px], observation[py]
    observation[px], observation[py] = x * cos + y * sin, y * cos - x * sin


@kernel
def command_at(memory: Floats, step: int, delay: int) -> Command:
    """Return the command that acts in a step of the model, of those given before.

    memory: (M,) of the driver; delay: [thirds of a decision] from a command to its effect.
    """
    # The newest command was given one decision ago.
    place = COMMANDS + COMMAND * age_at(THIRDS + step // FINE, delay)
    return Command(memory[place], memory[place + 1], memory[place + 2])


@kernel
def felt_at(cockpit: Cockpit, steering: float, step: int, delay: int) -> Command:
    """Return the command of `command_at` as wheels with play follow it.

    steering: angle of the wheels before [rad].
    """
    limit, memory = cockpit.vehicle.steering_limit, cockpit.memory
    command, play = command_at(memory, step, delay), steering_play(memory) / limit
    felt = min(max(steering / limit, command.steering - play), command.steering + play)
    return Command(felt, command.throttle, command.brake)


@large_kernel
def move_on(cockpit: Cockpit, motion: Motion, delay: int) -> Motion:
    """Return the motion after `delay` thirds of a decision, under the commands given before."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup = cockpit.vehicle, cockpit.setup
    cap, thrust = observation[offsets[SPEED_CAP]], observation[offsets[THRUST_SCALE]]
    allowance = Allowance(cap, thrust, observation[offsets[GRIP_SCALE]], 0.0)
    step_s = setup[DECISION] / (THIRDS * FINE)
    for step in range(delay * FINE):
        motion = move(
            vehicle, motion, felt_at(cockpit, motion.steering, step, delay), allowance, step_s
        )
    return motion


@large_kernel
def angle_later(cockpit: Cockpit, motion: Motion, angle: float, delay: int) -> float:
    """Return the angle at the hitch [rad] of the first trailer at the end of `move_on`.

    angle: at the start of it [rad].
    """
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup = cockpit.vehicle, cockpit.setup
    cap, thrust = observation[offsets[SPEED_CAP]], observation[offsets[THRUST_SCALE]]
    allowance = Allowance(cap, thrust, observation[offsets[GRIP_SCALE]], 0.0)
    step_s = setup[DECISION] / (THIRDS * FINE)
    drawn = vehicle.trailers[0]
    for step in range(delay * FINE):
        motion = move(
            vehicle, motion, felt_at(cockpit, motion.steering, step, delay), allowance, step_s
        )
        across = motion.lateral_speed - (vehicle.rear_axle + drawn.hitch) * motion.yaw_rate
        turning = turning_of(motion.speed, across, angle, drawn.bar)
        half = angle + 0.5 * step_s * (motion.yaw_rate - turning)
        turning = turning_of(motion.speed, across, half, drawn.bar)
        angle += step_s * (motion.yaw_rate - turning)
    return angle


@large_kernel
def roll_on(cockpit: Cockpit, delay: int) -> tuple[float, float, float, float]:
    """Move the observed kart on by `delay` thirds of a decision, under the commands given before.

    Return its later pose in its present frame, x, y [m] and heading [rad], and its way along the
    line [m].
    """
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup = cockpit.vehicle, cockpit.setup
    step_s = setup[DECISION] / (THIRDS * FINE)
    speed, sliding = observation[offsets[SPEED]], observation[offsets[LATERAL_SPEED]]
    turning, steering = observation[offsets[YAW_RATE]], observation[offsets[STEERING]]
    motion = Motion(0.0, 0.0, 0.0, speed, sliding, turning, steering)
    cap, thrust = observation[offsets[SPEED_CAP]], observation[offsets[THRUST_SCALE]]
    allowance = Allowance(cap, thrust, observation[offsets[GRIP_SCALE]], 0.0)
    offset, bearing = observation[offsets[OFFSET]], observation[offsets[HEADING]]
    along = 0.0
    for step in range(delay * FINE):
        motion = move(
            vehicle, motion, felt_at(cockpit, motion.steering, step, delay), allowance, step_s
        )
        speed, sliding = motion.speed, motion.lateral_speed
        bend = at_distance(
            observation, offsets[CURVATURE], along / max(observation[offsets[STEP]], 0.01)
        )
        cos, sin = math.cos(bearing), math.sin(bearing)
        forward = (speed * cos - sliding * sin) / max(1.0 - offset * bend, 0.3)
        offset += step_s * (speed * sin + sliding * cos)
        bearing += step_s * (motion.yaw_rate - bend * forward)
        along += step_s * forward
    observation[offsets[SPEED]], observation[offsets[LATERAL_SPEED]] = speed, sliding
    observation[offsets[YAW_RATE]] = motion.yaw_rate
    observation[offsets[STEERING]] = motion.steering
    observation[offsets[OFFSET]], observation[offsets[HEADING]] = offset, bearing
    return motion.x, motion.y, motion.heading, along


@large_kernel
def follow_line(cockpit: Cockpit, along: float, x: float, y: float, heading: float) -> None:
    """Replace the observed line by the one that begins `along` [m] further on.

    cockpit: its observation is changed in place; x, y [m], heading [rad]: pose of the later frame
    in the present one. Beyond the last sample the line goes on straight, as wide and as fast as
    there.
    """
    observation, offsets = cockpit.observation, cockpit.offsets
    shift = max(along / max(observation[offsets[STEP]], 0.01), 0.0)
    cos, sin = math.cos(heading), math.sin(heading)
    last = AHEAD - 1
    ux = observation[offsets[LINE_X] + last] - observation[offsets[LINE_X] + last - 1]
    uy = observation[offsets[LINE_Y] + last] - observation[offsets[LINE_Y] + last - 1]
    for index in range(AHEAD):
        place = index + shift
        px, py = offsets[LINE_X] + index, offsets[LINE_Y] + index
        beyond = max(place - last, 0.0)
        observation[px] = at_distance(observation, offsets[LINE_X], place) + beyond * ux - x
        observation[py] = at_distance(observation, offsets[LINE_Y], place) + beyond * uy - y
        turn_point(observation, px, py, cos, sin)
        observation[offsets[CURVATURE] + index] = at_distance(
            observation, offsets[CURVATURE], place
        )
        observation[offsets[LINE_SPEED] + index] = at_distance(
            observation, offsets[LINE_SPEED], place
        )
        observation[offsets[LEFT] + index] = at_distance(observation, offsets[LEFT], place)
        observation[offsets[RIGHT] + index] = at_distance(observation, offsets[RIGHT], place)
