"""The way that a car has driven, by its own motion, and the rays of a scan that look across it.

No course crosses itself. So the way on is never to be seen across the way driven: an opening there
leads back, however wide it is. In narrow places walls hide it; in wide ones nothing else does.
"""

import math

from race_agents.planning.tactics import LIGHTS, RESCUE_OFFERED, SPEED
from race_server.core.kernel_driver import DECISION, DRIVEN, DRIVEN_POINTS, KEPT, Cockpit
from race_server.core.kernels.jit import kernel
from race_server.core.observation import PART_NUMBERS
from race_server.core.state import Floats, Ints

LATERAL_SPEED, YAW_RATE = PART_NUMBERS["lateral_speed"], PART_NUMBERS["yaw_rate"]
# Places in a driver's memory: how many points are kept, and the points (x, y) [m] as seen from the
# car, the last one first. They are SPACING body lengths apart.
COUNT, POINTS = DRIVEN, DRIVEN + 1
SPACING = 1.0
NONE = -1  # in place of the first ray, where no ray looks across the way


@kernel
def moved_in(
    observation: Floats, offsets: Ints, speed: float, seconds: float
) -> tuple[float, float, float]:
    """Return how far a car moves ahead and to the left [m] and turns [rad] in a time [s].

    observation: (size,) with its yaw rate and lateral speed; offsets: of its parts; speed: [m/s].
    """
    turn = seconds * observation[offsets[YAW_RATE]]
    ahead, aside = seconds * speed, seconds * observation[offsets[LATERAL_SPEED]]
    cos, sin = math.cos(0.5 * turn), math.sin(0.5 * turn)
    return ahead * cos - aside * sin, ahead * sin + aside * cos, turn


@kernel
def remember_way(cockpit: Cockpit) -> None:
    """Move the points by what the car has driven since the last decision, and add its place."""
    observation, offsets, memory = cockpit.observation, cockpit.offsets, cockpit.memory
    if observation[offsets[LIGHTS]] > 0.0 or observation[offsets[RESCUE_OFFERED]] > 0.0:
        memory[COUNT] = 0.0  # from here on it may be put elsewhere
        return
    step, speed = cockpit.setup[DECISION], observation[offsets[SPEED]]
    dx, dy, turn = moved_in(observation, offsets, speed, step)
    cos, sin = math.cos(turn), math.sin(turn)
    for place in range(POINTS, POINTS + 2 * int(memory[COUNT]), 2):
        x, y = memory[place] - dx, memory[place + 1] - dy
        memory[place], memory[place + 1] = cos * x + sin * y, cos * y - sin * x
    if speed < 0.0:
        take_back(memory)
    spacing = SPACING * cockpit.vehicle.length
    x, y = memory[POINTS], memory[POINTS + 1]
    if memory[COUNT] == 0.0 or x * x + y * y >= spacing * spacing:
        add_place(memory)


@kernel
def take_back(memory: Floats) -> None:
    """Forget the last points that lie ahead: the car backs out over them."""
    while memory[COUNT] > 0.0 and memory[POINTS] > 0.0:
        memory[COUNT] -= 1.0
        for place in range(POINTS, POINTS + 2 * int(memory[COUNT])):
            memory[place] = memory[place + 2]


@kernel
def add_place(memory: Floats) -> None:
    """Put the car's place before the other points; the oldest one may fall out."""
    memory[COUNT] = min(memory[COUNT] + 1.0, DRIVEN_POINTS)
    last = POINTS + 2 * int(memory[COUNT]) - 1
    for back in range(last - POINTS - 1):
        memory[last - back] = memory[last - back - 2]
    memory[POINTS] = memory[POINTS + 1] = 0.0


@kernel
def ray_across(
    memory: Floats, place: int, rays: int, field: float, length: float
) -> tuple[int, int, float]:
    """Return the ray that looks across a point, and as how wide [rays] and far [m] it is seen.

    memory: (M,) of the driver, with its scan at KEPT; place: of the point in it; rays: of the scan;
    field: angle between the outermost ones [rad]; length: of the body [m]. NONE: no ray does.
    """
    x, y = memory[place], memory[place + 1]
    distance = math.sqrt(x * x + y * y)
    ray = round((math.atan2(y, x) / field + 0.5) * (rays - 1))
    if distance < 0.5 * length or not 0 <= ray < rays or memory[KEPT + ray] < distance:
        return NONE, 0, distance  # below the car, behind it, or behind a wall
    return ray, int(0.5 * SPACING * length / distance / field * (rays - 1)) + 1, distance


@kernel
def rays_across(memory: Floats, rays: int, field: float, length: float) -> tuple[int, int]:
    """Return the first and the last ray of those that look across the way driven; NONE for none.

    The arguments are those of `ray_across`.
    """
    first, last = NONE, NONE
    for place in range(POINTS, POINTS + 2 * int(memory[COUNT]), 2):
        ray, half, _ = ray_across(memory, place, rays, field, length)
        if ray != NONE:
            first = max(ray - half, 0) if first == NONE else min(first, max(ray - half, 0))
            last = max(last, min(ray + half, rays - 1))
    return first, last


@kernel
def shut(ranges: Floats, base: int, across: tuple[int, int]) -> None:
    """Let no way lead along rays that look across the way driven, see `rays_across`.

    ranges: (n,) [m], the scan from `base` on.
    """
    for ray in range(max(across[0], 0), across[1] + 1):
        ranges[base + ray] = 0.0


@kernel
def wall_off(memory: Floats, rays: int, field: float, length: float) -> None:
    """Let the way driven be a wall: rays that look across it end there, and so do their points.

    The arguments are those of `ray_across`.
    """
    xs, ys = KEPT + 2 * rays, KEPT + 3 * rays
    for place in range(POINTS, POINTS + 2 * int(memory[COUNT]), 2):
        middle, half, distance = ray_across(memory, place, rays, field, length)
        if middle == NONE:
            continue
        for ray in range(max(middle - half, 0), min(middle + half, rays - 1) + 1):
            if memory[KEPT + ray] > distance:
                share = distance / memory[KEPT + ray]
                memory[xs + ray] *= share
                memory[ys + ray] *= share
                memory[KEPT + ray] = distance
