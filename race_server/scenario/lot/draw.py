"""Pictures of car parks: what is fixed, and one drawn round, as PNG or SVG."""

import math
from pathlib import Path
from typing import Any

from race_server.scenario.lot.drawn import Drawn, draw_rounds
from race_server.scenario.lot.faults import slots_of
from race_server.scenario.lot.footprint import Footprint
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.site import area_in, polygons_in
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.sheet import INK, draw_into, draw_obstacles, finish

GROUND, WALL, LINE = "#5b5f66", "#c62828", "white"
START, GOAL, CAR, BLOCK, PERSON = "#4fc3f7", "#66bb6a", "#aab2bd", "#f0ad4e", "#f27ba5"
ZONES = {"start": START, "goal": GOAL, "blocks": BLOCK, "people": PERSON}


def draw_lot(name: str, seed: int, path: Path, vehicle: str = "", vehicles: int = 1) -> None:
    """Draw a car park, with the round of a seed in it, into a file.

    vehicle: name, that of the lot where it is empty; vehicles: that drive there.

    Raises:
        LotError, TrackError, VehicleError, ScenarioError: there is no such lot or vehicle, more
            vehicles than slots, the file's suffix is neither .png nor .svg, or it cannot be
            written.
    """
    course = load_lot(name)
    (drawn,) = draw_rounds(name, [seed], vehicle, vehicles)

    def paint(axes: Any) -> None:
        _draw_site(axes, course)
        _draw_round(axes, drawn)
        finish(axes, f"{course.title}   seed {seed}")

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


def _draw_round(axes: Any, drawn: Drawn) -> None:
    """Draw what one seed drew."""
    for colour, order, places in (
        (GOAL, 3, drawn.slots),
        (CAR, 4, drawn.parked),
        (BLOCK, 4, drawn.blocks),
        (START, 6, [box for boxes in drawn.boxes for box in boxes]),
    ):
        for place in places:
            _draw_box(axes, place, colour, order)
    for place in (*drawn.slots, *(boxes[0] for boxes in drawn.boxes)):
        _point(axes, place)
    # Which slot a vehicle goes to.
    for start, slot in zip(drawn.starts, drawn.slots, strict=True):
        axes.plot((start.x, slot.x), (start.y, slot.y), color=START, linewidth=0.5, zorder=3)
    for x, y, to_x, to_y in drawn.people:
        axes.plot((x, to_x), (y, to_y), color=PERSON, linewidth=1.0, dashes=(2, 2), zorder=5)
        axes.scatter([x], [y], s=24, color=PERSON, edgecolor=INK, zorder=6)


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
