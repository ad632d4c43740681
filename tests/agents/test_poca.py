"""MA-POCA in its special cases, and in games small enough to reckon in the head."""

from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from race_agents.training.active_rollout import ActiveRollout
from race_agents.training.group_critic import GroupCritic
from race_agents.training.group_rollout import Decision, GroupRollout
from race_agents.training.poca import Poca
from support.team_games import TeamGame, a_door, alone, only_the_first_matters

SIZE, WIDTH = 3, 2
TANH = torch.nn.Tanh


@pytest.fixture(autouse=True)
def one_thread() -> None:
    """Networks as small as these lose by threads that wait for one another, as in a training."""
    torch.set_num_threads(1)


def critic() -> GroupCritic:
    torch.manual_seed(1)
    return GroupCritic(SIZE, WIDTH, (16, 8), TANH)


def group(agents: int, groups: int = 5) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return random observations, actions, and that all agents are active."""
    torch.manual_seed(2)
    shape = (groups, agents)
    active = torch.ones(shape, dtype=torch.bool)
    return torch.randn(*shape, SIZE), torch.randn(*shape, WIDTH), active


# The critic


def test_alone_an_agent_is_judged_without_its_action_and_like_the_state() -> None:
    seen, acted, active = group(agents=1)
    judge = critic()
    baselines = judge.baselines(seen, acted, active)
    assert torch.equal(baselines, judge.baselines(seen, acted + 7.0, active))
    assert torch.equal(baselines[:, 0], judge.values(seen, active))


def test_a_baseline_knows_the_actions_of_the_others_and_not_its_own() -> None:
    seen, acted, active = group(agents=3)
    judge = critic()
    before = judge.baselines(seen, acted, active)
    acted[:, 1] += 1.0
    after = judge.baselines(seen, acted, active)
    # Another order of summing changes the last bits.
    assert torch.allclose(after[:, 1], before[:, 1], atol=1e-6)
    assert ((after - before)[:, [0, 2]].abs() > 1e-5).all()


def test_the_numbers_of_agents_do_not_matter_to_the_bit() -> None:
    seen, acted, active = group(agents=6)
    active[:, 4] = False
    judge, order = critic(), torch.tensor([3, 0, 5, 1, 4, 2])
    moved = seen[:, order], acted[:, order], active[:, order]
    assert torch.equal(judge.values(seen, active), judge.values(moved[0], moved[2]))
    own = active[:, order]
    wanted = judge.baselines(seen, acted, active)[:, order]
    assert torch.equal(judge.baselines(*moved)[own], wanted[own])


def test_who_is_not_active_is_not_seen_to_the_bit() -> None:
    seen, acted, active = group(agents=4)
    active[:, 2] = False
    judge = critic()
    values, baselines = judge.values(seen, active), judge.baselines(seen, acted, active)
    seen[:, 2], acted[:, 2] = torch.nan, 1e30
    assert torch.equal(judge.values(seen, active), values)
    assert torch.equal(judge.baselines(seen, acted, active)[active], baselines[active])
    # A group of four of which one has left is a group of three.
    three = [0, 1, 3]
    fewer = judge.values(seen[:, three], active[:, three])
    assert torch.allclose(fewer, values, atol=1e-6)


def test_one_alone_is_judged_as_one_of_two_whose_other_has_left() -> None:
    seen, acted, active = group(agents=2)
    active[:, 1] = False
    judge = critic()
    alone = judge.worths(seen[:, :1], acted[:, :1], active[:, :1])
    of_two = judge.worths(seen, acted, active)
    assert torch.equal(alone[1][:, 0], alone[0])
    for one, two in zip(alone, of_two, strict=True):
        assert torch.allclose(one, two.reshape(len(one), -1)[:, :1].reshape(one.shape), atol=1e-6)


def test_how_many_there_are_is_known() -> None:
    one = torch.ones(1, 1, SIZE)
    judge = critic()
    alike = [judge.values(one.expand(1, count, SIZE), torch.ones(1, count) > 0) for count in (1, 2)]
    assert float((alike[0] - alike[1]).abs().detach()) > 1e-3


# Returns


class Told(GroupCritic):
    """A critic for which a state is worth the first number of its first agent."""

    def values(self, seen: torch.Tensor, active: torch.Tensor) -> torch.Tensor:
        return torch.where(active, seen[..., 0], 0.0).sum(dim=1)

    def baselines(
        self, seen: torch.Tensor, acted: torch.Tensor, active: torch.Tensor
    ) -> torch.Tensor:
        return torch.zeros(active.shape)


def rollout(decisions: int, gamma: float, gae_lambda: float) -> GroupRollout:
    """Return an empty rollout of one group of two, of which each agent sees one number."""
    box, two = spaces.Box(-10.0, 10.0, (1,)), spaces.Discrete(2)
    kept = GroupRollout(decisions, box, two, gamma=gamma, gae_lambda=gae_lambda, n_envs=2, agents=2)
    kept.begin(np.ones(2, np.bool_))
    return kept


def decide(
    kept: GroupRollout,
    seen: tuple[float, float],
    rewards: tuple[float, float],
    active: tuple[bool, bool],
    ended: tuple[bool, bool] = (False, False),
    cut: tuple[bool, bool] = (False, False),
    last: float = 0.0,
) -> None:
    """Keep one decision. last: what agents see whose time has run out."""
    infos = [
        {"terminal_observation": np.float32([last]), "TimeLimit.truncated": is_cut}
        for is_cut in cut
    ]
    going_on = np.array(active) & ~np.array(ended)
    kept.keep(
        Decision(
            seen=np.float32(seen).reshape(2, 1),
            actions=np.zeros((2, 1)),
            acted=np.zeros((2, 2)),
            log_probs=np.zeros(2),
            active=np.array(active),
            rewards=np.float32(rewards),
            ended=np.array(ended),
            infos=infos,
            active_next=going_on if going_on.any() else np.ones(2, np.bool_),
        )
    )


def conclude(kept: GroupRollout, seen: tuple[float, float] = (0.0, 0.0)) -> None:
    active = np.ones(2, np.bool_)
    kept.conclude(Told(1, 2, (4,), TANH), np.float32(seen).reshape(2, 1), active)


def test_a_return_of_two_by_hand() -> None:
    """Values 4, 2, 1; the team gets the half of 2, -2 and 4, of which the last ends the round.

    With gamma = lambda = 1/2 the last return is 2; -1 + (1 + 2) / 4 = -0.25 is the one before, and
    1 + (2 - 0.25) / 4 = 1.4375 the first.
    """
    kept = rollout(3, gamma=0.5, gae_lambda=0.5)
    decide(kept, (4.0, 0.0), (2.0, 0.0), (True, True))
    decide(kept, (2.0, 0.0), (0.0, -2.0), (True, True), ended=(False, True))
    decide(kept, (1.0, 9.0), (4.0, 9.0), (True, False), ended=(True, False))
    conclude(kept)
    assert kept.returns[:, 0].tolist() == [1.4375, -0.25, 2.0]


def test_who_has_left_gets_what_its_team_earns_afterwards() -> None:
    kept = rollout(3, gamma=1.0, gae_lambda=1.0)
    decide(kept, (0.0, 0.0), (0.0, -1.0), (True, True), ended=(False, True))
    decide(kept, (0.0, 0.0), (4.0, 0.0), (True, False))
    decide(kept, (0.0, 0.0), (6.0, 0.0), (True, False), ended=(True, False))
    conclude(kept)
    # The half of -1 + 4 + 6, for both: also for the one that left at once.
    assert kept.advantages[0, 0].tolist() == [4.5, 4.5]
    (whole,) = kept.batches(3)
    assert int(whole.active.sum()) == 4  # it decided once, the other one three times
    left = whole.advantages[whole.active[:, 1], 1]
    assert left.tolist() == [4.5]


def test_time_that_runs_out_is_worth_what_those_on_their_way_see() -> None:
    kept = rollout(2, gamma=0.5, gae_lambda=1.0)
    decide(kept, (0.0, 0.0), (0.0, 2.0), (True, True), ended=(False, True))
    decide(kept, (0.0, 0.0), (0.0, 0.0), (True, False), (True, False), cut=(True, False), last=8.0)
    conclude(kept)
    assert kept.returns[:, 0].tolist() == [1.0 + 0.5 * 4.0, 4.0]


def test_an_unfinished_round_goes_on_with_the_value_of_what_follows() -> None:
    kept = rollout(1, gamma=0.5, gae_lambda=1.0)
    decide(kept, (0.0, 0.0), (2.0, 2.0), (True, True))
    conclude(kept, seen=(3.0, 3.0))
    assert kept.returns[0, 0] == 2.0 + 0.5 * 6.0


# One agent


class Silent(BaseCallback):
    def _on_step(self) -> bool:
        return True


def learner(game: TeamGame, agents: int, **options: Any) -> Poca:
    usual: dict[str, Any] = {
        "n_steps": 32,
        "batch_size": 32 * game.num_envs,
        "n_epochs": 1,
        "learning_rate": 0.01,
    }
    network = {"net_arch": [16], "activation_fn": TANH}
    return Poca("MlpPolicy", game, agents=agents, seed=1, policy_kwargs=network, **usual | options)


def test_with_one_agent_it_is_ppo_with_another_critic() -> None:
    """On the same decisions both take the same step with the actor."""
    mine = learner(alone(8), agents=1, vf_coef=0.0, gamma=0.9, gae_lambda=0.8)
    network = {"net_arch": {"pi": [16], "vf": [16]}, "activation_fn": TANH}
    options: dict[str, Any] = {"n_steps": 32, "batch_size": 256, "n_epochs": 1, "vf_coef": 0.0}
    options |= {"gamma": 0.9, "gae_lambda": 0.8, "learning_rate": 0.01}
    ppo = PPO("MlpPolicy", alone(8), policy_kwargs=network, **options)
    actors = [
        torch.nn.ModuleList([one.policy.mlp_extractor.policy_net, one.policy.action_net])
        for one in (mine, ppo)
    ]
    actors[1].load_state_dict(actors[0].state_dict())
    judged = [values_of(mine)]
    mine.learn(256, callback=Judged(mine, judged))
    kept, theirs = mine.rollout_buffer, ppo.rollout_buffer
    assert isinstance(kept, GroupRollout)
    for name in ("observations", "actions", "log_probs"):
        setattr(theirs, name, getattr(kept, name)[:, :, 0].copy())
    for name in ("rewards", "values", "episode_starts"):
        setattr(theirs, name, getattr(kept, name).copy())
    theirs.compute_returns_and_advantage(torch.from_numpy(judged[-1]), kept._over)
    assert theirs.advantages == pytest.approx(kept.advantages[:, :, 0], abs=1e-5)
    theirs.full = True
    ppo.set_logger(configure(None, []))
    ppo.train()
    before = Poca("MlpPolicy", alone(8), agents=1, seed=1, policy_kwargs={"net_arch": [16]})
    for own, other, first in zip(
        actors[0].parameters(), actors[1].parameters(), before.policy.parameters(), strict=False
    ):
        assert torch.allclose(own, other, atol=1e-6)
        assert not torch.equal(own, first)


def values_of(mine: Poca) -> Any:
    """Return the values of what all agents see now, shape (n,)."""
    seen = mine._last_obs
    if seen is None:
        return np.zeros(mine.n_envs, np.float32)
    active = torch.ones(len(seen), 1, dtype=torch.bool)
    with torch.no_grad():
        return mine._policy.critic.values(torch.from_numpy(seen)[:, None], active).numpy()


class Judged(Silent):
    """Notes the values after a rollout, before the networks change."""

    def __init__(self, mine: Poca, judged: list[Any]) -> None:
        super().__init__()
        self._mine, self._judged = mine, judged

    def _on_rollout_end(self) -> None:
        self._judged.append(values_of(self._mine))


# Games


def fitted(mine: Poca, lessons: int) -> GroupRollout:
    """Return a rollout whose critic has learned what it is worth, by an actor that stays."""
    mine.learn(1, callback=Silent())
    kept = mine.rollout_buffer
    assert isinstance(kept, GroupRollout)
    steps = torch.optim.Adam(mine._policy.critic.parameters(), lr=0.01)
    for _ in range(lessons):
        for part in kept.batches(4096):
            loss: Any = mine.losses(part).critic
            steps.zero_grad()
            loss.backward()
            steps.step()
    assert isinstance(mine._last_obs, np.ndarray)
    kept.conclude(mine._policy.critic, mine._last_obs, np.ones(mine.n_envs, np.bool_))
    return kept


def test_credit_goes_to_the_one_whose_action_matters() -> None:
    """Half of all first players pick 1, so 1 is worth half more than expected, 0 half less."""
    kept = fitted(learner(only_the_first_matters(8), agents=2, learning_rate=0.0), lessons=100)
    first, second = kept.advantages[..., 0], kept.advantages[..., 1]
    picked = kept.actions[:, :, 0, 0] == 1
    assert first[picked].mean() == pytest.approx(0.5, abs=0.1)
    assert first[~picked].mean() == pytest.approx(-0.5, abs=0.1)
    for action in (0, 1):
        of_second = second[kept.actions[:, :, 1, 0] == action]
        assert abs(of_second.mean()) < 0.05
        assert np.abs(of_second).max() < 0.15  # not only in the mean


def test_an_agent_learns_to_leave_for_what_the_other_gains_by_it() -> None:
    mine = learner(a_door(16), agents=2, n_epochs=4, gamma=0.99, gae_lambda=0.95)
    mine.learn(8_000, callback=Silent())
    first, after = (np.eye(2, 3, dtype=np.float32) for _ in range(2))
    after[:, 2] = 1.0
    assert mine.predict(first[:1], deterministic=True)[0].tolist() == [1]
    assert mine.predict(after[1:], deterministic=True)[0].tolist() == [1]


# PPO among others


def test_ppo_does_not_learn_from_those_who_wait() -> None:
    game = a_door(4)
    options = {"rollout_buffer_class": ActiveRollout, "rollout_buffer_kwargs": {"world": game}}
    ppo = PPO("MlpPolicy", game, n_steps=16, batch_size=32, n_epochs=1, seed=1, **options)
    ppo.learn(128)
    kept = ppo.rollout_buffer
    assert isinstance(kept, ActiveRollout)
    seen = torch.cat([part.observations for part in kept.get(5)])
    # Who opens the door sees the second decision, and does not take part in it.
    waits = int((~kept.active).sum())
    assert 0 < waits < 64
    assert len(seen) == 128 - waits
    assert isinstance(kept, RolloutBuffer)
