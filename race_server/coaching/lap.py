"""One lap over the progress along the course: place, speed and controls at equal steps."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from race_server.core.clock import MICROSECONDS
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.tyres import cornering_drag
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.polyline import nearest_on, segments_of

# Steps of a lap at most: a course of more samples gets longer ones.
MOST_STEPS = 1500
# Steps over which curvature is averaged: positions jitter.
CALM_STEPS = 5
# A reference at more than this share of its vehicle's top speed drives with full throttle.
FLAT_OUT = 0.995
# Of pedals that are felt from outside: less throttle than the first is none. What is exceeded only
# on the last tenth of the way with throttle is full throttle; no motor is weaker than the third. At
# more than the fourth share of the lap's top speed a kart pulls no faster with all the throttle.
FELT, FULL_SHARE, LEAST_FULL, TOP_SHARE = 0.05, 0.9, 0.5, 0.99
# Slower than this [m/s] a motor pulls no harder.
LEAST_SPEED = 0.1


@dataclass(frozen=True, eq=False)
class Lap:
    """A lap from line to line. Its N + 1 points lie at equal steps of progress, both lines counted.

    Laps of a course have the same points, so they are compared place by place, whatever line each
    took: by the way driven they would drift apart.
    """

    name: str
    time_us: int
    progress: Floats  # (N + 1,) [m] along the course's centre line, from 0 to its length
    time: Floats  # (N + 1,) [s] since the lap began
    x: Floats  # (N + 1,) [m]
    y: Floats  # (N + 1,) [m]
    offset: Floats  # (N + 1,) [m] to the left of the centre line
    speed: Floats  # (N + 1,) [m/s]
    curvature: Floats  # (N + 1,) [1/m] of the way driven, left positive
    throttle: Floats  # (N + 1,) share of full, from this point on
    brake: Floats  # (N + 1,) share of full, from this point on

    @property
    def step(self) -> float:
        """Progress [m] from point to point."""
        return float(self.progress[1])

    @property
    def ways(self) -> Floats:
        """Way driven (N,) [m] from each point to the next."""
        return np.asarray(np.hypot(np.diff(self.x), np.diff(self.y)))

    def at(self, column: Floats, progress: float) -> float:
        """Return a column's value at a progress [m], which may be a lap too far."""
        return float(np.interp(progress % float(self.progress[-1]), self.progress, column))


def with_pedals_felt(lap: Lap, bounds: Bounds) -> Lap:
    """Return a lap with the pedals that its speeds take: of one that was only looked at.

    Its strongest pull is full throttle, and so is its top speed, so that a weak motor is not taken
    for a driver who opens the throttle less, or later; who never opens it fully is not found out.
    """
    pull = np.diff(lap.speed**2) / (2.0 * np.maximum(lap.ways, 1e-6))
    throttle, brake = _pedals(lap.speed[:-1], lap.curvature[:-1], pull, bounds)
    pulls = throttle[throttle > FELT]
    full = max(float(np.quantile(pulls, FULL_SHARE)), LEAST_FULL) if len(pulls) else 1.0
    throttle = np.minimum(throttle / full, 1.0)
    throttle[lap.speed[:-1] > TOP_SHARE * lap.speed.max()] = 1.0
    last = throttle[-1:], brake[-1:]
    return replace(lap, throttle=np.append(throttle, last[0]), brake=np.append(brake, last[1]))


def places_on(course: Course) -> Floats:
    """Return the progress (N + 1,) [m] of the points of each lap of a course."""
    return np.linspace(0.0, course.length, min(len(course.line), MOST_STEPS) + 1)


def lap_on(course: Course, name: str, time_us: int, samples: Mapping[str, Floats]) -> Lap:
    """Return a lap from samples (M,) in order of time, from line to line.

    samples: time_s [s], progress [m], x, y [m], speed [m/s], throttle, brake [shares]; the pedals
    are those that act from each sample on. Where a kart was pushed back, its first pass counts.
    """
    reached = np.maximum.accumulate(samples["progress"])
    first = np.concatenate([[True], np.diff(reached) > 0.0])
    reached, places = reached[first], places_on(course)

    def between(name: str) -> Floats:
        return np.asarray(np.interp(places, reached, samples[name][first]))

    # Pedals are what they were at the sample before: they change at once.
    held = np.clip(np.searchsorted(reached, places, side="right") - 1, 0, len(reached) - 1)
    time, x, y = between("time_s"), between("x"), between("y")
    time *= time_us / MICROSECONDS / time[-1]
    return Lap(
        name=name,
        time_us=time_us,
        progress=places,
        time=time,
        x=x,
        y=y,
        offset=offset_from(course, places, x, y),
        speed=between("speed"),
        curvature=_bend(x, y),
        throttle=samples["throttle"][first][held],
        brake=samples["brake"][first][held],
    )


