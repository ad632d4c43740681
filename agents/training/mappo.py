"""MAPPO: PPO whose critic knows the whole race, while the actor sees what its kart sees.

Yu et al., The Surprising Effectiveness of PPO in Cooperative Multi-Agent Games, 2022,
https://arxiv.org/abs/2103.01955. The critic takes what a kart sees and then the state of its race,
its own kart first, see `race_server.envs.sb3.KartVecEnv.race_states`. Everything else is `FastPpo`.
"""

from functools import partial
from typing import Any, ClassVar

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.policies import ActorCriticPolicy, BasePolicy
from stable_baselines3.common.torch_layers import create_mlp
from torch import nn

from race_agents.training.fast_ppo import FastPpo
from race_agents.training.gaussian_mlp import layers_of
from race_agents.training.reward_wrapper import width_of
from race_agents.training.stack import Rows
from race_server.errors import ScenarioError

LIMIT = 10.0  # of a normalised number, as that of what is seen
LEAST_DEVIATION = 1e-4


class CentralPolicy(ActorCriticPolicy):
    """An actor of what is seen, a critic of that and of S numbers of the race's state."""

    state_count: torch.Tensor
    state_mean: torch.Tensor
    state_squares: torch.Tensor

    def __init__(self, *arguments: Any, state_size: int, **options: Any) -> None:
        """Take the arguments of SB3's policy. state_size: S."""
        self.state_size = state_size
        super().__init__(*arguments, **options)

    def _build(self, lr_schedule: Any) -> None:
        layers: Any = self.net_arch
        self.net_arch = {"pi": layers, "vf": []}
        super()._build(lr_schedule)
        size = width_of(self.observation_space) + self.state_size
        network = nn.Sequential(*create_mlp(size, -1, list(layers), self.activation_fn))
        self.mlp_extractor.value_net = network
        self.add_module("value_net", nn.Linear(layers[-1], 1))
        for module, gain in ((network, np.sqrt(2.0)), (self.value_net, 1.0)):
            module.apply(partial(self.init_weights, gain=gain))
        # Running means of the state, which checkpoints keep with the parameters.
        self.register_buffer("state_count", torch.zeros((), dtype=torch.float64))
        self.register_buffer("state_mean", torch.zeros(self.state_size, dtype=torch.float64))
        self.register_buffer("state_squares", torch.zeros(self.state_size, dtype=torch.float64))
        # The one that was just made has the parameters of the network before.
        make: Any = self.optimizer_class
        self.optimizer = make(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)

    def learn_scale(self, states: Rows) -> None:
        """Count states (n, S) into their means and deviations."""
        rows = torch.from_numpy(states).double()
        mean, squares = rows.mean(0), ((rows - rows.mean(0)) ** 2).sum(0)
        count, more, off = self.state_count, len(rows), mean - self.state_mean
        total = count + more
        self.state_squares += squares + off**2 * (count * more / total)
        self.state_mean += off * (more / total)
        count += more

    def scaled(self, states: Rows) -> Rows:
        """Return states (n, S) with mean 0 and deviation 1."""
        spread = (self.state_squares / self.state_count.clamp(min=1.0)).sqrt().numpy()
        off = (states - self.state_mean.numpy()) / np.maximum(spread, LEAST_DEVIATION)
        return np.clip(off, -LIMIT, LIMIT).astype(np.float32)


class Mappo(FastPpo):
    """MAPPO. The vector environment has `race_states`, see `race_server.envs.sb3`."""

    policy_aliases: ClassVar[dict[str, type[BasePolicy]]] = {"MlpPolicy": CentralPolicy}

    def _setup_model(self) -> None:
        for name, is_set in (("clip_range_vf", self.clip_range_vf), ("use_sde", self.use_sde)):
            if is_set:
                raise ScenarioError(f"algorithm mappo takes no option {name}; leave it out")
        world: Any = self.env
        size = world.race_states.shape[1]
        self.policy_kwargs["state_size"] = size
        super()._setup_model()
        if layers_of(self.policy) is None or not isinstance(self.action_space, spaces.Box):
            raise ScenarioError("algorithm mappo: its actions are numbers, not choices; take ppo")
        both = spaces.Box(-np.inf, np.inf, (width_of(self.observation_space) + size,), np.float32)
        self.rollout_buffer = RolloutBuffer(
            self.n_steps,
            both,
            self.action_space,
            device=self.device,
            gamma=self.gamma,
            gae_lambda=self.gae_lambda,
            n_envs=self.n_envs,
        )

    def _known(self, env: Any, seen: Rows) -> Rows:
        policy: Any = self.policy
        states = env.race_states
        policy.learn_scale(states)
        return np.concatenate([seen, policy.scaled(states)], axis=1)

    def _known_at_last(
        self, known: Rows, numbers: NDArray[np.intp] | list[int], last: Rows
    ) -> Rows:
        # The race has gone on, perhaps from the grid: its state is that of one decision before.
        return np.concatenate([last, known[numbers, last.shape[1] :]], axis=1)
