"""What a lidar sees that is on no map: people, other vehicles; and how fast one may drive then.

A point that lies on a wall or a block of the map is expected. Whatever else is seen may walk, in
any direction. A vehicle may drive as fast as it can still stop, without that anything seen reaches
it before.
"""

import math
from typing import NamedTuple

import numpy as np

from race_agents.planning.path_follower import ANGLE, GEAR, HEADING, LAST, X, Y
from race_agents.planning.scan import ray_angle
from race_server.core.free_space.rig import Rig, Towed, pose_ahead, towed_by
from race_server.core.kernels.geometry import Pose, cos_sin, distance_to_box
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats, Record
from race_server.core.vehicles import GRAVITY

# A point this near [m] to something on the map belongs to it: noise, and the place of the sensor.
NEARNESS = 0.15
# Two rays that lie side by side see one thing where their ranges differ by less than this [m].
TOGETHER = 0.4
# How fast [m/s] something that is seen may come, and how near [m] it may get to a vehicle.
WALK, RESERVE = 1.6, 0.25
# From what is seen to brakes that act [s]: a decision, a delay of another, and half of one.
REACTION_S = 0.25
# Share of the brakes that a stop counts on.
STOP_SHARE = 0.7
# A vehicle drives at least this share of its fastest speed, or not at all; how often the share that
# it may drive is halved in between: it is found to 0.03.
LEAST_SHARE, HALVINGS = 0.1, 5
# What is seen no more, because it is behind or leans on the vehicle, is reckoned with for this time
# [s]: people rest for up to 3 s, and need 2 s along a vehicle. It may have walked for the second.
MEMORY_S, WALKED_S = 5.0, 1.5
# The outermost rays do not count as the field of view [rad].
EDGE = 0.1


class Chart(NamedTuple):
    """What is known to stand in a lot."""

    walls: Floats  # (P, 4) x0, y0, x1, y1 [m]
    boxes: Floats  # (B, 6) x, y [m], cosine and sine of the heading, half length, half width [m]

    def beside(self, boxes: Floats) -> "Chart":
        """Return the same with more boxes."""
        return Chart(self.walls, np.concatenate([self.boxes, boxes]))


def chart_around(chart: Chart, x: float, y: float, far: float) -> Chart:
    """Return what stands within `far` [m] of a place, and some of what is farther away."""
    walls, boxes, place = chart.walls, chart.boxes, np.array([x, y])
    ends = walls.reshape(-1, 2, 2)
    by = ((ends.min(axis=1) < place + far) & (ends.max(axis=1) > place - far)).all(axis=1)
    apart = np.hypot(*(boxes[:, :2] - place).T) - np.hypot(boxes[:, 4], boxes[:, 5])
    return Chart(walls[by], boxes[apart < far])


class Eye(NamedTuple):
    """A lidar where it scanned."""

    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad]
    field: float  # [rad] between the outermost rays
    reach: float  # [m]
    blind: float  # [m] so near it may stand in a body


@large_kernel
def unexpected_points(
    chart: Chart, eye: Eye, observation: Floats, start: int, rays: int, far: float, points: Floats
) -> int:
    """Fill `points`, (N, 3), with what a scan shows that is not on the chart; return how many.

    A point: x [m], y [m], and how long ago it was seen [s], here 0.

    observation: (size,), the scan of `rays` ranges [m] from `start` on; far: what is farther away
    than this [m] is left out.
    """
    # A ray that meets nothing reads the reach, and with noise a little less.
    far = min(far, eye.reach - NEARNESS)
    count, last, last_ray = 0, 0.0, -2
    for ray in range(rays):
        distance = observation[start + ray]
        if not 0.0 < distance < far:
            continue
        cos, sin = cos_sin(eye.heading + ray_angle(float(ray), rays, eye.field))
        x, y = eye.x + distance * cos, eye.y + distance * sin
        if _is_expected(chart, x, y):
            continue
        # One ray alone is noise.
        if ray == last_ray + 1 and abs(distance - last) < TOGETHER:
            points[count, 0], points[count, 1], points[count, 2] = x, y, 0.0
            count += 1
        last, last_ray = distance, ray
    return count


@large_kernel
def keep_in_mind(
    eye: Eye, before: Floats, known: int, elapsed_s: float, points: Floats, count: int
) -> int:
    """Add to `points`, (N, 3), what was seen before and has left the field of view; return the sum.

    before: (N, 3) as `points`, of which the first `known` count; elapsed_s: since then; count: of
    `points` so far. As many are kept as there is room for.
    """
    for number in range(known):
        seen_s = before[number, 2] + elapsed_s
        dx, dy = before[number, 0] - eye.x, before[number, 1] - eye.y
        cos, sin = cos_sin(eye.heading)
        bearing = math.atan2(dy * cos - dx * sin, dx * cos + dy * sin)
        is_in_view = abs(bearing) < 0.5 * eye.field - EDGE
        is_in_view = is_in_view and dx * dx + dy * dy > eye.blind * eye.blind
        if seen_s <= MEMORY_S and not is_in_view and count < len(points):
            points[count, 0], points[count, 1] = before[number, 0], before[number, 1]
            points[count, 2] = seen_s
            count += 1
    return count