def reference_lap(course: Course, line: ReferenceLine, bounds: Bounds) -> Lap:
    """Return the lap along a reference line at its speeds, with the pedals that they take."""
    count = len(line.x)
    progress = progress_on(course, line)
    # From line to line: the sample before the timing line and the one behind it are a lap apart.
    progress = np.concatenate(
        [progress[-1:] - course.length, progress, progress[:1] + course.length]
    )
    wrapped = np.arange(-1, count + 1) % count
    ahead = np.roll(line.speed, -1)
    times = np.concatenate([[0.0], np.cumsum(2.0 * line.spacing / (line.speed + ahead))])
    time = np.concatenate([times[:1] - (times[-1] - times[-2]), times])
    pull = (ahead**2 - line.speed**2) / (2.0 * line.spacing)
    throttle, brake = _pedals(line.speed, line.curvature, pull, bounds)
    places = places_on(course)

    def between(values: Floats) -> Floats:
        return np.asarray(np.interp(places, progress, values))

    begun = between(time)
    x, y = between(line.x[wrapped]), between(line.y[wrapped])
    return Lap(
        name="the limit",
        time_us=round(float(times[-1]) * MICROSECONDS),
        progress=places,
        time=(begun - begun[0]) * times[-1] / (begun[-1] - begun[0]),
        x=x,
        y=y,
        offset=offset_from(course, places, x, y),
        speed=between(line.speed[wrapped]),
        curvature=between(line.curvature[wrapped]),
        throttle=between(throttle[wrapped]),
        brake=between(brake[wrapped]),
    )


def offset_from(course: Course, places: Floats, x: Floats, y: Floats) -> Floats:
    """Return how far [m] to the left of the centre line points at some progress (N,) [m] are."""
    at = np.append(np.arange(len(course.line)) * course.spacing, course.length)
    heading = np.unwrap(course.line[:, 2])
    turn = round((course.line[0, 2] - heading[-1]) / (2.0 * np.pi)) * 2.0 * np.pi
    closed = np.vstack([course.line[:, :2], course.line[:1, :2]])
    centre_x, centre_y = (np.interp(places, at, column) for column in closed.T)
    way = np.interp(places, at, np.append(heading, course.line[0, 2] - turn))
    return np.asarray((y - centre_y) * np.cos(way) - (x - centre_x) * np.sin(way))


def progress_on(course: Course, line: ReferenceLine) -> Floats:
    """Return the progress (N,) [m] of a line's samples, in order from about zero."""
    count = len(line.x)
    sides = segments_of(course.line[:, :2])
    _, nearest = nearest_on(sides, np.column_stack([line.x, line.y]))
    # `beside` says which sample of the line is abreast of each of the centre line, to the nearest;
    # the point itself says where between.
    order = np.argsort(line.beside, kind="stable")
    rough = np.interp(
        np.arange(count), line.beside[order], np.unwrap(order * 1.0, period=len(order))
    )
    samples = np.round(rough).astype(np.int64) % len(course.line)
    centre = course.line[samples]
    along = (nearest[:, 0] - centre[:, 0]) * np.cos(centre[:, 2])
    along += (nearest[:, 1] - centre[:, 1]) * np.sin(centre[:, 2])
    progress = np.unwrap(samples * course.spacing + along, period=course.length)
    progress -= course.length * round(float(progress[0]) / course.length)
    return np.maximum.accumulate(progress)


def _pedals(
    speed: Floats, curvature: Floats, pull: Floats, bounds: Bounds
) -> tuple[Floats, Floats]:
    """Return throttle and brake (N,) for accelerations (N,) [m/s²] on a line."""
    drags = [
        cornering_drag(v, k, a, bounds)
        for v, k, a in zip(speed.tolist(), curvature.tolist(), pull.tolist(), strict=True)
    ]
    force = pull + np.array(drags) + bounds.rolling + bounds.drag * speed**2
    most = np.minimum(bounds.drive, bounds.power / np.maximum(speed, LEAST_SPEED))
    throttle = np.clip(force / most, 0.0, 1.0)
    throttle[speed > FLAT_OUT * bounds.top_speed] = 1.0
    return throttle, np.clip(-force / bounds.brake, 0.0, 1.0)


def _bend(x: Floats, y: Floats) -> Floats:
    """Return the curvature (N + 1,) [1/m] of a way through points."""
    heading = np.unwrap(np.arctan2(np.gradient(y), np.gradient(x)))
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    bend = np.gradient(heading, np.maximum(way, np.arange(len(way)) * 1e-9))
    padded = np.pad(bend, CALM_STEPS // 2, mode="edge")
    return np.convolve(padded, np.full(CALM_STEPS, 1.0 / CALM_STEPS), mode="valid")
