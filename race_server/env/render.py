"""A race seen from above, as pixels: a background drawn once, and what moves blended over it."""

import importlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from race_server import codes
from race_server.clock import TICK_S
from race_server.errors import ScenarioError
from race_server.state import Bytes, Floats, Record, World
from race_server.track.course import Course, Obstacle
from race_server.track.polyline import is_inside, loops_of

Colour = tuple[int, int, int]

# Colours that stay apart for colour-blind eyes: Okabe and Ito, "Color Universal Design", 2008.
PALETTE: tuple[Colour, ...] = (
    (230, 159, 0),  # orange
    (86, 180, 233),  # sky blue
    (0, 158, 115),  # bluish green
    (240, 228, 66),  # yellow
    (0, 114, 178),  # blue
    (213, 94, 0),  # vermilion
    (204, 121, 167),  # reddish purple
    (0, 0, 0),  # black
)
RETIRED_GREY: Colour = (160, 164, 170)

_PAGE: Colour = (243, 244, 240)
_GRASS: Colour = (207, 227, 196)
_KERB: Colour = (217, 83, 79)
_ASPHALT: Colour = (104, 109, 117)
_CENTRE: Colour = (146, 151, 158)
_INK: Colour = (32, 36, 42)
_FAINT: Colour = (128, 133, 140)
_CONCRETE: Colour = (216, 211, 198)
_AMBER: Colour = (255, 191, 0)
_OIL: Colour = (18, 18, 22)
_WHITE: Colour = (255, 255, 255)

_BACKGROUND_DETAIL = 2  # background pixels per pixel and axis before it is scaled down
_DETAIL = 4  # the same for what moves
_SHORTEST_KART = 8.0  # [px]
_SMALLEST_BOX = 6  # [px]
_SMALLEST_HAZARD = 3  # [px] radius
_NARROWEST_NUMBERED = 11.0  # [px] a narrower kart has its number beside it
_ROWS = 10.0  # heights of the text block for which room is kept, in rows
_COLUMNS = 11.0  # and its width, in text heights
_SQUARE = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])


@dataclass(frozen=True)
class _View:
    """How metres become pixels: x to the right, y up in the world and down in the picture."""

    size: tuple[int, int]
    scale: float  # [px/m]
    left: float  # [px] where x = 0 lies
    top: float  # [px] where y = 0 lies

    def pixels(self, points: Floats) -> Floats:
        """Return the pixel coordinates of points (N, 2) in metres."""
        return points * (self.scale, -self.scale) + (self.left, self.top)

    @property
    def text(self) -> int:
        """Height of the text [px]."""
        return max(10, round(min(self.size[0] / 64.0, self.size[1] / 48.0)))

    @property
    def row(self) -> float:
        """Distance between two rows of text [px]."""
        return 1.45 * self.text


class Picture:
    """One course from above, ready to be drawn with the karts of any moment."""

    def __init__(self, course: Course, size: tuple[int, int] = (960, 720)) -> None:
        if min(size) < 64:
            raise ScenarioError(f"a picture of {size[0]} x {size[1]} pixels: choose at least 64")
        self._view = _view_of(course, size)
        self._background = _background_of(course, self._view)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self._view.size

    def pixel_of(self, x: float, y: float) -> tuple[int, int]:
        """Return column and row of the pixel at a place [m] of the world."""
        column, row = np.floor(self._view.pixels(np.array([[x, y]]))[0])
        return int(column), int(row)

    def draw(self, world: World, w: int = 0, names: Sequence[str] = ()) -> NDArray[np.uint8]:
        """Return world `w` as an image (height, width, 3); `names` are those of its karts."""
        frame = self._background.copy()
        _draw_items(frame, self._view, world, w)
        present = [k for k, kart in enumerate(world.karts[w]) if kart.status != codes.ABSENT]
        # Who still races is drawn over who does not.
        for k in sorted(present, key=lambda k: world.karts[w, k].status != codes.RETIRED):
            _draw_kart(frame, self._view, world, w, k)
        _draw_order(frame, self._view, world, w, present, names)
        return frame


