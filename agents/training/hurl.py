"""HuRL: a heuristic that is believed at first, and less and less.

Cheng, Kolobov and Swaminathan, Heuristic-guided reinforcement learning, NeurIPS 2021: learn from
the reward r + (1 - m) g h(s') under the discount m g, where g is that of the task and the mixing m
rises to 1. With m = 1 that is the task itself. h is a return: it is 0 where an episode has ended.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.type_aliases import ReplayBufferSamples
from stable_baselines3.common.vec_env import (
    VecEnv,
    VecEnvWrapper,
    VecNormalize,
    unwrap_vec_wrapper,
)

from race_agents.training.budget import Budget
from race_agents.training.parking_settings import HurlSettings
from race_agents.training.settings import Settings
from race_server.envs.parking.reward_terms import GOAL_WAY
from race_server.envs.sb3 import KartVecEnv

FORETOLD = "foretold"  # h(s') in what a step tells of a vehicle
# The mixing comes so near to 1 before the last epoch, as the authors have it.
NEARLY = 0.99


def mixing_at(share: float, hurl: HurlSettings) -> float:
    """Return the mixing m after a share of the training, from `hurl.first` to 1 in epochs."""
    epoch = min(int(share * hurl.epochs), hurl.epochs - 1)
    rise = math.tanh(epoch * math.atanh(NEARLY) / (hurl.epochs - 1)) / NEARLY
    return hurl.first + (1.0 - hurl.first) * rise


def foretold_of(ways: NDArray[Any], settings: Settings) -> NDArray[np.float64]:
    """Return h (n,): the return of driving ways (n,) [m] to the slot at a constant speed.

    The prize comes after way / speed, and each decision until then has its cost.
    """
    hurl, gamma = settings.hurl, settings.gamma
    decisions = np.asarray(ways, np.float64) / (hurl.speed * settings.decision_s)
    if gamma == 1.0:
        return hurl.prize - hurl.cost * decisions
    left = gamma**decisions
    return hurl.prize * left - hurl.cost * (1.0 - left) / (1.0 - gamma)


class Foretelling(VecEnvWrapper):
    """Vehicles that tell what their heuristic foretells of where they are.

    `bonus`: (1 - m) g, which a learner without a replay buffer gets in its rewards.
    """

    def __init__(self, vehicles: VecEnv, settings: Settings) -> None:
        """Wrap vehicles in a lot."""
        super().__init__(vehicles)
        self.bonus = 0.0
        self._settings = settings

    def reset(self) -> Any:
        """Begin new ways and return the observations of all vehicles."""
        return self.venv.reset()

    def step_wait(self) -> Any:
        """Move every world on by one decision."""
        seen, rewards, dones, infos = self.venv.step_wait()
        vehicles = self.unwrapped
        assert isinstance(vehicles, KartVecEnv)
        foretold = foretold_of(vehicles.batch.buffers.terms[:, :, GOAL_WAY].ravel(), self._settings)
        for number, info in enumerate(infos):
            if dones[number] and not info["TimeLimit.truncated"]:
                foretold[number] = 0.0
            info[FORETOLD] = foretold[number]
        if self.bonus:
            rewards = rewards + self.bonus * foretold
        return seen, rewards, dones, infos


class MixingBuffer(ReplayBuffer):
    """A replay buffer that adds what was foretold to the rewards when they are drawn.

    `bonus`: (1 - m) g, which may change while the buffer is filled.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        """Make an empty buffer; arguments are those of `ReplayBuffer`."""
        super().__init__(*args, **options)
        self.foretold = np.zeros_like(self.rewards)
        self.bonus = 0.0

    def add(self, *args: Any) -> None:
        """Add the transitions of one step; the last argument is what the step tells of each."""
        self.foretold[self.pos] = [info[FORETOLD] for info in args[-1]]
        super().add(*args)

    def _get_samples(
        self, batch_inds: NDArray[Any], env: VecNormalize | None = None
    ) -> ReplayBufferSamples:
        # From the generator that the learner seeds.
        columns = np.random.randint(0, self.n_envs, size=len(batch_inds))  # noqa: NPY002
        drawn = (batch_inds, columns)
        seen: Any = self._normalize_obs(self.observations[drawn], env)
        after: Any = self._normalize_obs(self.next_observations[drawn], env)
        rewards = self.rewards[drawn] + self.bonus * self.foretold[drawn]
        ended = self.dones[drawn] * (1.0 - self.timeouts[drawn])
        return ReplayBufferSamples(
            self.to_torch(seen),
            self.to_torch(self.actions[drawn]),
            self.to_torch(after),
            self.to_torch(ended.reshape(-1, 1).astype(np.float32)),
            self.to_torch(self._normalize_reward(rewards.reshape(-1, 1), env)),
        )


class Mixing(BaseCallback):
    """Raises the mixing from epoch to epoch of a training."""

    def __init__(self, settings: Settings, budget: Budget) -> None:
        """Follow the elapsed share of a training."""
        super().__init__()
        self._settings, self._budget = settings, budget

    def _on_rollout_start(self) -> None:
        learner: Any = self.model
        gamma, mixing = self._settings.gamma, mixing_at(self._budget.share, self._settings.hurl)
        learner.gamma, bonus = mixing * gamma, (1.0 - mixing) * gamma
        if isinstance(learner, PPO):
            learner.rollout_buffer.gamma = learner.gamma
            wrapper = unwrap_vec_wrapper(self.training_env, Foretelling)
            assert isinstance(wrapper, Foretelling)
            wrapper.bonus = bonus
        else:
            learner.replay_buffer.bonus = bonus

    def _on_step(self) -> bool:
        return True
