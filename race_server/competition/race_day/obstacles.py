"""Fixed obstacles of a car's size at random places, with room to pass beside each."""

import hashlib
import math
from dataclasses import replace

import numpy as np

from race_server.competition.race_day.formats.format import Obstacles
from race_server.core.vehicles import Vehicle
from race_server.errors import ScenarioError
from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.polyline import corners_of_box, loops_of, nearest_on

# Free of obstacles, in car lengths: on both sides of the timing line and of the starting car …
QUIET_LENGTHS = 6.0
# … and between two obstacles, so that no car has to turn more sharply than it can.
APART_LENGTHS = 6.0
# Places tried in all; a course with little room gets fewer obstacles.
TRIES = 600
# Points checked on each side of a box.
POINTS = 8
# Bends in which a car needs all its lock have no obstacle: share of its sharpest curvature.
BEND_SHARE = 0.6


def with_obstacles(course: Course, wanted: Obstacles, vehicle: Vehicle, seed: int) -> Course:
    """Return the course with as many obstacles as its length asks for, placed by a seed.

    Between each obstacle and one of the two borders the passage asked for stays free.

    Raises:
        ScenarioError: there is no room for a single one.
    """
    chance = np.random.default_rng(seed)
    count = max(round(course.length / (wanted.every_lengths * vehicle.length)), 1)
    borders = sorted_borders(course)
    passage = wanted.passage_widths * vehicle.width
    placed: list[tuple[float, Obstacle]] = []
    for _ in range(TRIES):
        if len(placed) == count:
            break
        progress = float(chance.uniform(0.0, course.length))
        share = float(chance.uniform(-1.0, 1.0))
        turn = float(chance.uniform(-0.5, 0.5))
        if not _is_fit(course, vehicle, progress, [at for at, _ in placed]):
            continue
        obstacle = _box_at(course, vehicle, progress, share, turn)
        if is_passable(obstacle, borders, passage):
            placed.append((progress, obstacle))
    if not placed:
        raise ScenarioError(
            f"{course.name} has no room for an obstacle beside which {passage:.2f} m stay free; "
            "choose a wider track"
        )
    boxes = tuple(obstacle for _, obstacle in sorted(placed, key=lambda entry: entry[0]))
    digest = hashlib.sha256(str(boxes).encode()).hexdigest()
    # The part before the sign is the digest of the empty course, whose reference limit holds.
    digest = f"{course.digest}+{digest[:16]}"
    return replace(course, obstacles=course.obstacles + boxes, digest=digest)


def sorted_borders(course: Course) -> tuple[Floats, Floats]:
    """Return the border segments on the left and on the right of the line."""
    x, y, heading, _ = course.line[0]
    left: list[Floats] = []
    right: list[Floats] = []
    for loop in loops_of(course.borders):
        _, nearest = nearest_on(loop, np.array([[x, y]]))
        dx, dy = nearest[0] - (x, y)
        side = left if dy * math.cos(heading) - dx * math.sin(heading) > 0.0 else right
        side.append(loop)
    return np.concatenate(left), np.concatenate(right)


def is_passable(obstacle: Obstacle, borders: tuple[Floats, Floats], passage: float) -> bool:
    """Return whether an obstacle stands clear of both borders, and far enough from one."""
    corners = corners_of(obstacle)
    edge = np.concatenate(
        [
            np.linspace(corner, after, POINTS + 1)
            for corner, after in zip(corners, np.roll(corners, -1, 0), strict=True)
        ]
    )
    clear = [float(nearest_on(side, edge)[0].min()) for side in borders]
    # Of two neighbouring points that are this far from a border none can lie beyond it.
    step = obstacle.length / POINTS
    # A border's corner may lie nearer to the box than to any point checked.
    return min(clear) >= step and max(clear) >= passage + 0.01 * obstacle.length


def corners_of(obstacle: Obstacle) -> Floats:
    """Return the corners of an obstacle, shape (4, 2) [m]."""
    return corners_of_box(obstacle.x, obstacle.y, obstacle.heading, obstacle.length, obstacle.width)


def _is_fit(course: Course, vehicle: Vehicle, progress: float, taken: list[float]) -> bool:
    """Return whether a place is straight enough, and away from the start and other obstacles."""
    quiet = QUIET_LENGTHS * vehicle.length
    start = float(np.hypot(*(course.grid[0, :2] - course.line[0, :2])))
    if not quiet <= progress <= course.length - start - quiet:
        return False
    if any(_apart(course, progress, other) < APART_LENGTHS * vehicle.length for other in taken):
        return False
    reach = round(2.0 * vehicle.length / course.spacing)
    index = round(progress / course.spacing)
    near = np.arange(index - reach, index + reach + 1) % len(course.line)
    return bool(np.abs(course.line[near, 3]).max() <= BEND_SHARE / vehicle.turning_radius)


def _apart(course: Course, progress: float, other: float) -> float:
    gap = abs(progress - other)
    return min(gap, course.length - gap)


def _box_at(
    course: Course, vehicle: Vehicle, progress: float, share: float, turn: float
) -> Obstacle:
    """Return a box at a share of the way from the line to a border, turned against the line."""
    index = round(progress / course.spacing) % len(course.line)
    x, y, heading, _ = course.line[index]
    left, right = course.half_widths[index]
    reach = (left if share > 0.0 else right) - 0.5 * vehicle.width
    offset = share * max(reach, 0.0)
    return Obstacle(
        x=float(x - offset * math.sin(heading)),
        y=float(y + offset * math.cos(heading)),
        heading=float(heading + turn),
        length=vehicle.length,
        width=vehicle.width,
    )
