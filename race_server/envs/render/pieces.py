"""What moves on a course or changes there: karts, boxes and hazards."""

import numpy as np
from numpy.typing import NDArray

from race_server.core.state import Bytes, Floats, Record, World
from race_server.core.vehicles import vehicle_of
from race_server.envs.render.brush import dot, fill, tile, write
from race_server.envs.render.colours import AMBER, INK, OIL, WHITE, Colour, colour_of, ink_on
from race_server.envs.render.view import SQUARE, View, turned

_SHORTEST_KART = 8.0  # [px]
_SMALLEST_BOX = 6  # [px]
_SMALLEST_HAZARD = 3  # [px] radius
_NARROWEST_NUMBERED = 11.0  # [px] a narrower kart has its number beside it


def draw_items(frame: Bytes, view: View, world: World, w: int) -> None:
    """Draw the boxes that are ready and the hazards that lie about."""
    tick, rules = world.races[w].tick, world.rules[w]
    if rules.items == 0:
        return
    side = max(round(2.0 * rules.pick_up_radius * view.scale), _SMALLEST_BOX)
    for place in places_of(view, world.boxes[w], tick >= world.boxes["ready_tick"][w]):
        tile(frame, place, side, side, INK)
        tile(frame, place, side - 2, side - 2, AMBER)
    hazards, are_live = world.hazards[w], tick < world.hazards["until_tick"][w]
    radii = hazards["radius"][are_live] * view.scale
    for place, radius in zip(places_of(view, hazards, are_live), radii, strict=True):
        dot(frame, place, max(round(radius), _SMALLEST_HAZARD), OIL)


def places_of(view: View, records: Record, which: NDArray[np.bool_]) -> Floats:
    """Return the pixel coordinates (N, 2) of some of the records."""
    return view.pixels(np.stack([records["x"][which], records["y"][which]], axis=1))


def draw_kart(frame: Bytes, view: View, world: World, w: int, k: int) -> None:
    """Draw a kart in its colour, with a light rim while nothing can hit it, and its number.

    Its trailers lie behind it, and under it where they reach over it.
    """
    body, player, vehicle = world.bodies[w, k], world.players[w, k], world.vehicles[w, k]
    scale = max(view.scale, _SHORTEST_KART / vehicle.length)  # [px/m] of this body
    half = 0.5 * scale * np.array([vehicle.length, vehicle.width])
    middle = view.pixels(np.array([[body.x, body.y]]))
    middle += turned(np.array([[scale * vehicle.box_offset, 0.0]]), -body.heading)
    is_safe = world.races[w].tick < max(player.immune_until, player.shield_until)
    rim, rim_colour = (2.5, WHITE) if is_safe else (1.0, INK)
    colour = colour_of(body, k)
    ink = ink_on(colour)
    _draw_trailers(frame, view, body, vehicle, (ink, colour))
    screen = SQUARE * half * (0.1, 0.75) + (0.66 * half[0], 0.0)
    shapes = (SQUARE * (half + rim), rim_colour), (SQUARE * half, colour), (screen, ink)
    fill(frame, [(middle + turned(shape, -body.heading), paint) for shape, paint in shapes])
    _draw_number(frame, view, k, middle[0], half, body.heading, ink)


def _draw_trailers(
    frame: Bytes, view: View, body: Record, vehicle: Record, paints: tuple[Colour, Colour]
) -> None:
    """Draw the boxes of trailers. paints: of their edges, and of what is inside."""
    if vehicle.trailer_count == 0:
        return
    headings = body.trailers["heading"].tolist()
    places = vehicle_of(vehicle).boxes_at(body.x, body.y, body.heading, headings)
    for x, y, heading, length, width in places[1:]:
        middle = view.pixels(np.array([[x, y]]))
        half = 0.5 * view.scale * np.array([length, width])
        shapes = [SQUARE * half, SQUARE * np.maximum(half - 1.0, 0.5)]
        turned_shapes = [middle + turned(shape, -heading) for shape in shapes]
        fill(frame, list(zip(turned_shapes, paints, strict=True)))


def _draw_number(
    frame: Bytes, view: View, k: int, middle: Floats, half: Floats, heading: float, ink: Colour
) -> None:
    """Write the number of a kart on its body, or beside one that is too narrow."""
    if 2.0 * half[1] >= _NARROWEST_NUMBERED:
        place = middle + turned(np.array([-0.15 * half[0], 0.0]), -heading)
        size = min(round(1.7 * half[1]), 2 * view.text)
        write(frame, str(k), size, (place[0], place[1]), ink, 0.5)
    else:
        # Even numbers to the left and odd ones to the right, as karts stand on a grid.
        away = (half[1] + 0.7 * view.text) * (1.0 if k % 2 else -1.0)
        place = middle + turned(np.array([0.0, away]), -heading)
        size = round(0.8 * view.text)
        write(frame, str(k), size, (place[0], place[1]), INK, 0.5, stroke=2)
        write(frame, str(k), size, (place[0], place[1]), WHITE, 0.5)
