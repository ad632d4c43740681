"""Items: found by their files, drawn by rank, plain numbers."""

import numpy as np
import pytest

from race_server.rules.draw import draw_item
from race_server.rules.items import item_table, items

NAMES = [item.name for item in items()]


def test_the_four_items_are_found_by_their_files() -> None:
    assert NAMES == ["boost", "oil", "pulse", "shield"]


def test_number_zero_is_no_item() -> None:
    table = item_table()
    assert len(table) == 5
    assert table[0].use == 0


def _share(rank: int, name: str, catch_up: int) -> float:
    wanted = NAMES.index(name) + 1
    chances = (np.arange(1000) + 0.5) / 1000
    drawn = [draw_item(item_table(), rank, 8, catch_up, chance) for chance in chances]
    return drawn.count(wanted) / len(drawn)


def test_the_leader_draws_boost_two_times_in_thirteen() -> None:
    # Weights of the leader: boost 1, oil 3, pulse 0.5, shield 2, so 6.5 in all.
    assert _share(1, "boost", 1) == pytest.approx(1 / 6.5, abs=0.002)


def test_the_last_kart_draws_boost_three_times_in_seven() -> None:
    assert _share(8, "boost", 1) == pytest.approx(3 / 7, abs=0.002)


def test_without_catch_up_all_places_draw_alike() -> None:
    assert _share(1, "pulse", 0) == _share(8, "pulse", 0)


@pytest.mark.parametrize("chance", [0.0, 0.5, 1.0 - 2**-53])
def test_every_draw_gives_an_item(chance: float) -> None:
    assert 1 <= draw_item(item_table(), 3, 8, 1, chance) <= 4
