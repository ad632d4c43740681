"""What a vehicle's rays have met of people and of other vehicles, and remembers for a while.

Between two rays a person is not seen, and one scan does not tell where they go. So each vehicle of
a car park keeps where a ray met each moving thing last, and how fast that went from one sighting to
the next. What a ray has met is known with its middle: to tell a person from a post is taken for
granted, as it is where the radar says what it hit.
"""

import math

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rays import Fan
from race_server.core.observation_parts import MOVERS
from race_server.core.stages import observed_parts as part
from race_server.core.stages.observed_parts import KartFrame, put, to_frame
from race_server.core.state import Float32s, Ints, Record, World

# A range may be off by this [m] and still be that of a thing: noise of the sensor.
NOISE = 0.1
# Two sightings further apart [s] do not tell a speed.
APART = 1.0
# What was not met for longer [s] is forgotten. This far away [m] is said to be what there is not.
REMEMBERED, NOWHERE = 5.0, 100.0


@kernel
def forget_sightings(world: World, w: int) -> None:
    """Forget all that the vehicles of one world have seen."""
    sightings = world.sight.sightings
    for k in range(sightings.shape[1]):
        for number in range(sightings.shape[2]):
            sighting = sightings[w, k, number]
            sighting.x = sighting.y = sighting.speed_x = sighting.speed_y = 0.0
            sighting.seen = 0


@kernel
def note_sightings(world: World, w: int, k: int, fan: Fan, ranges: Float32s) -> None:
    """Note which vehicles and people the rays of a fan have met. ranges: (R,) [m] of kart k."""
    for number in range(world.sight.sightings.shape[2]):
        if _is_there(world, w, k, number):
            x, y, inner, outer = _disc_of(world, w, number)
            if _is_met(fan, ranges, x, y, inner, outer):
                _note(world.sight.sightings[w, k, number], x, y, world.races[w].tick)


@kernel
def _is_there(world: World, w: int, k: int, number: int) -> bool:
    """Return whether there is a moving thing of this number that vehicle k may see."""
    vehicles = world.bodies.shape[1]
    if number >= vehicles:
        return bool(world.parking.walkers[w, number - vehicles].radius > 0.0)
    body = world.bodies[w, number]
    return bool(number != k and body.status != codes.ABSENT and body.trust < codes.SUSPENDED)


@kernel
def _disc_of(world: World, w: int, number: int) -> tuple[float, float, float, float]:
    """Return the middle of a vehicle or a person, and the discs within it and around it [m]."""
    vehicles = world.bodies.shape[1]
    if number >= vehicles:
        walker = world.parking.walkers[w, number - vehicles]
        return walker.x, walker.y, walker.radius, walker.radius
    body, vehicle = world.bodies[w, number], world.vehicles[w, number]
    cos, sin = cos_sin(body.heading)
    x, y = body.x + vehicle.box_offset * cos, body.y + vehicle.box_offset * sin
    long, wide = 0.5 * vehicle.length, 0.5 * vehicle.width
    return x, y, wide, math.sqrt(long * long + wide * wide)


@kernel
def _is_met(fan: Fan, ranges: Float32s, x: float, y: float, inner: float, outer: float) -> bool:
    """Return whether a ray of a fan ends on a thing.

    ranges: (R,) [m]; x, y: its middle; inner, outer: radii of the discs in it and around it [m].
    """
    dx, dy = x - fan.x, y - fan.y
    far = fan.reach + outer
    if dx * dx + dy * dy > far * far:
        return False
    along, across = dx * fan.cos + dy * fan.sin, dy * fan.cos - dx * fan.sin
    for ray in range(len(fan.rays)):
        cos, sin = fan.rays[ray, 0], fan.rays[ray, 1]
        ahead, aside = along * cos + across * sin, across * cos - along * sin
        if abs(aside) <= inner and ahead > 0.0:
            if ahead - outer - NOISE <= ranges[ray] <= ahead + NOISE:
                return True
    return False


@kernel
def _note(sighting: Record, x: float, y: float, tick: int) -> None:
    """Note where a thing is at a tick [m], and its speed since it was seen before."""
    elapsed = tick + 1 - sighting.seen
    if elapsed == 0:  # another sensor has met it in this tick
        return
    sighting.speed_x, sighting.speed_y = 0.0, 0.0
    if sighting.seen > 0 and elapsed * TICK_S <= APART:
        sighting.speed_x = (x - sighting.x) / (elapsed * TICK_S)
        sighting.speed_y = (y - sighting.y) / (elapsed * TICK_S)
    sighting.x, sighting.y, sighting.seen = x, y, tick + 1


@kernel
def fill_movers(
    world: World, w: int, k: int, frame: KartFrame, offsets: Ints, out: Float32s
) -> None:
    """Fill the nearest things that were seen moving, where they would be by now."""
    nearest = -1.0
    for place in range(MOVERS):
        found, least = -1, math.inf
        for number in range(world.sight.sightings.shape[2]):
            away = _away(world, w, k, number, frame)
            if nearest < away < least:
                found, least = number, away
        _put_mover(world, w, k, found, frame, offsets, place, out)
        nearest = least


@kernel
def _age(world: World, w: int, sighting: Record) -> float:
    """Return for how long [s] a thing was not met; infinite where it is forgotten."""
    age = (world.races[w].tick + 1 - sighting.seen) * TICK_S
    return age if sighting.seen > 0 and age <= REMEMBERED else math.inf


@kernel
def _away(world: World, w: int, k: int, number: int, frame: KartFrame) -> float:
    """Return how far away [m] a thing would be by now; infinite where it is forgotten."""
    sighting = world.sight.sightings[w, k, number]
    age = _age(world, w, sighting)
    if age == math.inf:
        return math.inf
    dx = sighting.x + sighting.speed_x * age - frame.x
    dy = sighting.y + sighting.speed_y * age - frame.y
    return math.sqrt(dx * dx + dy * dy)


@kernel
def _put_mover(
    world: World,
    w: int,
    k: int,
    number: int,
    frame: KartFrame,
    offsets: Ints,
    place: int,
    out: Float32s,
) -> None:
    """Write one moving thing into the parts of movers; number: -1 for none."""
    x, y, speed_x, speed_y, age, radius = NOWHERE, 0.0, 0.0, 0.0, REMEMBERED, 0.0
    if number >= 0:
        sighting = world.sight.sightings[w, k, number]
        age = _age(world, w, sighting)
        x, y = to_frame(
            frame, sighting.x + sighting.speed_x * age, sighting.y + sighting.speed_y * age
        )
        speed_x = sighting.speed_x * frame.cos + sighting.speed_y * frame.sin
        speed_y = sighting.speed_y * frame.cos - sighting.speed_x * frame.sin
        radius = _disc_of(world, w, number)[2]
    put(out, offsets[part.MOVERS_X], place, x)
    put(out, offsets[part.MOVERS_Y], place, y)
    put(out, offsets[part.MOVERS_SPEED_X], place, speed_x)
    put(out, offsets[part.MOVERS_SPEED_Y], place, speed_y)
    put(out, offsets[part.MOVERS_AGE], place, age)
    put(out, offsets[part.MOVERS_RADIUS], place, radius)
