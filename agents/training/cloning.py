"""Cloning beside PPO: a policy imitates demonstrations while it learns by reward."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback

from race_agents.training.budget import Budget
from race_agents.training.demonstrations import pairs_for
from race_agents.training.normaliser import Normaliser
from race_agents.training.settings import Settings


class Cloning(BaseCallback):
    """Takes steps towards demonstrations between the rollouts of PPO.

    The steps have their optimiser, whose rate is a share of PPO's and falls evenly to zero:
    https://github.com/Unity-Technologies/ml-agents, behavioural cloning.
    """

    def __init__(self, settings: Settings, world: Normaliser, budget: Budget) -> None:
        """Read the demonstrations.

        Raises:
            RaceError: they are damaged, or do not fit the task.
        """
        super().__init__()
        self._wanted, self._world, self._budget = settings.cloning, world, budget
        self._rate = settings.algorithm.learning_rate
        seen, actions = pairs_for(settings, Path(settings.cloning.demonstrations))
        self._seen, self._actions = seen, torch.from_numpy(actions)
        self._chance = np.random.default_rng(settings.seed)
        self._optimiser: torch.optim.Optimizer | None = None

    @property
    def strength(self) -> float:
        """Share of PPO's first learning rate that a step has now."""
        left = 1.0 - self._budget.done / self._wanted.steps
        return self._wanted.strength * max(left, 0.0)

    def _on_rollout_start(self) -> None:
        policy: Any = self.model.policy
        if self.strength == 0.0 or not self._budget.done:
            return  # before the first rollout the means of observations are not known yet
        if not policy.action_net.weight.requires_grad:
            return  # the critic learns alone
        if self._optimiser is None:
            own = (*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters())
            self._optimiser = torch.optim.Adam(own)
        for group in self._optimiser.param_groups:
            group["lr"] = self._rate * self.strength
        for _ in range(self._wanted.lessons):
            rows = self._chance.integers(0, len(self._seen), self._wanted.batch_size)
            self._learn(policy, rows)

    def _learn(self, policy: Any, rows: Any) -> None:
        """Take one step towards the demonstrations of these rows, shape (n,)."""
        seen = torch.from_numpy(self._world.normalize_obs(self._seen[rows]))
        answers = policy.get_distribution(seen).distribution.mean
        loss: Any = ((answers - self._actions[rows]) ** 2).mean()
        assert self._optimiser is not None
        self._optimiser.zero_grad()
        loss.backward()
        self._optimiser.step()

    def _on_step(self) -> bool:
        return True
