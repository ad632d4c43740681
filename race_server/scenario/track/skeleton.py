"""Random closed paths along the lines of a grid, the basis of generated courses."""

from random import Random

Cell = tuple[int, int]
Corner = tuple[int, int]

# The eight neighbours of a cell in order round it; those at even places share a side with it.
_RING = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
# Share of the cells beside two others that are accepted anyway: they fill bays.
_FILL = 0.25


def whole(chance: Random, low: int, high: int) -> int:
    """Return a whole number from low to high, as likely each.

    Only `Random.random` promises the same numbers in every release of Python.
    """
    return low + int(chance.random() * (high - low + 1))


def draw_path(chance: Random, cells: int, gaps: tuple[int, int]) -> list[Corner]:
    """Return the corners of a closed path that meets itself nowhere, counter-clockwise.

    It runs around a patch of `cells` cells of a grid whose lines lie at random distances.
    """
    corners = _outline(_grow(chance, cells))
    west, south = (min(corner[axis] for corner in corners) for axis in (0, 1))
    columns, rows = _positions(chance, cells + 1, gaps), _positions(chance, cells + 1, gaps)
    return [(columns[x - west], rows[y - south]) for x, y in corners]


def _positions(chance: Random, count: int, gaps: tuple[int, int]) -> list[int]:
    """Return where `count` lines lie, the first at 0."""
    positions = [0]
    for _ in range(count - 1):
        positions.append(positions[-1] + whole(chance, *gaps))
    return positions


def _grow(chance: Random, cells: int) -> set[Cell]:
    """Return a patch without holes in which no two cells touch with a corner alone."""
    patch = {(0, 0)}
    while len(patch) < cells:
        x, y = sorted(patch)[whole(chance, 0, len(patch) - 1)]
        east, north = _RING[2 * whole(chance, 0, 3)]
        cell = (x + east, y + north)
        beside = sum((cell[0] + i, cell[1] + j) in patch for i, j in _RING[::2])
        if cell in patch or not _keeps_whole(patch, cell):
            continue
        if beside == 1 or chance.random() < _FILL:
            patch.add(cell)
    return patch


def _keeps_whole(patch: set[Cell], cell: Cell) -> bool:
    """Return whether a cell touches the patch in one run of neighbours that shares a side."""
    ring = [(cell[0] + x, cell[1] + y) in patch for x, y in _RING]
    runs = sum(here and not ring[place - 1] for place, here in enumerate(ring))
    return runs == 1 and any(ring[::2])


def _outline(patch: set[Cell]) -> list[Corner]:
    """Return the corners at which the border of a patch turns, the patch on its left."""
    following: dict[Corner, Corner] = {}
    for x, y in patch:
        if (x, y - 1) not in patch:
            following[x, y] = (x + 1, y)
        if (x + 1, y) not in patch:
            following[x + 1, y] = (x + 1, y + 1)
        if (x, y + 1) not in patch:
            following[x + 1, y + 1] = (x, y + 1)
        if (x - 1, y) not in patch:
            following[x, y + 1] = (x, y)
    first = min(following)
    path = [first]
    while following[path[-1]] != first:
        path.append(following[path[-1]])
    return without_straights(path)


def without_straights(path: list[Corner]) -> list[Corner]:
    """Return the corners of a closed path at which it turns."""
    kept = []
    for place, (x, y) in enumerate(path):
        before, after = path[place - 1], path[(place + 1) % len(path)]
        if not (before[0] == x == after[0] or before[1] == y == after[1]):
            kept.append((x, y))
    return kept
