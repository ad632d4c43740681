"""A part of a training's races, run wherever there is a core: decisions come back, not steps.

A runner has the learner of the settings with fewer worlds, gets the parameters before each rollout,
and collects as the learner itself would. `far_ppo.py` asks several of them, on this machine or on
others.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.running_mean_std import RunningMeanStd

from race_agents.training.budget import Budget
from race_agents.training.learner import learner_of, world_of
from race_agents.training.normaliser import Normaliser, restore_means, state_of
from race_agents.training.settings import Settings

Array = NDArray[Any]
# Arrays of a rollout buffer, (T, n, …).
KEPT = (
    *("observations", "actions", "rewards", "episode_starts"),
    *("values", "log_probs", "advantages", "returns"),
)
SB3_STEPS = 2048  # of a rollout, by default


class Moments(NamedTuple):
    """Mean and variance of rows that were seen, and their number."""

    mean: Array
    variance: Array
    rows: float


@dataclass(frozen=True)
class Parameters:
    """What a runner needs of the learner for a rollout, as plain arrays."""

    policy: dict[str, Array]
    seen: dict[str, Array]  # running means of observations,
    returns: dict[str, Array]  # and of returns


@dataclass(frozen=True)
class Rollout:
    """What a runner brings back."""

    arrays: dict[str, Array]  # of KEPT
    episodes: list[dict[str, Any]]  # figures of those that ended, the last hundred
    seen: Moments  # of this rollout alone
    returns: Moments


def parameters_of(learner: Any, world: Normaliser) -> Parameters:
    """Return the parameters of a learner and of its normalisation."""
    seen: Any = world.obs_rms
    policy = {name: value.numpy() for name, value in learner.policy.state_dict().items()}
    return Parameters(policy, _arrays(seen), _arrays(world.ret_rms))


def _arrays(means: RunningMeanStd) -> dict[str, Array]:
    return {name: value.numpy() for name, value in state_of(means).items()}


def moments_since(before: Moments, means: RunningMeanStd) -> Moments:
    """Return the moments of the rows that means were updated with since they were `before`."""
    count = means.count - before.rows
    mean = (means.mean * means.count - before.mean * before.rows) / count
    off = mean - before.mean
    shared = before.rows * count / means.count
    squares = means.var * means.count - before.variance * before.rows - off * off * shared
    return Moments(mean, np.maximum(squares / count, 0.0), count)


class _Silent(BaseCallback):
    def _on_step(self) -> bool:
        return True


class Runner:
    """Collects rollouts of some worlds."""

    def __init__(self, settings: Settings, worlds: int, seed: int) -> None:
        """Build `worlds` worlds of settings, of which the first has this seed.

        Raises:
            RaceError: the settings are not valid.
        """
        own = settings.model_copy(update={"worlds": worlds, "seed": seed, "threads": 1})
        budget = Budget.of(own)
        self.world = world_of(own, budget)
        self._seen: Any = self.world.obs_rms
        # One batch of all: it learns from none.
        rows = int(own.algorithm.options.get("n_steps", SB3_STEPS)) * self.world.num_envs
        self.learner = learner_of(own, self.world, budget, None, {"batch_size": rows})
        # What SB3 makes at the beginning of `learn`; the first means are those that it is sent.
        self.world.training = False
        _, self._callback = self.learner._setup_learn(1, _Silent())
        self.world.training = self._is_new = True

    def collect(self, parameters: Parameters) -> Rollout:
        """Return a rollout of a learner with these parameters."""
        learner, seen = self.learner, self._seen
        tensors = {name: torch.tensor(value) for name, value in parameters.policy.items()}
        learner.policy.load_state_dict(tensors)
        self._restore(parameters)
        before = self._moments()
        learner.ep_info_buffer.clear()
        if self._is_new:
            self._begin(seen)
        learner.collect_rollouts(
            self.world, self._callback, learner.rollout_buffer, learner.n_steps
        )
        buffer = learner.rollout_buffer
        return Rollout(
            {name: getattr(buffer, name).copy() for name in KEPT},
            list(learner.ep_info_buffer),
            moments_since(before[0], seen),
            moments_since(before[1], self.world.ret_rms),
        )

    def _begin(self, means: Any) -> None:
        """See the first observations, by the means that the learner has; it may have none yet."""
        first = self.world.get_original_obs()
        if means.count < 1.0:
            means.update(first)
        self.learner._last_obs = self.world.normalize_obs(first)
        self._is_new = False

    def _restore(self, parameters: Parameters) -> None:
        for means, numbers in (
            (self._seen, parameters.seen),
            (self.world.ret_rms, parameters.returns),
        ):
            restore_means(means, {name: torch.tensor(value) for name, value in numbers.items()})

    def _moments(self) -> tuple[Moments, Moments]:
        pair = (self._seen, self.world.ret_rms)
        first, second = (Moments(one.mean.copy(), np.copy(one.var), one.count) for one in pair)
        return first, second

    def close(self) -> None:
        """End the worlds."""
        self.world.close()
