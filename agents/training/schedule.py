"""What changes while a policy learns by reward: who learns, and how much is tried out."""

from typing import Any

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents.training.pace import Pace
from agents.training.settings import Settings


class Schedule(BaseCallback):
    """PPO after a warm start: first its critic alone learns; and the actions' deviation falls."""

    def __init__(self, settings: Settings, pace: Pace) -> None:
        """Go by the elapsed share of a training."""
        super().__init__()
        self._pace = pace
        warm, network = settings.warm_start, settings.network
        self._begin = warm.share if warm.is_wanted else 0.0
        self._critic_until = self._begin + warm.critic_share if warm.is_wanted else 0.0
        self._first = warm.log_std if warm.is_wanted else network.log_std
        self._last = network.last_log_std

    def _on_rollout_start(self) -> None:
        if not isinstance(self.model, PPO):
            return
        share = self._pace.share
        policy: Any = self.model.policy
        actor = [*policy.mlp_extractor.policy_net.parameters(), *policy.action_net.parameters()]
        deviation = getattr(policy, "log_std", None)  # discrete actions have none
        for parameter in actor if deviation is None else [*actor, deviation]:
            parameter.requires_grad_(share >= self._critic_until)
        if deviation is not None and self._last is not None:
            elapsed = (share - self._begin) / max(1.0 - self._begin, 1e-9)
            most = self._first + max(elapsed, 0.0) * (self._last - self._first)
            deviation.data.clamp_(max=most)

    def _on_step(self) -> bool:
        return True
