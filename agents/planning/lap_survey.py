"""A first lap, surveyed: where each scan was taken, and when the lap comes back to its start."""

import math
from dataclasses import dataclass, field

import numpy as np

from race_agents.planning.wall_map import Fit, Pose, Scan, WallMap, compose, inverse, placed
from race_server.core.state import Floats

# A scan is matched with those of the last stretch [body lengths], at least this many.
RECENT, FEWEST = 14.0, 8
# How far odometry may be off between two scans, of the way and of the turn, beside the least
# [m], [rad].
SLIP, TWIST = 0.02, 0.02
LEAST_SLIP, LEAST_TWIST = 0.004, 0.002
# Share of a scan that must lie on known walls.
FITTING = 0.5
# The shortest lap [body lengths]; how near to its start the odometry says to be [body lengths, and
# share of the way driven]; how well the scan fits there; how far its net turn may be from a circle.
SHORTEST, NEAR, NEAR_SHARE, CLOSING, TURN = 15.0, 2.0, 0.04, 0.7, 0.7
# A kart that has turned this far has driven past its start, however small the course is.
PAST = 4.0 * math.pi - TURN
# The start is looked for on walls of coarse cells first: a fit reaches as far as a cell.
COARSE = (4.0, 1.0)


@dataclass
class LapSurvey:
    """Scans with their poses in the frame of the first, as they come in."""

    cell: float  # [m]
    length: float  # [m] of the body
    scans: list[Scan] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)
    ways: list[float] = field(default_factory=list)  # [m] driven up to each scan
    failures: int = 0  # scans in a row that fit nothing
    is_past: bool = False  # whether it was beside its start, and the lap did not close
    _was_beside: bool = False
    _beginning: list[WallMap] = field(default_factory=list)

    def add(self, scan: Scan, moved: Pose, way: float) -> Fit:
        """Take in a scan; return where it fits.

        moved: since the last scan, by odometry; way: driven meanwhile [m].
        """
        if not self.poses:
            self.scans, self.poses, self.ways = [scan], [(0.0, 0.0, 0.0)], [0.0]
            return Fit((0.0, 0.0, 0.0), 1.0, 0.0)
        guess = compose(self.poses[-1], moved)
        trust = (LEAST_SLIP + SLIP * way, LEAST_TWIST + TWIST * abs(moved[2]))
        first = max(int(np.searchsorted(self.ways, self.ways[-1] - RECENT * self.length)), 0)
        fit = self.map_of(min(first, max(len(self.poses) - FEWEST, 0)), len(self.poses)).match(
            scan, guess, trust
        )
        self.failures = self.failures + 1 if fit.share < FITTING else 0
        pose = guess if self.failures else fit.pose
        if way < 0.1 * self.length:  # it stands: nothing new
            self.poses[-1] = pose
            self.scans[-1] = scan
            return fit
        self.scans.append(scan)
        self.poses.append(pose)
        self.ways.append(self.ways[-1] + way)
        return fit

    def map_of(self, first: int, last: int) -> WallMap:
        """Return the walls that the scans from `first` to before `last` saw."""
        return wall_map_of(self.scans[first:last], self.poses[first:last], self.cell)

    def map_at(self, poses: list[Pose]) -> WallMap:
        """Return all walls, seen from other poses of the scans."""
        return wall_map_of(self.scans, poses, self.cell)

    def closing(self) -> Fit | None:
        """Return where the last scan fits beside the start, where the lap is complete."""
        x, y, heading = self.poses[-1]
        way = self.ways[-1]
        near, scan = NEAR * self.length + NEAR_SHARE * way, self.scans[-1]
        is_away = math.hypot(x, y) > near + RECENT * self.length
        self.is_past = self._was_beside and (is_away or abs(heading) > PAST)
        turned = abs(abs(heading) - 2.0 * math.pi) <= TURN
        if is_away or not turned or way < SHORTEST * self.length:
            return None
        self._was_beside = True
        if not scan.is_placed:
            return None
        if not self._beginning:
            end = int(np.searchsorted(self.ways, RECENT * self.length))
            scans, poses = self.scans[:end], self.poses[:end]
            self._beginning = [wall_map_of(scans, poses, size * self.cell) for size in COARSE]
        turn = math.copysign(2.0 * math.pi, heading)
        best = Fit((x, y, heading - turn), 0.0, 0.0)
        for beginning in self._beginning:
            best = beginning.match(scan, best.pose, (near, 0.1))
        if best.share < CLOSING:
            return None
        back = compose(best.pose, (0.0, 0.0, turn))
        # Before the start the lap is not complete.
        return Fit(back, best.share, best.error) if best.pose[0] > 0.0 else None

    def closed(self, end: Pose) -> list[Pose]:
        """Return the poses with the error of the lap spread over its way.

        end: where the last one really is, its heading with the full turn.
        """
        return spread_error(self.poses, self.ways, end)


def wall_map_of(scans: list[Scan], poses: list[Pose], cell: float) -> WallMap:
    """Return the walls that scans saw from poses."""
    points = [placed(scan.points, pose) for scan, pose in zip(scans, poses, strict=True)]
    normals = [
        placed(scan.normals, pose, turned_only=True)
        for scan, pose in zip(scans, poses, strict=True)
    ]
    return WallMap(np.concatenate(points), np.concatenate(normals), cell)


def spread_error(poses: list[Pose], ways: list[float], end: Pose) -> list[Pose]:
    """Return poses bent so that the last one is `end`, each by its share of the way.

    The error of the heading goes into the turns between poses, and what is then left of the error
    of the place is added in proportion. ways: driven up to each [m].
    """
    twist = end[2] - poses[-1][2]
    shares = [way / max(ways[-1], 1e-9) for way in ways]
    bent = [poses[0]]
    for index in range(1, len(poses)):
        moved = compose(inverse(poses[index - 1]), poses[index])
        turn = twist * (shares[index] - shares[index - 1])
        bent.append(compose(bent[-1], compose((0.0, 0.0, 0.5 * turn), moved)))
        x, y, heading = bent[-1]
        bent[-1] = (x, y, heading + 0.5 * turn)
    dx, dy = end[0] - bent[-1][0], end[1] - bent[-1][1]
    return [
        (x + share * dx, y + share * dy, heading)
        for (x, y, heading), share in zip(bent, shares, strict=True)
    ]


def dead_reckoning(
    last: tuple[float, float, float], now: tuple[float, float, float], seconds: float
) -> Pose:
    """Return the motion between two observations of speed, lateral speed [m/s] and yaw rate."""
    ahead, aside, turn = (0.5 * seconds * (one + two) for one, two in zip(last, now, strict=True))
    cos, sin = math.cos(0.5 * turn), math.sin(0.5 * turn)
    return ahead * cos - aside * sin, ahead * sin + aside * cos, turn


def path_of(poses: list[Pose]) -> Floats:
    """Return the places (N, 2) [m] of poses."""
    return np.array(poses)[:, :2]
