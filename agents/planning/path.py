"""A path: arcs of the rear axle, forward and back, and poses along them."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from race_server.core.free_space.footprint import Point, convert
from race_server.core.kernels.geometry import Pose, along_arc
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle

# Arcs that differ by less than this in curvature [1/m] are one.
SAME_CURVATURE = 1e-9


@dataclass(frozen=True)
class Path:
    """Arcs that follow one another, driven by the rear axle."""

    start: Pose
    arcs: Floats  # (A, 2) curvature [1/m], way [m], negative in reverse

    @property
    def length(self) -> float:
        """The way driven [m]."""
        return float(np.abs(self.arcs[:, 1]).sum())

    @property
    def changes(self) -> int:
        """Changes of direction."""
        return int(np.count_nonzero(np.diff(np.sign(self.arcs[:, 1]))))

    @cached_property
    def poses(self) -> Floats:
        """Ends of the arcs: (A + 1, 3) x [m], y [m], heading [rad]; the first is the start."""
        poses = [self.start]
        for curvature, way in self.arcs:
            poses.append(along_arc(poses[-1], float(curvature), float(way)))
        return np.array(poses)

    def sampled(self, spacing: float) -> "Samples":
        """Return poses along the path, at most `spacing` [m] apart, each end of an arc included."""
        parts = []
        for pose, (curvature, way) in zip(self.poses, self.arcs, strict=False):
            count = max(math.ceil(abs(way) / spacing), 1)
            parts += [
                (*along_arc(Pose(*pose), float(curvature), way * k / count), way / count, curvature)
                for k in range(count)
            ]
        rows = np.array(parts).reshape(-1, 5)
        return Samples(
            poses=np.concatenate([rows[:, :3], self.poses[-1:]]),
            ways=rows[:, 3],
            curvatures=rows[:, 4],
        )


@dataclass(frozen=True)
class Samples:
    """Poses of the rear axle along a path."""

    poses: Floats  # (S + 1, 3) x [m], y [m], heading [rad]
    ways: Floats  # (S,) [m] from each pose to the next, negative in reverse
    curvatures: Floats  # (S,) [1/m] on that way

    def of(self, vehicle: Vehicle, point: Point) -> Floats:
        """Return the poses of another point of the vehicle, shape (S + 1, 3)."""
        return convert(self.poses, vehicle, Point.REAR_AXLE, point)


def path_of(start: Pose, arcs: Floats) -> Path:
    """Return a path, with arcs joined that are one arc, and without those of no length."""
    joined: list[list[float]] = []
    for curvature, way in arcs:
        if way == 0.0:
            continue
        if joined and joined[-1][1] * way > 0.0:
            if abs(joined[-1][0] - curvature) < SAME_CURVATURE:
                joined[-1][1] += way
                continue
        joined.append([float(curvature), float(way)])
    return Path(start, np.array(joined).reshape(-1, 2))


def driven_back(path: Path) -> Path:
    """Return the path from the end of a path to its start."""
    return Path(Pose(*map(float, path.poses[-1])), path.arcs[::-1] * (1.0, -1.0))


def in_words(pose: Pose) -> str:
    """Return a pose as errors name it."""
    return f"({pose.x:.2f} m, {pose.y:.2f} m, {math.degrees(pose.heading):.0f}°)"
