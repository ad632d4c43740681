"""The corridor of an occupancy map that leads around an island, and the line in its middle.

The middle is made of all points that are as near to the walls inside as to those outside. It is
read off the Delaunay triangles of the points on the walls: those with corners on both sides form
one closed strip, and the centres of their circles are the corners of the line (its Voronoi edges).
The radius of such a circle is free of walls: the line may move by less anywhere.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from race_server.errors import TrackError
from race_server.scenario.track.course import Floats
from race_server.scenario.track.occupancy_map import OccupancyMap
from race_server.scenario.track.pixel_parts import Mask, Numbers, Parts, parts_of

MOST_EDGES = 1 << 17  # of pixels, between the corridor and its walls
# What is less than this share of the free pixels is no corridor, and an island less than this
# share of the corridor's extent is not what it leads around.
LEAST_SHARE, LEAST_ISLAND = 0.01, 0.05
# An island from this share of the extent of that one may be the middle of another loop.
LOOP_SHARE = 0.25


@dataclass(frozen=True, eq=False)
class Corridor:
    """Free pixels around an island, and the parts that stand in and around them."""

    free: Mask  # (rows, columns)
    walls: Parts  # connected parts of all other pixels
    outside: int  # number of the part around the corridor
    island: int  # number of the largest part that it leads around
    others: int = 0  # free parts beside it that lead around islands not much smaller
    is_at_frame: bool = False  # the edge of the picture is a border of it


def find_corridor(occupancy: OccupancyMap) -> Corridor:
    """Return the free part that leads around the largest island, first of those within the picture.

    A part that surrounds less is a field beside a course, with a house or a name in it.

    Raises:
        TrackError: there is none.
    """
    name = occupancy.file.path
    parts = parts_of(occupancy.free, name)
    if not parts.sizes.any():
        raise TrackError(
            f"{name}: the map has no free pixel; free is what is opaque and light, or dark with "
            "negate: 1"
        )
    touching = np.unique(np.concatenate([parts.of[1, :], parts.of[-2, :], *parts.of[:, [1, -2]].T]))
    large = np.flatnonzero(parts.sizes >= LEAST_SHARE * parts.sizes.sum())
    extents = {part: _extent(parts.of == part) for part in large}
    within, at_frame = np.setdiff1d(large, touching), np.intersect1d(large, touching)
    for group in (within, at_frame):
        best: Corridor | None = None
        islands: list[float] = []  # extents
        # No island is larger than what surrounds it.
        for part in sorted(group, key=lambda part: -extents[part]):
            largest = max(islands, default=0.0)
            if extents[part] > LOOP_SHARE * largest:
                free = np.asarray(parts.of == part)
                walls = parts_of(~free, name, diagonal=True)
                outside = int(walls.of[0, 0])
                island, extent = _largest_island(walls, outside)
                if extent > LEAST_ISLAND * extents[part]:
                    islands.append(extent)
                    if extent > largest:
                        best = Corridor(free, walls, outside, island)
        if best is not None:
            others = sum(extent > LOOP_SHARE * max(islands) for extent in islands) - 1
            return replace(best, others=others, is_at_frame=group is at_frame)
    raise TrackError(f"{name}: the free space has no island in it: no closed corridor")


def _largest_island(walls: Parts, outside: int) -> tuple[int, float]:
    """Return the number of the largest island and its extent, which is zero if there is none."""
    sizes = walls.sizes.copy()
    sizes[outside] = 0
    island = int(np.argmax(sizes))
    return island, _extent(walls.of == island) if sizes[island] else 0.0


def other_loops(corridor: Corridor) -> int:
    """Return how many islands in a corridor are not much smaller than the one that it surrounds."""
    walls = corridor.walls
    least = LOOP_SHARE * _extent(walls.of == corridor.island)
    # The thinnest wall that is this long has this number of pixels, or more.
    large = np.flatnonzero(walls.sizes >= np.sqrt(0.5) * least).tolist()
    others = set(large) - {corridor.outside, corridor.island}
    return sum(_extent(walls.of == part) >= least for part in others)


def _extent(mask: Mask) -> float:
    """Return the diagonal of the box around a mask, in pixels."""
    sides = [np.flatnonzero(mask.any(axis=axis)) for axis in (0, 1)]
    return float(np.hypot(*(side[-1] - side[0] + 1 for side in sides)))


def middle_of(corridor: Corridor, name: object) -> tuple[Floats, Floats]:
    """Return the closed line midway between the walls (N, 2), and its distance to them (N,).

    In pixels. Islands other than the one that the corridor leads around belong to the side that
    they are nearer to, so that the line passes where there is more room.

    Raises:
        TrackError: the walls have too many edges.
    """
    from matplotlib.tri import Triangulation

    points, parts = _edges(corridor)
    if len(points) > MOST_EDGES:
        raise TrackError(
            f"{name}: the walls have {len(points)} edges of pixels, at most {MOST_EDGES} make a "
            "map; make the picture coarser"
        )
    net = Triangulation(*points.T)
    inside = _sides(points, parts, net.edges, corridor)[parts]
    corners = points[strip_between(net.triangles, net.neighbors, inside)]
    middle = _centres(corners)
    return middle, np.asarray(np.hypot(*(middle - corners[:, 0]).T))


def _edges(corridor: Corridor) -> tuple[Floats, Numbers]:
    """Return the middles (N, 2) of edges between free pixels and others, and the others' parts."""
    free, found, parts = corridor.free, [], []
    for axis in (0, 1):
        row, column = np.nonzero(np.diff(free, axis=axis))
        beyond = free[row, column]  # whether the pixel on the far side of the edge is the wall
        parts.append(corridor.walls.of[row + beyond * (1 - axis), column + beyond * axis])
        found.append(np.column_stack([column, row]) + ([1.0, 0.5] if axis else [0.5, 1.0]))
    return np.concatenate(found), np.concatenate(parts)


