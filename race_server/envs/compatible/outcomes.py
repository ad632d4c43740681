"""What the cars of a compatible car park have come to, in one compiled call."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.state import Float32s, Floats, Ints, Records

# What is seen of each car, in this order.
PARTS = (
    *("position_x", "position_y", "heading_cos", "heading_sin", "speed"),
    *("slot_x", "slot_y", "slot_heading"),
)
# A goal is x, y [m], speeds [m/s], cosine and sine of the heading, each divided by its scale.
SCALES = (100.0, 100.0, 5.0, 5.0, 1.0, 1.0)


class Prices(NamedTuple):
    """What outcomes are worth."""

    weights: Floats  # (6,) of the differences between two goals
    collision: float
    success: float  # a car has arrived where its reward is above minus this
    decisions: float  # until time is up


class Outcomes(NamedTuple):
    """What W cars have come to."""

    achieved: Floats  # (W, 6) goals where they are
    desired: Floats  # (W, 6) and where they are wanted
    rewards: Floats  # (W,)
    speeds: Floats  # (W,) [m/s]
    crashed: NDArray[np.bool_]  # (W,)
    arrived: NDArray[np.bool_]  # (W,)
    over: NDArray[np.bool_]  # (W,) whether the episode has ended
    cut: NDArray[np.bool_]  # (W,) whether its time is up

    @classmethod
    def of(cls, worlds: int) -> "Outcomes":
        """Return outcomes that are not written yet."""
        goals, numbers = np.zeros((2, worlds, len(SCALES))), np.zeros((2, worlds))
        return cls(*goals, *numbers, *np.zeros((4, worlds), np.bool_))


@kernel
def judge(
    bodies: Records,
    observations: Float32s,
    places: Ints,
    steps: Ints,
    prices: Prices,
    outcomes: Outcomes,
) -> None:
    """Write what all cars have come to.

    bodies: (W, 1); observations: (W, 1, size), with PARTS at `places` (8,); steps: (W,) decisions
    of the episodes.
    """
    for w in range(len(steps)):
        _write_goals(observations[w, 0], places, outcomes.achieved[w], outcomes.desired[w])
        near = _nearness(outcomes.achieved[w], outcomes.desired[w], prices.weights)
        crashed = bodies[w, 0].status == codes.RETIRED
        arrived = near > -prices.success
        outcomes.rewards[w] = near + (prices.collision if crashed else 0.0)
        outcomes.speeds[w] = bodies[w, 0].speed
        outcomes.crashed[w], outcomes.arrived[w] = crashed, arrived
        outcomes.over[w] = crashed or arrived
        outcomes.cut[w] = steps[w] >= prices.decisions


@kernel
def write_nearness(achieved: Floats, desired: Floats, weights: Floats, rewards: Floats) -> None:
    """Write the rewards (n,) for goals (n, 6)."""
    for row in range(len(rewards)):
        rewards[row] = _nearness(achieved[row], desired[row], weights)


@kernel
def _nearness(achieved: Floats, desired: Floats, weights: Floats) -> float:
    """Return minus the root of the weighted differences of two goals (6,)."""
    squares = 0.0
    for number, weight in enumerate(weights):
        squares += weight * abs(achieved[number] - desired[number])
    return -math.sqrt(squares)


@kernel
def _write_goals(seen: Float32s, places: Ints, achieved: Floats, desired: Floats) -> None:
    cos, sin, speed = seen[places[2]], seen[places[3]], seen[places[4]]
    heading = float(seen[places[7]])
    achieved[0], achieved[1] = seen[places[0]], seen[places[1]]
    achieved[2], achieved[3] = speed * cos, speed * sin
    achieved[4], achieved[5] = cos, sin
    desired[0], desired[1] = seen[places[5]], seen[places[6]]
    desired[2], desired[3] = 0.0, 0.0
    desired[4], desired[5] = math.cos(heading), math.sin(heading)
    for number, scale in enumerate(SCALES):
        achieved[number] /= scale
        desired[number] /= scale
