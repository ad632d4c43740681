"""Several policies that learn in the same races, and a critic that knows the whole race."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from race_agents.policies.session import Policy
from race_agents.training.mappo import CentralPolicy
from race_agents.training.run import train
from race_agents.training.seats import Seats, SharedRaces
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_agents.training.together import Company, train_together
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from support.trainings import QUICK, untrained

FOUR = (
    *QUICK,
    "steps=800",
    "worlds=2",
    "algorithm.options.batch_size=50",
    "observation=['speed', 'line_offset', 'line_heading']",
)
RACE = "race={karts = 4, learners = 4, opponents = ['raceline']}"


def settings_of(policies: str, *changes: str) -> Settings:
    words = (*FOUR, RACE, f"policies={policies}", "evaluation.seconds=1.0", *changes)
    return read_settings("time-trial-ppo", words)


def test_one_policy_of_all_karts_learns_what_it_learns_without_being_named(tmp_path: Path) -> None:
    for folder in ("named", "alone"):
        (tmp_path / folder).mkdir()
    (named,) = train_together(settings_of("[{name = 'all', karts = 4}]"), tmp_path / "named")
    alone = train(settings_of("[]"), tmp_path / "alone")
    seen = np.random.default_rng(1).normal(size=(50, 3)).astype(np.float32)
    first, other = (Policy(one.folder / "policy.onnx").decide(seen) for one in (named, alone))
    # A kart's reward is summed up in another order.
    assert first == pytest.approx(other, abs=1e-5)


def test_each_policy_has_its_own_observation_and_file(tmp_path: Path) -> None:
    two = "[{name = 'red', karts = 3}, {name = 'blue', observation = ['speed']}]"
    results = train_together(settings_of(two), tmp_path)
    assert [one.folder for one in results] == [tmp_path / "red", tmp_path / "blue"]
    # Three karts of four make three quarters of the decisions.
    assert [one.evaluation["steps"] for one in results] == [600, 200]
    sizes = [Policy(one.folder / "policy.onnx").metadata.sizes for one in results]
    assert sizes == [(1, 1, 1), (1,)]
    assert results[1].evaluation["learned_with"] == ["red"]


def test_resumed_policies_learn_in_races_that_they_have_not_had(tmp_path: Path) -> None:
    """After 400 and 400 decisions, the seed of the first race is 2^31 + 1 + 800."""
    two = "[{name = 'red', karts = 2}, {name = 'blue', karts = 2}]"
    settings = settings_of(two)
    train_together(settings, tmp_path)
    seeds = [
        Company(settings, tmp_path, {"resume": resume}, print, print).races.batch.buffers.rounds
        for resume in (False, True)
    ]
    assert [rounds["seed"].tolist() for rounds in seeds] == [[1, 2], [2**31 + 801, 2**31 + 802]]
    more = train_together(settings_of(two, "steps=1200"), tmp_path, resume=True)
    assert [one.evaluation["steps"] for one in more] == [600, 600]


def test_a_policy_that_was_not_written_is_written_when_the_others_have_been(tmp_path: Path) -> None:
    settings = settings_of("[{name = 'red', karts = 2}, {name = 'blue', karts = 2}]")
    train_together(settings, tmp_path)
    written = [tmp_path / "blue" / name for name in ("evaluation.json", "policy.onnx")]
    for path in written:  # it was killed in between
        path.unlink()
    said: list[str] = []
    (blue,) = train_together(settings, tmp_path, resume=True, say=said.append)
    assert (blue.folder.name, blue.evaluation["steps"]) == ("blue", 400)
    assert all(path.exists() for path in written)
    assert "red: it has learned for all its time and is evaluated, so its karts roll" in said
    with pytest.raises(ScenarioError, match="has learned for 400 of 400 decisions"):
        train_together(settings, tmp_path, resume=True)


class OneStep:
    """Takes turns without threads: the last of two policies moves the races on."""

    def __init__(self, policies: str) -> None:
        settings = settings_of(policies, "steps=8", "reward={progress = 1.0, speed = 0.0}")
        self.races = SharedRaces(settings)
        self.red, self.blue = (Seats(self.races, settings, number) for number in range(2))

    def rewards(self) -> tuple[Any, Any]:
        """Return what each policy's karts get, (W, karts)."""
        batch = self.races.batch
        batch.step(
            np.ones(batch.buffers.actions.shape, np.float32) * [[[0.5], [0.1], [0.9], [0.3]]]
        )
        self.races.decide = lambda *_: None  # type: ignore[method-assign]
        return tuple(seats.step(None)[1].reshape(2, 2) for seats in (self.red, self.blue))


