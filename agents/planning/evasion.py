"""Steers round, brakes or goes back where a command would soon touch something.

What a command does is looked at a second ahead, the body on its circle: what the scan shows stands,
and people and vehicles go on as they were seen to. Where the body would come too near, other
commands are compared in the same way, as in the dynamic window of Fox, Burgard and Thrun (1997):
steered otherwise, braked, back, and ahead at once. The one that lacks least room is given, and of
those that lack none the one most like the first. A vehicle that stands for long, because all is
shut or because a policy does nothing, goes a little way where there is most room.
"""

import math

from race_agents.planning.gap_way import MOUNT
from race_agents.planning.scan import ray_angle
from race_server.core.kernel_driver import (
    DECISION,
    ESCAPE,
    FIELD,
    KEPT,
    REACH,
    REVERSING,
    STANDING,
    Cockpit,
    Cockpits,
    cockpit_at,
)
from race_server.core.kernels.geometry import distance_to_box
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.motion import Command
from race_server.core.observation import PART_NUMBERS
from race_server.core.observation_parts import MOVERS

# What a policy that evades has to see.
SEES = (
    *("speed", "lidar", "lights", "finished", "goal_x", "goal_distance", "parked_for"),
    *("movers_x", "movers_y", "movers_speed_x", "movers_speed_y", "movers_age", "movers_radius"),
)
SPEED, LIDAR, LIGHTS, FINISHED, GOAL_X, GOAL_DISTANCE, PARKED_FOR = (
    PART_NUMBERS[name] for name in SEES[:7]
)
MOVERS_X, MOVERS_Y, MOVERS_SPEED_X, MOVERS_SPEED_Y, MOVERS_AGE, MOVERS_RADIUS = (
    PART_NUMBERS[name] for name in SEES[7:]
)
# The next second, in steps of this [s].
STEPS, STEP_S = 5, 0.2
# Room to leave [m] to what moves, and to what stands.
APART, CLEAR = 0.5, 0.1
# What moves and was not met by a ray for longer [s] may be anywhere. What is wider [m] than a
# person is as long as the vehicle itself, along its motion if it is faster than this [m/s].
LATEST, PERSON, MOVES = 2.0, 0.45, 0.2
# Points of a scan are looked at up to this range [m], about this number of them at most.
FAR, POINTS = 5.0, 50
# Share of the brakes that is reckoned with, and the time until they act [s].
BRAKE_SHARE, LAG_S = 0.55, 0.1
# What it costs [m of room]: to steer otherwise, for the whole steering; to brake; to drive off.
STEER_COST, BRAKE_COST, PEDAL_COST = 0.05, 0.05, 0.15
TURNS, TURN = 7, 0.35  # commands of the steering that are compared, and what lies between two
EASE = 0.4  # of the brakes, where that is enough
# A vehicle slower than this [m/s] stands. After a time [s] it goes, for another [s].
STANDS_BELOW, PATIENCE, GOES_S = 0.08, 0.6, 1.0
# With this pedal and steering, and less pedal where its slot is nearer than this [m].
PEDAL, WHEEL, SLOT_PEDAL, BY_SLOT = 0.5, 0.7, 0.25, 1.5
# To go towards the slot is worth so much room [m]; more room than this [m] is no gain. It may lack
# so much more room [m] to what moves than where it stands.
TOWARDS, ENOUGH, LITTLE = 0.2, 0.5, 0.03


@kernel
def evade_all(cockpits: Cockpits) -> None:
    """Change the commands of many vehicles that would soon touch something."""
    for row in range(len(cockpits.seats)):
        evade(cockpit_at(cockpits, row))


