"""What the stewards watch: false starts, wrong way, leaving the track, standing still."""

import math

from race_server.core import codes
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.trailers import straighten
from race_server.core.rules import edition
from race_server.core.rules.conduct import is_in_the_way
from race_server.core.stages.clearance import is_clear
from race_server.core.stages.events import penalise, report, retire
from race_server.core.state import World

# A kart that has moved further than this share of its length before the lights started early.
FALSE_START_SHARE = 0.25
# … and a real kart, whose place is known less well, further than this.
REAL_START_SHARE = 1.0
# After a rescue other karts drive through it for this time.
GHOST_TICKS = 120
# Places looked at for a rescue, each one length and a half further back.
RESCUE_TRIES = 16


@kernel
def steward(world: World, w: int) -> None:
    """Judge every racing kart."""
    race = world.races[w]
    for k in world.turns[w]:
        body = world.bodies[w, k]
        if body.status != codes.RACING or body.trust >= codes.DOUBTFUL:
            continue
        if race.tick < race.start_tick:
            _watch_start(world, w, k)
        else:
            _watch_direction(world, w, k)
            _watch_limits(world, w, k)
            _watch_standstill(world, w, k)
            _watch_stop(world, w, k)


@kernel
def _watch_start(world: World, w: int, k: int) -> None:
    """Fine a kart that moved before the lights, once."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    dx, dy = body.x - racer.start_x, body.y - racer.start_y
    share = FALSE_START_SHARE if body.trust <= codes.SIMULATED else REAL_START_SHARE
    allowed = share * world.vehicles[w, k].length
    if racer.false_started == 0 and dx * dx + dy * dy > allowed * allowed:
        racer.false_started = 1
        report(world, w, codes.EVENT_FALSE_START, k, -1, 0)
        penalise(world, w, k, world.rules[w].false_start_us, codes.EVENT_FALSE_START)


@kernel
def _watch_direction(world: World, w: int, k: int) -> None:
    """Report a kart that begins or ends driving the wrong way; remove it in the end."""
    racer = world.racers[w, k]
    wrong = 1 if racer.backward > world.rules[w].wrong_way_limit else 0
    if wrong != racer.wrong_way:
        racer.wrong_way = wrong
        report(world, w, codes.EVENT_WRONG_WAY, k, -1, wrong)
    if 0.0 < world.rules[w].wrong_way_removal < racer.backward:
        retire(world, w, k, codes.WENT_WRONG_WAY)


@kernel
def _watch_limits(world: World, w: int, k: int) -> None:
    """Report a kart that leaves the asphalt or comes back."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    off = 1 if body.surface == codes.GRASS else 0
    if off != racer.off_track:
        racer.off_track = off
        racer.lap_clean = 0
        report(world, w, codes.EVENT_OFF_TRACK, k, -1, off)
    if off and world.rules[w].edition >= edition.SECOND:
        racer.lap_clean = 0  # nor is the next lap, where it crosses the line so


@kernel
def _watch_standstill(world: World, w: int, k: int) -> None:
    """Offer a kart that is stuck a rescue, and rescue it once it accepts."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    race, rules = world.races[w], world.rules[w]
    if body.trust > codes.SIMULATED:
        return  # a real kart is not put back on the line
    held = race.flag == codes.RED or race.tick < race.hold_until
    if held or abs(body.speed) > rules.stuck_speed:
        # A kart that only rocks on the spot stays stuck; real progress takes the offer back.
        racer.still_ticks = max(racer.still_ticks - 3, 0)
        if racer.still_ticks == 0:
            racer.rescue_offered = 0
        return
    racer.still_ticks += 1
    if rules.stuck_ticks > 0 and racer.still_ticks > rules.stuck_ticks and not racer.rescue_offered:
        racer.rescue_offered = 1
        report(world, w, codes.EVENT_STUCK, k, -1, 0)
    if racer.rescue_offered and body.buttons & codes.ACCEPT_RESCUE:
        rescue(world, w, k)


@kernel
def _watch_stop(world: World, w: int, k: int) -> None:
    """Remove a kart that stands too long. While another blocks it, its clock waits."""
    body, racer = world.bodies[w, k], world.racers[w, k]
    race, rules = world.races[w], world.rules[w]
    if rules.stopped_limit_ticks <= 0 or race.flag == codes.RED or race.tick < race.hold_until:
        return
    if abs(body.speed) > rules.stuck_speed:
        racer.stopped_ticks = max(racer.stopped_ticks - 3, 0)
    elif not _is_blocked(world, w, k):
        racer.stopped_ticks += 1
        if racer.stopped_ticks > rules.stopped_limit_ticks:
            retire(world, w, k, codes.STOPPED)


@kernel
def _is_blocked(world: World, w: int, k: int) -> bool:
    """Return whether another racing kart stands in the way of one that faces the right way.

    Of two that stand nose to nose the one that faces the wrong way is not blocked.
    """
    kart_body, racer, vehicle = world.bodies[w, k], world.racers[w, k], world.vehicles[w, k]
    if abs(racer.heading_error) > 0.5 * math.pi:
        return False
    cos, sin = math.cos(kart_body.heading), math.sin(kart_body.heading)
    for o in range(world.bodies.shape[1]):
        other, body = world.bodies[w, o], world.vehicles[w, o]
        if o == k or other.status != codes.RACING:
            continue
        turn = wrap_angle(other.heading - kart_body.heading)
        dx, dy = other.x - kart_body.x, other.y - kart_body.y
        along = dx * cos + dy * sin + body.box_offset * math.cos(turn) - vehicle.box_offset
        across = dy * cos - dx * sin + body.box_offset * math.sin(turn)
        if is_in_the_way(
            along, across, turn, vehicle.length, vehicle.width, body.length, body.width
        ):
            return True
    return False


@kernel
def rescue(world: World, w: int, k: int) -> None:
    """Put a kart on the centre line, at rest, where no other kart stands, for a penalty."""
    route, race, body, racer = world.route, world.races[w], world.bodies[w, k], world.racers[w, k]
    course = route.courses[world.rules[w].course]
    stride = int(1.5 * world.vehicles[w, k].length / course.spacing) + 1
    sample = racer.line_index
    for _ in range(RESCUE_TRIES):
        line = route.line[course.line_start + sample]
        if is_clear(world, w, k, world.bodies.shape[1], line.x, line.y, codes.RACING):
            break
        sample = (sample - stride) % course.line_count
    line = route.line[course.line_start + sample]
    body.x, body.y, body.heading = line.x, line.y, line.heading
    straighten(body, world.vehicles[w, k])
    body.speed = body.lateral_speed = body.yaw_rate = body.steering = 0.0
    # The way back counts as driven back, but not as driving the wrong way.
    back = racer.progress - sample * course.spacing
    racer.distance -= back if back > -0.5 * course.length else back + course.length
    racer.progress = sample * course.spacing
    racer.line_index = sample
    racer.backward = 0.0
    racer.wrong_way = 0
    racer.still_ticks = 0
    racer.stopped_ticks = 0
    racer.rescue_offered = 0
    racer.lap_clean = 0
    body.ghost_until = race.tick + GHOST_TICKS
    report(world, w, codes.EVENT_RESCUED, k, -1, 0)
    penalise(world, w, k, world.rules[w].rescue_us, codes.EVENT_RESCUED)
