"""What the rays of a lap passed through, and what sticks into a course where hardly one did.

A wall that ends in a tip shows the lidar hardly a piece with a direction there, so the border that
is made of such pieces ends before the tip does. No ray went through it.
"""

import numpy as np

from race_agents.planning.wall_map import Pose, Scan, placed
from race_server.core.state import Floats
from race_server.scenario.track.polyline import (
    corners_of_box,
    is_inside,
    nearest_on,
    segments_of,
)

# Side of a square, in cells of the map; how far inside the borders [cells] it is no part of them;
# scans that look through what is free; neighbours that are not free either, at least.
SIDE, CLEAR, SEEN, ALIKE = 0.5, 1.0, 2, 1


def walls_unseen(
    scans: list[Scan], poses: list[Pose], left: Floats, right: Floats, cell: float
) -> Floats:
    """Return walls (W, 4) x0, y0, x1, y1 [m] around squares between borders that are not free.

    left, right: closed borders, (N, 2) [m] each; cell: size of a piece of wall [m].
    """
    side = SIDE * cell
    both = np.concatenate([left, right])
    corner = both.min(axis=0) - 2.0 * side
    shape = np.ceil((both.max(axis=0) + 2.0 * side - corner) / side).astype(np.int64)
    seen = _scans_through(scans, poses, corner, shape, side) >= SEEN
    around = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    free = sum(np.roll(seen, step, axis=(0, 1)).astype(np.int64) for step in around)
    # Those at the edge of what is free; one alone is a gap between rays.
    edge = ~seen & (free > 0) & (len(around) - free >= ALIKE)
    middles = corner + (np.argwhere(edge) + 0.5) * side
    borders = segments_of(left), segments_of(right)
    middles = middles[is_inside(middles, borders[0]) != is_inside(middles, borders[1])]
    if not len(middles):
        return np.zeros((0, 4))
    off, _ = nearest_on(np.concatenate(borders), middles)
    walls = [
        segments_of(corners_of_box(x, y, 0.0, side, side)) for x, y in middles[off > CLEAR * cell]
    ]
    return np.concatenate([np.zeros((0, 4)), *walls])


def _scans_through(
    scans: list[Scan], poses: list[Pose], corner: Floats, shape: Floats, side: float
) -> Floats:
    """Return how many scans looked through each square of a grid, shape (columns, rows)."""
    counts = np.zeros(int(shape.prod()), np.int64)
    for scan, pose in zip(scans, poses, strict=True):
        away = scan.ends - scan.lidar
        length = np.hypot(*away.T)
        steps = np.arange(0.0, length.max(initial=0.0), 0.5 * side)
        # The square in which a ray ends may be wall.
        short = steps[None] < length[:, None] - side
        ray, step = np.nonzero(short)
        points = scan.lidar + away[ray] * (steps[step] / length[ray])[:, None]
        place = np.floor((placed(points, pose) - corner) / side).astype(np.int64)
        place = place[np.all((place >= 0) & (place < shape), axis=1)]
        through = np.zeros(len(counts), np.bool_)
        through[place[:, 0] * shape[1] + place[:, 1]] = True
        counts += through
    return counts.reshape(tuple(shape))
