"""What one seat sees around it: the nearest karts, and the item boxes and hazards ahead."""

import math

from race_server.core import codes
from race_server.core.kernels.course import place_on_reference
from race_server.core.kernels.jit import kernel
from race_server.core.observation import NEARBY, THINGS
from race_server.core.stages import observed_parts as part
from race_server.core.stages.observed_parts import KartFrame, put, shows, to_frame
from race_server.core.state import HAZARDS, Float32s, Ints, Record, World

FAR = 1000.0  # stands for "there is none"


@kernel
def fill_karts(
    world: World, w: int, k: int, here: float, frame: KartFrame, offsets: Ints, out: Float32s
) -> None:
    """Fill the nearest karts, nearest first; equally near ones in the order of the grid.

    here: fractional sample of the reference line abreast of the own kart, negative without one.
    """
    last, chosen = -1.0, -1  # square of the distance [m²] and turn of the kart filled last
    for index in range(NEARBY):
        best, following = math.inf, -1
        for turn in range(world.turns.shape[1]):
            other = world.turns[w, turn]
            rival = world.bodies[w, other]
            if other == k or rival.status != codes.RACING or rival.trust >= codes.SUSPENDED:
                continue
            dx, dy = rival.x - frame.x, rival.y - frame.y
            square = dx * dx + dy * dy
            later = square > last or (square == last and turn > chosen)
            if later and square < best:
                best, following = square, turn
        if following < 0:
            put(out, offsets[part.KARTS_X], index, FAR)
            put(out, offsets[part.KARTS_Y], index, FAR)
            put(out, offsets[part.KARTS_SPEED_X], index, 0.0)
            put(out, offsets[part.KARTS_SPEED_Y], index, 0.0)
            put(out, offsets[part.KARTS_ALONG], index, FAR)
            put(out, offsets[part.KARTS_ACROSS], index, 0.0)
            continue
        last, chosen = best, following
        other = world.turns[w, following]
        _fill_kart(world.bodies[w, other], index, frame, offsets, out)
        if shows(offsets, part.KARTS_ON_LINE):
            way, across = _rival_on_line(world, w, other, here)
            put(out, offsets[part.KARTS_ALONG], index, way)
            put(out, offsets[part.KARTS_ACROSS], index, across)


@kernel
def _fill_kart(rival: Record, index: int, frame: KartFrame, offsets: Ints, out: Float32s) -> None:
    """Fill place and velocity of one kart in the frame of the one that observes."""
    ahead, left = to_frame(frame, rival.x, rival.y)
    cos, sin = math.cos(rival.heading), math.sin(rival.heading)
    vx = rival.speed * cos - rival.lateral_speed * sin
    vy = rival.speed * sin + rival.lateral_speed * cos
    put(out, offsets[part.KARTS_X], index, ahead)
    put(out, offsets[part.KARTS_Y], index, left)
    put(out, offsets[part.KARTS_SPEED_X], index, vx * frame.cos + vy * frame.sin)
    put(out, offsets[part.KARTS_SPEED_Y], index, vy * frame.cos - vx * frame.sin)


@kernel
def _rival_on_line(world: World, w: int, k: int, here: float) -> tuple[float, float]:
    """Return the way [m] to kart k along the reference line, the shorter one, and its offset [m].

    here: fractional sample abreast of the own kart, negative where the race has no line.
    """
    if here < 0.0:
        return 0.0, 0.0
    route, course = world.route, world.route.courses[world.rules[w].course]
    rival = world.bodies[w, k]
    there = place_on_reference(route, course, rival.x, rival.y, world.racers[w, k].line_index)
    point = route.reference[course.line_start + int(there + 0.5) % course.line_count]
    way, half = there - here, 0.5 * course.line_count
    if way >= half:
        way -= course.line_count
    elif way < -half:
        way += course.line_count
    return way * course.reference_spacing, offset_from(point, rival)


@kernel
def offset_from(point: Record, body: Record) -> float:
    """Return how far [m] a kart is left of the reference line, abreast of `point` on it."""
    dx, dy = body.x - point.x, body.y - point.y
    along = dx * point.cos + dy * point.sin
    return dy * point.cos - dx * point.sin - 0.5 * point.curvature * along * along


@kernel
def fill_things(
    world: World, w: int, frame: KartFrame, boxes: bool, offsets: Ints, out: Float32s
) -> None:
    """Fill the item boxes, or else the hazards, that lie ahead, nearest first."""
    xs, ys = (
        (offsets[part.BOXES_X], offsets[part.BOXES_Y])
        if boxes
        else (offsets[part.HAZARDS_X], offsets[part.HAZARDS_Y])
    )
    count = world.boxes.shape[1] if boxes else HAZARDS
    last, chosen = -1.0, -1  # square of the distance [m²] and number of the thing filled last
    for index in range(THINGS):
        best, following = math.inf, -1
        best_ahead, best_left = FAR, FAR
        for thing in range(count):
            is_there, x, y = _thing(world, w, thing, boxes)
            dx, dy = x - frame.x, y - frame.y
            square = dx * dx + dy * dy
            later = square > last or (square == last and thing > chosen)
            if is_there and later and square < best:
                ahead, left = to_frame(frame, x, y)
                if ahead > 0.0:
                    best, following, best_ahead, best_left = square, thing, ahead, left
        put(out, xs, index, best_ahead)
        put(out, ys, index, best_left)
        if following >= 0:
            last, chosen = best, following


@kernel
def _thing(world: World, w: int, thing: int, boxes: bool) -> tuple[bool, float, float]:
    """Return whether an item box, or else a hazard, is there now, and its place [m].

    In a race without items no box can be taken.
    """
    tick = world.races[w].tick
    if boxes:
        box = world.boxes[w, thing]
        return world.rules[w].items > 0 and tick >= box.ready_tick, box.x, box.y
    hazard = world.hazards[w, thing]
    return tick < hazard.until_tick, hazard.x, hazard.y
