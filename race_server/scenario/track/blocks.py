"""Borders laid from blocks, as at the 1/10 race: straights of 1 m and 0.5 m and quarter turns.

A list such as ``H S L 2xR`` describes the line down the middle of border pieces that are 0.10 m
thick; what can be driven on ends at the edge of the pieces, 0.05 m inside.
"""

import math
import re
from dataclasses import dataclass

import numpy as np

from race_server.errors import TrackError
from race_server.scenario.track.course import Floats
from race_server.scenario.track.limits import MOST_PIECES, check_count

STRAIGHTS = {"S": 1.0, "H": 0.5}  # [m]
TURN_RADIUS = 0.5  # [m] of the middle of the piece
HALF_THICKNESS = 0.05  # [m]
SAGITTA = 0.001  # [m] by which a chord may miss its arc
CLOSED = 1e-6  # [m] between the ends of a loop

_TOKEN = re.compile(r"(?:(\d{1,3})x)?([SHLR])")


@dataclass(frozen=True)
class Loop:
    """One closed border."""

    name: str
    x: float
    y: float
    heading: float  # [rad] of the first piece
    blocks: str


def pieces_of(loop: Loop) -> list[str]:
    """Return the pieces of a loop one by one.

    Raises:
        TrackError: a word is no piece, or there are too many.
    """
    pieces: list[str] = []
    for word in loop.blocks.split():
        match = _TOKEN.fullmatch(word)
        if match is None:
            raise TrackError(
                f"{loop.name} border, piece {len(pieces) + 1}: {word!r} is no block; "
                "use S, H, L, R or a repetition such as 3xS"
            )
        count = int(match[1] or 1)
        check_count(f"blocks of the {loop.name} border", len(pieces) + count, MOST_PIECES)
        pieces += [match[2]] * count
    return pieces


def lay(loop: Loop, inset: float) -> Floats:
    """Return the closed polyline `inset` [m] to the left of a loop's middle line.

    Raises:
        TrackError: the loop does not close.
    """
    x, y, heading = loop.x, loop.y, loop.heading
    points: list[tuple[float, float]] = []
    for piece in pieces_of(loop):
        cos, sin = math.cos(heading), math.sin(heading)
        if piece in STRAIGHTS:
            points.append((x - inset * sin, y + inset * cos))
            x, y = x + STRAIGHTS[piece] * cos, y + STRAIGHTS[piece] * sin
            continue
        side = 1.0 if piece == "L" else -1.0
        middle_x, middle_y = x - side * TURN_RADIUS * sin, y + side * TURN_RADIUS * cos
        radius = TURN_RADIUS - side * inset
        for step in np.linspace(0.0, 0.5 * math.pi, _chords(radius), endpoint=False):
            angle = heading + side * step
            away = side * radius
            points.append((middle_x + away * math.sin(angle), middle_y - away * math.cos(angle)))
        heading += side * 0.5 * math.pi
        x = middle_x + side * TURN_RADIUS * math.sin(heading)
        y = middle_y - side * TURN_RADIUS * math.cos(heading)
    gap = math.hypot(x - loop.x, y - loop.y)
    turns = (heading - loop.heading) / (2.0 * math.pi)
    if gap > CLOSED or abs(abs(turns) - 1.0) > 1e-6:
        raise TrackError(
            f"{loop.name} border is open: it ends {gap:.2f} m from where it starts, "
            f"at ({x:.2f}, {y:.2f}), after {turns:+.2f} turns; a closed loop makes one turn"
        )
    return np.array(points)


def _chords(radius: float) -> int:
    """Return how many chords of a quarter arc stay within the sagitta."""
    step = 2.0 * math.acos(1.0 - SAGITTA / radius)
    return math.ceil(0.5 * math.pi / step)
