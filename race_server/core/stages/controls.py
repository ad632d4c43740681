"""Before the motion: effects that end, what flags and effects leave, and the use of items."""

import math

import numpy as np

from race_server.core import codes
from race_server.core.kernels.course import way_to
from race_server.core.kernels.jit import kernel
from race_server.core.rules.effects import add_effect, is_harmless, sum_effects, surface_grip
from race_server.core.stages.events import report
from race_server.core.state import EFFECTS, HAZARDS, Floats, Record, World

# A yellow flag around a kart begins so many lengths before it and ends so many behind.
YELLOW_BEFORE, YELLOW_BEHIND = 12.0, 3.0


@kernel
def take_controls(world: World, w: int, controls: Floats) -> None:
    """Store what the drivers want. controls: (K, 4) steering, throttle, brake, buttons.

    Whatever is not a number counts as zero, whatever is out of range as the limit. They are
    rounded to the digits that a message and a recording hold, whoever drives.
    """
    for k in range(world.bodies.shape[1]):
        body = world.bodies[w, k]
        body.steering_command = _share(controls[k, 0], -1.0)
        body.throttle = _share(controls[k, 1], -1.0)
        body.brake = _share(controls[k, 2], 0.0)
        buttons = controls[k, 3]
        body.buttons = int(buttons) if 0.0 <= buttons < 4.0 else 0


@kernel
def _share(value: float, low: float) -> float:
    if math.isnan(value):
        return 0.0
    return float(np.float32(min(max(value, low), 1.0)))


@kernel
def apply_effects(world: World, w: int) -> None:
    """End effects whose time is over and work out what is left of speed, motor and grip."""
    race, rules = world.races[w], world.rules[w]
    held = race.flag == codes.RED or race.tick < race.hold_until
    show_yellow(world, w)
    for k in range(world.bodies.shape[1]):
        body, racer, player = world.bodies[w, k], world.racers[w, k], world.players[w, k]
        if body.status == codes.ABSENT:
            continue
        for index in range(EFFECTS):
            effect = player.effects[index]
            if effect.source > 0 and race.tick >= effect.until_tick:
                _end_effect(world, w, k, effect)
        speed, thrust, grip = sum_effects(player)
        body.speed_cap = speed * world.vehicles[w, k].top_speed
        body.thrust_scale = thrust
        body.grip_scale = grip * surface_grip(body.surface)
        if held or body.status != codes.RACING or body.trust >= codes.SUSPENDED:
            body.speed_cap = 0.0
        elif race.flag == codes.YELLOW or racer.yellow:
            body.speed_cap = min(body.speed_cap, rules.yellow_speed)


@kernel
def show_yellow(world: World, w: int) -> None:
    """Show a yellow flag to all karts near one whose place is in doubt, itself included."""
    karts = world.bodies.shape[1]
    troubled = False
    for k in range(karts):
        body, racer = world.bodies[w, k], world.racers[w, k]
        racer.yellow = 0
        troubled = troubled or _is_in_trouble(body)
    if not troubled:
        return
    course = world.route.courses[world.rules[w].course]
    for other in range(karts):
        trouble_body, trouble_racer = world.bodies[w, other], world.racers[w, other]
        if not _is_in_trouble(trouble_body):
            continue
        length = world.vehicles[w, other].length
        for k in range(karts):
            body, racer = world.bodies[w, k], world.racers[w, k]
            way = way_to(course, racer.progress, trouble_racer.progress)
            if -YELLOW_BEHIND * length <= way <= YELLOW_BEFORE * length:
                racer.yellow = 1


@kernel
def _is_in_trouble(body: Record) -> bool:
    return bool(body.trust >= codes.DOUBTFUL and body.status == codes.RACING)


@kernel
def _end_effect(world: World, w: int, k: int, effect: Record) -> None:
    item = world.items[effect.source]
    if item.immunity_ticks > 0:
        player = world.players[w, k]
        player.immune_until = max(player.immune_until, effect.until_tick + item.immunity_ticks)
    report(world, w, codes.EVENT_EFFECT_END, k, effect.source, 0)
    effect.source = 0


@kernel
def use_items(world: World, w: int) -> None:
    """Let every kart that presses the button anew use the item it holds."""
    race = world.races[w]
    for k in range(world.bodies.shape[1]):
        body, player = world.bodies[w, k], world.players[w, k]
        pressed = body.buttons & ~player.buttons_before
        player.buttons_before = body.buttons
        racing = body.status == codes.RACING and race.tick >= race.start_tick
        racing = racing and body.trust <= codes.TRUSTED
        if racing and pressed & codes.USE_ITEM and player.held > 0:
            _use(world, w, k)


@kernel
def _use(world: World, w: int, k: int) -> None:
    tick = world.races[w].tick
    racer, player = world.racers[w, k], world.players[w, k]
    number = player.held
    item = world.items[number]
    if item.use == codes.ON_KART_AHEAD and racer.rank <= 1:
        return  # nobody to act on: the item is kept
    player.held = 0
    player.items_used += 1
    report(world, w, codes.EVENT_USE, k, number, 0)
    if item.use == codes.ON_SELF:
        add_effect(player, item, number, tick)
    elif item.use == codes.GUARD:
        player.shield_until = tick + item.effect_ticks
    elif item.use == codes.PLACED:
        _place(world, w, k, number)
    else:
        for other in range(world.bodies.shape[1]):
            target_body, target_racer = world.bodies[w, other], world.racers[w, other]
            if target_racer.rank == racer.rank - 1 and target_body.status == codes.RACING:
                hit(world, w, other, k, number)


@kernel
def _place(world: World, w: int, k: int, number: int) -> None:
    """Leave a hazard just behind the kart; the oldest one makes room where all are in use."""
    tick = world.races[w].tick
    body, vehicle, item = world.bodies[w, k], world.vehicles[w, k], world.items[number]
    place = 0
    for index in range(HAZARDS):
        if world.hazards[w, index].until_tick < world.hazards[w, place].until_tick:
            place = index
    hazard = world.hazards[w, place]
    hazard.radius = item.radius * vehicle.width
    behind = 0.5 * vehicle.length - vehicle.box_offset + 1.5 * hazard.radius
    hazard.x = body.x - behind * math.cos(body.heading)
    hazard.y = body.y - behind * math.sin(body.heading)
    hazard.source = number
    hazard.owner = k
    hazard.until_tick = tick + item.life_ticks
    hazard.owner_safe_tick = tick + item.owner_grace_ticks


@kernel
def hit(world: World, w: int, k: int, cause: int, number: int) -> None:
    """Let an item's effect strike a kart, unless a shield or immunity takes it."""
    tick = world.races[w].tick
    player = world.players[w, k]
    if is_harmless(player, tick):
        report(world, w, codes.EVENT_BLOCKED_HIT, k, cause, number)
        if tick < player.shield_until:
            player.shield_until = tick  # a shield is used up by the hit it takes
        return
    player.hits += 1
    add_effect(player, world.items[number], number, tick)
    report(world, w, codes.EVENT_HIT, k, cause, number)
