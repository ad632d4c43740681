"""MA-POCA: PPO for agents that learn together and are paid together, of which some leave early.

Cohen et al., On the Use and Misuse of Absorbing States in Multi-agent Reinforcement Learning, 2021,
https://arxiv.org/abs/2111.05992. The actor, its steps and everything around it are those of PPO;
the critic is that of a group, see `group_critic.py`, and so is the return, see `group_rollout.py`.
With one agent it is PPO with another critic.
"""

from typing import Any, ClassVar, NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.vec_env import VecEnv
from torch.nn import functional

from race_agents.training.group_critic import GroupPolicy
from race_agents.training.group_rollout import Decision, GroupBatch, GroupRollout
from race_agents.training.reward_wrapper import numbers_of

Array = NDArray[Any]


class Losses(NamedTuple):
    """What a lesson makes smaller."""

    actor: torch.Tensor
    entropy: torch.Tensor  # minus the mean entropy of the actions
    critic: torch.Tensor  # mean of the squared errors of values and of baselines


class Poca(PPO):
    """MA-POCA. The vector environment has a property `active`, see `race_server.envs.sb3`."""

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = {"MlpPolicy": GroupPolicy}

    def __init__(
        self,
        policy: str,
        env: VecEnv,
        learning_rate: Any = 3e-4,
        n_steps: int = 2048,
        batch_size: int = 64,
        n_epochs: int = 10,
        gamma: float = 0.99,
        gae_lambda: float = 0.95,
        clip_range: float = 0.2,
        normalize_advantage: bool = True,
        ent_coef: float = 0.0,
        vf_coef: float = 0.5,
        max_grad_norm: float = 0.5,
        agents: int = 1,
        policy_kwargs: dict[str, Any] | None = None,
        seed: int | None = None,
        device: str = "cpu",
        tensorboard_log: str | None = None,
    ) -> None:
        """Learn from the agents of a vector environment, in groups of `agents` neighbours.

        The options are those of SB3's PPO. A batch has `batch_size` agents, of all groups together.
        """
        self.agents = agents
        super().__init__(
            policy,
            env,
            learning_rate=learning_rate,
            n_steps=n_steps,
            batch_size=batch_size,
            n_epochs=n_epochs,
            gamma=gamma,
            gae_lambda=gae_lambda,
            clip_range=clip_range,
            normalize_advantage=normalize_advantage,
            ent_coef=ent_coef,
            vf_coef=vf_coef,
            max_grad_norm=max_grad_norm,
            rollout_buffer_class=GroupRollout,
            rollout_buffer_kwargs={"agents": agents},
            policy_kwargs=policy_kwargs,
            seed=seed,
            device=device,
            tensorboard_log=tensorboard_log,
        )

    def collect_rollouts(
        self,
        env: VecEnv,
        callback: BaseCallback,
        rollout_buffer: RolloutBuffer,
        n_rollout_steps: int,
    ) -> bool:
        """Fill the rollout; return False if the callback ended the training."""
        world: Any = env
        rollout = _group(rollout_buffer)
        self.policy.set_training_mode(False)
        rollout.reset()
        callback.on_rollout_start()
        seen = self._last_obs  # a callback may have begun other rounds
        assert isinstance(seen, np.ndarray)
        assert self._last_episode_starts is not None
        if self._last_episode_starts.all():
            rollout.begin(world.active)
        for _ in range(n_rollout_steps):
            actions, log_probs = self._decide(seen)
            done = self._limited(actions)
            active = world.active
            after, rewards, dones, infos = env.step(done)
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            self._update_info_buffer(infos, dones)
            acted = numbers_of(done, self.action_space)
            rollout.keep(
                Decision(
                    *(seen, actions, acted, log_probs, active, rewards, dones, infos),
                    active_next=world.active,
                )
            )
            assert isinstance(after, np.ndarray)
            self._last_obs = seen = after
            self._last_episode_starts = dones
        rollout.conclude(self._policy.critic, seen, world.active)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    @property
    def _policy(self) -> GroupPolicy:
        assert isinstance(self.policy, GroupPolicy)
        return self.policy

    def _decide(self, seen: Array) -> tuple[Array, Array]:
        """Return actions (n, …) for observations (n, S), and logarithms of their densities."""
        with torch.no_grad():
            answers = self._policy.get_distribution(torch.from_numpy(seen))
            actions = answers.get_actions()
            return actions.numpy(), answers.log_prob(actions).numpy()

    def _limited(self, actions: Array) -> Array:
        space = self.action_space
        return np.clip(actions, space.low, space.high) if isinstance(space, spaces.Box) else actions

    def train(self) -> None:
        """Take the steps of one lesson on the rollout."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        told: list[Losses] = []
        for _ in range(self.n_epochs):
            for part in _group(self.rollout_buffer).batches(max(self.batch_size // self.agents, 1)):
                losses = self.losses(part)
                loss: Any = losses.actor + self.ent_coef * losses.entropy
                loss = loss + self.vf_coef * losses.critic
                self.policy.optimizer.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
                self.policy.optimizer.step()
                told.append(Losses(*(one.detach() for one in losses)))
        self._n_updates += self.n_epochs
        for name, values in zip(Losses._fields, zip(*told, strict=True), strict=True):
            self.logger.record(f"train/{name}", float(torch.stack(values).mean()))

    def losses(self, part: GroupBatch) -> Losses:
        """Return the losses of one batch; agents that are not active have none."""
        policy, active = self._policy, part.active
        answers = policy.get_distribution(part.seen[active])
        actions = part.actions[active]
        if isinstance(self.action_space, spaces.Discrete):
            actions = actions.long().flatten()
        log_probs = answers.log_prob(actions)
        entropies = answers.entropy()
        values, baselines = policy.critic.worths(part.seen, part.acted, active)
        wanted = part.returns[:, None].expand_as(baselines)
        errors = functional.mse_loss(values, part.returns)
        errors = errors + functional.mse_loss(baselines[active], wanted[active])
        return Losses(
            actor=self._actor_loss(log_probs - part.log_probs[active], part.advantages[active]),
            entropy=-(-log_probs if entropies is None else entropies).mean(),
            critic=0.5 * errors,
        )

    def _actor_loss(self, change: torch.Tensor, advantages: torch.Tensor) -> torch.Tensor:
        """Return PPO's clipped loss.

        change: (n,) of the logarithm of each action's density since it was drawn.
        """
        if self.normalize_advantage and len(advantages) > 1:
            advantages = (advantages - advantages.mean()) / (advantages.std() + 1e-8)
        clip: Any = self.clip_range
        most = clip(self._current_progress_remaining)
        ratio = change.exp()
        limited = ratio.clamp(1.0 - most, 1.0 + most)
        return -torch.min(advantages * ratio, advantages * limited).mean()


def _group(rollout: RolloutBuffer) -> GroupRollout:
    assert isinstance(rollout, GroupRollout)
    return rollout
