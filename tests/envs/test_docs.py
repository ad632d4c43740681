"""The manual of observations says what the code says."""

from race_server.envs import reward_terms
from race_server.envs.docs import COMMAND, GAP_TEXTS, TARGET, manual
from race_server.envs.reality_gap import DRAWS
from race_server.envs.rewards import TERMS


def test_the_committed_manual_is_what_the_definitions_give() -> None:
    committed = TARGET.read_text(encoding="utf-8")
    assert committed == manual(), f"docs/observations.md is out of date: run `{COMMAND}`"


def test_the_numbers_of_the_reward_terms_are_their_order() -> None:
    assert [getattr(reward_terms, name.upper()) for name in TERMS] == list(range(len(TERMS)))


def test_every_draw_of_the_reality_gap_is_explained() -> None:
    assert tuple(GAP_TEXTS) == DRAWS
