"""Items: found by their files, drawn by rank, plain numbers."""

from pathlib import Path

import numpy as np
import pytest

from race_server.core.rules.draw import draw_item
from race_server.core.rules.items import Item, item_table, items
from race_server.scenario.race import Rules

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


RULE_BOOK = Path(__file__).parents[2] / "docs/rules.md"


def _figures(item: Item) -> str:
    """Return the figures of an item's row in the rule book."""
    scales = (item.speed_scale, item.thrust_scale, item.grip_scale)
    acts = any(scale != 1.0 for scale in scales)
    parts = [f"{scale:.0%}".replace("%", " %") if acts else "–" for scale in scales]
    parts.append(f"{item.effect_s:g} s")
    parts.append(f"{item.immunity_s:g} s" if item.immunity_s else "–")
    parts.append(f"{item.leader_weight:g} : {item.last_weight:g}")
    return " | ".join(parts)


@pytest.mark.parametrize("item", items(), ids=NAMES)
def test_the_rule_book_has_the_figures_of_every_item(item: Item) -> None:
    rows = [
        line for line in RULE_BOOK.read_text().splitlines() if line.startswith(f"| {item.name}")
    ]
    assert len(rows) == 1
    assert rows[0].endswith(f"| {_figures(item)} |")


def test_the_rule_book_has_the_figures_of_the_rules() -> None:
    text, rules = " ".join(RULE_BOOK.read_text().split()), Rules()
    oil = next(item for item in items() if item.name == "oil")
    for words in (
        f"there again after {rules.box_respawn_s:g} s",
        f"a radius of {oil.radius:g} kart widths, stays for {oil.life_s:g} s",
        f"spares its owner for {oil.owner_grace_s:g} s",
        f"by a length | {rules.false_start_penalty_s:g} s",
        f"left out | {rules.short_cut_penalty_s:g} s",
        f"after {rules.stuck_s:g} s below {rules.stuck_speed:g} m/s",
        f"drive through it for 2 s | {rules.rescue_penalty_s:g} s",
        f"after {rules.wrong_way_lengths:g} lengths",
        f"{100.0 * rules.yellow_share:g} % of the top speed",
        f"not home {rules.finish_limit_s:g} s after the winner",
        f"longer than {rules.limit_s / 60.0:g} min",
    ):
        assert words in text
