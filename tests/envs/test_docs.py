"""The manual of observations says what the code says."""

from race_server.envs import reality_gap
from race_server.envs.docs import COMMAND, TARGET, manual
from race_server.envs.racing import reward_terms
from race_server.envs.racing.reward_terms import TERMS


def test_the_committed_manual_is_what_the_definitions_give() -> None:
    committed = TARGET.read_text(encoding="utf-8")
    assert committed == manual(), f"docs/observations.md is out of date: run `{COMMAND}`"


def test_the_numbers_of_the_reward_terms_are_their_order() -> None:
    assert [getattr(reward_terms, name.upper()) for name in TERMS] == list(range(len(TERMS)))


def test_every_draw_of_the_reality_gap_is_explained() -> None:
    names = [
        "ACTION_DELAY",
        "OBSERVATION_DELAY",
        "LAG",
        "PLAY",
        "SPEED",
        "MASS",
        "GRIP",
        "STIFFNESS",
        "HITCH",
    ]
    numbers = [getattr(reality_gap, name) for name in names]
    assert numbers == list(range(len(reality_gap.FACTORS)))
    for name, factor in reality_gap.FACTORS.items():
        assert f"| `{name}` | {factor.unit} |" in manual()
        assert factor.meaning in manual()
