"""Points and groups: pure functions of places and times."""

from collections.abc import Sequence
from typing import TypeVar

Team = TypeVar("Team")


def falling_points(times_us: Sequence[int], best: int, least: int) -> list[int]:
    """Return points for times, `best` for the shortest, falling evenly to `least` for the last.

    Equal times share the points of the last place among them.
    """
    last = max(len(times_us) - 1, 1)
    points = []
    for mine in times_us:
        place = sum(time <= mine for time in times_us)  # the last among equals
        drop = (best - least) * (place - 1) / last if len(times_us) > 1 else 0.0
        points.append(round(best - drop))
    return points


def place_points(place: int, table: Sequence[int], finishing: int) -> int:
    """Return the points of a place from 1; 0 for place 0, which is not classified."""
    if place <= 0:
        return 0
    return table[place - 1] if place <= len(table) else finishing


def groups_in_order(teams: Sequence[Team], most: int, least: int) -> list[list[Team]]:
    """Return the teams in groups of `most`, the best in the first.

    A last group smaller than `least` is filled from the end of the one before.
    """
    groups = [list(teams[first : first + most]) for first in range(0, len(teams), most)]
    while len(groups) > 1 and len(groups[-1]) < least < len(groups[-2]):
        groups[-1].insert(0, groups[-2].pop())
    return groups


def mixed_groups(teams: Sequence[Team], most: int) -> list[list[Team]]:
    """Return the teams in as few groups as possible, of equal size and strength, each in order.

    They are dealt there and back again: 1, 4, 5, 8 against 2, 3, 6, 7.
    """
    count = max(-(-len(teams) // most), 1)
    groups: list[list[Team]] = [[] for _ in range(count)]
    for place, team in enumerate(teams):
        turn, seat = divmod(place, count)
        groups[seat if turn % 2 == 0 else count - 1 - seat].append(team)
    return groups
