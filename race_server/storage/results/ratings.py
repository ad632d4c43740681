"""How strong drivers are, from the orders in which they finished all their races.

After Plackett (1975) and Luce (1959): the next to finish is driver i with the chance
exp(s_i) / sum of exp(s_j) over all that are still out. All races count alike, and their order does
not matter. Strengths are the most likely ones, where each driver won and lost once against one of
strength 0 before its races: so they are finite for drivers that win or lose all of them.
"""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np
from numpy.typing import NDArray

# As in Elo's ratings: 400 points are ten wins to each defeat. The mean of all drivers.
POINTS, MEAN = 400.0 / math.log(10.0), 1500.0
INTERVAL = 1.96  # half-width of an interval of 95 %, in standard deviations
MOST_STEPS, CLOSE = 200, 1e-9  # of Newton's method; the last step [1]
LONGEST = 1.0  # of a step, so that it does not overshoot
TOGETHER = 4096  # finishes that are summed up at a time

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rating:
    """The strength of a driver, beside the mean of all."""

    driver: str
    mu: float
    sigma: float  # standard error, if it raced the same rivals again
    low: float  # with `high` the bounds of 95 %
    high: float
    races: int


def ratings(races: Iterable[Sequence[tuple[str, int]]]) -> list[Rating]:
    """Return the ratings after these races, the best lower bound first.

    A race is a driver and a rank for each kart. A driver with several karts in a race counts
    once, by the mean of their ranks; a race of one driver says nothing.
    """
    counted = [places for race in races if len(places := _places(race)) > 1]
    starts = Counter(driver for places in counted for driver in places)
    drivers = sorted(starts)
    if not drivers:
        return []
    numbers = {driver: number for number, driver in enumerate(drivers)}
    choices, weights = _choices(
        [[(numbers[one], rank) for one, rank in places.items()] for places in counted]
    )
    strengths, spreads = _fit(choices, weights, len(drivers))
    found = []
    for driver, strength, spread in zip(drivers, strengths, spreads, strict=True):
        mu, sigma = MEAN + POINTS * float(strength), POINTS * float(spread)
        reach = INTERVAL * sigma
        found.append(Rating(driver, mu, sigma, mu - reach, mu + reach, starts[driver]))
    return sorted(found, key=lambda rating: (-rating.low, rating.driver))


def _places(race: Sequence[tuple[str, int]]) -> dict[str, float]:
    """Return the mean rank of each driver of a race."""
    ranks: dict[str, list[int]] = {}
    for driver, rank in race:
        ranks.setdefault(driver, []).append(rank)
    return {driver: fmean(of_driver) for driver, of_driver in ranks.items()}


def _choices(races: Sequence[Sequence[tuple[int, float]]]) -> tuple[NDArray[np.int64], Floats]:
    """Return each driver that finished with those behind it (m, widest race), how often (m,).

    The first of a row finished before its others; -1 fills it up. No driver stands behind another
    of the same rank.
    """
    counts = Counter(
        (one, *sorted(other for other, behind in race if behind > rank))
        for race in races
        for one, rank in race
    )
    rows = [row for row in counts if len(row) > 1]
    choices = np.full((len(rows), max(map(len, rows), default=2)), -1)
    for number, row in enumerate(rows):
        choices[number, : len(row)] = row
    return choices, np.array([counts[row] for row in rows], dtype=np.float64)


def _fit(choices: NDArray[np.int64], weights: Floats, drivers: int) -> tuple[Floats, Floats]:
    """Return the strengths (n,), whose mean is 0, and their standard errors (n,)."""
    strengths = np.zeros(drivers)
    wins = 1.0 + np.bincount(choices[:, 0], weights, drivers)  # one before the races
    for _ in range(MOST_STEPS):
        expected, curvature = _expected(strengths, choices, weights)
        step = np.linalg.solve(curvature, wins - expected)
        longest = float(np.abs(step).max())
        strengths += step * min(1.0, LONGEST / max(longest, CLOSE))
        if longest < CLOSE:
            break
    beside_mean = np.eye(drivers) - 1.0 / drivers
    covariance = beside_mean @ np.linalg.inv(curvature) @ beside_mean
    return strengths - strengths.mean(), np.sqrt(np.diag(covariance))


def _expected(
    strengths: Floats, choices: NDArray[np.int64], weights: Floats
) -> tuple[Floats, Floats]:
    """Return how often each driver should have been next (n,), and the slope of it (n, n)."""
    count = len(strengths)
    powers = np.append(np.exp(strengths - strengths.max()), 0.0)  # of what fills up a row: none
    next_ones, together = np.zeros(count), np.zeros((count, count))
    for first in range(0, len(choices), TOGETHER):
        rows = choices[first : first + TOGETHER]
        chances = np.zeros((len(rows), count + 1))
        np.put_along_axis(chances, rows, powers[rows], axis=1)
        chances = chances[:, :count] / powers[rows].sum(axis=1, keepdims=True)
        often = weights[first : first + TOGETHER, np.newaxis] * chances
        next_ones += often.sum(axis=0)
        together += chances.T @ often
    before = 1.0 / (1.0 + np.exp(-strengths))  # the win and the defeat before the races
    slope = np.diag(next_ones + 2.0 * before * (1.0 - before)) - together
    return next_ones + 2.0 * before, slope
