"""What one seat sees, as the vector that `race_server.core.observation` describes.

The numbers of the parts are their places in `observe.PARTS`; a test holds the two together.
"""

import math

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.course import place_on_reference
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.state import HAZARDS, RADAR_RAYS, Float32s, Ints, Record, World

AHEAD = 16
NEARBY = 4
THINGS = 4
USES = 4
FAR = 1000.0  # stands for "there is none"

# Distance between two look-ahead samples: a time at top speed, but never less than a length.
LOOK_AHEAD_S = 0.1


@kernel
def observe(world: World, w: int, k: int, parts: Ints, out: Float32s) -> None:
    """Fill `out` with the parts of the given numbers, one behind the other."""
    place = 0
    for index in range(len(parts)):
        if parts[index] < 0:
            return
        place = _fill(world, w, k, parts[index], out, place)


@kernel
def observe_karts(world: World, parts: Ints, presets: Ints, out: Float32s) -> None:
    """Fill `out`, shape (W, K, size), for every kart of every world in one call.

    parts: (P, n) part numbers of each preset, filled up with -1; presets: (K,) the row of
    `parts` that each kart gets, -1 for none.
    """
    for w in range(world.bodies.shape[0]):
        for k in range(world.bodies.shape[1]):
            if presets[k] >= 0:
                observe(world, w, k, parts[presets[k]], out[w, k])


@kernel
def look_ahead_of(vehicle: Record) -> float:
    """Return the distance [m] between two look-ahead samples."""
    return max(vehicle.length, LOOK_AHEAD_S * vehicle.top_speed)


@kernel
def _fill(world: World, w: int, k: int, number: int, out: Float32s, place: int) -> int:
    sight = world.sight
    if number <= 1:
        rays = sight.lidar.shape[3]
        for ray in range(rays):
            out[place + ray] = sight.lidar[w, k, number, ray]
        return place + rays
    if number == 2:
        for ray in range(RADAR_RAYS):
            out[place + ray] = sight.radar[w, k, ray]
        return place + RADAR_RAYS
    if number == 3:
        for ray in range(RADAR_RAYS):
            out[place + ray] = sight.radar_kinds[w, k, ray]
        return place + RADAR_RAYS
    if 11 <= number <= 15:
        _course_ahead(world, w, k, number - 11, out, place)
        return place + AHEAD
    if 17 <= number <= 20:
        _karts_near(world, w, k, number - 17, out, place)
        return place + NEARBY
    if 21 <= number <= 24:
        _things_ahead(world, w, k, number - 21, out, place)
        return place + THINGS
    if 38 <= number <= 40:
        out[place] = _place_on_line(world, w, k, number - 38)
        return place + 1
    if 41 <= number <= 46:
        _line_ahead(world, w, k, number - 41, out, place)
        return place + AHEAD
    if 47 <= number <= 48:
        _karts_near(world, w, k, number - 43, out, place)
        return place + NEARBY
    if number == 49:
        use = world.items[world.players[w, k].held].use
        for index in range(USES):
            out[place + index] = 1.0 if use == index + 1 else 0.0
        return place + USES
    out[place] = _scalar(world, w, k, number)
    return place + 1


@kernel
def _scalar(world: World, w: int, k: int, number: int) -> float:
    body, racer, player = world.bodies[w, k], world.racers[w, k], world.players[w, k]
    race = world.races[w]
    if number == 4:
        return body.speed
    if number == 5:
        return body.lateral_speed
    if number == 6:
        return body.yaw_rate
    if number == 7:
        return body.steering
    if number == 8:
        return racer.progress
    if number == 9:
        return racer.lateral_offset
    if number == 10:
        return racer.heading_error
    if number == 16:
        return look_ahead_of(world.vehicles[w, k])
    if number == 25:
        return float(player.held)
    if number == 26:
        return body.speed_cap
    if number == 27:
        return body.thrust_scale
    if number == 28:
        return body.grip_scale
    if number == 29:
        return max(max(race.start_tick, race.hold_until) - race.tick, 0) * TICK_S
    if number == 30:
        return float(max(race.flag, racer.yellow))
    if number == 31:
        return float(racer.laps)
    if number == 32:
        return float(racer.rank)
    if number == 33 or number == 34:
        return _gap(world, w, k, -1 if number == 33 else 1)
    if number == 35:
        return float(racer.wrong_way)
    if number == 36:
        return float(racer.rescue_offered)
    return 1.0 if body.status != codes.RACING else 0.0


