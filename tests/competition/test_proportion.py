"""The interval of a share that was counted."""

import pytest

from race_server.competition.proportion import wilson_interval


def test_the_interval_of_half_of_a_hundred_is_a_tenth_to_either_side() -> None:
    assert wilson_interval(50, 100) == pytest.approx((0.404, 0.596), abs=5e-4)


@pytest.mark.parametrize("runs", [1, 7, 180, 1000, 1002])
def test_of_none_and_of_all_one_bound_is_exact(runs: int) -> None:
    assert wilson_interval(0, runs)[0] == 0.0
    assert wilson_interval(runs, runs)[1] == 1.0


def test_without_runs_it_may_be_any_share() -> None:
    assert wilson_interval(0, 0) == (0.0, 1.0)
