"""Tentacles as the report of the 1/10 race tuned them: the longest of 81 arcs wins.

After report B (Paris-Saclay 1/10 race), which simplifies von Hundelshausen et al., Driving with
Tentacles, 2008 (`agents/drivers/tentacles.py`). Each speed class has 81 arcs, from hard left to
hard right, of 20 points each in polar form about the lidar. An arc ends before its first point
beyond the lidar's range in that direction; the longest wins. Then the three neighbours on either
side are compared, and the choice moves away from the shorter side: this stands for the car's width.

Where the report is silent, this is ours:

- The largest angle of the slowest class, which the report does not print: a / R_min, so that the
  sharpest arc is just what the car can steer. With its a of 3.2 m and R_min of 0.70 m: 4.57 rad.
- The growth of the radii from arc to arc. With the paper's 1.15 half of the arcs have radii above
  ten metres, nearly straight at this scale, and three neighbours span next to nothing there.
- "One speed class only in the final race": the slowest, the only one with arcs for every bend.
- Ranges count two body widths less than they are: so far ahead an arc has to leave a wall alone.
- Report lengths are those of a car of 0.45 m; others have them in proportion.
- The report decides ten times a second, here twenty times with the newest scan. It computes its
  arcs beforehand, which gives the same numbers.
"""

import math

from race_agents.drivers.tentacle_search import grown
from race_agents.planning.scan import fill_dropouts, nearest
from race_agents.planning.tactics import LIGHTS, SPEED, finish_decision, press_pedals
from race_server.core.kernel_driver import (
    ESCAPE,
    FIELD,
    KEPT,
    REACH,
    REVERSING,
    SHIFT,
    Cockpit,
    Cockpits,
    KernelDriver,
    cockpit_at,
)
from race_server.core.kernels.jit import kernel
from race_server.core.observation import PART_NUMBERS
from race_server.core.state import Floats
from race_server.core.vehicle_presets import TENTH

LIDAR = PART_NUMBERS["lidar"]
LIDAR_BEFORE = PART_NUMBERS["lidar_before"]

CLASSES, ARCS, POINTS = 15, 81, 20
STRAIGHT = ARCS // 2
FINAL_CLASS = 0
# The report's constants; lengths in metres for a body of REPORT_LENGTH.
A, B, C, D, E = 3.2, 6.7, 1.2, 0.9, 2.7
REPORT_LENGTH = 0.45
GROWTH = 1.025  # of the radius from one arc to the next, the report's rho

STAND_OFF = 2.0  # body widths
NEIGHBOURS = 3
SHORTER = 0.12  # body lengths by which a side has to be shorter, on average
MOST_MOVES = 10

FRONT = math.radians(7.0)
# Speeds [body lengths/s] between which it grows while the front opens and falls while it closes.
SLOWEST, FASTEST = 4.4, 6.2
OPENING, CLOSING = 0.22, 0.11  # [body lengths/s] a decision
BLOCKED = 0.8  # body lengths in front of the lidar
REVERSE_S = 1.5  # the report reverses for one to two seconds


@kernel
def class_length(speed_class: int, scale: float) -> float:
    """Return the length l = a + b q^c [m] that the arcs of a class start from."""
    q = speed_class / (CLASSES - 1)
    return scale * (A + B * q**C)


@kernel
def class_radius(speed_class: int, scale: float, turning_radius: float) -> float:
    """Return the radius R_j [m] of a class's sharpest arc; the last class is straight."""
    if speed_class >= CLASSES - 1:
        return math.inf
    widest = scale * A / turning_radius
    q = speed_class / (CLASSES - 1)
    return class_length(speed_class, scale) / (widest * (1.0 - q**D))


@kernel
def arc_curvature(arc: int, sharpest: float) -> float:
    """Return the curvature [1/m] of an arc: 0 is hard left, 40 straight, 80 hard right."""
    if arc == STRAIGHT:
        return 0.0
    if arc < STRAIGHT:
        return 1.0 / (sharpest * grown(GROWTH, arc))
    return -1.0 / (sharpest * grown(GROWTH, ARCS - 1 - arc))


@kernel
def arc_length(arc: int, start: float, scale: float) -> float:
    """Return the length [m] of an arc of a class whose lengths begin at `start` [m]."""
    rank = min(arc, ARCS - 1 - arc)
    return start + scale * E * math.sqrt(rank / STRAIGHT)