def _sides(points: Floats, parts: Numbers, edges: Numbers, corridor: Corridor) -> NDArray[np.bool_]:
    """Return by number of a part whether it belongs to the inner side.

    Parts are joined by the shortest ways between them, those of one side never with the other.
    """
    one, other = parts[edges].T
    apart = one != other
    lengths = np.hypot(*(points[edges[apart, 0]] - points[edges[apart, 1]]).T)
    pairs = np.stack([one[apart], other[apart]], axis=1)
    joined: dict[int, list[int]] = {int(part): [int(part)] for part in np.unique(parts)}
    ends = {corridor.outside, corridor.island}
    for first, second in pairs[np.argsort(lengths, kind="stable")].tolist():
        group, more = joined[first], joined[second]
        if group is more or len(ends & {*group, *more}) == len(ends):
            continue
        group += more
        joined.update(dict.fromkeys(more, group))
    inside = np.zeros(len(corridor.walls.sizes), np.bool_)
    inside[joined[corridor.island]] = True
    return inside


def strip_between(triangles: Numbers, neighbors: Numbers, inside: NDArray[np.bool_]) -> Numbers:
    """Return the longest closed strip of triangles with corners on both sides, in order (K, 3).

    triangles: (T, 3) numbers of points; neighbors: (T, 3) triangle across the side from each corner
    to the next, -1 where there is none; inside: (N,) whether a point lies on the inner side.

    Raises:
        TrackError: no strip is closed.
    """
    mixed = inside[triangles]
    crosses = mixed != np.roll(mixed, -1, axis=1)
    across = np.flatnonzero(crosses.any(axis=1))
    # Each has two sides that lead across, to the triangle before and to the one behind.
    both = neighbors[across][crosses[across]].reshape(-1, 2)
    following = dict(zip(across.tolist(), both.tolist(), strict=True))
    best: list[int] = []
    while following:
        first, (ahead, _) = following.popitem()
        strip = [first]
        while ahead in following:
            one, other = following.pop(ahead)
            before, here = strip[-1], ahead
            ahead = other if one == before else one
            strip.append(here)
        if ahead == first and len(strip) > len(best):
            best = strip
    if not best:
        raise TrackError("the walls of one side do not lead around those of the other")
    return np.asarray(triangles[best])


def _centres(corners: Floats) -> Floats:
    """Return the centres (T, 2) of the circles through the corners (T, 3, 2) of triangles."""
    one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    double = 2.0 * (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])
    squares = (one**2).sum(axis=1), (other**2).sum(axis=1)
    x = (other[:, 1] * squares[0] - one[:, 1] * squares[1]) / double
    y = (one[:, 0] * squares[1] - other[:, 0] * squares[0]) / double
    return np.asarray(corners[:, 0] + np.column_stack([x, y]))
