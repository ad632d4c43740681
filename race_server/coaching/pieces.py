"""The lap of a driver's best pieces: what he drove already, put together where it fits.

Two laps are joined where the kart passed a place of a corner at nearly the same speed, at nearly
the same distance from the centre line. What one lap is faster there than the other has to be gained
or lost first, as far as the vehicle can: so the lap could be driven, and no speed comes from
nowhere. Between joints each piece is as it was driven.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from race_server.coaching.corners import Corner
from race_server.coaching.counterfactual import Motion, joined_time, motion_of
from race_server.coaching.faults import KART_PACE
from race_server.coaching.lap import Lap
from race_server.core.clock import MICROSECONDS
from race_server.scenario.raceline.bounds import Bounds

# Laps are joined where they differ by less than this in speed [m/s] and offset [m]; below the pace
# of karts by less in proportion.
MOST_FASTER, MOST_ASIDE = 0.3, 0.3
# A change of laps that gains less than this [s] is none.
LEAST_GAIN_S = 0.01


@dataclass(frozen=True)
class Piece:
    """A part of one lap."""

    lap: int  # its place among the laps
    begin: float  # [m] progress
    end: float  # [m]


@dataclass(frozen=True)
class BestPieces:
    """The lap that a driver has driven in pieces."""

    time_us: int
    pieces: tuple[Piece, ...]  # from line to line


def best_pieces(laps: Sequence[Lap], corners: Sequence[Corner], bounds: Bounds) -> BestPieces:
    """Return the fastest lap of pieces of some laps: the fastest of them where none can be joined.

    Raises:
        ValueError: there is no lap.
    """
    motions, first = [motion_of(lap, bounds) for lap in laps], laps[0]
    count = len(first.progress) - 1
    # Of every lap's best way to the joint before: its time [s], and where it changed laps.
    times, ways = [0.0] * len(laps), [[Piece(at, 0.0, 0.0)] for at in range(len(laps))]
    before = 0
    for at in [*_joints(corners, first.step, count), count]:
        times = [
            time + float(lap.time[at] - lap.time[before])
            for time, lap in zip(times, laps, strict=True)
        ]
        if at < count:
            times, ways = _change(laps, motions, times, ways, at)
        before = at
    best = min(range(len(laps)), key=times.__getitem__)
    return BestPieces(round(times[best] * MICROSECONDS), _whole(ways[best], first))


def _joints(corners: Sequence[Corner], step: float, count: int) -> list[int]:
    """Return the points of a lap where it may be joined with another one, in order."""
    places = [
        place
        for corner in corners
        for place in (corner.begin, corner.brake, corner.entry, corner.apex, corner.exit)
    ]
    return sorted({round(place / step) % count for place in places} - {0})


def _change(
    laps: Sequence[Lap],
    motions: Sequence[Motion],
    times: list[float],
    ways: list[list[Piece]],
    at: int,
) -> tuple[list[float], list[list[Piece]]]:
    """Return the best way to a point from which each lap is driven on."""
    found_times, found_ways = list(times), list(ways)
    fastest = sorted(range(len(laps)), key=times.__getitem__)
    for to, lap in enumerate(laps):
        for frm in fastest:
            if times[frm] + LEAST_GAIN_S >= found_times[to]:
                break  # a change costs time: all others are slower
            if not _fit(laps[frm], lap, at):
                continue
            time = times[frm] + _cost(motions[frm], motions[to], at)
            if time + LEAST_GAIN_S < found_times[to]:
                found_times[to] = time
                found_ways[to] = [*ways[frm], Piece(to, float(lap.progress[at]), 0.0)]
    return found_times, found_ways


def _fit(lap: Lap, other: Lap, at: int) -> bool:
    share = min(float(lap.speed[at]) / KART_PACE, 1.0)
    is_alike = abs(float(lap.speed[at] - other.speed[at])) < MOST_FASTER * share
    return is_alike and abs(float(lap.offset[at] - other.offset[at])) < MOST_ASIDE * share


def _cost(before: Motion, after: Motion, at: int) -> float:
    """Return how much longer [s] both parts take together for being joined at a point."""
    parts = before.time[at] + after.time[-1] - after.time[at]
    return max(joined_time(before, after, at) - parts, 0.0)


def _whole(way: Sequence[Piece], lap: Lap) -> tuple[Piece, ...]:
    """Return pieces with their ends."""
    ends = [piece.begin for piece in way[1:]] + [float(lap.progress[-1])]
    return tuple(Piece(one.lap, one.begin, end) for one, end in zip(way, ends, strict=True))
