"""What one seat sees, as the vector that `race_server.core.observation` describes."""

import math

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.course import place_on_reference
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import AHEAD, USES
from race_server.core.stages import observed_parts as part
from race_server.core.stages.feelers import feel
from race_server.core.stages.observe_around import fill_karts, fill_things, offset_from
from race_server.core.stages.observe_lot import fill_goal, fill_hitches, fill_lot
from race_server.core.stages.observed_parts import KartFrame, put, put_all, shows, to_frame
from race_server.core.stages.sightings import fill_movers
from race_server.core.state import Float32s, Ints, Record, World
from race_server.core.vehicles import FEELERS

# Least time at top speed [s] between two look-ahead samples; they are a body length apart at least.
LOOK_AHEAD_S = 0.1


@large_kernel
def observe(world: World, w: int, k: int, offsets: Ints, out: Float32s) -> None:
    """Fill `out` (size,) with what kart k of world w sees.

    offsets: (parts + 1,) where each part begins in `out`, see `observation.offsets_of`.
    """
    body = world.bodies[w, k]
    frame = KartFrame(body.x, body.y, math.cos(body.heading), math.sin(body.heading))
    _fill_scans(world, w, k, offsets, out)
    _fill_motion(body, offsets, out)
    _fill_game(world, w, k, offsets, out)
    _fill_race(world, w, k, offsets, out)
    _fill_place(world, w, k, offsets, out)
    if shows(offsets, part.COURSE):
        _fill_course(world, w, k, frame, offsets, out)
    here = _place_on_line(world, w, k, offsets)
    if shows(offsets, part.LINE):
        _fill_line(world, w, k, here, frame, offsets, out)
    if shows(offsets, part.KARTS):
        fill_karts(world, w, k, here, frame, offsets, out)
    if shows(offsets, part.LOT):
        fill_lot(world, w, k, frame, offsets, out)
    if shows(offsets, part.GOAL):
        fill_goal(world, w, k, frame, offsets, out)
    if shows(offsets, part.HITCHES):
        fill_hitches(body, world.vehicles[w, k], offsets, out)
    if shows(offsets, part.FEELING):
        feel(world, w, k, out[offsets[part.FEELERS] : offsets[part.FEELERS] + FEELERS])
    if shows(offsets, part.MOVING):
        fill_movers(world, w, k, frame, offsets, out)
    if shows(offsets, part.BOXES):
        fill_things(world, w, frame, True, offsets, out)
    if shows(offsets, part.HAZARDS_AHEAD):
        fill_things(world, w, frame, False, offsets, out)


@kernel
def observe_karts(world: World, offsets: Ints, presets: Ints, out: Float32s) -> None:
    """Fill `out`, shape (W, K, size), for every kart of every world in one call.

    offsets: (P, parts + 1) of each preset; presets: (K,) the row of `offsets` that each kart
    gets, -1 for none.
    """
    for w in range(world.bodies.shape[0]):
        for k in range(world.bodies.shape[1]):
            if presets[k] >= 0:
                observe(world, w, k, offsets[presets[k]], out[w, k])


@kernel
def look_ahead_of(vehicle: Record) -> float:
    """Return the distance [m] between two look-ahead samples."""
    return max(vehicle.length, LOOK_AHEAD_S * vehicle.top_speed)


@kernel
def line_step_of(vehicle: Record) -> float:
    """Return the distance [m] between two samples of the reference line ahead."""
    return 0.5 * vehicle.length


@kernel
def _fill_scans(world: World, w: int, k: int, offsets: Ints, out: Float32s) -> None:
    sight = world.sight
    put_all(out, offsets[part.LIDAR], sight.lidar[w, k, 0])
    put_all(out, offsets[part.LIDAR_BEFORE], sight.lidar[w, k, 1])
    put_all(out, offsets[part.RADAR], sight.radar[w, k])
    put_all(out, offsets[part.RADAR_KIND], sight.radar_kinds[w, k])
    put_all(out, offsets[part.RADAR_BEFORE], sight.radar_before[w, k])