class Window:
    """A window on the screen, opened by the first frame."""

    def __init__(self, title: str = "race") -> None:
        self._title = title
        self._pygame: Any = None
        self._screen: Any = None

    def show(self, frame: NDArray[np.uint8]) -> None:
        """Show an image (height, width, 3).

        Raises:
            ScenarioError: pygame is not installed.
        """
        height, width = frame.shape[:2]
        if self._pygame is None:
            self._open()
        if self._screen is None or self._screen.get_size() != (width, height):
            self._screen = self._pygame.display.set_mode((width, height))
        image = self._pygame.image.frombuffer(frame.tobytes(), (width, height), "RGB")
        self._screen.blit(image, (0, 0))
        self._pygame.display.flip()
        self._pygame.event.pump()

    def close(self) -> None:
        """Close the window; the next frame opens another one."""
        if self._pygame is not None:
            self._pygame.display.quit()
        self._pygame = self._screen = None

    def _open(self) -> None:
        os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
        try:
            pygame: Any = importlib.import_module("pygame")
        except ImportError as error:
            raise ScenarioError(
                "rendering for people needs pygame: pip install pygame-ce, "
                'or use render_mode="rgb_array"'
            ) from error
        pygame.display.init()
        pygame.display.set_caption(self._title)
        self._pygame = pygame


def _view_of(course: Course, size: tuple[int, int]) -> _View:
    """Fit a course beside or below the text block, whichever leaves it larger."""
    points = course.borders.reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    text = _View(size, 1.0, 0.0, 0.0)
    beside, below = (_COLUMNS * text.text, 0.0), (0.0, _ROWS * text.row)
    margin = 0.035 * min(size)

    def scale(taken: tuple[float, float]) -> float:
        return float(np.min((np.array(size) - taken - 2.0 * margin) / np.maximum(high - low, 1e-6)))

    taken = max(beside, below, key=scale)
    fit = scale(taken)
    middle = 0.5 * (np.array(size) + taken)
    centre = 0.5 * (low + high)
    return _View(size, fit, float(middle[0] - fit * centre[0]), float(middle[1] + fit * centre[1]))


# The background.


def _background_of(course: Course, view: _View) -> Bytes:
    detail = _BACKGROUND_DETAIL
    fine = _View(
        (view.size[0] * detail, view.size[1] * detail),
        view.scale * detail,
        view.left * detail,
        view.top * detail,
    )
    image = Image.new("RGB", fine.size, _PAGE)
    pen = ImageDraw.Draw(image)
    loops = loops_of(course.borders)
    has_verge = course.kerb + course.grass > 0.0
    _fill_loops(pen, fine, loops, _GRASS if has_verge else _ASPHALT)
    if has_verge:
        _fill_ribbon(pen, fine, course, course.kerb, _KERB)
        _fill_ribbon(pen, fine, course, 0.0, _ASPHALT)
    _draw_centre(pen, fine, course)
    _draw_timing_line(pen, fine, course)
    for loop in loops:
        ends = np.vstack([loop[:, :2], loop[-1:, 2:], loop[:1, 2:]])
        pen.line(_flat(fine.pixels(ends)), fill=_INK, width=2 * detail, joint="curve")
    for obstacle in course.obstacles:
        corners = _flat(fine.pixels(_box_of(obstacle)))
        pen.polygon(corners, fill=_CONCRETE, outline=_INK, width=detail)
    small = image.resize(view.size, Image.Resampling.LANCZOS)
    return np.array(small, np.uint8)


def _flat(points: Floats) -> list[float]:
    return [float(number) for number in points.ravel()]


