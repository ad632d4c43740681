"""How strong drivers are, from orders of finish: chances that can be checked in the head."""

import math
from random import Random

import pytest

from race_server.storage.results.ratings import MEAN, POINTS, ratings

Order = list[tuple[str, int]]


def drawn(strengths: dict[str, float], races: int, seed: int) -> list[Order]:
    """Return orders drawn by the model itself: the least of exponential times is next."""
    chance = Random(seed)

    def race() -> Order:
        times = {name: chance.expovariate(math.exp(s)) for name, s in strengths.items()}
        return [(name, rank) for rank, name in enumerate(sorted(times, key=times.__getitem__), 1)]

    return [race() for _ in range(races)]


def test_ten_wins_to_each_defeat_are_four_hundred_points() -> None:
    races = [[("ann", 1), ("bob", 2)]] * 10_000 + [[("bob", 1), ("ann", 2)]] * 1_000
    ann, bob = ratings(races)
    assert ann.mu - bob.mu == pytest.approx(400.0, abs=0.5)
    assert ann.mu + bob.mu == pytest.approx(2.0 * MEAN)


def test_the_error_is_that_of_a_counted_share() -> None:
    # The log-odds of a share p of n have the variance 1 / (n p (1 - p)); each driver is half of
    # their difference from the mean.
    races = [[("ann", 1), ("bob", 2)]] * 5_000 + [[("bob", 1), ("ann", 2)]] * 5_000
    for rating in ratings(races):
        assert rating.sigma == pytest.approx(POINTS * 0.5 / math.sqrt(2_500.0), rel=1e-3)


def test_the_order_of_the_races_does_not_matter() -> None:
    races = drawn({"ann": 1.0, "bob": 0.0, "cid": -1.0}, 30, seed=1)
    for one, other in zip(ratings(races), ratings(races[::-1]), strict=True):
        assert one.driver == other.driver
        assert one.mu == pytest.approx(other.mu)


def test_who_never_loses_has_a_finite_rating_that_grows_with_its_races() -> None:
    few, many = (ratings([[("ann", 1), ("bob", 2)]] * races)[0] for races in (1, 100))
    assert few.driver == many.driver == "ann"
    assert MEAN < few.mu < many.mu < MEAN + 1000.0
    assert few.low < MEAN < many.low


def test_the_bounds_hold_the_truth_in_nineteen_of_twenty_cases() -> None:
    strengths = {f"driver {number}": 0.6 * (number - 2.5) for number in range(6)}
    held = sum(
        rating.low < MEAN + POINTS * strengths[rating.driver] < rating.high
        for seed in range(100)
        for rating in ratings(drawn(strengths, 40, seed))
    )
    assert 0.93 < held / 600.0 < 0.97


def test_drivers_of_the_same_rank_are_not_compared() -> None:
    tied = ratings([[("ann", 1), ("bob", 1), ("cid", 3)]] * 5)
    assert tied[0].mu == pytest.approx(tied[1].mu)
    assert tied[2].driver == "cid"
    assert [rating.mu for rating in ratings([[("ann", 1), ("bob", 1)]])] == pytest.approx(
        [MEAN] * 2
    )


def test_a_large_field_is_rated_as_a_small_one_is() -> None:
    strengths = {f"driver {number}": 0.05 * number for number in range(64)}
    rated = ratings(drawn(strengths, 200, seed=1))
    held = sum(
        rating.low < MEAN + POINTS * (strengths[rating.driver] - 0.05 * 31.5) < rating.high
        for rating in rated
    )
    assert 57 <= held <= 64


def test_drivers_that_never_met_are_compared_through_others() -> None:
    chain = [[("ann", 1), ("bob", 2)], [("bob", 1), ("cid", 2)]] * 20
    assert [rating.driver for rating in ratings(chain)] == ["ann", "bob", "cid"]


def test_a_driver_with_several_karts_counts_once_by_their_mean_rank() -> None:
    mixed = [("ann", 1), ("bob", 2), ("bob", 3), ("ann", 6)]
    assert [row.driver for row in ratings([mixed])] == ["bob", "ann"]
    assert ratings([[("ann", 1), ("ann", 2)]]) == []
