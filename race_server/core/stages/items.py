"""Items: their use, what they do to karts, and how long it lasts."""

import math

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.rules import edition
from race_server.core.rules.effects import add_effect, is_harmless
from race_server.core.stages.events import report
from race_server.core.state import EFFECTS, HAZARDS, Record, World


@kernel
def end_effects(world: World, w: int) -> None:
    """End the effects whose time is over."""
    tick = world.races[w].tick
    for k in range(world.bodies.shape[1]):
        if world.bodies[w, k].status == codes.ABSENT:
            continue
        for index in range(EFFECTS):
            effect = world.players[w, k].effects[index]
            if effect.source > 0 and tick >= effect.until_tick:
                _end_effect(world, w, k, effect)


@kernel
def _end_effect(world: World, w: int, k: int, effect: Record) -> None:
    """Take an effect off a kart, which is immune for a while where the item says so."""
    item = world.items[effect.source]
    if item.immunity_ticks > 0:
        player = world.players[w, k]
        player.immune_until = max(player.immune_until, effect.until_tick + item.immunity_ticks)
    report(world, w, codes.EVENT_EFFECT_END, k, effect.source, 0)
    effect.source = 0


@kernel
def use_items(world: World, w: int) -> None:
    """Use the item of every kart that has pressed the button since the last tick."""
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
    """Use the item that a kart holds, if there is something to act on."""
    tick = world.races[w].tick
    player = world.players[w, k]
    number = player.held
    item = world.items[number]
    ahead, keeps = -1, False
    if item.use == codes.ON_KART_AHEAD:
        ahead = _kart_ahead(world, w, k)
        is_first = world.rules[w].edition < edition.SECOND
        keeps = world.racers[w, k].rank <= 1 if is_first else ahead < 0
    if keeps:
        return  # there is no kart to act on: the item is kept
    player.held = 0
    player.items_used += 1
    report(world, w, codes.EVENT_USE, k, number, 0)
    if item.use == codes.ON_SELF:
        add_effect(player, item, number, tick)
    elif item.use == codes.GUARD:
        player.shield_until = tick + item.effect_ticks
    elif item.use == codes.PLACED:
        _place(world, w, k, number)
    elif ahead >= 0:
        hit(world, w, ahead, k, number)


@kernel
def _kart_ahead(world: World, w: int, k: int) -> int:
    """Return the kart that races on at the nearest place before that of a kart, -1 without one.

    By the first edition of the rule book only the very next place counts.
    """
    own = world.racers[w, k].rank
    best = 0 if world.rules[w].edition >= edition.SECOND else own - 2
    found = -1
    for other in range(world.bodies.shape[1]):
        place = world.racers[w, other].rank
        if world.bodies[w, other].status == codes.RACING and best < place < own:
            found, best = other, place
    return found


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
    """Apply an item's effect to a kart, unless a shield or immunity protects it.

    cause: number of the kart that used the item; number: of the item.
    """
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