@kernel
def free_length(
    ranges: Floats, base: int, rays: int, field: float, off: float, curvature: float, length: float
) -> float:
    """Return the length [m] of an arc up to its first point beyond the lidar's range.

    The point at arc length s of a circle through the lidar lies at the polar angle s κ / 2, at a
    distance of 2 / κ times its sine. off: what the ranges count less [m].
    """
    step = field / (rays - 1)
    for point in range(1, POINTS + 1):
        along = length * point / POINTS
        angle = 0.5 * along * curvature
        distance = along if curvature == 0.0 else 2.0 * math.sin(abs(angle)) / abs(curvature)
        ray = math.floor((angle + 0.5 * field) / step + 0.5)
        if not 0 <= ray < rays or distance > ranges[base + ray] - off:
            return length * (point - 1) / POINTS
    return length


@kernel
def longest(lengths: Floats, base: int) -> int:
    """Return the number of the longest arc, of equally long ones the straightest."""
    best = STRAIGHT
    for rank in range(1, STRAIGHT + 1):
        if lengths[base + STRAIGHT - rank] > lengths[base + best]:
            best = STRAIGHT - rank
        if lengths[base + STRAIGHT + rank] > lengths[base + best]:
            best = STRAIGHT + rank
    return best


@kernel
def move_off(lengths: Floats, base: int, arc: int, shorter: float) -> int:
    """Return the arc that one ends at by moving away from the side with the shorter neighbours.

    shorter: by how much the three on one side are shorter in the mean [m] for a move.
    """
    before = 0
    for _ in range(MOST_MOVES):
        left, right = 0.0, 0.0
        for away in range(1, NEIGHBOURS + 1):
            left += lengths[base + max(arc - away, 0)]
            right += lengths[base + min(arc + away, ARCS - 1)]
        difference = (right - left) / NEIGHBOURS
        move = 0
        if abs(difference) > shorter:
            move = 1 if difference > 0.0 else -1
        if move in (0, -before):
            return arc
        before = move
        arc = min(max(arc + move, 0), ARCS - 1)
    return arc


@kernel
def choose(cockpit: Cockpit) -> None:
    """Drive along the longest arc; faster while the front opens, slower while it closes."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup = cockpit.vehicle, cockpit.setup
    memory, control = cockpit.memory, cockpit.control
    rays, field, reach = offsets[-1], setup[FIELD], setup[REACH]
    lengths = KEPT + 4 * rays
    fill_dropouts(observation, offsets[LIDAR_BEFORE], rays, reach, memory, KEPT)
    front_before = nearest(memory, KEPT, rays, field, -FRONT, FRONT, reach)
    fill_dropouts(observation, offsets[LIDAR], rays, reach, memory, KEPT)
    front = nearest(memory, KEPT, rays, field, -FRONT, FRONT, reach)

    scale = vehicle.length / REPORT_LENGTH
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    start = class_length(FINAL_CLASS, scale)
    sharpest = class_radius(FINAL_CLASS, scale, wheelbase / math.tan(vehicle.steering_limit))
    off = STAND_OFF * vehicle.width
    for arc in range(ARCS):
        curvature, length = arc_curvature(arc, sharpest), arc_length(arc, start, scale)
        memory[lengths + arc] = free_length(memory, KEPT, rays, field, off, curvature, length)
    arc = move_off(memory, lengths, longest(memory, lengths), SHORTER * vehicle.length)
    curvature = arc_curvature(arc, sharpest)
    control[0] = math.atan(curvature * wheelbase) / vehicle.steering_limit

    change = OPENING if front > front_before or front >= 0.98 * reach else -CLOSING
    memory[SHIFT] = min(max(memory[SHIFT] + change, SLOWEST), FASTEST)
    press_pedals(observation[offsets[SPEED]], memory[SHIFT] * vehicle.length, 2.0, control)
    _back_out(cockpit, front, curvature)
    finish_decision(cockpit)


@kernel
def _back_out(cockpit: Cockpit, front: float, curvature: float) -> None:
    """Begin to reverse where the front is blocked, wheels turned away from the arc wanted."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, memory = cockpit.vehicle, cockpit.memory
    crawls = abs(observation[offsets[SPEED]]) < 2.0 * vehicle.length
    if front > BLOCKED * vehicle.length or not crawls or observation[offsets[LIGHTS]] > 0.0:
        return
    if memory[REVERSING] <= 0.0:
        memory[REVERSING] = REVERSE_S
        memory[ESCAPE] = -1.0 if curvature >= 0.0 else 1.0


@kernel
def choose_all(cockpits: Cockpits) -> None:
    """Decide for many karts in one call."""
    for row in range(len(cockpits.seats)):
        choose(cockpit_at(cockpits, row))


class TentaclesReportB(KernelDriver):
    """Drives along the longest of 81 arcs, as the 1/10 race's report tuned them."""

    preset = "lidar"
    vehicles = TENTH  # its arcs are longer than a kart sees
    decide = staticmethod(choose)
    decide_all = staticmethod(choose_all)
