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
        self._begin = warm.end
        self._critic_until = warm.end + warm.critic_share if warm.is_wanted else 0.0
        self._first = warm.log_std if warm.is_wanted else network.log_std
        self._last = network.last_log_std

    def _on_rollout_start(self) -> None:
        if not isinstance(self.model, PPO):
            return
        share = self._pace.share
        policy: Any = self.model.policy
        for network in (policy.mlp_extractor.policy_net, policy.action_net):
            network.requires_grad_(share >= self._critic_until)
        deviation = getattr(policy, "log_std", None)  # discrete actions have none
        if deviation is None:
            return
        # A deviation that is learned falls so soon that nothing new is tried out any more.
        deviation.requires_grad_(self._last is None and share >= self._critic_until)
        if self._last is not None:
            elapsed = self._pace.share_since(self._begin)
            deviation.data.fill_(self._first + elapsed * (self._last - self._first))

    def _on_step(self) -> bool:
        return True
