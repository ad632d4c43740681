"""A course in track coordinates: stations along its centre line."""

from dataclasses import dataclass, replace

import numpy as np

from race_server.errors import TrackError
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.polyline import (
    derivatives,
    lengths_of,
    ranges_to,
    resample,
    segments_of,
    smooth,
)

# Track coordinates fold over at the centre of a bend: one tighter than the free width on its
# inside forbids lines that exist. Where offset · curvature comes this near to one, the centre line
# is smoothed, by a standard deviation in samples of the course: 0.25 m at 1/10, 2.5 m for karts.
FOLDING = 0.8
SMOOTHING = 5.0
# A lap that is driven, by this share of the vehicle's tightest radius: its bends stay where they
# are, to a sixteenth of that radius.
SMOOTHING_OF_RADIUS = 0.35
# An alcove is cut off this many samples from the centre line: 1.2 m at 1/10, 12 m for karts; and
# twice as many from a lap, which may lie at the edge of what was seen from there.
DEEPEST, DEEPEST_BESIDE = 24.0, 48.0
# A lap of several kilometres has wide bends and gets longer steps: it is solved in seconds.
MOST_STATIONS = 1200


@dataclass(frozen=True)
class Frame:
    """N stations at equal steps along a closed line: the centre line, or one to drive."""

    name: str  # of the course
    step: float  # [m]
    progress: Floats  # (N,) [m] of each station along the course's own centre line
    x: Floats  # (N,) [m]
    y: Floats  # (N,) [m]
    heading: Floats  # (N,) [rad]
    curvature: Floats  # (N,) [1/m] mean over a step about the station, left positive
    low: Floats  # (N,) [m] offset of a vehicle's middle at the right border, left positive
    high: Floats  # (N,) [m] the same at the left border

    def narrowed(self, room: Floats | float, least: Floats | float) -> "Frame":
        """Return a frame whose sides are `room` [m] nearer, or meet but for `least` [m].

        room, least: for all stations, or (N,).
        """
        if np.all(np.equal(room, 0.0)):
            return self
        middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
        half = np.maximum(half - room, np.minimum(half, least))
        return replace(self, low=middle - half, high=middle + half)


def frame_of(course: Course, bounds: Bounds) -> Frame:
    """Return stations along the centre line, smoothed if need be, and the room of a vehicle there.

    They lie two samples of the course apart, 0.1 m at 1/10 and 1 m for karts, unless the course is
    very long; half of that moves a lap time by less than one percent.

    Raises:
        TrackError: the course is somewhere too narrow for the vehicle.
    """
    line = course.line[:, :2]
    bend, (left, right) = course.line[:, 3], course.half_widths.T
    if max(float((left * bend).max()), float((-right * bend).max())) > FOLDING:
        line = smooth(line, min(SMOOTHING, 0.05 * len(line)))
    return _frame(course, bounds, line, np.arange(len(line) + 1.0), is_centre=True)


def frame_about(course: Course, bounds: Bounds, line: Floats, progress: Floats) -> Frame:
    """Return stations along a line that is driven, and the room of a vehicle beside it.

    It is smoothed: a line has kinks where it lay at the end of the coordinates it was found in.
    line: (M, 2) x, y [m]; progress: (M,) [m] of its points along the course's centre line.

    Raises:
        TrackError: as of `frame_of`.
    """
    at = np.concatenate([[0.0], np.cumsum(lengths_of(line))])
    count = max(round(at[-1] / course.spacing), 16)
    samples = np.append(progress / course.spacing, len(course.line))
    own = np.interp(np.linspace(0.0, at[-1], count + 1), at, samples)
    deviation = SMOOTHING_OF_RADIUS / (bounds.curvature * course.spacing)
    smoothed = smooth(resample(line, count), min(deviation, 0.05 * count))
    return _frame(course, bounds, smoothed, own, is_centre=False)


def _frame(
    course: Course, bounds: Bounds, line: Floats, samples: Floats, *, is_centre: bool
) -> Frame:
    """Return stations along a line (M, 2). samples: (M + 1,) of the course at its points."""
    at = np.concatenate([[0.0], np.cumsum(lengths_of(line))])
    stations = min(max(round(at[-1] / (2.0 * course.spacing)), 16), MOST_STATIONS)
    # Every second point is a station; the headings at those between give its mean curvature.
    points = resample(line, 2 * stations)
    heading, _ = derivatives(points)
    step = float(lengths_of(points).sum()) / stations
    turn = heading[1::2] - np.roll(heading[1::2], 1)
    own = np.interp(np.linspace(0.0, at[-1], stations, endpoint=False), at, samples)
    if is_centre and course.kerb + course.grass > 0.0:
        left, right = _asphalt(course, points[::2], heading[::2], own)
    else:
        deepest = (DEEPEST if is_centre else DEEPEST_BESIDE) * course.spacing
        left, right = _room(course, line, stations, deepest)
    frame = Frame(
        name=course.name,
        step=step,
        progress=own * course.spacing,
        x=points[::2, 0],
        y=points[::2, 1],
        heading=heading[::2],
        curvature=((turn + np.pi) % (2.0 * np.pi) - np.pi) / step,
        low=bounds.reach - right,
        high=left - bounds.reach,
    )
    tight = int(np.argmin(left + right))
    if left[tight] + right[tight] <= 2.0 * bounds.reach:
        raise TrackError(
            f"{course.name}: {left[tight] + right[tight]:.2f} m wide at "
            f"({frame.x[tight]:.2f}, {frame.y[tight]:.2f}); no line fits a vehicle that needs "
            f"{2.0 * bounds.reach:.2f} m with its margin"
        )
    return frame


def _room(course: Course, line: Floats, stations: int, deepest: float) -> tuple[Floats, Floats]:
    """Return the free width [m] to the left and right of the stations (N,) along a line (M, 2).

    It is the least that rays meet about a station, one for each sample of the course, each of which
    some station looks at: the tip of a wall lies between two stations. They meet the borders, or
    the edges of the asphalt where kerbs and grass lie beyond it.
    """
    walls = course.borders
    if course.kerb + course.grass > 0.0:
        walls = np.concatenate([segments_of(edge) for edge in course.edges()])
    rays = max(-(-len(line) // stations), 2)
    points = resample(line, rays * stations)
    across = _across(derivatives(points)[0])
    about = np.arange(stations)[:, np.newaxis] * rays + np.arange(-(rays // 2), rays // 2 + 1)
    left, right = (
        ranges_to(walls, points, way, deepest)[about % len(points)].min(axis=1)
        for way in (across, -across)
    )
    return left, right


def _asphalt(course: Course, points: Floats, heading: Floats, own: Floats) -> tuple[Floats, Floats]:
    """Return the width of the asphalt to the left and right of points (N, 2) of the centre line.

    own: (N,) fractional sample of the course's line at each point. It is the course's half-widths,
    less what the smoothing moved the line.
    """
    across = _across(heading)
    closed = np.vstack([course.line[:, :2], course.line[:1, :2]])
    sides = np.vstack([course.half_widths, course.half_widths[:1]])
    samples = np.arange(len(closed))
    x, y, left, right = (np.interp(own, samples, values) for values in (*closed.T, *sides.T))
    moved = np.sum((points - np.stack([x, y], axis=1)) * across, axis=1)
    return left - moved, right + moved


def _across(heading: Floats) -> Floats:
    """Return unit vectors (N, 2) to the left of headings (N,)."""
    return np.stack([-np.sin(heading), np.cos(heading)], axis=1)
