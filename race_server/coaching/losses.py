"""What each corner of a lap costs against another lap; the costs add up to what the lap lost.

A corner costs what the lap would have gained with it driven as in the other lap. What one corner
costs depends on the others: a fast exit is worth more if the next corner makes use of it. Each is
therefore taken twice: with the corners before it driven as in the other lap, and with those behind
it; the cost is the mean of both. As only neighbours matter to each other, that is the mean over all
orders in which the corners could be mended: the Shapley value (Shapley, A value for n-person games,
1953).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from race_server.coaching.corners import Corner
from race_server.coaching.counterfactual import joined_time, motion_of
from race_server.coaching.lap import Lap
from race_server.core.clock import MICROSECONDS
from race_server.scenario.raceline.bounds import Bounds

PHASES = ("approach", "bend", "exit")


@dataclass(frozen=True)
class CornerLoss:
    """What a corner costs [µs], by phases: before the turn-in, in the bend, behind it."""

    corner: Corner
    approach_us: int
    bend_us: int
    exit_us: int

    @property
    def total_us(self) -> int:
        """What the whole corner costs [µs]."""
        return self.approach_us + self.bend_us + self.exit_us


@dataclass(frozen=True)
class LapLoss:
    """What a lap costs against another one [µs], by corners. It all adds up to `total_us`."""

    total_us: int
    line_us: int  # for the speed at the timing line: it comes from the lap before
    corners: tuple[CornerLoss, ...]


def lap_loss(lap: Lap, other: Lap, corners: Sequence[Corner], bounds: Bounds) -> LapLoss:
    """Return what a lap loses on another one in each corner; less than zero where it gains."""
    pieces = _pieces(lap, corners)
    cuts = [first for first, _, _ in pieces]
    own, wanted = motion_of(lap, bounds), motion_of(other, bounds)
    ends = (lap.time_us / MICROSECONDS, other.time_us / MICROSECONDS)
    # With everything before a cut mended, and with everything from the cut on.
    mended = [ends[0], *(joined_time(wanted, own, cut) for cut in cuts), ends[1]]
    unmended = [ends[1], *(joined_time(own, wanted, cut) for cut in cuts), ends[0]]
    costs = 0.5 * (-np.diff(mended) + np.diff(unmended))
    # Rounded as sums, so that they still add up.
    costs_us = np.diff(np.round(np.cumsum(costs) * MICROSECONDS).astype(int), prepend=0)
    spent = {(row, phase): 0 for row in range(len(corners)) for phase in range(len(PHASES))}
    for (_, row, phase), cost in zip(pieces, costs_us[1:], strict=True):
        spent[row, phase] += int(cost)
    return LapLoss(
        lap.time_us - other.time_us,
        int(costs_us[0]),
        tuple(
            CornerLoss(corner, *(spent[row, phase] for phase in range(len(PHASES))))
            for row, corner in enumerate(corners)
        ),
    )


def _pieces(lap: Lap, corners: Sequence[Corner]) -> list[tuple[int, int, int]]:
    """Return the pieces of a lap in order: their first point, corner and phase.

    The first begins at the timing line, and may be the rest of a piece that began before it.
    """
    count = len(lap.progress) - 1
    cuts = [
        (round(place / lap.step), row, phase)
        for row, corner in enumerate(corners)
        for phase, place in enumerate((corner.begin, corner.entry, corner.exit))
    ]
    # In order along the lap. At one point the piece before the other comes first, in order of
    # driving: the exit of the last corner, a lap further on, before the begin of the first one.
    cuts.sort(key=lambda cut: (cut[0] % count, -cut[0]))
    pieces = [(at % count, row, phase) for at, row, phase in cuts]
    _, row, phase = pieces[-1]
    return pieces if pieces[0][0] == 0 else [(0, row, phase), *pieces]
