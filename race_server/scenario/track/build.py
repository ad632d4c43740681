"""From a track file to a course, for all three forms."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from race_server.errors import TrackError
from race_server.scenario.track.blocks import HALF_THICKNESS, Loop, lay
from race_server.scenario.track.borders import border_beside
from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.limits import LEAST_POINTS, MOST_PLACES, check_length
from race_server.scenario.track.lot import Lot
from race_server.scenario.track.medial import medial_line
from race_server.scenario.track.polyline import (
    area_of,
    crossings,
    derivatives,
    is_inside,
    lengths_of,
    nearest_on,
    ranges_to,
    resample,
    segments_of,
    smooth,
)

# Standard deviations [m] of the smoothing of a medial line between blocks. The first takes its
# corners off, so that it has a curvature, and keeps its length to half a percent. The second is
# half the longest car: the free width is what a car meets that follows the line.
LINE_SMOOTHING = 0.13
WIDTH_SMOOTHING = 0.24
MEDIAL_SPACING = 0.05  # [m]

# Share of a step by which the samples are moved to look for crossings in them: no simple fraction.
ASIDE = 0.382

GATES = 12  # on a lap, unless the file says otherwise
SECTORS = 3


@dataclass(frozen=True)
class TrackScale:
    """Distances that go with the size of the karts [m]."""

    spacing: float  # of the samples of the line
    row: float  # between two rows of the grid
    column: float  # from the centre line to a column of the grid
    first_row: float  # behind the timing line
    body: float  # half-diagonal of a kart, kept clear of the borders
    box_step: float  # between rows of item boxes


SCALES = {
    "1/10": TrackScale(0.05, row=0.65, column=0.24, first_row=0.4, body=0.13, box_step=9.0),
    "kart": TrackScale(0.5, row=4.0, column=1.6, first_row=2.5, body=0.9, box_step=80.0),
}
# Model cars race on what is narrower than this [m] on average: the widest corridor of the public
# 1/10 maps has 4.7 m, and halls and circuits for karts have more.
WIDTH_OF_KARTS = 5.0


def scale_for(width: float) -> str:
    """Return the scale that a mean width [m] speaks for."""
    return "1/10" if width < WIDTH_OF_KARTS else "kart"


@dataclass(frozen=True)
class TrackSpec:
    """A track file, checked value by value."""

    name: str
    title: str
    form: str
    scale: str
    digest: str
    outer: Loop | None = None
    inner: Loop | None = None
    points: Floats = field(default_factory=lambda: np.zeros((0, 4)))  # x, y, left, right
    reverse: bool = False
    kerb: float = 0.0
    grass: float = 0.0
    gates: int = GATES
    sectors: int = SECTORS
    line_at: tuple[float, float] | None = None  # a point near which the timing line lies
    places: int = MOST_PLACES
    items: tuple[tuple[float, float], ...] | None = None  # progress, lateral offset
    obstacles: tuple[Obstacle, ...] = ()
    starts: Floats = field(default_factory=lambda: np.zeros((0, 6)))  # the last two [deg]
    slots: Floats = field(default_factory=lambda: np.zeros((0, 5)))  # see `Lot.slots`


def build(plan: TrackSpec) -> Course:
    """Return the course that a plan describes.

    Raises:
        TrackError: it describes no course.
    """
    scale = SCALES[plan.scale]
    if plan.form == "blocks":
        raw, borders, widths, drawn = _from_blocks(plan)
    else:
        raw, drawn = _from_points(plan, scale), None
        borders, widths = np.zeros((0, 4)), np.zeros(0)
    check_length(float(lengths_of(raw[:, :2]).sum()), scale.spacing, plan.name)
    line, half_widths = _line(raw, scale.spacing, drawn)
    heading, curvature = derivatives(line)
    if plan.form != "blocks":
        _check_half_widths(plan.name, line, half_widths)
        borders = _borders_beside(plan, line, heading, half_widths)
        widths = half_widths.sum(axis=1)
    spacing = float(lengths_of(line).sum()) / len(line)
    length = spacing * len(line)
    gates = np.round(np.arange(plan.gates) * len(line) / plan.gates) * spacing
    course = Course(
        name=plan.name,
        title=plan.title,
        spacing=spacing,
        line=np.column_stack([line, heading, curvature]),
        half_widths=half_widths,
        kerb=plan.kerb,
        grass=plan.grass,
        borders=borders,
        gates=gates,
        sectors=_sectors(plan.gates, plan.sectors),
        grid=np.zeros((0, 3)),
        spots=np.zeros((0, 2)),
        obstacles=plan.obstacles,
        starts=_starts(plan.starts, line, heading),
        width_min=float(widths.min()),
        width_mean=float(widths.mean()),
        width_max=float(widths.max()),
        digest=plan.digest,
        lot=Lot(plan.slots) if len(plan.slots) else None,
    )
    spots = plan.items if plan.items is not None else _item_rows(course, scale, length)
    return replace(
        course,
        grid=_grid(course, scale, plan.places),
        spots=np.array([_at(course, *spot)[:2] for spot in spots]).reshape(-1, 2),
    )


def _from_blocks(plan: TrackSpec) -> tuple[Floats, Floats, Floats, tuple[Floats, Floats]]:
    """Return line with half-widths, borders, free widths, and the two border polylines."""
    if plan.outer is None or plan.inner is None:
        raise TrackError(f"{plan.name}: the form 'blocks' needs an outer and an inner border")
    outer, inner = (_edge(loop, inside) for loop, inside in ((plan.outer, 1), (plan.inner, -1)))
    if not is_inside(inner, segments_of(outer)).all():
        raise TrackError(f"{plan.name}: the inner border does not lie inside the outer one")
    line, _ = medial_line(outer, inner, MEDIAL_SPACING)
    if (area_of(line) < 0.0) != plan.reverse:
        line = line[::-1]
    walls_out, walls_in = segments_of(outer), segments_of(inner)
    path = smooth(line, WIDTH_SMOOTHING / MEDIAL_SPACING)
    widths = nearest_on(walls_out, path)[0] + nearest_on(walls_in, path)[0]
    line = smooth(line, LINE_SMOOTHING / MEDIAL_SPACING)
    line = _start_near(line, plan.line_at)
    left, right = (walls_out, walls_in) if plan.reverse else (walls_in, walls_out)
    sides = _reach_across(left, right, line)
    return np.hstack([line, sides]), np.concatenate([walls_out, walls_in]), widths, (left, right)


def _reach_across(left: Floats, right: Floats, line: Floats) -> Floats:
    """Return how far each border lies from a line, straight across it, shape (N, 2).

    Into an alcove it is at most half as much again as the nearest point of the border.
    """
    heading, _ = derivatives(line)
    across = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    sides = []
    for walls, way in ((left, across), (right, -across)):
        sides.append(ranges_to(walls, line, way, 1.5 * nearest_on(walls, line)[0]))
    return np.column_stack(sides)


def _edge(loop: Loop, inside: int) -> Floats:
    """Return the drivable edge of a border; inside: 1 for the outer, -1 for the inner one."""
    middle = lay(loop, 0.0)
    turn = 1 if area_of(middle) > 0.0 else -1
    return lay(loop, inside * turn * HALF_THICKNESS)


def _start_near(line: Floats, point: tuple[float, float] | None) -> Floats:
    if point is None:
        return line
    return np.roll(line, -int(np.argmin(np.hypot(*(line - point).T))), axis=0)


def _from_points(plan: TrackSpec, scale: TrackScale) -> Floats:
    points = plan.points
    if len(points) < LEAST_POINTS:
        what = f"{len(points)} points make no course; give {LEAST_POINTS} or more"
        raise TrackError(f"{plan.name}: {what}")
    steps = np.hypot(*(np.roll(points, -1, axis=0) - points)[:, :2].T)
    if steps.min() < 1e-6:
        index = int(np.argmin(steps))
        raise TrackError(
            f"{plan.name}: points {index + 1} and {index + 2} are the same; leave one out "
            "(the first point is not repeated at the end)"
        )
    check_length(float(steps.sum()), scale.spacing, plan.name)
    if plan.reverse:
        points = points[::-1][:, [0, 1, 3, 2]]
    curve = periodic_spline(points, scale.spacing)
    order = int(np.argmin(np.hypot(*(curve[:, :2] - plan.line_at).T))) if plan.line_at else 0
    return np.roll(curve, -order, axis=0)


def periodic_spline(points: Floats, spacing: float) -> Floats:
    """Return a closed cubic spline through points (N, columns), finely sampled.

    Chord-length parameter; the tangents solve the usual cyclic system of equations.
    """
    steps = np.hypot(*(np.roll(points, -1, axis=0) - points)[:, :2].T)
    count = len(points)
    before, after = np.roll(steps, 1), steps
    rows = np.arange(count)
    system = np.zeros((count, count))
    system[rows, rows] = 2.0 * (before + after)
    system[rows, (rows - 1) % count] += after
    system[rows, (rows + 1) % count] += before
    slope_after = (np.roll(points, -1, axis=0) - points) / after[:, None]
    slope_before = np.roll(slope_after, 1, axis=0)
    right = 3.0 * (after[:, None] * slope_before + before[:, None] * slope_after)
    tangents = np.linalg.solve(system, right)
    pieces = []
    for index in range(count):
        following = (index + 1) % count
        samples = max(int(4.0 * steps[index] / spacing), 4)
        t = np.linspace(0.0, 1.0, samples, endpoint=False)[:, None]
        h = steps[index]
        pieces.append(
            (1 + 2 * t) * (1 - t) ** 2 * points[index]
            + t * (1 - t) ** 2 * h * tangents[index]
            + t**2 * (3 - 2 * t) * points[following]
            + t**2 * (t - 1) * h * tangents[following]
        )
    return np.concatenate(pieces)


def _line(
    raw: Floats, spacing: float, borders: tuple[Floats, Floats] | None
) -> tuple[Floats, Floats]:
    """Return the line at equal steps and its half-widths."""
    count = max(round(lengths_of(raw[:, :2]).sum() / spacing), 32)
    rows = resample(raw, count)
    line = np.ascontiguousarray(rows[:, :2])
    return line, rows[:, 2:] if borders is None else _reach_across(*borders, line)


def _check_half_widths(name: str, line: Floats, half_widths: Floats) -> None:
    """Check that a line lies between its borders between its points, too.

    Raises:
        TrackError: it does not.
    """
    narrow, side = np.unravel_index(np.argmin(half_widths), half_widths.shape)
    if half_widths[narrow, side] <= 0.0:
        x, y = line[narrow]
        raise TrackError(
            f"{name}: the spline through the points falls to a half-width of "
            f"{half_widths[narrow, side]:.2f} m on the {('left', 'right')[side]} near "
            f"({x:.2f}, {y:.2f}); let the width change over more points"
        )


def _borders_beside(plan: TrackSpec, line: Floats, heading: Floats, half_widths: Floats) -> Floats:
    beyond = plan.kerb + plan.grass
    pairs = crossings(segments_of(line))
    if not len(pairs):
        # Where a sample lies in the crossing itself, the steps beside it only touch there.
        pairs = crossings(segments_of(line + ASIDE * (np.roll(line, -1, axis=0) - line)))
    if len(pairs):
        spacing = float(np.hypot(*(line[1] - line[0])))
        (x, y), (first, second) = line[pairs[0, 0]], pairs[0] * spacing
        raise TrackError(
            f"{plan.name}: the line crosses itself at ({x:.2f}, {y:.2f}), {first:.1f} m and "
            f"{second:.1f} m after its start; a course has one level and no bridges: leave a part "
            "out"
        )
    left = border_beside(line, heading, half_widths[:, 0] + beyond)
    right = border_beside(line, heading, -half_widths[:, 1] - beyond)
    if min(len(left), len(right)) < 3:
        turn = np.sin(np.roll(heading, -1) - heading)[:, None] * (1.0, -1.0)
        tight, side = divmod(int(np.argmax(half_widths * turn)), 2)
        (x, y), width = line[tight], half_widths[tight, side] + beyond
        where = f"on the {('left', 'right')[side]} near ({x:.2f}, {y:.2f})"
        what = f"wider than its bends allow, up to {width:.2f} m {where}"
        raise TrackError(f"{plan.name}: {what}; make it narrower")
    return np.concatenate([segments_of(left), segments_of(right)])


def _starts(rows: Floats, line: Floats, heading: Floats) -> Floats:
    """Return the boxes of random starts in radians, turned to the direction of travel."""
    starts = rows.copy()
    starts[:, 4:] = np.radians(rows[:, 4:])
    for start in starts:
        middle = np.array([0.5 * (start[0] + start[1]), 0.5 * (start[2] + start[3])])
        nearest = int(np.argmin(np.hypot(*(line - middle).T)))
        if np.cos(start[4] - heading[nearest]) < 0.0:
            start[4] += np.pi
    return starts


def _sectors(gates: int, sectors: int) -> tuple[int, ...]:
    return tuple(round(gates * number / sectors) % gates for number in range(1, sectors + 1))


def _at(course: Course, progress: float, offset: float) -> tuple[float, float, float]:
    """Return x, y, heading at a progress and lateral offset."""
    x, y, heading, _ = course.line[round(progress / course.spacing) % len(course.line)]
    return x - offset * math.sin(heading), y + offset * math.cos(heading), heading


def _grid(course: Course, scale: TrackScale, most: int) -> Floats:
    """Return start places behind the timing line: two staggered columns, as many as fit.

    Where the track is too narrow for two columns the places stand behind one another.
    """
    places: list[tuple[float, float, float]] = []
    distance = scale.first_row
    side = 1.0
    while len(places) < most and distance < 0.9 * course.length:
        index = round((course.length - distance) / course.spacing) % len(course.line)
        left, right = course.half_widths[index]
        room = min(left, right) - scale.body
        if room < 0.0:
            distance += scale.row / 2.0
            continue
        offset = side * min(scale.column, room)
        # Columns that stand close together need a row each.
        alone = min(scale.column, room) < 0.75 * scale.column
        places.append(_at(course, course.length - distance, 0.0 if alone else offset))
        distance += scale.row if alone else 0.5 * scale.row
        side = -side
    return np.array(places).reshape(-1, 3)


def _item_rows(course: Course, scale: TrackScale, length: float) -> list[tuple[float, float]]:
    """Return item boxes in rows across the track: two or three, as the width allows."""
    rows = max(round(length / scale.box_step), 2)
    spots = []
    for row in range(rows):
        progress = (row + 0.5) * length / rows
        left, right = course.half_widths[round(progress / course.spacing) % len(course.line)]
        reach = 0.5 * min(left, right)
        across = (-reach, 0.0, reach) if min(left, right) > 4.5 * scale.body else (-reach, reach)
        spots += [(progress, offset) for offset in across]
    return spots
