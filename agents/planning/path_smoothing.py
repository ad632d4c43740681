"""The path of least bending through gates, and the speed along it.

A path is a place on each gate [m from its right end]. What it turns at a gate, squared and over the
way on which it turns, is the integral of the squared curvature; Gauss and Newton's method makes the
sum small, with walls as stiff springs. Each turn hangs on three places only, so that the normal
equations have five diagonals and are solved in one sweep forth and one back. The line of minimum
curvature is known from Heilmeier et al., Minimum curvature trajectory planning and control for an
autonomous race car, Vehicle System Dynamics 58(10), 2020; here the path may turn by any angle.
"""

import math

from race_agents.planning.corridor import ACROSS_X, ACROSS_Y, GATES, RIGHT_X, RIGHT_Y, WIDTH
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats

# Where a number of each gate begins, behind those of the gates: the place on it [m], the point [m],
# the way from the point before [m] and what it was at first, and the curvature [1/m].
PLACE, X, Y, STEP, FIRST_STEP, BEND = range(5 * GATES, 11 * GATES, GATES)
# The normal equations: the main diagonal, the two beside it and the right side.
MAIN, NEXT, SECOND, CHANGE = range(11 * GATES, 15 * GATES, GATES)
SIZE = 15 * GATES

ROUNDS = 12
# Springs beside a turn of 1 rad on one body width: of a wall and of a place to where it was, for a
# move by one width; of the last direction to that of the last gate, for 1 rad.
WALL, STAY, END = 2.0, 0.0034, 0.3
# No two points are nearer to each other [m].
LEAST_STEP = 0.02


@kernel
def place_points(memory: Floats, path: int, gates: int) -> None:
    """Write the points and steps that the places make; the path begins at the origin."""
    last_x, last_y = 0.0, 0.0
    for gate in range(path, path + gates):
        x = memory[gate + RIGHT_X] + memory[gate + PLACE] * memory[gate + ACROSS_X]
        y = memory[gate + RIGHT_Y] + memory[gate + PLACE] * memory[gate + ACROSS_Y]
        dx, dy = x - last_x, y - last_y
        memory[gate + X], memory[gate + Y] = x, y
        memory[gate + STEP] = max(math.sqrt(dx * dx + dy * dy), LEAST_STEP)
        last_x, last_y = x, y


@large_kernel
def add_square(
    memory: Floats, path: int, gate: int, value: float, before: float, here: float, after: float
) -> None:
    """Add the square of a value to the normal equations.

    memory: (M,) of the driver; path: place of the path in it; value: weighted turn [rad/√m];
    before, here, after: its slopes [rad/√m per m] by the places on the gates `gate` - 1, `gate` and
    `gate` + 1, of which only the last one must exist.
    """
    at = path + gate
    if gate > 0:
        memory[at + MAIN - 1] += before * before
        memory[at + NEXT - 1] += before * here
        memory[at + SECOND - 1] += before * after
        memory[at + CHANGE - 1] -= before * value
    if gate >= 0:
        memory[at + MAIN] += here * here
        memory[at + NEXT] += here * after
        memory[at + CHANGE] -= here * value
    memory[at + MAIN + 1] += after * after
    memory[at + CHANGE + 1] -= after * value


@large_kernel
def solve(memory: Floats, path: int, gates: int) -> None:
    """Solve the normal equations, whose matrix is symmetric, in the place of their right side."""
    for gate in range(gates):
        at = path + gate
        if gate + 1 < gates:
            share = memory[at + NEXT] / memory[at + MAIN]
            memory[at + MAIN + 1] -= share * memory[at + NEXT]
            memory[at + CHANGE + 1] -= share * memory[at + CHANGE]
        if gate + 2 < gates:
            memory[at + NEXT + 1] -= share * memory[at + SECOND]
            share = memory[at + SECOND] / memory[at + MAIN]
            memory[at + MAIN + 2] -= share * memory[at + SECOND]
            memory[at + CHANGE + 2] -= share * memory[at + CHANGE]
    for back in range(gates):
        at = path + gates - 1 - back
        value = memory[at + CHANGE]
        if back > 0:
            value -= memory[at + NEXT] * memory[at + CHANGE + 1]
        if back > 1:
            value -= memory[at + SECOND] * memory[at + CHANGE + 2]
        memory[at + CHANGE] = value / memory[at + MAIN]


@large_kernel
def add_turns(memory: Floats, path: int, gates: int, cos: float, sin: float) -> None:
    """Add the squares of what the path turns at each point, the last gate's normal included.

    memory: (M,) of the driver; path: place of the path in it; gates: of the path; cos, sin: of the
    direction in which it begins.
    """
    before = 0.0  # slope of the step's direction by a move of its ends to the left
    x = y = last_way = 0.0
    last_normal_x, last_normal_y = 0.0, 0.0
    for gate in range(gates):
        at = path + gate
        step = memory[at + STEP]
        next_cos, next_sin = (memory[at + X] - x) / step, (memory[at + Y] - y) / step
        way = memory[at + FIRST_STEP]
        root = math.sqrt(2.0 / (last_way + way))
        turn = math.atan2(cos * next_sin - sin * next_cos, cos * next_cos + sin * next_sin)
        normal_x, normal_y = -next_sin * root / step, next_cos * root / step
        here = behind = 0.0
        after = normal_x * memory[at + ACROSS_X] + normal_y * memory[at + ACROSS_Y]
        if gate > 0:
            last_normal_x, last_normal_y = -sin * before * root, cos * before * root
            both_x, both_y = normal_x + last_normal_x, normal_y + last_normal_y
            here = -both_x * memory[at - 1 + ACROSS_X] - both_y * memory[at - 1 + ACROSS_Y]
        if gate > 1:
            behind = last_normal_x * memory[at - 2 + ACROSS_X]
            behind += last_normal_y * memory[at - 2 + ACROSS_Y]
        add_square(memory, path, gate - 1, turn * root, behind, here, after)
        cos, sin, before, last_way = next_cos, next_sin, 1.0 / step, way
        x, y = memory[at + X], memory[at + Y]
    # The normal of a gate is the direction across, turned to the right.
    at = path + gates - 1
    ahead_x, ahead_y = memory[at + ACROSS_Y], -memory[at + ACROSS_X]
    turn = math.atan2(cos * ahead_y - sin * ahead_x, cos * ahead_x + sin * ahead_y)
    root = math.sqrt(2.0 * END / last_way)
    normal_x, normal_y = sin * before * root, -cos * before * root
    after = normal_x * memory[at + ACROSS_X] + normal_y * memory[at + ACROSS_Y]
    here = 0.0
    if gates > 1:
        here = -normal_x * memory[at - 1 + ACROSS_X] - normal_y * memory[at - 1 + ACROSS_Y]
    add_square(memory, path, gates - 2, turn * root, 0.0, here, after)