@kernel
def _gap(world: World, w: int, k: int, places: int) -> float:
    racer = world.racers[w, k]
    for other in range(world.bodies.shape[1]):
        rival_body, rival_racer = world.bodies[w, other], world.racers[w, other]
        if rival_body.status != codes.ABSENT and rival_racer.rank == racer.rank + places:
            return abs(rival_racer.ranked - racer.ranked)
    return 0.0


@kernel
def _course_ahead(world: World, w: int, k: int, what: int, out: Float32s, place: int) -> None:
    body, racer = world.bodies[w, k], world.racers[w, k]
    course = world.route.courses[world.rules[w].course]
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    step = look_ahead_of(world.vehicles[w, k]) / course.spacing
    here = racer.progress / course.spacing
    for index in range(AHEAD):
        sample = int(here + (index + 1) * step + 0.5) % course.line_count
        line = world.route.line[course.line_start + sample]
        if what == 0:
            out[place + index] = line.curvature
        elif what == 1:
            out[place + index] = (line.x - body.x) * cos + (line.y - body.y) * sin
        elif what == 2:
            out[place + index] = (line.y - body.y) * cos - (line.x - body.x) * sin
        elif what == 3:
            out[place + index] = line.left
        else:
            out[place + index] = line.right


@kernel
def line_step_of(vehicle: Record) -> float:
    """Return the distance [m] between two samples of the reference line ahead."""
    return 0.5 * vehicle.length


@kernel
def _place_on_line(world: World, w: int, k: int, what: int) -> float:
    """Return offset (what 0) or heading error (1) against the reference line, or its step (2)."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    course = world.route.courses[world.rules[w].course]
    if course.reference_spacing <= 0.0:
        return 0.0
    if what == 2:
        return line_step_of(world.vehicles[w, k])
    place = place_on_reference(world.route, course, body.x, body.y, racer.line_index)
    sample = int(place + 0.5) % course.line_count
    if what == 0:
        return _offset_from(world, course, sample, body)
    point = world.route.reference[course.line_start + sample]
    along = (body.x - point.x) * point.cos + (body.y - point.y) * point.sin
    return wrap_angle(body.heading - point.heading - along * point.curvature)


@kernel
def _offset_from(world: World, course: Record, sample: int, body: Record) -> float:
    """Return how far [m] a kart is left of the reference line, abreast of a sample of it."""
    point = world.route.reference[course.line_start + sample]
    dx, dy = body.x - point.x, body.y - point.y
    along = dx * point.cos + dy * point.sin
    return dy * point.cos - dx * point.sin - 0.5 * point.curvature * along * along


@kernel
def _rival_on_line(world: World, w: int, k: int, other: int, what: int) -> float:
    """Return the way [m] to a rival along the reference line (what 0), or its offset (1)."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    rival_body, rival_racer = world.bodies[w, other], world.racers[w, other]
    route = world.route
    course = route.courses[world.rules[w].course]
    if course.reference_spacing <= 0.0:
        return 0.0
    there = place_on_reference(route, course, rival_body.x, rival_body.y, rival_racer.line_index)
    if what == 1:
        return _offset_from(world, course, int(there + 0.5) % course.line_count, rival_body)
    here = place_on_reference(route, course, body.x, body.y, racer.line_index)
    way, half = there - here, 0.5 * course.line_count
    if way >= half:
        way -= course.line_count
    elif way < -half:
        way += course.line_count
    return way * course.reference_spacing


