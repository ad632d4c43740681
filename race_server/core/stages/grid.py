"""The start: every kart finds its place on the course and sees for the first time."""

from race_server.core import codes
from race_server.core.kernels.course import nearest_sample_anywhere, progress_of
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.stages.progress import has_line
from race_server.core.stages.sensing import sense
from race_server.core.stages.sightings import forget_sightings
from race_server.core.stages.standings import rank
from race_server.core.state import World


@large_kernel
def line_up(world: World, w: int) -> None:
    """Make every kart of one world that is not absent race from the pose it has."""
    for k in range(world.bodies.shape[1]):
        if world.bodies[w, k].status != codes.ABSENT:
            place_kart(world, w, k)
        _take_turn(world, w, k)
    rank(world, w)
    forget_sightings(world, w)
    # The scan now and the scan before are the same at the start.
    sense(world, w)
    sense(world, w)


@kernel
def _take_turn(world: World, w: int, k: int) -> None:
    """Put kart k among those before it, in the order of their places on the grid.

    So a race does not depend on the numbers of its karts. Absent ones are where their numbers are.
    """
    turns = world.turns[w]
    turn = k
    while turn > 0 and _turn_of(world, w, turns[turn - 1]) > _turn_of(world, w, k):
        turns[turn] = turns[turn - 1]
        turn -= 1
    turns[turn] = k


@kernel
def _turn_of(world: World, w: int, k: int) -> int:
    is_there = world.bodies[w, k].status != codes.ABSENT
    return int(world.racers[w, k].grid_place if is_there else k)


@kernel
def place_kart(world: World, w: int, k: int) -> None:
    """Start the race of a kart at the pose it has, before its first lap."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    course = world.route.courses[world.rules[w].course]
    body.status = codes.RACING
    body.speed_cap = world.vehicles[w, k].top_speed
    body.thrust_scale = 1.0
    body.grip_scale = 1.0
    racer.start_x, racer.start_y = body.x, body.y
    if not has_line(world, w):
        return
    racer.line_index = nearest_sample_anywhere(world.route, course, body.x, body.y)
    progress, offset = progress_of(world.route, course, body.x, body.y, racer.line_index)
    racer.progress, racer.lateral_offset = progress, offset
    line = world.route.line[course.line_start + racer.line_index]
    racer.heading_error = wrap_angle(body.heading - line.heading)
    racer.distance = progress - course.length
    racer.zone = course.gate_count - 1
    for gate in range(course.gate_count - 1):
        first = world.route.gates[course.gate_start + gate].progress
        following = world.route.gates[course.gate_start + gate + 1].progress
        if first <= progress < following:
            racer.zone = gate