def test_a_team_shares_what_its_karts_earn() -> None:
    alone = OneStep("[{name = 'red', karts = 2}, {name = 'blue', karts = 2}]").rewards()
    shared = OneStep("[{name = 'red', karts = 2}, {name = 'blue', karts = 2, team = 1.0}]")
    assert len(np.unique(alone)) > 4
    red, blue = shared.rewards()
    assert np.array_equal(red, alone[0])
    assert blue == pytest.approx(np.repeat(alone[1].mean(axis=1, keepdims=True), 2, axis=1))


def test_a_policy_may_have_a_reward_of_its_own() -> None:
    own = OneStep(
        "[{name = 'red', karts = 2}, {name = 'blue', karts = 2, reward = {progress = 3}}]"
    )
    plain = OneStep("[{name = 'red', karts = 2}, {name = 'blue', karts = 2}]")
    assert own.rewards()[1] == pytest.approx(3.0 * plain.rewards()[1], rel=1e-6)


def test_lines_of_evaluations_are_found_before_policies_learn_in_their_threads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def find(tasks: list[Task], *_: Any) -> None:
        asked.extend(one.course.name for task in tasks for one in task.scenarios)
        raise KeyboardInterrupt

    monkeypatch.setattr("race_agents.training.together.find_lines_shown", find)
    two = "[{name = 'red', karts = 2}, {name = 'blue', karts = 2}]"
    with pytest.raises(KeyboardInterrupt):
        train_together(settings_of(two, "evaluation.final={names = ['oval']}"), tmp_path)
    assert asked.count("oval") >= 2
    assert not list(tmp_path.iterdir())


def test_where_one_policy_cannot_learn_all_end_with_its_error(tmp_path: Path) -> None:
    two = "[{name = 'red', karts = 3}, {name = 'blue', reward = {luck = 1.0}}]"
    with pytest.raises(ScenarioError, match="luck"):
        train_together(settings_of(two), tmp_path)


@pytest.mark.parametrize(
    ("policies", "sentence"),
    [
        ("[{name = 'red', karts = 3}]", "race.learners = 4: their karts are 3"),
        ("[{name = 'a', karts = 2}, {name = 'a', karts = 2}]", "give each its own"),
        ("[{name = '../up', karts = 4}]", "policies.0.name"),
    ],
)
def test_policies_that_do_not_fit_are_refused(policies: str, sentence: str) -> None:
    with pytest.raises(ScenarioError, match=sentence):
        settings_of(policies)


def test_the_critic_of_mappo_knows_the_race_and_its_actor_does_not(tmp_path: Path) -> None:
    settings = settings_of("[]", "algorithm.name=mappo")
    done = train(settings, tmp_path)
    assert done.evaluation["parity"] < 1e-5
    assert Policy(tmp_path / "policy.onnx").metadata.sizes == (1, 1, 1)
    _, world, learner = untrained(settings)
    karts: Any = world.unwrapped
    known = learner._known(karts, np.zeros((8, 3), np.float32))
    # The tick, and 14 numbers of each of four karts.
    assert known.shape == (8, 3 + 1 + 4 * 14)
    (network,) = learner._networks()[:1]
    acts, worth = network.act(known).copy(), network.critic.answer(known).copy()
    known[:, 3:] += 1.0
    assert np.array_equal(acts, network.act(known))
    assert not np.array_equal(worth, network.critic.answer(known))


@pytest.mark.parametrize("option", ["clip_range_vf=0.2", "use_sde=true"])
def test_an_option_that_mappo_does_not_take_is_named(option: str) -> None:
    name = option.partition("=")[0]
    with pytest.raises(ScenarioError, match=f"^algorithm mappo takes no option {name}; leave it"):
        untrained(settings_of("[]", "algorithm.name=mappo", f"algorithm.options.{option}"))


def test_a_kart_comes_first_in_its_own_state_of_the_race() -> None:
    races = SharedRaces(settings_of("[{name = 'red', karts = 3}, {name = 'blue'}]"))
    blue = Seats(races, settings_of("[{name = 'red', karts = 3}, {name = 'blue'}]"), 1)
    x = races.batch.world.bodies["x"]
    states = blue.race_states.reshape(2, -1)[:, 1:].reshape(2, 4, 14)
    assert np.allclose(states[..., 2], x[:, [3, 0, 1, 2]])


def test_running_means_of_states_are_those_of_all_rows() -> None:
    policy = CentralPolicy.__new__(CentralPolicy)
    torch.nn.Module.__init__(policy)
    for name, shape in (("count", ()), ("mean", (2,)), ("squares", (2,))):
        policy.register_buffer(f"state_{name}", torch.zeros(shape, dtype=torch.float64))
    rows = np.random.default_rng(0).normal(3.0, 2.0, (60, 2)).astype(np.float32)
    for part in (rows[:10], rows[10:]):
        policy.learn_scale(part)
    wanted = (rows - rows.mean(axis=0)) / rows.std(axis=0)
    assert policy.scaled(rows) == pytest.approx(wanted, abs=1e-5)
