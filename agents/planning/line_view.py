"""A reference line as a driver observes it that finds its own pose and others by its lidar."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.planning.wall_map import Pose, WallMap, placed
from race_server.core.observation import AHEAD, NEARBY, Layout, Observation, layout_of, offsets_of
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.scenario.track.line import ReferenceLine

LAYOUT = layout_of("rivals", 0)
# What stays 0 in it: a chart has a line, and no centre line.
UNKNOWN = frozenset(
    (
        *("lateral_offset", "heading_error", "curvature_ahead", "path_ahead_x", "path_ahead_y"),
        *("left_ahead", "right_ahead", "look_ahead"),
    )
)
# What says that there is none.
FAR_OFF = (
    *("karts_x", "karts_y", "karts_along"),
    *("boxes_x", "boxes_y", "hazards_x", "hazards_y"),
)
SCAN = ("lidar", "lidar_before")
NOWHERE = 1e3
# How far around a kart others are looked for on the line [m].
AROUND = 9.0
# Rays that see a stranger at least, and rays between two of them that may miss it.
RAYS, MISSED = 3, 2
# What stands nearer to a border than this [m] is part of it.
EDGE = 0.15
# A stranger moves no faster than this [m/s], and its speed is averaged by this share.
FASTEST, NEW_SHARE = 12.0, 0.5
# How far its middle lies behind what is seen of it [body lengths].
DEPTH = 0.3


class LineView:
    """A line with what is around a kart on it."""

    def __init__(self, line: ReferenceLine, walls: WallMap, vehicle: Vehicle) -> None:
        """Observe a line between walls."""
        self._line, self._walls, self._vehicle = line, walls, vehicle
        self._held = line.held
        self._places = np.column_stack([line.x, line.y])
        self._left = np.column_stack([-np.sin(line.heading), np.cos(line.heading)])
        self.others = np.zeros((0, 4))  # x, y [m], velocity [m/s] of strangers

    def look(self, ranges: Floats, field: float, mount: float, pose: Pose, seconds: float) -> None:
        """Find who else is on the course.

        ranges: (R,) of a scan [m]; field: [rad]; mount: [m] of the lidar ahead; pose: of the kart;
        seconds: since the last scan.
        """
        angles = np.linspace(-0.5 * field, 0.5 * field, len(ranges))
        points = np.column_stack([ranges * np.cos(angles) + mount, ranges * np.sin(angles)])
        at = placed(points, pose)
        strange = (ranges > 0.0) & (ranges < AROUND - 1.5) & self._is_inside(at, pose)
        rays = np.flatnonzero(strange)
        rays = rays[~self._walls.is_known(at[rays])]
        found = []
        for group in np.split(rays, np.flatnonzero(np.diff(rays) > MISSED) + 1):
            if len(group) >= RAYS:
                away = at[group].mean(axis=0) - np.array(pose[:2])
                distance = max(float(np.hypot(*away)), 1e-6)
                middle = away * (1.0 + DEPTH * self._vehicle.length / distance)
                found.append([*(middle + np.array(pose[:2])), 0.0, 0.0])
        self.others = self._tracked(np.array(found).reshape(-1, 4), max(seconds, 0.02))

    def _is_inside(self, at: Floats, pose: Pose) -> NDArray[np.bool_]:
        """Return which points (N, 2) lie clear of the borders."""
        line = self._line
        here = int(np.argmin(np.sum((self._places - np.array(pose[:2])) ** 2, axis=1)))
        half = min(int(AROUND / line.spacing), len(line.x) // 2)
        window = np.arange(here - half, here + half, 2) % len(line.x)
        near = self._places[window]
        square = ((at[:, None, :] - near) ** 2).sum(axis=2)
        sample = window[np.argmin(square, axis=1)]
        offset = np.sum((at - self._places[sample]) * self._left[sample], axis=1)
        inside = (offset < line.left[sample] - EDGE) & (offset > EDGE - line.right[sample])
        return np.asarray(inside & (square.min(axis=1) < 9.0))

    def _tracked(self, found: Floats, seconds: float) -> Floats:
        """Return strangers (N, 4) with velocities, from where the nearest of before was."""
        for other in found if len(self.others) else ():
            away = np.hypot(*(self.others[:, :2] - other[:2]).T)
            before = self.others[int(np.argmin(away))]
            if away.min() < FASTEST * seconds:
                velocity = (other[:2] - before[:2]) / seconds
                other[2:] = NEW_SHARE * velocity + (1.0 - NEW_SHARE) * before[2:]
        return found

    def observe(self, observation: Observation, pose: Pose, step: float) -> Observation:
        """Return what a driver on the line is to see, in the preset `rivals`.

        observation: of the preset `lidar`; pose: of the kart [m], [rad]; step: between two samples
        ahead [m].
        """
        line, slices = self._line, LAYOUT.slices
        values = np.zeros(LAYOUT.size, np.float32)
        for name in observation.layout.slices.keys() & slices.keys():
            values[slices[name]] = observation[name]
        for name in FAR_OFF:
            values[slices[name]] = NOWHERE
        x, y, heading = pose
        here, along, across = self._abreast(x, y)
        bearing = heading - line.heading[here] - along * line.curvature[here]
        values[slices["progress"]] = max(here * line.spacing + along, 0.0)
        values[slices["line_offset"]] = across
        values[slices["line_heading"]] = (bearing + math.pi) % (2.0 * math.pi) - math.pi
        values[slices["line_step"]] = step
        place = np.asarray(here + (along + np.arange(AHEAD) * step) / line.spacing, np.float64)
        for name, numbers in self._ahead(place, pose).items():
            values[slices[name]] = numbers
        last = int(place[-1] + 0.5) % len(line.x)
        values[slices["line_speed_held"]] = self._held[last]
        self._fill_others(values, pose, here * line.spacing + along)
        return Observation(observation.tick, LAYOUT, values)

    def _abreast(self, x: float, y: float) -> tuple[int, float, float]:
        """Return the sample nearest to a point, and its way [m] from there along and across."""
        away = np.array([x, y]) - self._places
        here = int(np.argmin(np.sum(away**2, axis=1)))
        cos, sin = math.cos(self._line.heading[here]), math.sin(self._line.heading[here])
        (dx, dy) = away[here].tolist()
        return here, dx * cos + dy * sin, dy * cos - dx * sin

    def _ahead(self, place: Floats, pose: Pose) -> dict[str, Floats]:
        """Return the parts ahead, at fractional samples (AHEAD,) of the line."""
        line, count = self._line, len(self._line.x)
        low = np.floor(place).astype(np.int64)
        share, one, two = place - low, low % count, (low + 1) % count

        def at(numbers: Floats) -> Floats:
            return np.asarray(numbers[one] + share * (numbers[two] - numbers[one]))

        ahead = _seen_from(pose, at(line.x), at(line.y))
        return {
            "line_ahead_x": ahead[0],
            "line_ahead_y": ahead[1],
            "line_curvature_ahead": at(line.curvature),
            "line_speed_ahead": at(line.speed),
            "line_left_ahead": at(line.left),
            "line_right_ahead": at(line.right),
        }

    def _fill_others(self, values: NDArray[Any], pose: Pose, progress: float) -> None:
        """Fill the nearest strangers. progress: of the kart along the line [m]."""
        near = np.argsort(np.hypot(*(self.others[:, :2] - np.array(pose[:2])).T))[:NEARBY]
        others, slices, line = self.others[near], LAYOUT.slices, self._line
        length = len(line.x) * line.spacing
        x, y = _seen_from(pose, others[:, 0], others[:, 1])
        vx, vy = _seen_from((0.0, 0.0, pose[2]), others[:, 2], others[:, 3])
        beside = [self._abreast(*other[:2].tolist()) for other in others]
        ways = [sample * line.spacing + along - progress for sample, along, _ in beside]
        shown = {
            "karts_x": x,
            "karts_y": y,
            "karts_speed_x": vx,
            "karts_speed_y": vy,
            "karts_along": [(way + 0.5 * length) % length - 0.5 * length for way in ways],
            "karts_across": [across for _, _, across in beside],
        }
        for name, numbers in shown.items():
            start = slices[name].start
            values[start : start + len(near)] = numbers


def _seen_from(pose: Pose, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return points of the map in the frame of a pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = x - pose[0], y - pose[1]
    return cos * dx + sin * dy, cos * dy - sin * dx


def layout_with_scan(scan: Layout) -> Layout:
    """Return the layout of what a line shows, with the scan of another layout behind it."""
    return layout_of((*LAYOUT.slices, *SCAN), int(offsets_of(scan)[-1]))


def with_scan(line: Observation, scan: Observation) -> Observation:
    """Return what a line shows, with the scan of another observation behind it."""
    values = np.concatenate([line.values, *(scan[part] for part in SCAN)])
    return Observation(scan.tick, layout_with_scan(scan.layout), values)
