"""What a round in a car park has drawn: slots to go to, blocks, parked vehicles, people."""

import numpy as np

from race_server.core import codes
from race_server.core.state import Bytes, Floats, World
from race_server.envs.render.brush import dot, fill
from race_server.envs.render.colours import (
    ASPHALT,
    CONCRETE,
    INK,
    MINE,
    PERSON,
    STANDING,
    WHITE,
    Colour,
    colour_of,
    mixed,
)
from race_server.envs.render.pieces import places_of
from race_server.envs.render.view import View
from race_server.scenario.lot.footprint import Footprint

_SMALLEST_PERSON = 4  # [px] radius
_FILLED, _TINTED = 0.5, 0.16  # how densely the slot of the vehicle followed is filled, and others
# An arrow head in a slot, by its tip and its wings in shares of half the length and of the width.
_TIP, _WING = 0.84, 0.32


def draw_round(frame: Bytes, view: View, world: World, w: int, followed: int) -> None:
    """Draw what one round has drawn, below the vehicles; nothing in a race.

    followed: number of the vehicle whose slot stands out, -1 for none.
    """
    for k, parker in enumerate(world.parking.parkers[w]):
        if parker.length > 0.0 and world.bodies[w, k].status != codes.ABSENT:
            slot = Footprint(parker.x, parker.y, parker.heading, parker.length, parker.width)
            colour = MINE if k == followed else colour_of(world.bodies[w, k], k)
            _draw_goal(frame, view, slot, colour, _FILLED if k == followed else _TINTED)
    blocks = world.parking.blocks[w]
    for one in blocks[blocks["kind"] != codes.NOTHING]:
        box = Footprint(one.x, one.y, one.heading, 2.0 * one.half_length, 2.0 * one.half_width)
        paint = STANDING if one.kind == codes.KART_HIT else CONCRETE
        fill(
            frame, [(_pixels(view, box), INK), (_pixels(view, box.grown(-1.0 / view.scale)), paint)]
        )
    walkers = world.parking.walkers[w]
    are_there = walkers["radius"] > 0.0
    radii = walkers["radius"][are_there] * view.scale
    for place, radius in zip(places_of(view, walkers, are_there), radii, strict=True):
        size = max(round(radius), _SMALLEST_PERSON)
        dot(frame, place, size + 1, INK)
        dot(frame, place, size, PERSON)


def _draw_goal(frame: Bytes, view: View, slot: Footprint, colour: Colour, density: float) -> None:
    """Draw a slot to go to: its outline, its ground, and an arrow where a vehicle looks there."""
    wing = _WING * min(slot.length, slot.width)
    tip = 0.5 * _TIP * slot.length
    along, across = np.array([[tip, tip - wing, tip - wing], [0.0, wing, -wing]])
    cos, sin = np.cos(slot.heading), np.sin(slot.heading)
    arrow = np.stack([slot.x + cos * along - sin * across, slot.y + sin * along + cos * across], 1)
    inside = _pixels(view, slot.grown(-2.0 / view.scale))
    tint = mixed(colour, ASPHALT, density)
    fill(frame, [(_pixels(view, slot), colour), (inside, tint), (view.pixels(arrow), WHITE)])


def _pixels(view: View, place: Footprint) -> Floats:
    return view.pixels(place.corners)
