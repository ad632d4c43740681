"""Pictures of car parks: what is fixed, and one drawn round, as PNG or SVG."""

import math
from pathlib import Path
from typing import Any

from race_server.core import codes
from race_server.core.state import World
from race_server.core.vehicles import vehicle_named
from race_server.scenario.lot.check import body_at, slot_at
from race_server.scenario.lot.faults import slots_of
from race_server.scenario.lot.footprint import Footprint
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.site import area_in, polygons_in
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.sheet import INK, draw_into, draw_obstacles, finish

GROUND, WALL, LINE = "#5b5f66", "#c62828", "white"
START, GOAL, CAR, BLOCK, PERSON = "#4fc3f7", "#66bb6a", "#aab2bd", "#f0ad4e", "#f27ba5"
ZONES = {"start": START, "goal": GOAL, "blocks": BLOCK, "people": PERSON}


def draw_lot(name: str, seed: int, path: Path, vehicle: str = "") -> None:
    """Draw a car park, with the round of a seed in it, into a file.

    vehicle: name, that of the lot where it is empty.

    Raises:
        LotError, TrackError, VehicleError: there is no such lot or vehicle, the file's suffix is
            neither .png nor .svg, or it cannot be written.
    """
    course = load_lot(name)
    world = make_world(parking_scenario(name, vehicle=vehicle), seeds=[seed])
    assert course.lot is not None
    size = vehicle_named(vehicle or course.lot.vehicle)

    def paint(axes: Any) -> None:
        _draw_site(axes, course)
        _draw_round(axes, world)
        parker = world.parking.parkers[0, 0]
        _draw_box(axes, slot_at(parker), GOAL, 3)
        _point(axes, slot_at(parker))
        body = body_at(world.bodies[0, 0], size)
        _draw_box(axes, body, START, 6)
        _point(axes, body)
        away = math.hypot(body.x - parker.x, body.y - parker.y)
        finish(axes, f"{course.title}   {size.name}, seed {seed}: {away:.1f} m to the slot")

    draw_into(path, course, paint)


def _draw_site(axes: Any, course: Course) -> None:
    """Draw what is the same in every round: ground, walls, slots, zones."""
    area, polygons = area_in(course), polygons_in(course)
    axes.fill(area[:, 0], area[:, 1], color=GROUND, zorder=1)
    for loop in (area, *polygons):
        closed = _closed(loop)
        axes.plot(closed[:, 0], closed[:, 1], color=WALL, linewidth=1.8, zorder=5)
    for polygon in polygons:
        axes.fill(polygon[:, 0], polygon[:, 1], color=BLOCK, zorder=4)
    draw_obstacles(axes, course.obstacles)
    for slot in slots_of(course):
        corners = slot.corners
        order = corners[[0, 1, 2, 3, 0]]
        axes.plot(order[:, 0], order[:, 1], color=LINE, linewidth=0.8, zorder=2)
        _point(axes, slot, LINE)
    assert course.lot is not None
    for zone in course.lot.zones:
        (x0, x1), (y0, y1) = zone.x, zone.y
        colour = ZONES[zone.role]
        corners_x, corners_y = (x0, x1, x1, x0, x0), (y0, y0, y1, y1, y0)
        axes.fill(corners_x, corners_y, color=colour, alpha=0.15, zorder=2)
        axes.plot(corners_x, corners_y, color=colour, linewidth=1.0, dashes=(4, 3), zorder=2)
        # Blocks and people often share their place: the one name above the edge, the other below.
        side = "top" if zone.role == "people" else "bottom"
        axes.annotate(zone.role, (x0, y1), fontsize=7, color=colour, va=side, zorder=8)


def _draw_round(axes: Any, world: World) -> None:
    """Draw what one seed drew besides start and slot: blocks, parked vehicles, people."""
    for block in world.parking.blocks[0]:
        if block.kind != codes.NOTHING:
            colour = CAR if block.kind == codes.KART_HIT else BLOCK
            length, width = 2.0 * block.half_length, 2.0 * block.half_width
            place = Footprint(block.x, block.y, block.heading, length, width)
            _draw_box(axes, place, colour, 4)
    for walker in world.parking.walkers[0]:
        if walker.radius > 0.0:
            way_x, way_y = (walker.x, walker.to_x), (walker.y, walker.to_y)
            axes.plot(way_x, way_y, color=PERSON, linewidth=1.0, dashes=(2, 2), zorder=5)
            axes.scatter([walker.x], [walker.y], s=24, color=PERSON, edgecolor=INK, zorder=6)


def _draw_box(axes: Any, place: Footprint, colour: str, order: int) -> None:
    corners = place.corners
    axes.fill(corners[:, 0], corners[:, 1], facecolor=colour, edgecolor=INK, zorder=order)


def _point(axes: Any, place: Footprint, colour: str = INK) -> None:
    """Draw an arrow from the middle of a rectangle in the direction of its heading."""
    ahead = 0.42 * place.length
    tip = (place.x + ahead * math.cos(place.heading), place.y + ahead * math.sin(place.heading))
    arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", tip, (place.x, place.y), arrowprops=arrow, zorder=7)


def _closed(loop: Floats) -> Floats:
    """Return the points of a loop of segments, the first again at the end."""
    return loop[[*range(len(loop)), 0], :2]