@kernel
def _line_ahead(world: World, w: int, k: int, what: int, out: Float32s, place: int) -> None:
    """Tell of the reference line from abreast of the kart on, at equal steps along it."""
    body, racer, route = world.bodies[w, k], world.racers[w, k], world.route
    course = route.courses[world.rules[w].course]
    if course.reference_spacing <= 0.0:
        for index in range(AHEAD):
            out[place + index] = 0.0
        return
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    step = line_step_of(world.vehicles[w, k]) / course.reference_spacing
    here = place_on_reference(route, course, body.x, body.y, racer.line_index)
    for index in range(AHEAD):
        at = here + index * step
        sample = int(at)
        share = at - sample
        sample %= course.line_count
        following = sample + 1 if sample + 1 < course.line_count else 0
        one = route.reference[course.line_start + sample]
        two = route.reference[course.line_start + following]
        if what <= 1:
            dx = one.x + share * (two.x - one.x) - body.x
            dy = one.y + share * (two.y - one.y) - body.y
            out[place + index] = dx * cos + dy * sin if what == 0 else dy * cos - dx * sin
        elif what == 2:
            out[place + index] = one.curvature + share * (two.curvature - one.curvature)
        elif what == 3:
            out[place + index] = one.speed + share * (two.speed - one.speed)
        elif what == 4:
            out[place + index] = one.left + share * (two.left - one.left)
        else:
            out[place + index] = one.right + share * (two.right - one.right)


@kernel
def _karts_near(world: World, w: int, k: int, what: int, out: Float32s, place: int) -> None:
    """Tell of the nearest karts: x, y, velocity x, y in the kart frame, along, across the line."""
    body = world.bodies[w, k]
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    last = -1.0
    chosen = -1
    for index in range(NEARBY):
        best, following = math.inf, -1
        for other in range(world.bodies.shape[1]):
            rival = world.bodies[w, other]
            if other == k or rival.status != codes.RACING or rival.trust >= codes.SUSPENDED:
                continue
            dx, dy = rival.x - body.x, rival.y - body.y
            square = dx * dx + dy * dy
            # Next further away than the last one told of; equals in order of their numbers.
            later = square > last or (square == last and other > chosen)
            if later and square < best:
                best, following = square, other
        if following < 0:
            out[place + index] = FAR if what <= 1 or what == 4 else 0.0
            continue
        last, chosen = best, following
        if what >= 4:
            out[place + index] = _rival_on_line(world, w, k, following, what - 4)
            continue
        rival = world.bodies[w, following]
        dx, dy = rival.x - body.x, rival.y - body.y
        if what >= 2:
            c, s = math.cos(rival.heading), math.sin(rival.heading)
            dx = rival.speed * c - rival.lateral_speed * s
            dy = rival.speed * s + rival.lateral_speed * c
        out[place + index] = dx * cos + dy * sin if what % 2 == 0 else dy * cos - dx * sin


@kernel
def _things_ahead(world: World, w: int, k: int, what: int, out: Float32s, place: int) -> None:
    """Tell of boxes (what 0, 1) or hazards (2, 3): x or y in the kart frame, nearest first."""
    body, tick = world.bodies[w, k], world.races[w].tick
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    boxes = what <= 1
    count = world.boxes.shape[1] if boxes else HAZARDS
    last = -1.0
    chosen = -1
    for index in range(THINGS):
        best, following = math.inf, -1
        for thing in range(count):
            if boxes:
                seen = tick >= world.boxes[w, thing].ready_tick
                dx, dy = world.boxes[w, thing].x - body.x, world.boxes[w, thing].y - body.y
            else:
                seen = tick < world.hazards[w, thing].until_tick
                dx, dy = world.hazards[w, thing].x - body.x, world.hazards[w, thing].y - body.y
            square = dx * dx + dy * dy
            later = square > last or (square == last and thing > chosen)
            if seen and later and square < best and dx * cos + dy * sin > 0.0:
                best, following = square, thing
        if following < 0:
            out[place + index] = FAR
            continue
        last, chosen = best, following
        if boxes:
            dx, dy = world.boxes[w, following].x - body.x, world.boxes[w, following].y - body.y
        else:
            dx, dy = world.hazards[w, following].x - body.x, world.hazards[w, following].y - body.y
        out[place + index] = dx * cos + dy * sin if what % 2 == 0 else dy * cos - dx * sin