@kernel
def nearest_allowed(place: float, width: float, margin: float) -> float:
    """Return the place nearest to one that keeps off both ends of a gate; the middle if none."""
    return min(max(place, min(margin, 0.5 * width)), max(width - margin, 0.5 * width))


@large_kernel
def smooth_path(
    memory: Floats, path: int, gates: int, drift: float, width: float, margin: float, most: float
) -> None:
    """Write the path of least bending that stays `margin` [m] off the ends of the gates.

    memory: (M,) of the driver; path: place of the path in it; gates: of the path; drift: direction
    in which it begins [rad]; width: of the body [m]; most: how far a point moves in one round [m].
    """
    cube = width * width * width
    wall, stay = WALL / cube, STAY / cube
    cos, sin = math.cos(drift), math.sin(drift)
    for at in range(path, path + gates):
        memory[at + PLACE] = 0.5 * memory[at + WIDTH]
    place_points(memory, path, gates)
    for at in range(path, path + gates):
        memory[at + FIRST_STEP] = memory[at + STEP]
    for _ in range(ROUNDS):
        for at in range(path, path + gates):
            excess = nearest_allowed(memory[at + PLACE], memory[at + WIDTH], margin)
            excess -= memory[at + PLACE]
            memory[at + MAIN] = stay + (wall if excess != 0.0 else 0.0)
            memory[at + NEXT] = memory[at + SECOND] = 0.0
            memory[at + CHANGE] = wall * excess
        add_turns(memory, path, gates, cos, sin)
        solve(memory, path, gates)
        for at in range(path, path + gates):
            place = memory[at + PLACE] + min(max(memory[at + CHANGE], -most), most)
            memory[at + PLACE] = min(max(place, 0.0), memory[at + WIDTH])
        place_points(memory, path, gates)
    for at in range(path, path + gates):
        memory[at + PLACE] = nearest_allowed(memory[at + PLACE], memory[at + WIDTH], margin)
    place_points(memory, path, gates)
    write_bends(memory, path, gates)


@kernel
def write_bends(memory: Floats, path: int, gates: int) -> None:
    """Write the curvature at each point; the last one has that of the one before."""
    x = y = 0.0
    for at in range(path, path + gates - 1):
        step, next_step = memory[at + STEP], memory[at + STEP + 1]
        cos, sin = (memory[at + X] - x) / step, (memory[at + Y] - y) / step
        x, y = memory[at + X], memory[at + Y]
        next_cos, next_sin = (
            (memory[at + X + 1] - x) / next_step,
            (memory[at + Y + 1] - y) / next_step,
        )
        memory[at + BEND] = 2.0 * (cos * next_sin - sin * next_cos) / (step + next_step)
    last = path + gates - 1
    memory[last + BEND] = memory[last + BEND - 1] if gates > 1 else 0.0


@kernel
def speed_before(
    memory: Floats, path: int, gates: int, end: float, grip: float, share: float, braking: float
) -> float:
    """Return the most speed [m/s] at which a path may begin.

    memory: (M,) of the driver; path: place of the path in it; gates: of the path; end: the speed at
    its end [m/s]; grip: [m/s²], of which bends may take `share`; braking: [m/s²] on the straight,
    less in a bend, where the tyres share their grip.
    """
    square = end * end
    for back in range(gates):
        at = path + gates - 1 - back
        bend = abs(memory[at + BEND])
        if 0 < back < gates - 1:
            # The curvature at a single point is noisy: average it with its neighbours.
            bend = 0.25 * abs(memory[at + BEND - 1]) + 0.5 * bend
            bend += 0.25 * abs(memory[at + BEND + 1])
        square = min(square, share * grip / max(bend, 1e-3))
        used = min(square * bend / grip, 1.0)
        room = math.sqrt(max(1.0 - used * used, 0.05))
        square += 2.0 * braking * room * memory[at + STEP]
    return math.sqrt(square)


@kernel
def point_along(memory: Floats, path: int, gates: int, distance: float) -> tuple[float, float]:
    """Return the point [m] at a distance [m] along a path, or beyond its end straight on.

    memory: (M,) of the driver; path: place of the path in it; gates: of the path.
    """
    x = y = 0.0
    for gate in range(gates):
        at = path + gate
        step = memory[at + STEP]
        if distance <= step or gate == gates - 1:
            share = distance / step
            return x + share * (memory[at + X] - x), y + share * (memory[at + Y] - y)
        distance -= step
        x, y = memory[at + X], memory[at + Y]
    return distance, 0.0