def _fill_loops(pen: ImageDraw.ImageDraw, view: _View, loops: list[Floats], colour: Colour) -> None:
    """Fill what lies inside an odd number of loops."""
    depths = [
        sum(bool(is_inside(loop[:1, :2], other)[0]) for other in loops if other is not loop)
        for loop in loops
    ]
    for number in np.argsort(depths, kind="stable"):
        fill = _PAGE if depths[number] % 2 else colour
        if len(loops[number]) > 2:
            pen.polygon(_flat(view.pixels(loops[number][:, :2])), fill=fill)


def _edges(course: Course, beyond: float) -> tuple[Floats, Floats]:
    heading = course.line[:, 2]
    across = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    left = course.line[:, :2] + (course.half_widths[:, :1] + beyond) * across
    return left, course.line[:, :2] - (course.half_widths[:, 1:] + beyond) * across


def _fill_ribbon(
    pen: ImageDraw.ImageDraw, view: _View, course: Course, beyond: float, colour: Colour
) -> None:
    left, right = (view.pixels(edge) for edge in _edges(course, beyond))
    after = np.roll(np.arange(len(left)), -1)
    for piece in np.stack([left, left[after], right[after], right], axis=1):
        pen.polygon(_flat(piece), fill=colour)


def _draw_centre(pen: ImageDraw.ImageDraw, view: _View, course: Course) -> None:
    dash = 8.0 * _BACKGROUND_DETAIL / view.scale  # [m]
    progress = course.spacing * np.arange(len(course.line) + 1)
    closed = np.vstack([course.line[:, :2], course.line[:1, :2]])
    for start in np.arange(0.0, course.length, 2.0 * dash):
        at = np.linspace(start, min(start + dash, course.length), 4)
        points = np.stack([np.interp(at, progress, closed[:, axis]) for axis in (0, 1)], axis=1)
        pen.line(_flat(view.pixels(points)), fill=_CENTRE, width=_BACKGROUND_DETAIL)


def _draw_timing_line(pen: ImageDraw.ImageDraw, view: _View, course: Course) -> None:
    """Draw two rows of black and white squares across the asphalt."""
    index = round(course.gates[0] / course.spacing) % len(course.line)
    left, right = (view.pixels(edge[index : index + 1])[0] for edge in _edges(course, 0.0))
    width = float(np.hypot(*(right - left)))
    count = max(4, round(width / (5.0 * _BACKGROUND_DETAIL)))
    across = (right - left) / count
    along = np.array([-across[1], across[0]])
    for row in (-1, 0):
        for column in range(count):
            corner = left + column * across + row * along
            square = np.array([corner, corner + across, corner + across + along, corner + along])
            pen.polygon(_flat(square), fill=_WHITE if (row + column) % 2 else _INK)


def _box_of(obstacle: Obstacle) -> Floats:
    half = np.array([0.5 * obstacle.length, 0.5 * obstacle.width])
    corners = _turned(_SQUARE * half, obstacle.heading)
    return corners + np.array([obstacle.x, obstacle.y])


# What moves.


def _turned(points: Floats, angle: float) -> Floats:
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]))


def _blend(frame: Bytes, mask: Bytes, left: int, top: int, colour: Colour | Bytes) -> None:
    """Lay a colour over a frame, as densely as a mask says; what lies outside is cut off."""
    height, width = mask.shape
    rows, columns = frame.shape[:2]
    x0, x1 = max(left, 0), min(left + width, columns)
    y0, y1 = max(top, 0), min(top + height, rows)
    if x0 >= x1 or y0 >= y1:
        return
    inside = slice(y0 - top, y1 - top), slice(x0 - left, x1 - left)
    share = mask[inside][..., None].astype(np.uint16)
    paint = np.asarray(colour if isinstance(colour, tuple) else colour[inside], np.uint16)
    part = frame[y0:y1, x0:x1]
    part[:] = (part * (255 - share) + paint * share + 127) // 255


