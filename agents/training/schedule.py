"""What changes while a policy learns by reward: which networks learn, and the exploration."""

from typing import Any

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from race_agents.training.budget import Budget
from race_agents.training.settings import Settings
from race_agents.training.settings_table import Deviations
from race_server.errors import ScenarioError


def deviations(wanted: Deviations, like: torch.Tensor) -> torch.Tensor:
    """Return the logarithm of the deviation of each number of an action, shape (A,).

    like: (A,) those that a policy has.

    Raises:
        ScenarioError: their number does not fit the action.
    """
    logarithms = torch.as_tensor(wanted, dtype=like.dtype)
    if logarithms.ndim and logarithms.shape != like.shape:
        raise ScenarioError(
            f"log_std = {list(logarithms.tolist())}: the action has {len(like)} numbers; give as "
            "many, or one for all of them"
        )
    return logarithms.expand_as(like)


class Schedule(BaseCallback):
    """PPO after a warm start: its critic learns alone at first, and the deviation falls."""

    def __init__(self, settings: Settings, budget: Budget) -> None:
        """Follow the elapsed share of a training."""
        super().__init__()
        self._budget = budget
        warm, network = settings.warm_start, settings.network
        self._begin = warm.end
        self._critic_until = warm.critic_end
        self._told = warm.log_std if warm.policy else None  # of a policy that no one imitated
        self._first: Deviations = network.log_std if self._told is None else self._told
        if warm.is_wanted:
            self._first = warm.imitated_log_std
        self._last = network.last_log_std

    def _on_rollout_start(self) -> None:
        if not isinstance(self.model, PPO):
            return
        share = self._budget.share
        policy: Any = self.model.policy
        for network in (policy.mlp_extractor.policy_net, policy.action_net):
            network.requires_grad_(share >= self._critic_until)
        deviation = getattr(policy, "log_std", None)  # discrete actions have none
        if deviation is None:
            return
        # A learned deviation falls so soon that exploration ends.
        deviation.requires_grad_(self._last is None and share >= self._critic_until)
        if self._last is not None:
            elapsed = self._budget.share_since(self._begin)
            first, last = (deviations(each, deviation) for each in (self._first, self._last))
            deviation.data.copy_(first + elapsed * (last - first))
        elif self._told is not None and not self._budget.done:
            deviation.data.copy_(deviations(self._told, deviation))

    def _on_step(self) -> bool:
        return True
