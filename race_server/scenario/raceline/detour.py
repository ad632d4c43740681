"""A reference line that leads around the fixed obstacles of a course."""

from dataclasses import dataclass, replace

import numpy as np

from race_server.core.vehicles import Vehicle
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.profile import speeds_on
from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.line import ReferenceLine

# A detour begins and ends over about this length, in lengths of the vehicle.
EASE_LENGTHS = 3.0
# Room between body and obstacle in vehicle widths, or this share of the free room if that is less.
CLEAR_WIDTHS, CLEAR_SHARE = 0.5, 0.45
# An obstacle lies abreast of the line within this many vehicle lengths of its place along the
# centre line: beyond, another part of the course may be nearer.
ABREAST_LENGTHS = 4.0
# Points checked on each side of an obstacle.
POINTS = 9
# Towards the inside of a bend no detour comes nearer to its centre than this share of the radius
# leaves: coordinates beside a line fold over there.
FOLDING = 0.7
# A bound may be missed by this much [m]: no driver is that exact.
NEAR = 0.002
# Keeps neighbouring pushes apart numerically; too stiff to matter.
STIFF = 1e-9
# Pushes at most; a lap among a dozen obstacles needs about thirty.
MOST_PUSHES = 400


@dataclass(frozen=True)
class Block:
    """The part of the way that an obstacle blocks, in coordinates of the line."""

    first: int  # samples of the line
    last: int
    low: float  # [m] left of the line
    high: float  # [m]


def around(course: Course, line: ReferenceLine, bounds: Bounds, vehicle: Vehicle) -> ReferenceLine:
    """Return the line, led around the course's obstacles as gently as the borders allow.

    It passes each obstacle on the side on which it has to give way less, if there is room. Its
    speeds are those of the line, less by what the bends of the detour cost.
    """
    if not course.obstacles:
        return line
    low, high = (
        np.minimum(bounds.reach - line.right, 0.0),
        np.maximum(line.left - bounds.reach, 0.0),
    )
    left, right = line.left.copy(), line.right.copy()
    for box in course.obstacles:
        narrow(block_of(course, line, vehicle, box), vehicle, (low, high), (left, right))
    with np.errstate(divide="ignore"):
        inside = FOLDING / line.curvature
    high = np.where(line.curvature > 0.0, np.minimum(high, inside), high)
    low = np.where(line.curvature < 0.0, np.maximum(low, inside), low)
    offset = eased(low, high, line.spacing, EASE_LENGTHS * vehicle.length)
    return shifted(replace(line, left=left, right=right), offset, bounds)


def block_of(course: Course, line: ReferenceLine, vehicle: Vehicle, box: Obstacle) -> Block:
    """Return where an obstacle lies beside the line."""
    count, edge = len(line.x), edge_of(box)
    nearest = np.argmin(np.hypot(course.line[:, 0] - box.x, course.line[:, 1] - box.y))
    reach = round(ABREAST_LENGTHS * vehicle.length / line.spacing)
    near = int(line.beside[nearest]) + np.arange(-reach, reach + 1)
    dx = edge[:, 0, None] - line.x[near % count]
    dy = edge[:, 1, None] - line.y[near % count]
    best = np.argmin(np.hypot(dx, dy), axis=1)
    rows, heading = np.arange(len(edge)), line.heading[near % count][best]
    across = dy[rows, best] * np.cos(heading) - dx[rows, best] * np.sin(heading)
    # The body is beside it while any part of its length is.
    half = int(np.ceil(0.5 * vehicle.length / line.spacing))
    first, last = int(near[best.min()]) - half, int(near[best.max()]) + half
    return Block(first, last, float(across.min()), float(across.max()))


def edge_of(box: Obstacle) -> Floats:
    """Return points along the sides of an obstacle, shape (n, 2) [m]."""
    cos, sin = np.cos(box.heading), np.sin(box.heading)
    along = 0.5 * box.length * np.linspace(-1.0, 1.0, POINTS)
    across = 0.5 * box.width * np.linspace(-1.0, 1.0, POINTS)
    ends = np.array([(u, v) for u in along[[0, -1]] for v in across])
    sides = np.array([(u, v) for u in along for v in across[[0, -1]]])
    return np.vstack([ends, sides]) @ np.array([[cos, sin], [-sin, cos]]) + (box.x, box.y)