def _fill(frame: Bytes, shapes: Sequence[tuple[Floats, Colour]]) -> None:
    """Fill polygons of pixel coordinates (N, 2), the first around all others, smoothly."""
    around, rim = shapes[0]
    low = np.floor(around.min(axis=0)).astype(int)
    width, height = np.ceil(around.max(axis=0)).astype(int) - low + 1
    fine = Image.new("RGBA", (int(width) * _DETAIL, int(height) * _DETAIL), (*rim, 0))
    pen = ImageDraw.Draw(fine)
    for corners, colour in shapes:
        pen.polygon(_flat((corners - low) * _DETAIL - 0.5), fill=(*colour, 255))
    pixels = np.asarray(fine.reduce(_DETAIL))
    _blend(frame, pixels[..., 3], int(low[0]), int(low[1]), pixels[..., :3])


def _tile(frame: Bytes, place: Floats, width: int, height: int, colour: Colour) -> None:
    """Fill an upright rectangle of whole pixels around a place."""
    left, top = round(place[0] - 0.5 * width), round(place[1] - 0.5 * height)
    frame[max(top, 0) : max(top + height, 0), max(left, 0) : max(left + width, 0)] = colour


@lru_cache(maxsize=64)
def _disc(radius: int) -> Bytes:
    side = (2 * radius + 1) * _DETAIL
    mask = Image.new("L", (side, side))
    ImageDraw.Draw(mask).ellipse((0, 0, side - 1, side - 1), fill=255)
    return np.asarray(mask.reduce(_DETAIL))


@lru_cache(maxsize=64)
def _font(size: int) -> Any:
    return ImageFont.load_default(size)


@lru_cache(maxsize=1024)
def _letters(text: str, size: int, stroke: int = 0) -> Bytes:
    """Return a mask of a text, cut to its ink from left to right and to its line in height."""
    font = _font(size)
    left, _, right, _ = font.getbbox(text, stroke_width=stroke)
    _, top, _, bottom = font.getbbox("0", stroke_width=stroke)
    descent = round(0.25 * size)
    mask = Image.new("L", (max(int(right - left), 1), int(bottom - top) + 2 * descent))
    place = (-left, descent - top)
    ImageDraw.Draw(mask).text(place, text, fill=255, font=font, stroke_width=stroke)
    return np.asarray(mask)


def _write(
    frame: Bytes,
    text: str,
    size: int,
    place: tuple[float, float],
    colour: Colour,
    anchor: float = 0.0,
    stroke: int = 0,
) -> None:
    """Write a text at the height of its middle; anchor 0 is its left end, 1 its right end."""
    mask = _letters(text, size, stroke)
    left = round(place[0] - anchor * mask.shape[1])
    _blend(frame, mask, left, round(place[1] - 0.5 * mask.shape[0]), colour)


@lru_cache(maxsize=256)
def _shortened(text: str, size: int, width: int) -> str:
    while text and _letters(text, size).shape[1] > width:
        text = text[:-1]
    return text


def _draw_items(frame: Bytes, view: _View, world: World, w: int) -> None:
    tick, rules = world.races[w].tick, world.rules[w]
    if rules.items == 0:
        return
    side = max(round(2.0 * rules.pick_up_radius * view.scale), _SMALLEST_BOX)
    for place in _places(view, world.boxes[w], tick >= world.boxes["ready_tick"][w]):
        _tile(frame, place, side, side, _INK)
        _tile(frame, place, side - 2, side - 2, _AMBER)
    hazards, are_live = world.hazards[w], tick < world.hazards["until_tick"][w]
    radii = hazards["radius"][are_live] * view.scale
    for place, radius in zip(_places(view, hazards, are_live), radii, strict=True):
        mask = _disc(max(round(radius), _SMALLEST_HAZARD))
        left, top = np.floor(place).astype(int) - mask.shape[0] // 2
        _blend(frame, mask, int(left), int(top), _OIL)