@kernel
def evade(cockpit: Cockpit) -> None:
    """Change the command of a vehicle that would soon touch something."""
    seen, offsets = cockpit.observation, cockpit.offsets
    control, memory, passed = cockpit.control, cockpit.memory, cockpit.setup[DECISION]
    if seen[offsets[LIGHTS]] > 0.0 or seen[offsets[FINISHED]] > 0.0:
        return
    points = note_points(cockpit)
    wanted = Command(control[0], control[1], control[2])
    stood = abs(seen[offsets[SPEED]]) < STANDS_BELOW and seen[offsets[PARKED_FOR]] <= 0.0
    memory[STANDING] = memory[STANDING] + passed if stood else 0.0
    if memory[STANDING] > PATIENCE:
        choose_escape(cockpit, points)
    if memory[REVERSING] != 0.0:
        pedal = SLOT_PEDAL if seen[offsets[GOAL_DISTANCE]] < BY_SLOT else PEDAL
        escape = Command(memory[ESCAPE], math.copysign(pedal, -memory[REVERSING]), 0.0)
        left = max(abs(memory[REVERSING]) - passed, 0.0)
        memory[REVERSING] = math.copysign(left, memory[REVERSING]) if left > 1e-9 else 0.0
        if lack(cockpit, points, escape) <= lack_now(cockpit, points):
            give(cockpit, escape)
            return
        memory[REVERSING] = 0.0
    if lack(cockpit, points, wanted) > 0.0:
        give(cockpit, best_command(cockpit, points, wanted))


@kernel
def give(cockpit: Cockpit, command: Command) -> None:
    """Write a command into the controls."""
    control = cockpit.control
    control[0], control[1], control[2] = command.steering, command.throttle, command.brake


