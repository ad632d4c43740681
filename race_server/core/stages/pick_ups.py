"""Item boxes and hazards that karts drive into."""

from race_server.core import codes
from race_server.core.kernels.boxes import box_count, hull_of, reach_of
from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rng import ITEM_STREAM, uniform
from race_server.core.rules.draw import draw_item
from race_server.core.stages.events import report
from race_server.core.stages.items import hit
from race_server.core.state import HAZARDS, Record, World


@kernel
def pick_up_items(world: World, w: int) -> None:
    """Give karts the boxes and the hazards that they touch."""
    rules, race = world.rules[w], world.races[w]
    if rules.items == 0 or race.tick < race.start_tick:
        return
    for k in range(world.bodies.shape[1]):
        body, player = world.bodies[w, k], world.players[w, k]
        if body.status == codes.RACING and body.trust <= codes.TRUSTED:
            if player.held == 0:
                _pick_up(world, w, k)
            _suffer(world, w, k)


@kernel
def _covers(body: Record, vehicle: Record, x: float, y: float, radius: float) -> bool:
    """Return whether a circle touches a body.

    body: BODY; vehicle: VEHICLE; x, y, radius: of the circle [m].
    """
    dx, dy = x - body.x, y - body.y
    near = reach_of(vehicle) + radius
    if dx * dx + dy * dy > near * near:
        return False
    for number in range(box_count(vehicle)):
        hull = hull_of(vehicle, body, number)
        dx, dy = x - hull.x, y - hull.y
        cos, sin = cos_sin(hull.heading)
        along = abs(dx * cos + dy * sin - hull.offset) - hull.half_length
        across = abs(dy * cos - dx * sin) - hull.half_width
        along, across = max(along, 0.0), max(across, 0.0)
        if along * along + across * across <= radius * radius:
            return True
    return False


@kernel
def _pick_up(world: World, w: int, k: int) -> None:
    """Give a kart the item of the first box that it touches."""
    body, racer, player = world.bodies[w, k], world.racers[w, k], world.players[w, k]
    race, rules = world.races[w], world.rules[w]
    for index in range(world.boxes.shape[1]):
        box = world.boxes[w, index]
        if race.tick < box.ready_tick:
            continue
        if not _covers(body, world.vehicles[w, k], box.x, box.y, rules.pick_up_radius):
            continue
        chance = uniform(race.seed, ITEM_STREAM, race.tick, k)
        karts = _racing(world, w)
        player.held = draw_item(world.items, racer.rank, karts, rules.catch_up, chance)
        box.ready_tick = race.tick + rules.box_respawn_ticks
        report(world, w, codes.EVENT_PICK_UP, k, player.held, index)
        return


@kernel
def _racing(world: World, w: int) -> int:
    """Return how many karts are not absent."""
    count = 0
    for k in range(world.bodies.shape[1]):
        if world.bodies[w, k].status != codes.ABSENT:
            count += 1
    return count


@kernel
def _suffer(world: World, w: int, k: int) -> None:
    """Apply the hazards that a kart touches to it."""
    tick, body = world.races[w].tick, world.bodies[w, k]
    for index in range(HAZARDS):
        hazard = world.hazards[w, index]
        if tick >= hazard.until_tick:
            continue
        if hazard.owner == k and tick < hazard.owner_safe_tick:
            continue
        if _covers(body, world.vehicles[w, k], hazard.x, hazard.y, hazard.radius):
            hazard.until_tick = tick  # a hazard acts once
            hit(world, w, k, hazard.owner, hazard.source)