def narrow(
    block: Block,
    vehicle: Vehicle,
    offsets: tuple[Floats, Floats],
    asphalt: tuple[Floats, Floats],
) -> None:
    """Take an obstacle out of the room beside the line, in place.

    offsets: least and most (N,) [m] that a vehicle's middle may be left of the line; asphalt: to
    the left and to the right of the line (N,) [m], up to the obstacle where the line passes it.
    """
    (low, high), (left, right) = offsets, asphalt
    at = np.arange(block.first, block.last + 1) % len(low)
    beyond_left, beyond_right = left[at] - block.high, right[at] + block.low
    wide_left, wide_right = float(beyond_left.min()), float(beyond_right.min())
    yields_left, yields_right = max(block.high, 0.0), max(-block.low, 0.0)
    needed = (1.0 + CLEAR_WIDTHS) * vehicle.width
    goes_left = yields_left < yields_right
    if min(wide_left, wide_right) < needed:
        goes_left = wide_left > wide_right
    spare = np.maximum((beyond_left if goes_left else beyond_right) - vehicle.width, 0.0)
    clear = 0.5 * vehicle.width + np.minimum(CLEAR_WIDTHS * vehicle.width, CLEAR_SHARE * spare)
    if goes_left:
        low[at] = np.maximum(low[at], block.high + clear)
        high[at] = np.maximum(np.minimum(high[at], left[at] - clear), low[at])
        right[at] = -block.high
    else:
        high[at] = np.minimum(high[at], block.low - clear)
        low[at] = np.minimum(np.maximum(low[at], clear - right[at]), high[at])
        left[at] = block.low


def eased(low: Floats, high: Floats, spacing: float, length: float) -> Floats:
    """Return the offsets (N,) [m] between bounds that bend a closed line least.

    Like a beam on springs that is pushed aside: least is the integral of n''² + n² / length⁴,
    n the offset, over the line. Each push adds the same curve at another place, so only the pushes
    are looked for, one after the other where most is missing, by the active-set method of Lawson
    and Hanson, Solving Least Squares Problems, 1974.
    """
    count = len(low)
    wave = 2.0 * np.pi * np.fft.rfftfreq(count, spacing)
    pushed = np.fft.irfft(1.0 / (wave**4 + length**-4), count)
    pushed /= pushed[0]
    places, sides, push = np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    offset = np.zeros(count)
    for _ in range(MOST_PUSHES):
        short = np.maximum(low - offset, offset - high)
        worst = int(np.argmax(short))
        if short[worst] < NEAR:
            break
        places = np.append(places, worst)
        sides = np.append(sides, 1.0 if offset[worst] < low[worst] else -1.0)
        push = np.append(push, 0.0)
        while True:
            bound = np.where(sides > 0.0, low[places], high[places])
            among = pushed[(places[:, None] - places) % count]
            wanted = np.linalg.solve(among + STIFF * np.eye(len(places)), bound)
            pulls = wanted * sides < 0.0
            if not pulls.any():
                break
            # No push may pull: stop where the first one would, and drop it.
            share = push[pulls] / (push[pulls] - wanted[pulls])
            push = push + share.min() * (wanted - push)
            first = np.flatnonzero(pulls)[np.argmin(share)]
            places, sides, push = (np.delete(a, first) for a in (places, sides, push))
        push = wanted
        offset = pushed[(np.arange(count)[:, None] - places) % count] @ push
    return offset


def shifted(line: ReferenceLine, offset: Floats, bounds: Bounds) -> ReferenceLine:
    """Return a line `offset` (N,) [m] to the left of another, resampled at equal steps."""
    count = len(offset)
    cos, sin = np.cos(line.heading), np.sin(line.heading)
    points = np.stack([line.x - offset * sin, line.y + offset * cos], axis=1)
    slope = (np.roll(offset, -1) - np.roll(offset, 1)) / (2.0 * line.spacing)
    room = 1.0 - offset * line.curvature
    turned = np.arctan2(slope, room)
    bend = (np.roll(turned, -1) - np.roll(turned, 1)) / (2.0 * line.spacing)
    stretch = np.hypot(room, slope)
    curvature = (line.curvature + bend) / stretch
    steps = line.spacing * 0.5 * (stretch + np.roll(stretch, -1))
    before = speeds_on(np.full(count, line.spacing), line.curvature, bounds)
    speed = line.speed * speeds_on(steps, curvature, bounds) / before

    at = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.linspace(0.0, at[-1], count, endpoint=False)

    def between(values: Floats) -> Floats:
        return np.interp(wanted, at, np.append(values, values[0]))

    heading = np.unwrap(np.append(line.heading, line.heading[0]))
    spacing = float(at[-1]) / count
    return replace(
        line,
        spacing=spacing,
        x=between(points[:, 0]),
        y=between(points[:, 1]),
        heading=np.interp(wanted, at, heading + np.append(turned, turned[0])),
        curvature=between(curvature),
        speed=between(speed),
        left=np.maximum(between(line.left - offset), 0.0),
        right=np.maximum(between(line.right + offset), 0.0),
        beside=np.round(at[line.beside] / spacing).astype(np.int64) % count,
    )
