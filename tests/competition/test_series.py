"""Several races in a row: fair places on the grid, and ratings at the end."""

from typing import Any

import pytest

from race_server.competition.launch import RaceSpec
from race_server.competition.series import plans_of, rated, run_series

PLAN = RaceSpec(serve=("--seed", "1"), drivers=("a", "b", "c"), address="", session="race")


def document(*drivers: str) -> dict[str, Any]:
    """The result of a race that ended in this order."""
    karts = [{"driver": driver, "rank": rank} for rank, driver in enumerate(drivers, 1)]
    return {"karts": karts, "stopped": False}


def test_everybody_starts_once_from_each_place() -> None:
    plans = list(plans_of(PLAN, races=6, seed=7))
    for first in (0, 3):
        for seat in range(3):
            assert {plan.drivers[seat] for plan in plans[first : first + 3]} == {"a", "b", "c"}


def test_each_race_has_a_seed_of_its_own() -> None:
    seeds = [plan.serve[-1] for plan in plans_of(PLAN, races=3, seed=7)]
    assert seeds == ["7", "8", "9"]


def test_a_series_of_the_same_seed_is_the_same() -> None:
    assert list(plans_of(PLAN, 5, 7)) == list(plans_of(PLAN, 5, 7))


def test_who_always_wins_leads_with_an_interval_above_the_others() -> None:
    found = run_series(PLAN, 12, 1, lambda plan, number: document("b", "a", "c"))
    first, second, third = found["ratings"]
    assert [row["driver"] for row in (first, second, third)] == ["b", "a", "c"]
    assert first["low"] < first["mu"] < first["high"]
    assert first["low"] > third["high"]
    assert (first["wins"], first["mean_place"], first["starts"]) == (12, 1.0, 12)


def test_a_race_that_is_stopped_ends_the_series_and_is_not_rated() -> None:
    def run(_: RaceSpec, number: int) -> dict[str, Any]:
        return {**document("a", "b", "c"), "stopped": number == 2}

    found = run_series(PLAN, 12, 1, run)
    assert found["stopped"]
    assert len(found["races"]) == 2
    assert [row["races"] for row in found["ratings"]] == [2, 2, 2]


def test_a_driver_with_two_karts_counts_once_a_race() -> None:
    rows = {row["driver"]: row for row in rated([document("a", "b", "a")])}
    assert rows["a"]["starts"] == 2
    assert rows["a"]["races"] == 1
    assert rows["a"]["mean_place"] == pytest.approx(rows["b"]["mean_place"])