@kernel
def note_points(cockpit: Cockpit) -> int:
    """Write x, y [m] of the points of a scan that are near; return how many."""
    seen, offsets, memory = cockpit.observation, cockpit.offsets, cockpit.memory
    rays, far = offsets[-1], min(FAR, 0.98 * cockpit.setup[REACH])
    found = 0
    for ray in range(0, rays, max(rays // POINTS, 1)):
        away = seen[offsets[LIDAR] + ray]
        if 0.0 < away < far:
            angle = ray_angle(ray, rays, cockpit.setup[FIELD])
            memory[KEPT + 2 * found] = MOUNT + away * math.cos(angle)
            memory[KEPT + 2 * found + 1] = away * math.sin(angle)
            found += 1
    return found


@kernel
def best_command(cockpit: Cockpit, points: int, wanted: Command) -> Command:
    """Return the command that lacks least room, at the least cost."""
    best, least = wanted, math.inf
    for pedals in range(5):
        throttle, brake, cost = wanted.throttle, wanted.brake, 0.0
        if pedals == 1:
            throttle, brake, cost = 0.0, max(wanted.brake, EASE), 0.5 * BRAKE_COST
        elif pedals == 2:
            throttle, brake, cost = 0.0, 1.0, BRAKE_COST
        elif pedals > 2:
            throttle, brake, cost = -1.0 if pedals == 3 else 1.0, 0.0, PEDAL_COST
        for turn in range(TURNS):
            aside = TURN * (turn - TURNS // 2)
            steering = wanted.steering + aside
            if abs(steering) > 1.0:
                continue
            command = Command(steering, throttle, brake)
            total = lack(cockpit, points, command) + cost + STEER_COST * abs(aside)
            if total < least - 1e-6:
                best, least = command, total
    return best


@kernel
def choose_escape(cockpit: Cockpit, points: int) -> None:
    """Set out to where there is most room, and rather towards the slot."""
    memory, best = cockpit.memory, -math.inf
    to_slot = cockpit.observation[cockpit.offsets[GOAL_X]]
    for pedal in (1.0, -1.0):
        for wheel in (-WHEEL, 0.0, WHEEL):
            moving, standing = rooms(cockpit, points, Command(wheel, pedal * PEDAL, 0.0), STEPS)
            gain = min(moving, ENOUGH) + min(standing, ENOUGH)
            gain += TOWARDS if pedal * to_slot > 0.0 else 0.0
            if gain > best:
                best, memory[ESCAPE], memory[REVERSING] = gain, wheel, -pedal * GOES_S
    memory[STANDING] = 0.0


@kernel
def lack(cockpit: Cockpit, points: int, command: Command) -> float:
    """Return how much room [m] a command lacks in the next second; 0: none."""
    moving, standing = rooms(cockpit, points, command, STEPS)
    return max(APART - moving, 0.0) + max(CLEAR - standing, 0.0)


@kernel
def lack_now(cockpit: Cockpit, points: int) -> float:
    """Return how much room [m] a vehicle lacks where it stands, and a little more."""
    moving, standing = rooms(cockpit, points, Command(0.0, 0.0, 1.0), 1)
    return max(APART - moving, LITTLE) + max(CLEAR - standing, 0.0)


@kernel
def rooms(cockpit: Cockpit, points: int, command: Command, steps: int) -> tuple[float, float]:
    """Return the least room [m] that a command leaves to what moves, and to what stands."""
    vehicle, memory = cockpit.vehicle, cockpit.memory
    bend = math.tan(command.steering * vehicle.steering_limit) / (
        vehicle.front_axle + vehicle.rear_axle
    )
    long, wide = 0.5 * vehicle.length, 0.5 * vehicle.width
    middle = vehicle.rear_axle + vehicle.box_offset
    speed = cockpit.observation[cockpit.offsets[SPEED]]
    moving = standing = FAR
    x, y, heading = -vehicle.rear_axle, 0.0, 0.0
    for step in range(steps):
        speed = speed_after(cockpit, command, speed, step)
        turn = 0.5 * STEP_S * speed * bend
        heading += turn
        x, y = x + STEP_S * speed * math.cos(heading), y + STEP_S * speed * math.sin(heading)
        heading += turn
        cos, sin = math.cos(heading), math.sin(heading)
        at_x, at_y = x + middle * cos, y + middle * sin
        for place in range(MOVERS):
            ahead, aside, radius = mover_from(cockpit, place, at_x, at_y, (step + 1) * STEP_S)
            away = distance_to_box(ahead, aside, cos, sin, long, wide)
            moving = min(moving, away - radius)
        for point in range(points):
            dx, dy = memory[KEPT + 2 * point] - at_x, memory[KEPT + 2 * point + 1] - at_y
            standing = min(standing, distance_to_box(dx, dy, cos, sin, long, wide))
    return moving, standing


@kernel
def speed_after(cockpit: Cockpit, command: Command, speed: float, step: int) -> float:
    """Return the speed [m/s] after one more step of a command, of which `step` have passed."""
    vehicle = cockpit.vehicle
    if command.brake > 0.05:
        taken = BRAKE_SHARE * command.brake * vehicle.brake_force / vehicle.mass
        taken *= STEP_S - LAG_S if step == 0 else STEP_S
        return math.copysign(max(abs(speed) - taken, 0.0), speed)
    speed += STEP_S * command.throttle * vehicle.motor_force / vehicle.mass
    return min(max(speed, -vehicle.reverse_speed), vehicle.top_speed)


@kernel
def mover_from(
    cockpit: Cockpit, place: int, x: float, y: float, later: float
) -> tuple[float, float, float]:
    """Return where something that moves is from a point, x, y [m], and its radius [m], later [s].

    That is the nearest point of what is as long as a vehicle.
    """
    seen, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    radius = seen[offsets[MOVERS_RADIUS] + place]
    if radius <= 0.0 or seen[offsets[MOVERS_AGE] + place] > LATEST:
        return 2.0 * FAR, 2.0 * FAR, 0.0
    speed_x = seen[offsets[MOVERS_SPEED_X] + place]
    speed_y = seen[offsets[MOVERS_SPEED_Y] + place]
    ahead = seen[offsets[MOVERS_X] + place] + speed_x * later - x
    aside = seen[offsets[MOVERS_Y] + place] + speed_y * later - y
    speed = math.sqrt(speed_x * speed_x + speed_y * speed_y)
    if radius > PERSON and speed > MOVES:
        along = -(ahead * speed_x + aside * speed_y) / speed
        half = 0.5 * (vehicle.length - vehicle.width)
        along = min(max(along, -half), half)
        ahead, aside = ahead + along * speed_x / speed, aside + along * speed_y / speed
    return ahead, aside, radius
