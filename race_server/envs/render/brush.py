"""What draws on a frame: polygons, tiles, discs and letters, with smooth edges."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from race_server.core.state import Bytes, Floats
from race_server.envs.render.colours import Colour

_DETAIL = 4  # pixels per pixel and axis of a frame before a shape is scaled down


def flat(points: Floats) -> list[float]:
    """Return points (N, 2) as a pen wants them: x and y in turn."""
    return [float(number) for number in points.ravel()]


def blend(frame: Bytes, mask: Bytes, left: int, top: int, colour: Colour | Bytes) -> None:
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


def fill(frame: Bytes, shapes: Sequence[tuple[Floats, Colour]]) -> None:
    """Fill polygons of pixel coordinates (N, 2), the first around all others, smoothly."""
    around, rim = shapes[0]
    low = np.floor(around.min(axis=0)).astype(int)
    width, height = np.ceil(around.max(axis=0)).astype(int) - low + 1
    fine = Image.new("RGBA", (int(width) * _DETAIL, int(height) * _DETAIL), (*rim, 0))
    pen = ImageDraw.Draw(fine)
    for corners, colour in shapes:
        pen.polygon(flat((corners - low) * _DETAIL - 0.5), fill=(*colour, 255))
    pixels = np.asarray(fine.reduce(_DETAIL))
    blend(frame, pixels[..., 3], int(low[0]), int(low[1]), pixels[..., :3])


def tile(frame: Bytes, place: Floats, width: int, height: int, colour: Colour) -> None:
    """Fill an upright rectangle of whole pixels around a place."""
    left, top = round(place[0] - 0.5 * width), round(place[1] - 0.5 * height)
    frame[max(top, 0) : max(top + height, 0), max(left, 0) : max(left + width, 0)] = colour


@lru_cache(maxsize=64)
def disc(radius: int) -> Bytes:
    """Return the mask of a disc, (2 radius + 1) pixels wide and high."""
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


def write(
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
    blend(frame, mask, left, round(place[1] - 0.5 * mask.shape[0]), colour)


def dot(frame: Bytes, place: Floats, radius: int, colour: Colour) -> None:
    """Fill a disc of a radius [px] around a place."""
    mask = disc(radius)
    left, top = np.floor(place).astype(int) - mask.shape[0] // 2
    blend(frame, mask, int(left), int(top), colour)


@lru_cache(maxsize=256)
def shortened(text: str, size: int, width: int) -> str:
    """Return as much of a text as fits into a width [px]."""
    while text and _letters(text, size).shape[1] > width:
        text = text[:-1]
    return text