def _places(view: _View, records: Record, which: NDArray[np.bool_]) -> Floats:
    return view.pixels(np.stack([records["x"][which], records["y"][which]], axis=1))


def _colour_of(kart: Record, k: int) -> Colour:
    return RETIRED_GREY if kart.status == codes.RETIRED else PALETTE[k % len(PALETTE)]


def _ink_on(colour: Colour) -> Colour:
    red, green, blue = colour
    return _INK if 0.3 * red + 0.59 * green + 0.11 * blue > 110.0 else _WHITE


def _draw_kart(frame: Bytes, view: _View, world: World, w: int, k: int) -> None:
    kart, vehicle = world.karts[w, k], world.vehicles[w, k]
    scale = max(view.scale, _SHORTEST_KART / vehicle.length)  # [px/m] of this body
    half = 0.5 * scale * np.array([vehicle.length, vehicle.width])
    middle = view.pixels(np.array([[kart.x, kart.y]]))
    middle += _turned(np.array([[scale * vehicle.box_offset, 0.0]]), -kart.heading)
    is_safe = world.races[w].tick < max(kart.immune_until, kart.shield_until)
    rim, rim_colour = (2.5, _WHITE) if is_safe else (1.0, _INK)
    colour = _colour_of(kart, k)
    ink = _ink_on(colour)
    screen = _SQUARE * half * (0.1, 0.75) + (0.66 * half[0], 0.0)
    shapes = (_SQUARE * (half + rim), rim_colour), (_SQUARE * half, colour), (screen, ink)
    _fill(frame, [(middle + _turned(shape, -kart.heading), fill) for shape, fill in shapes])
    if 2.0 * half[1] >= _NARROWEST_NUMBERED:
        place = middle[0] + _turned(np.array([-0.15 * half[0], 0.0]), -kart.heading)
        size = min(round(1.7 * half[1]), 2 * view.text)
        _write(frame, str(k), size, (place[0], place[1]), ink, 0.5)
    else:
        # Even numbers to the left and odd ones to the right, as karts stand on a grid.
        away = (half[1] + 0.7 * view.text) * (1.0 if k % 2 else -1.0)
        place = middle[0] + _turned(np.array([0.0, away]), -kart.heading)
        size = round(0.8 * view.text)
        _write(frame, str(k), size, (place[0], place[1]), _INK, 0.5, stroke=2)
        _write(frame, str(k), size, (place[0], place[1]), _WHITE, 0.5)


# The text block.


def _draw_order(
    frame: Bytes, view: _View, world: World, w: int, present: list[int], names: Sequence[str]
) -> None:
    race, laps, text = world.races[w], int(world.rules[w].laps), view.text
    race_s = (race.tick - race.start_tick) * TICK_S
    left, right, row = 0.8 * text, (_COLUMNS - 0.6) * text, view.row
    _write(frame, f"{race_s:.1f} s", round(1.3 * text), (left, 1.1 * row), _INK)
    order = sorted(present, key=lambda k: (world.karts[w, k].rank, k))
    for line, k in enumerate(order[: int(view.size[1] / row) - 3]):
        kart, y = world.karts[w, k], (2.4 + line) * row
        ink = _FAINT if kart.status == codes.RETIRED else _INK
        colour = _colour_of(kart, k)
        _write(frame, str(kart.rank), text, (left + 0.9 * text, y), _FAINT, 1.0)
        middle = np.array([left + 2.1 * text, y])
        _tile(frame, middle, round(1.5 * text), round(1.2 * text), colour)
        _write(frame, str(k), round(0.85 * text), (middle[0], y), _ink_on(colour), 0.5)
        if k < len(names):
            name = _shortened(names[k], text, round(right - left - 5.5 * text))
            _write(frame, name, text, (left + 3.2 * text, y), ink)
        count = f"{kart.laps}/{laps}" if laps else str(kart.laps)
        count = "out" if kart.status == codes.RETIRED else count
        _write(frame, count, text, (right, y), ink, 1.0)
