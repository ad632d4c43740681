"""Points, groups and orders of a race day, in plain numbers."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from race_server.competition.race_day.formats import Format, Races, TimeTrial, format_named, formats
from race_server.competition.race_day.ledger import Heat, Label, Ledger, RacesResult
from race_server.competition.race_day.plan import DayPlan
from race_server.competition.race_day.points import (
    falling_points,
    groups_in_order,
    mixed_groups,
    place_points,
)
from race_server.competition.race_day.qualify import trial_result
from race_server.competition.race_day.record import RaceRecord, Team, TeamResult
from race_server.competition.race_day.tables import tables_of
from race_server.core.vehicle_presets import vehicle_named
from support.courses import TINY_RING

SECOND = 1_000_000
F1 = (25, 18, 15, 12, 10, 8, 6, 4, 2, 1)


def drive(team: str, place: int = 1, seconds: float = 30.0) -> TeamResult:
    time_us = round(seconds * SECOND) if place else 0
    return TeamResult(team, place, 2, time_us, 0, (), 0, 0, 0, 0, "" if place else "stood for 10 s")


def test_the_formats_of_both_years_are_found_by_their_files() -> None:
    assert list(formats()) == ["2023", "2025", "time-trial"]
    assert format_named("2023").letters == "AB"
    assert format_named("2025").letters == "ABC"


def test_points_fall_evenly_from_the_first_to_the_last() -> None:
    assert falling_points([30, 31, 40, 50, 60], 25, 5) == [25, 20, 15, 10, 5]


def test_equal_times_share_the_points_of_the_last_place_among_them() -> None:
    assert falling_points([30, 120, 120], 25, 5) == [25, 5, 5]


def test_a_team_alone_takes_all_points() -> None:
    assert falling_points([30], 25, 5) == [25]


@given(st.lists(st.integers(1, 100), min_size=1, max_size=20))
def test_nobody_gets_more_points_for_more_time(times: list[int]) -> None:
    points = falling_points(sorted(times), 25, 5)
    assert all(before >= after for before, after in pairwise(points))
    assert all(5 <= given_points <= 25 for given_points in points)


def test_the_winner_of_a_final_gets_25_points_and_the_tenth_one() -> None:
    assert [place_points(place, F1, 0) for place in (1, 2, 10, 11)] == [25, 18, 1, 0]


def test_who_is_not_classified_gets_nothing() -> None:
    assert place_points(0, (10, 6, 4), 2) == 0


def test_finishing_a_heat_fifth_is_worth_two_points() -> None:
    assert place_points(5, (10, 6, 4), 2) == 2


def test_the_first_six_race_apart_from_the_next_six() -> None:
    assert groups_in_order(list(range(8)), 6, 2) == [[0, 1, 2, 3, 4, 5], [6, 7]]


def test_nobody_races_alone_where_another_can_join() -> None:
    assert groups_in_order(list(range(7)), 6, 2) == [[0, 1, 2, 3, 4], [5, 6]]
    assert groups_in_order([0], 6, 2) == [[0]]


def test_mixed_groups_are_dealt_there_and_back() -> None:
    assert mixed_groups(list(range(1, 9)), 4) == [[1, 4, 5, 8], [2, 3, 6, 7]]


@given(st.integers(0, 64), st.integers(1, 10), st.integers(1, 5), st.booleans())
def test_everybody_is_in_one_group_and_no_group_is_too_large(
    count: int, most: int, least: int, mixed: bool
) -> None:
    teams = list(range(count))
    groups = mixed_groups(teams, most) if mixed else groups_in_order(teams, most, least)
    assert sorted(team for group in groups for team in group) == teams
    assert all(len(group) <= most for group in groups)
    assert all(group == sorted(group) for group in groups)


@given(st.integers(8, 64))
def test_heats_of_eight_at_most_have_four_karts_at_least(count: int) -> None:
    sizes = [len(group) for group in mixed_groups(list(range(count)), 8)]
    assert min(sizes) >= 4
    assert max(sizes) - min(sizes) <= 1


def trial(**attempts: tuple[float, ...]) -> Ledger:
    """Return a day after one time trial; a time of 0 is a failure."""
    stage = TimeTrial("Trial", track="A")
    teams = tuple(Team(name, "avoider") for name in attempts)
    drives = {
        name: [drive(name, place=int(time > 0), seconds=time) for time in times]
        for name, times in attempts.items()
    }
    ledger = Ledger(Format("x", "X", (stage,)), teams)
    ledger.stages.append(trial_result(stage, TINY_RING, drives))
    return ledger


def names(teams: list[Team]) -> list[str]:
    return [team.name for team in teams]


def test_the_best_attempt_counts_and_a_failure_is_two_minutes() -> None:
    ledger = trial(a=(0, 40.0), b=(30.0, 0), c=(0, 0))
    assert ledger.qualifying_us() == {"a": 40 * SECOND, "b": 30 * SECOND, "c": 120 * SECOND}
    assert names(ledger.order()) == ["b", "a", "c"]


def test_of_equal_best_times_the_better_other_attempt_is_ahead() -> None:
    assert names(trial(a=(30.0, 0), b=(30.0, 45.0)).order()) == ["b", "a"]


def test_of_equal_attempts_the_entry_list_decides() -> None:
    assert names(trial(a=(30.0, 31.0), b=(31.0, 30.0)).order()) == ["a", "b"]


def heat(
    ledger: Ledger, group: int, *places: tuple[str, int], points: tuple[int, ...] = ()
) -> None:
    """Add a race to the last stage of a day, which is one of races."""
    drives = tuple(drive(name, place) for name, place in places)
    given_points = {row.team: place_points(row.place, points, 0) for row in drives}
    record = RaceRecord("", drives)
    label = Label("Race", 1, group)
    entry = Heat(label, "A", TINY_RING, tuple(name for name, _ in places), record, given_points)
    stage = Races("Race", "A", 5, points=points)
    before = ledger.heats()
    ledger.stages = [*ledger.trials(), RacesResult(stage, (*before, entry))]


def test_the_first_race_ranks_before_the_second_and_who_fails_has_no_place() -> None:
    ledger = trial(a=(30.0, 0), b=(31.0, 0), c=(32.0, 0), d=(33.0, 0))
    heat(ledger, 1, ("b", 1), ("a", 0))
    heat(ledger, 2, ("d", 1), ("c", 2))
    rows = [(row.place, row.team) for row in ledger.classification()]
    assert rows == [(1, "b"), (2, "d"), (3, "c"), (0, "a")]


def test_of_equal_points_more_wins_are_ahead() -> None:
    form = Format("x", "X", (Races("Race", "A", 5, points=(5, 3, 2)),))
    ledger = Ledger(form, (Team("a", "d"), Team("b", "d"), Team("c", "d")))
    table = (5, 3, 2)
    heat(ledger, 1, ("c", 1), ("a", 2), ("b", 3), points=table)
    heat(ledger, 1, ("b", 1), ("a", 2), ("c", 3), points=table)
    heat(ledger, 1, ("b", 0), ("a", 0), ("c", 0), points=table)
    # c and b have 7 and a win each; a has 6.
    assert ledger.points() == {"a": 6, "b": 7, "c": 7}
    assert [row.team for row in ledger.classification()] == ["b", "c", "a"]


def test_the_table_of_a_stage_orders_equals_as_the_classification_does() -> None:
    table = (5, 3, 2)
    stage = Races("Race", "A", 5, rounds=3, points=table)
    teams = tuple(Team(name, "d") for name in "abc")
    ledger = Ledger(Format("x", "X", (stage,)), teams)
    heat(ledger, 1, ("c", 1), ("a", 2), ("b", 3), points=table)
    heat(ledger, 1, ("b", 1), ("a", 2), ("c", 3), points=table)
    heat(ledger, 1, ("c", 1), ("a", 2), ("b", 3), points=table)
    ledger.stages = [RacesResult(stage, tuple(ledger.heats()))]
    plan = DayPlan(ledger.format, teams, {"A": TINY_RING}, vehicle_named("kart-60"), seed=1)
    points, final = tables_of(plan, ledger)
    # a and b have 9 each; b has a win.
    assert [row[1] for row in points.rows] == [row[1] for row in final.rows] == ["c", "b", "a"]
