"""A drive of a plant as its sensors saw it, beside the truth: the same for every estimator."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from race_agents.plant.chauffeur import Chauffeur
from race_agents.plant.kart import Plant
from race_agents.plant.radar import Floats, Surroundings
from race_agents.plant.sensors import Sensors
from race_agents.unit.estimator import Estimator
from race_agents.unit.motion import HEADING, X, Y, wrap
from race_agents.unit.readings import Readings
from race_server.core.vehicles import Vehicle

PERIOD_S = 0.02
# The radar sees nothing: an estimator does not ask it.
BLIND_S = math.inf
STAND_S = 2.0  # every trip begins with a stand, as on a grid


@dataclass(frozen=True)
class Truth:
    """Where the rear axle's middle was."""

    x: float
    y: float
    heading: float
    speed: float


@dataclass(frozen=True)
class Trip:
    """Readings, and the truth at the same moments."""

    vehicle: Vehicle
    readings: tuple[Readings, ...]
    truths: tuple[Truth, ...]


@dataclass(frozen=True, eq=False)
class Course:
    """The part of a course that a trip needs."""

    line: Floats
    borders: Floats


def drive(
    course: Course,
    vehicle: Vehicle,
    sensors: Sensors,
    *,
    seconds: float,
    seed: int,
    grip_share: float = 0.6,
) -> Trip:
    """Return a trip of a plant as built from a seed, begun at a place that the seed draws."""
    chauffeur = Chauffeur.of(course.line, vehicle, grip_share)
    place = course.line[int(np.random.default_rng(seed).integers(len(course.line)))]
    start = float(place[0]), float(place[1]), float(place[2])
    plant = Plant.of(
        vehicle, Surroundings(course.borders), start, replace(sensors, radar_s=BLIND_S), seed
    )
    readings, truths = [], []
    for turn in range(round(seconds / PERIOD_S)):
        now_s = turn * PERIOD_S
        readings.append(plant.read(now_s))
        body = plant.body
        back = vehicle.rear_axle
        truths.append(
            Truth(
                body.x - back * math.cos(body.heading),
                body.y - back * math.sin(body.heading),
                body.heading,
                body.speed,
            )
        )
        if now_s >= STAND_S:
            plant.act(chauffeur.act(body))
    return Trip(vehicle, tuple(readings), tuple(truths))


@dataclass(frozen=True, eq=False)
class Followed:
    """How an estimator followed a trip, from its first fix on; all (T,) but `errors`."""

    times: Floats  # [s]
    errors: Floats  # (T, 3) ahead, left [m], heading [rad]
    squares: Floats  # eᵀP⁻¹e of x, y and heading (NEES): 3 is expected
    deviations: Floats  # [m] of the place, as told
    delays: Floats  # [s] as learned
    innovations: dict[str, Floats]  # NIS of each sensor's readings
    refused: int  # fixes
    fixes: int

    @property
    def off(self) -> Floats:
        """How far off the place is [m], shape (T,)."""
        return np.hypot(self.errors[:, 0], self.errors[:, 1])


def follow(
    trip: Trip,
    *,
    compliance: float | None = None,
    change: Callable[[Readings], Readings] = lambda readings: readings,
) -> Followed:
    """Return how an estimator follows a trip.

    compliance: of the rear tyres, see `Estimator`; change: what is done to the readings before.
    """
    estimator: Estimator | None = None
    rows: list[tuple[float, ...]] = []
    innovations: dict[str, list[float]] = {}
    refused = fixes = 0
    for given, truth in zip(trip.readings, trip.truths, strict=True):
        readings = change(given)
        if estimator is None:
            if (fix := readings.fix) is not None:
                estimator = Estimator(
                    trip.vehicle, fix, truth.heading, readings.time_s, compliance=compliance
                )
            continue
        estimator.filter.squares.clear()
        for _, is_believed in estimator.sense(readings):
            fixes, refused = fixes + 1, refused + (not is_believed)
        for sensor, square in estimator.filter.squares.items():
            innovations.setdefault(sensor, []).append(square)
        rows.append((readings.time_s, *_errors(estimator, truth)))
    table = np.array(rows)
    return Followed(
        times=table[:, 0],
        errors=table[:, 1:4],
        squares=table[:, 4],
        deviations=table[:, 5],
        delays=table[:, 6],
        innovations={sensor: np.array(values) for sensor, values in innovations.items()},
        refused=refused,
        fixes=fixes,
    )


def _errors(estimator: Estimator, truth: Truth) -> tuple[float, ...]:
    state, columns = estimator.state, [X, Y, HEADING]
    off = np.array(
        [
            state[X] - truth.x,
            state[Y] - truth.y,
            wrap(float(state[HEADING]) - truth.heading),
        ]
    )
    covariance = estimator.filter.covariance[np.ix_(columns, columns)]
    square = float(off @ np.linalg.solve(covariance, off))
    cos, sin = math.cos(truth.heading), math.sin(truth.heading)
    ahead, left = off[0] * cos + off[1] * sin, off[1] * cos - off[0] * sin
    return ahead, left, float(off[2]), square, estimator.deviation, estimator.delay_s
