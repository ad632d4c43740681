"""What of a race never moves: the course, drawn once."""

import numpy as np
from PIL import Image, ImageDraw

from race_server.core.state import Bytes, Floats
from race_server.envs.render.brush import flat
from race_server.envs.render.colours import (
    ASPHALT,
    CENTRE,
    CONCRETE,
    GRASS,
    INK,
    KERB,
    PAGE,
    WHITE,
    Colour,
)
from race_server.envs.render.view import View
from race_server.scenario.lot.faults import slots_of
from race_server.scenario.track.course import Course
from race_server.scenario.track.polyline import corners_of_box, is_inside, loops_of

_DETAIL = 2  # pixels per pixel and axis of the picture before it is scaled down


def background_of(course: Course, view: View) -> Bytes:
    """Return a course as an image (height, width, 3)."""
    fine = view.finer(_DETAIL)
    image = Image.new("RGB", fine.size, PAGE)
    pen = ImageDraw.Draw(image)
    loops = loops_of(course.borders)
    has_verge = course.kerb + course.grass > 0.0
    _fill_loops(pen, fine, loops, GRASS if has_verge else ASPHALT)
    if has_verge:
        _fill_ribbon(pen, fine, course, course.kerb, KERB)
        _fill_ribbon(pen, fine, course, 0.0, ASPHALT)
    if len(course.line):
        _draw_centre(pen, fine, course)
        _draw_timing_line(pen, fine, course)
    if course.lot is not None:
        _draw_slots(pen, fine, course)
    for loop in loops:
        ends = np.vstack([loop[:, :2], loop[-1:, 2:], loop[:1, 2:]])
        pen.line(flat(fine.pixels(ends)), fill=INK, width=2 * _DETAIL, joint="curve")
    for one in course.obstacles:
        box = corners_of_box(one.x, one.y, one.heading, one.length, one.width)
        pen.polygon(flat(fine.pixels(box)), fill=CONCRETE, outline=INK, width=_DETAIL)
    small = image.resize(view.size, Image.Resampling.LANCZOS)
    return np.array(small, np.uint8)


def _fill_loops(pen: ImageDraw.ImageDraw, view: View, loops: list[Floats], colour: Colour) -> None:
    """Fill what lies inside an odd number of loops."""
    depths = [
        sum(bool(is_inside(loop[:1, :2], other)[0]) for other in loops if other is not loop)
        for loop in loops
    ]
    for number in np.argsort(depths, kind="stable"):
        fill = PAGE if depths[number] % 2 else colour
        if len(loops[number]) > 2:
            pen.polygon(flat(view.pixels(loops[number][:, :2])), fill=fill)


def _fill_ribbon(
    pen: ImageDraw.ImageDraw, view: View, course: Course, beyond: float, colour: Colour
) -> None:
    left, right = (view.pixels(edge) for edge in course.edges(beyond))
    after = np.roll(np.arange(len(left)), -1)
    for piece in np.stack([left, left[after], right[after], right], axis=1):
        pen.polygon(flat(piece), fill=colour)


def _draw_centre(pen: ImageDraw.ImageDraw, view: View, course: Course) -> None:
    dash = 8.0 * _DETAIL / view.scale  # [m]
    progress = course.spacing * np.arange(len(course.line) + 1)
    closed = np.vstack([course.line[:, :2], course.line[:1, :2]])
    for start in np.arange(0.0, course.length, 2.0 * dash):
        at = np.linspace(start, min(start + dash, course.length), 4)
        points = np.stack([np.interp(at, progress, closed[:, axis]) for axis in (0, 1)], axis=1)
        pen.line(flat(view.pixels(points)), fill=CENTRE, width=_DETAIL)


def _draw_timing_line(pen: ImageDraw.ImageDraw, view: View, course: Course) -> None:
    """Draw two rows of black and white squares across the asphalt."""
    index = round(course.gates[0] / course.spacing) % len(course.line)
    left, right = (view.pixels(edge[index : index + 1])[0] for edge in course.edges())
    width = float(np.hypot(*(right - left)))
    count = max(4, round(width / (5.0 * _DETAIL)))
    across = (right - left) / count
    along = np.array([-across[1], across[0]])
    for row in (-1, 0):
        for column in range(count):
            corner = left + column * across + row * along
            square = np.array([corner, corner + across, corner + across + along, corner + along])
            pen.polygon(flat(square), fill=WHITE if (row + column) % 2 else INK)


def _draw_slots(pen: ImageDraw.ImageDraw, view: View, course: Course) -> None:
    """Draw the outlines of all slots; goals in a zone have none."""
    for slot in slots_of(course):
        pen.polygon(flat(view.pixels(slot.corners)), outline=WHITE, width=_DETAIL)
