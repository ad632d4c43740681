"""Figures of many episodes of parking: what was parked, what failed, and how long it took.

An episode is what the training world tells of one, `info["parking"]`; see
`race_server/envs/parking/discipline.py:Parking.report`.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from statistics import fmean, median
from typing import Any

from race_server.competition.proportion import wilson_interval

PARKED, PERSON, LATE = "parked", "person", "late"
# Endings at something that was run into.
COLLISIONS = frozenset({"wall", "block", "vehicle", PERSON})
# Endings at a hitch: bent beyond its limit, or until a trailer touched what draws it.
JACK_KNIVES = frozenset({"jack_knife", "own_body"})


@dataclass(frozen=True)
class ParkingTally:
    """Figures of episodes. Times, ways and moves are of those that were parked."""

    episodes: int
    success_rate: float  # of all episodes
    success_interval: tuple[float, float]  # bounds of 95 %
    aligned_rate: float  # parked, and within 10° of the slot's heading, of all episodes
    aligned_interval: tuple[float, float]
    aligned_of_parked: float | None
    collisions: int  # with a person, too
    jack_knives: int
    hit_people: int
    walked_into: int  # people who walked into the vehicle while it stood
    failures: dict[str, int]  # by how the episode ended, the most frequent first
    time_s_median: float | None
    path_m_median: float | None
    direction_changes_mean: float | None

    @staticmethod
    def of(episodes: Iterable[Mapping[str, Any]]) -> "ParkingTally":
        """Return the figures of episodes."""
        every = list(episodes)
        parked = [one for one in every if one["is_success"]]
        aligned = sum(bool(one["aligned"]) for one in every)
        failed = Counter(str(one["ending"]) for one in every if not one["is_success"])
        runs = max(len(every), 1)
        return ParkingTally(
            episodes=len(every),
            success_rate=len(parked) / runs,
            success_interval=wilson_interval(len(parked), len(every)),
            aligned_rate=aligned / runs,
            aligned_interval=wilson_interval(aligned, len(every)),
            aligned_of_parked=aligned / len(parked) if parked else None,
            collisions=sum(count for ending, count in failed.items() if ending in COLLISIONS),
            jack_knives=sum(count for ending, count in failed.items() if ending in JACK_KNIVES),
            hit_people=failed[PERSON],
            walked_into=sum(int(one["walked_into"]) for one in every),
            failures=dict(failed.most_common()),
            time_s_median=_median_of(parked, "time_s"),
            path_m_median=_median_of(parked, "path_m"),
            direction_changes_mean=_mean_of(parked, "direction_changes"),
        )


def _median_of(episodes: list[Mapping[str, Any]], name: str) -> float | None:
    return median(float(one[name]) for one in episodes) if episodes else None


def _mean_of(episodes: list[Mapping[str, Any]], name: str) -> float | None:
    return fmean(float(one[name]) for one in episodes) if episodes else None
