"""Judge blows by the rules of the race: contacts that count, warnings, retirements."""

import math

from race_server.core import codes
from race_server.core.kernels.boxes import hull_of
from race_server.core.kernels.contacts import Material
from race_server.core.kernels.jit import kernel
from race_server.core.rules import edition
from race_server.core.rules.conduct import is_new_touch, is_ramming
from race_server.core.stages.blocks import Standing
from race_server.core.stages.contacts import Blow, is_blow, next_body_blow
from race_server.core.stages.events import report, retire
from race_server.core.stages.wall_contacts import next_wall_blow
from race_server.core.state import World

# A touch softer than this closing speed [m/s] is no event.
TOUCH_SPEED = 0.2


@kernel
def touch_karts(world: World, w: int) -> None:
    """Resolve contacts between karts, and judge every blow before the next."""
    rules, tick = world.rules[w], world.races[w].tick
    if rules.kart_contact == codes.GHOST or world.bodies.shape[1] == 1:
        return
    bodies, vehicles, turns = world.bodies[w], world.vehicles[w], world.turns[w]
    material = Material(rules.restitution, rules.wall_friction)
    cursor = 0
    while cursor >= 0:
        blow = next_body_blow(bodies, vehicles, turns, tick, material, cursor)
        cursor = blow.cursor
        if is_blow(blow):
            _judge_contact(world, w, blow)


@kernel
def touch_walls(world: World, w: int) -> None:
    """Resolve contacts with borders and obstacles; judge the first hard blow of each kart."""
    rules = world.rules[w]
    site = world.walls.sites[rules.course]
    bodies, vehicles = world.bodies[w], world.vehicles[w]
    standing = Standing(world.parking.blocks[w], world.parking.rooms[w])
    material = Material(rules.restitution, rules.wall_friction)
    # Where a touch ends the race, the softest one does.
    softest = 0.0 if rules.wall_contact == codes.RETIRE else TOUCH_SPEED
    cursor = 0
    while cursor >= 0:
        blow = next_wall_blow(
            bodies, vehicles, world.walls, site, standing, material, softest, cursor
        )
        cursor = blow.cursor
        if is_blow(blow):
            _judge_wall_contact(world, w, blow)


@kernel
def _judge_contact(world: World, w: int, blow: Blow) -> None:
    """Count a contact of two karts and warn one that rammed; retire both where the rules say so."""
    rules, tick = world.rules[w], world.races[w].tick
    a, b = world.racers[w, blow.first], world.racers[w, blow.second]
    is_new = is_new_touch(tick, a.contact_kart_tick, a.contacts)
    if rules.edition >= edition.SECOND and is_new_touch(tick, b.contact_kart_tick, b.contacts):
        is_new = True  # of two karts either may have touched a third one a moment ago
    if blow.closing > TOUCH_SPEED and is_new:
        a.contact_kart_tick = tick
        b.contact_kart_tick = tick
        a.contacts += 1
        b.contacts += 1
        value = round(blow.impulse * 1000.0)
        report(world, w, codes.EVENT_CONTACT_KART, blow.first, blow.second, value)
        if rules.ram_speed > 0.0:
            _judge_ramming(world, w, blow, is_first=True)
            _judge_ramming(world, w, blow, is_first=False)
    note_touch(world, w, blow.first, blow.kind)
    note_touch(world, w, blow.second, blow.kind)
    if rules.kart_contact == codes.RETIRE:
        retire(world, w, blow.first, codes.CRASH)
        retire(world, w, blow.second, codes.CRASH)


@kernel
def _judge_wall_contact(world: World, w: int, blow: Blow) -> None:
    """Count a contact with a wall, and retire the kart where that ends its race."""
    k, tick = blow.first, world.races[w].tick
    body, racer = world.bodies[w, k], world.racers[w, k]
    if blow.closing > TOUCH_SPEED and body.status == codes.RACING:
        if is_new_touch(tick, racer.contact_wall_tick, racer.wall_contacts):
            racer.contact_wall_tick = tick
            racer.wall_contacts += 1
            racer.lap_clean = 0
            report(world, w, codes.EVENT_CONTACT_WALL, k, -1, round(blow.impulse * 1000.0))
    note_touch(world, w, k, blow.kind)
    if world.rules[w].wall_contact == codes.RETIRE:
        retire(world, w, k, codes.CRASH)


@kernel
def note_touch(world: World, w: int, k: int, kind: int) -> None:
    """Record what a vehicle on its way to a slot ran into last. kind: RayHit."""
    parkers = world.parking.parkers[w]
    if len(parkers) > 0 and world.bodies[w, k].status == codes.RACING:
        parkers[k].touched = kind


@kernel
def _judge_ramming(world: World, w: int, blow: Blow, is_first: bool) -> None:
    """Warn, and in the end remove, one of the two karts if it drove into the other."""
    k, other = (blow.first, blow.second) if is_first else (blow.second, blow.first)
    # The normal points to the kart that is judged.
    nx, ny = (blow.nx, blow.ny) if is_first else (-blow.nx, -blow.ny)
    approach = blow.first_approach if is_first else blow.second_approach
    kart = hull_of(world.vehicles[w, k], world.bodies[w, k], 0)
    hit = hull_of(world.vehicles[w, other], world.bodies[w, other], 0)
    cos, sin = math.cos(hit.heading), math.sin(hit.heading)
    c, s = math.cos(kart.heading), math.sin(kart.heading)
    front = kart.offset + kart.half_length
    dx, dy = kart.x + front * c - hit.x, kart.y + front * s - hit.y
    nose = dx * cos + dy * sin - hit.offset
    rules, racer = world.rules[w], world.racers[w, k]
    if not is_ramming(-(nx * c + ny * s), nose, blow.closing, approach, rules.ram_speed):
        return
    racer.warnings += 1
    report(world, w, codes.EVENT_WARNING, k, other, racer.warnings)
    if 0 < rules.ram_warnings <= racer.warnings:
        retire(world, w, k, codes.RAMMING)