@kernel
def _fill_motion(body: Record, offsets: Ints, out: Float32s) -> None:
    put(out, offsets[part.SPEED], 0, body.speed)
    put(out, offsets[part.LATERAL_SPEED], 0, body.lateral_speed)
    put(out, offsets[part.YAW_RATE], 0, body.yaw_rate)
    put(out, offsets[part.STEERING], 0, body.steering)


@kernel
def _fill_game(world: World, w: int, k: int, offsets: Ints, out: Float32s) -> None:
    """Fill the item held, and what flags, effects and the surface leave of speed and force."""
    body, player = world.bodies[w, k], world.players[w, k]
    put(out, offsets[part.ITEM], 0, float(player.held))
    use = world.items[player.held].use
    for index in range(USES):
        put(out, offsets[part.ITEM_USE], index, 1.0 if use == index + 1 else 0.0)
    put(out, offsets[part.SPEED_CAP], 0, body.speed_cap)
    put(out, offsets[part.THRUST_SCALE], 0, body.thrust_scale)
    put(out, offsets[part.GRIP_SCALE], 0, body.grip_scale)


@kernel
def _fill_race(world: World, w: int, k: int, offsets: Ints, out: Float32s) -> None:
    """Fill what race control shows and how the race stands."""
    body, racer, race = world.bodies[w, k], world.racers[w, k], world.races[w]
    until_start = max(max(race.start_tick, race.hold_until) - race.tick, 0)
    put(out, offsets[part.LIGHTS], 0, until_start * TICK_S)
    put(out, offsets[part.FLAG], 0, float(max(race.flag, racer.yellow)))
    put(out, offsets[part.LAP], 0, float(racer.laps))
    put(out, offsets[part.RANK], 0, float(racer.rank))
    if offsets[part.GAP_AHEAD] >= 0:
        out[offsets[part.GAP_AHEAD]] = _gap(world, w, k, -1)
    if offsets[part.GAP_BEHIND] >= 0:
        out[offsets[part.GAP_BEHIND]] = _gap(world, w, k, 1)
    put(out, offsets[part.WRONG_WAY], 0, float(racer.wrong_way))
    put(out, offsets[part.RESCUE_OFFERED], 0, float(racer.rescue_offered))
    put(out, offsets[part.FINISHED], 0, 1.0 if body.status != codes.RACING else 0.0)


@kernel
def _gap(world: World, w: int, k: int, places: int) -> float:
    """Return the distance [m] to the kart `places` places behind, 0 where there is none."""
    racer = world.racers[w, k]
    for other in range(world.bodies.shape[1]):
        rival = world.racers[w, other]
        if world.bodies[w, other].status != codes.ABSENT and rival.rank == racer.rank + places:
            return abs(rival.ranked - racer.ranked)
    return 0.0


@kernel
def _fill_place(world: World, w: int, k: int, offsets: Ints, out: Float32s) -> None:
    """Fill where the kart is on the course."""
    racer = world.racers[w, k]
    put(out, offsets[part.PROGRESS], 0, racer.progress)
    put(out, offsets[part.LATERAL_OFFSET], 0, racer.lateral_offset)
    put(out, offsets[part.HEADING_ERROR], 0, racer.heading_error)
    put(out, offsets[part.LOOK_AHEAD], 0, look_ahead_of(world.vehicles[w, k]))


@kernel
def _fill_course(
    world: World, w: int, k: int, frame: KartFrame, offsets: Ints, out: Float32s
) -> None:
    """Fill the centre line at the look-ahead distances, and the asphalt on both sides of it."""
    course = world.route.courses[world.rules[w].course]
    if course.line_count == 0:
        _fill_no_course(offsets, out)
        return
    step = look_ahead_of(world.vehicles[w, k]) / course.spacing
    here = world.racers[w, k].progress / course.spacing
    for index in range(AHEAD):
        sample = int(here + (index + 1) * step + 0.5) % course.line_count
        line = world.route.line[course.line_start + sample]
        ahead, left = to_frame(frame, line.x, line.y)
        put(out, offsets[part.CURVATURE], index, line.curvature)
        put(out, offsets[part.PATH_X], index, ahead)
        put(out, offsets[part.PATH_Y], index, left)
        put(out, offsets[part.LEFT], index, line.left)
        put(out, offsets[part.RIGHT], index, line.right)


