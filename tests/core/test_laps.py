"""Gates, laps and the clock, with numbers that can be checked in the head."""

import math

from hypothesis import given
from hypothesis import strategies as st

from race_server.core.kernels.course import nearest_sample
from race_server.core.rules.laps import (
    Gate,
    count_gate,
    crossing_share,
    is_missed,
    microseconds,
    race_distance,
)
from race_server.scenario.race import Scenario, make_world
from support.courses import SMALL_RING


def test_a_kart_that_crosses_the_next_gate_waits_for_the_one_after() -> None:
    assert count_gate(1, 0, 1, 4) == Gate(next_gate=2, lap=0)


def test_a_kart_that_skips_a_gate_gets_no_lap() -> None:
    assert count_gate(2, 0, 3, 4) == Gate(next_gate=2, lap=0)


def test_the_timing_line_completes_the_lap() -> None:
    assert count_gate(0, 1, 0, 4) == Gate(next_gate=1, lap=2)


def test_the_last_gate_is_followed_by_the_timing_line() -> None:
    assert count_gate(3, 1, 3, 4) == Gate(next_gate=0, lap=1)


@given(st.lists(st.integers(0, 5), max_size=200))
def test_laps_never_outnumber_the_times_all_gates_were_crossed(crossed: list[int]) -> None:
    gate, lap = 1, 0
    for number in crossed:
        gate, lap = count_gate(gate, lap, number, 6)
    assert lap <= min(crossed.count(number) for number in range(6))


def test_a_gate_ahead_of_the_next_one_means_a_short_cut() -> None:
    assert is_missed(1, 3, 8)


def test_a_gate_crossed_again_after_driving_back_is_no_short_cut() -> None:
    assert not is_missed(3, 2, 8)


def test_sixty_ticks_are_a_second() -> None:
    assert microseconds(60, 0.0) == 1_000_000


def test_half_a_tick_is_counted() -> None:
    assert microseconds(60, 0.5) == 1_008_333


def test_a_line_a_quarter_of_the_way_is_crossed_after_a_quarter_of_the_tick() -> None:
    assert crossing_share(-1.0, 3.0) == 0.25


def test_distance_beyond_a_missed_gate_does_not_rank() -> None:
    assert race_distance(130.0, 1, 20.0, 100.0) == 120.0


def test_the_search_for_a_place_that_is_no_number_ends_where_it_began() -> None:
    route = make_world(Scenario(SMALL_RING, karts=1)).route
    assert nearest_sample(route, route.courses[0], math.nan, math.nan, 3) == 3