@kernel
def _is_expected(chart: Chart, x: float, y: float) -> bool:
    """Return whether a point [m] lies on something that is known, or in it."""
    for wall in range(len(chart.walls)):
        x0, y0 = chart.walls[wall, 0], chart.walls[wall, 1]
        along_x, along_y = chart.walls[wall, 2] - x0, chart.walls[wall, 3] - y0
        square = max(along_x * along_x + along_y * along_y, 1e-12)
        share = min(max(((x - x0) * along_x + (y - y0) * along_y) / square, 0.0), 1.0)
        dx, dy = x - x0 - share * along_x, y - y0 - share * along_y
        if dx * dx + dy * dy < NEARNESS * NEARNESS:
            return True
    for box in range(len(chart.boxes)):
        if _away(chart.boxes[box], x, y) < NEARNESS:
            return True
    return False


@kernel
def _away(box: Floats, x: float, y: float) -> float:
    """Return the distance [m] from a point to a box, (6,) as in `Chart`."""
    return distance_to_box(x - box[0], y - box[1], box[2], box[3], box[4], box[5])


@large_kernel
def safe_speed(
    track: Floats,
    progress: Floats,
    vehicle: Record,
    rig: Rig | None,
    points: Floats,
    count: int,
    box: Floats,
) -> float:
    """Return the most speed [m/s] at which a vehicle on a track can stop before what it sees.

    track: (S, COLUMNS), see `path_follower`; progress: (1,) number of the point that was passed
    last; rig: the vehicle with its trailer, None without one; points: (N, 3), see
    `unexpected_points`, of which the first `count` count; box: (6,), work space.
    """
    if count == 0:
        return math.inf
    fastest, point = max(vehicle.top_speed, vehicle.reverse_speed), int(progress[0])
    if _can_stop(track, point, vehicle, rig, points, count, fastest, box):
        return fastest
    safe, unsafe = LEAST_SHARE * fastest, fastest
    if not _can_stop(track, point, vehicle, rig, points, count, safe, box):
        return 0.0
    for _ in range(HALVINGS):
        speed = 0.5 * (safe + unsafe)
        if _can_stop(track, point, vehicle, rig, points, count, speed, box):
            safe = speed
        else:
            unsafe = speed
    return safe


@kernel
def _is_near(points: Floats, count: int, passed_s: float, box: Floats) -> bool:
    """Return whether anything seen may be at a box after a time [s]. box: (6,) as in `Chart`."""
    for number in range(count):
        near = RESERVE + WALK * (passed_s + min(points[number, 2], WALKED_S))
        if _away(box, points[number, 0], points[number, 1]) < near:
            return True
    return False


@kernel
def _put(box: Floats, pose: Pose, ahead: float, half_length: float, half_width: float) -> None:
    """Fill a box, (6,) as in `Chart`, whose middle lies `ahead` [m] of a pose."""
    cos, sin = cos_sin(pose.heading)
    box[0], box[1] = pose.x + ahead * cos, pose.y + ahead * sin
    box[2], box[3], box[4], box[5] = cos, sin, half_length, half_width


@kernel
def _meets(
    track: Floats,
    point: int,
    vehicle: Record,
    rig: Rig | None,
    points: Floats,
    count: int,
    passed_s: float,
    box: Floats,
) -> bool:
    """Return whether anything seen may be where the vehicle is at a point after a time [s]."""
    pose = Pose(track[point, X], track[point, Y], track[point, HEADING])
    if rig is not None:
        angle, drawn = track[point, ANGLE], rig.drawn
        if track[point, GEAR] > 0.0:
            towed = towed_by(rig, pose, angle, 0.0)
        else:
            towed = Towed(pose.x, pose.y, pose.heading, angle, 0.0)
            pose = pose_ahead(rig, towed)
        place = Pose(towed.x, towed.y, towed.heading)
        _put(box, place, drawn.middle, drawn.half_length, drawn.half_width)
        if _is_near(points, count, passed_s, box):
            return True
    ahead = vehicle.rear_axle + vehicle.box_offset
    _put(box, pose, ahead, 0.5 * vehicle.length, 0.5 * vehicle.width)
    return _is_near(points, count, passed_s, box)


@kernel
def _can_stop(
    track: Floats,
    point: int,
    vehicle: Record,
    rig: Rig | None,
    points: Floats,
    count: int,
    speed: float,
    box: Floats,
) -> bool:
    """Return whether nothing reaches a vehicle that now drives at a speed [m/s] and then stops.

    The other arguments as for `safe_speed`.
    """
    brakes = STOP_SHARE * (vehicle.brake_force / vehicle.mass + vehicle.rolling * GRAVITY)
    reaction = speed * REACTION_S
    driven, last = 0.0, int(track[point, LAST])
    while True:
        braked = max(driven - reaction, 0.0)
        square = speed * speed - 2.0 * brakes * braked
        if square < 0.0:
            return True
        passed_s = min(driven / speed, REACTION_S) + (speed - math.sqrt(square)) / brakes
        if _meets(track, point, vehicle, rig, points, count, passed_s, box):
            return False
        if point >= last:
            return True
        dx, dy = track[point + 1, X] - track[point, X], track[point + 1, Y] - track[point, Y]
        driven += math.sqrt(dx * dx + dy * dy)
        point += 1
