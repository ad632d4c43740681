"""Figures of rounds in which several vehicles park, each with a driver.

Standing for a turn is no fault of one vehicle: a deadlock is a time in which none of a round moves.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import fmean

from race_server.competition.parking_exam import Try
from race_server.competition.parking_tally import COLLISIONS
from race_server.competition.proportion import wilson_interval

# For longer than this [s] no vehicle of a round moves where they block each other.
DEADLOCK_S = 10.0


@dataclass(frozen=True)
class RoundTally:
    """Figures of rounds. Intervals are bounds of 95 %; times are of rounds with all parked."""

    rounds: int
    all_parked_rate: float
    all_parked_interval: tuple[float, float]
    with_contact: int  # rounds in which a vehicle ran into something
    contact_interval: tuple[float, float]
    deadlocks: int
    deadlock_rate: float
    deadlock_interval: tuple[float, float]
    parked_mean: float | None  # vehicles of a round
    time_s_mean: float | None  # until a vehicle is parked
    last_time_s_mean: float | None  # until the last of a round is
    last_time_s_most: float | None
    failed_seeds: tuple[int, ...]
    deadlock_seeds: tuple[int, ...]

    @staticmethod
    def of(tries: Iterable[Try]) -> "RoundTally":
        """Return the figures of rounds, from the tries of all their vehicles."""
        rounds: dict[int, list[Try]] = {}
        for one in tries:
            rounds.setdefault(one.seed, []).append(one)
        failed = sorted(seed for seed, group in rounds.items() if not _are_all_parked(group))
        stuck = sorted(
            seed for seed, group in rounds.items() if max(o.pause_s for o in group) > DEADLOCK_S
        )
        met = sum(any(o.figures["ending"] in COLLISIONS for o in g) for g in rounds.values())
        good = [group for seed, group in rounds.items() if seed not in failed]
        times = [[float(one.figures["time_s"]) for one in group] for group in good]
        count = len(rounds)
        parked = [sum(bool(o.figures["is_success"]) for o in group) for group in rounds.values()]
        return RoundTally(
            rounds=count,
            all_parked_rate=len(good) / max(count, 1),
            all_parked_interval=wilson_interval(len(good), count),
            with_contact=met,
            contact_interval=wilson_interval(met, count),
            deadlocks=len(stuck),
            deadlock_rate=len(stuck) / max(count, 1),
            deadlock_interval=wilson_interval(len(stuck), count),
            parked_mean=fmean(parked) if parked else None,
            time_s_mean=fmean(time for group in times for time in group) if times else None,
            last_time_s_mean=fmean(max(group) for group in times) if times else None,
            last_time_s_most=max((max(group) for group in times), default=None),
            failed_seeds=tuple(failed),
            deadlock_seeds=tuple(stuck),
        )


def _are_all_parked(group: Sequence[Try]) -> bool:
    return all(one.figures["is_success"] for one in group)