@kernel
def _fill_no_course(offsets: Ints, out: Float32s) -> None:
    """Fill zeros where a course would lie ahead: a car park has none."""
    for number in part.COURSE:
        for index in range(AHEAD):
            put(out, offsets[number], index, 0.0)


@kernel
def _place_on_line(world: World, w: int, k: int, offsets: Ints) -> float:
    """Return where the kart is abreast of the reference line, as a fractional sample of it.

    -1 where the race has no line, or the layout shows nothing that needs the place.
    """
    course = world.route.courses[world.rules[w].course]
    if course.reference_spacing <= 0.0 or not (
        shows(offsets, part.LINE) or shows(offsets, part.KARTS_ON_LINE)
    ):
        return -1.0
    body, racer = world.bodies[w, k], world.racers[w, k]
    return place_on_reference(world.route, course, body.x, body.y, racer.line_index)


@kernel
def _fill_line(
    world: World, w: int, k: int, here: float, frame: KartFrame, offsets: Ints, out: Float32s
) -> None:
    """Fill where the kart is beside the reference line, and the line from there on.

    here: fractional sample abreast of the kart, negative where the race has no line.
    """
    if here < 0.0:
        put(out, offsets[part.LINE_OFFSET], 0, 0.0)
        put(out, offsets[part.LINE_HEADING], 0, 0.0)
        put(out, offsets[part.LINE_STEP], 0, 0.0)
        put(out, offsets[part.LINE_HELD], 0, 0.0)
        for number in part.LINE_AHEAD:
            for index in range(AHEAD):
                put(out, offsets[number], index, 0.0)
        return
    body, route = world.bodies[w, k], world.route
    course = route.courses[world.rules[w].course]
    sample = int(here + 0.5) % course.line_count
    point = route.reference[course.line_start + sample]
    along = (body.x - point.x) * point.cos + (body.y - point.y) * point.sin
    heading = wrap_angle(body.heading - point.heading - along * point.curvature)
    put(out, offsets[part.LINE_OFFSET], 0, offset_from(point, body))
    put(out, offsets[part.LINE_HEADING], 0, heading)
    put(out, offsets[part.LINE_STEP], 0, line_step_of(world.vehicles[w, k]))
    step = line_step_of(world.vehicles[w, k]) / course.reference_spacing
    for index in range(AHEAD):
        _fill_line_sample(world, w, here + index * step, index, frame, offsets, out)
    last = course.line_start + int(here + (AHEAD - 1) * step + 0.5) % course.line_count
    put(out, offsets[part.LINE_HELD], 0, route.reference[last].held)


@kernel
def _fill_line_sample(
    world: World, w: int, place: float, index: int, frame: KartFrame, offsets: Ints, out: Float32s
) -> None:
    """Fill element `index` of the parts ahead with the reference line at a fractional sample."""
    course = world.route.courses[world.rules[w].course]
    sample = int(place)
    share = place - sample
    sample %= course.line_count
    following = sample + 1 if sample + 1 < course.line_count else 0
    one = world.route.reference[course.line_start + sample]
    two = world.route.reference[course.line_start + following]
    ahead, left = to_frame(frame, one.x + share * (two.x - one.x), one.y + share * (two.y - one.y))
    curvature = one.curvature + share * (two.curvature - one.curvature)
    put(out, offsets[part.LINE_X], index, ahead)
    put(out, offsets[part.LINE_Y], index, left)
    put(out, offsets[part.LINE_CURVATURE], index, curvature)
    put(out, offsets[part.LINE_SPEED], index, one.speed + share * (two.speed - one.speed))
    put(out, offsets[part.LINE_LEFT], index, one.left + share * (two.left - one.left))
    put(out, offsets[part.LINE_RIGHT], index, one.right + share * (two.right - one.right))
