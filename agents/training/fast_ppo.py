"""PPO as Stable-Baselines3 has it, with the same lessons in less time.

It draws the same actions and minibatches from the same seed, and takes the same steps up to
rounding: SB3's class (`ppo-sb3`) is the reference that a test compares it with. Where a policy is
not made of dense layers with a Gaussian answer, SB3's own code does the work.
"""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.utils import explained_variance
from stable_baselines3.common.vec_env import VecEnv
from threadpoolctl import threadpool_limits
from torch import nn

from race_agents.training.gaussian_mlp import (
    HALF_LOG_TAU,
    GaussianMlp,
    Lesson,
    Told,
    layers_of,
)
from race_agents.training.stack import Rows

LEAST_ROWS = 512  # of a part: below it waiting for other threads costs more than it saves


class FastPpo(PPO):
    """PPO whose gradients are written out, on several threads."""

    def __init__(
        self, *arguments: Any, threads: int = 1, halves: bool = False, **options: Any
    ) -> None:
        """Take SB3's options.

        threads: that learn from one minibatch together: two teach actor and critic, four do so for
        each half of it, and so on; halves: inner products are of bfloat16.
        """
        # These threads are all: a product of matrices must not ask for more.
        threadpool_limits(1, "blas")
        self.threads, self.halves = threads, halves
        self._pool: ThreadPoolExecutor | None = None
        self._parts: list[GaussianMlp] = []
        self._gradients: list[tuple[nn.Parameter, torch.Tensor]] = []
        super().__init__(*arguments, **options)

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "_pool", "_parts", "_gradients"]

    def _networks(self) -> list[GaussianMlp]:
        """Return actor and critic for each thread; none where SB3 is to do the work."""
        found = layers_of(self.policy)
        if found is None or self.clip_range_vf is not None or self.device.type != "cpu":
            return []
        if type(self.rollout_buffer) is not RolloutBuffer:
            return []
        actor, critic = found
        first = self._parts[0].actor.layers[0].weight if self._parts else None
        if first is None or first.ctypes.data != actor[0].weight.ctypes.data:
            # New parameters, or those of a checkpoint in other memory.
            rows = max(self.batch_size, self.n_envs)
            self._parts = [
                GaussianMlp(actor, critic, rows, halves=self.halves)
                for _ in range(max(self.threads // 2, 1))
            ]
            self._gradients = self._gradients_of(self._parts[0])
            if type(self.policy.optimizer) is torch.optim.Adam:
                # One call for all parameters, with the same steps.
                self.policy.optimizer.param_groups[0]["fused"] = True
        if self.threads > 1 and self._pool is None:
            self._pool = ThreadPoolExecutor(self.threads - 1)  # beside the one that asks
        return self._parts

    def collect_rollouts(
        self, env: VecEnv, callback: Any, rollout_buffer: Any, n_rollout_steps: int
    ) -> bool:
        """Fill the buffer with decisions of the policy; return False where a callback ends it."""
        networks = self._networks()
        if not networks:
            return super().collect_rollouts(env, callback, rollout_buffer, n_rollout_steps)
        self.policy.set_training_mode(False)
        rollout_buffer.reset()
        callback.on_rollout_start()
        seen: Any = self._last_obs  # a callback may have begun other races
        networks[0].renew()  # after what else may have taught them
        space: Any = self.action_space
        dones: Any = None
        for _ in range(n_rollout_steps):
            known = self._known(env, seen)
            actions, values, log_chances = self._draw(networks[0], known)
            after, rewards, dones, infos = env.step(np.clip(actions, space.low, space.high))
            self.num_timesteps += env.num_envs
            callback.update_locals(locals())
            if not callback.on_step():
                return False
            ended = np.flatnonzero(dones).tolist()
            self._update_info_buffer([infos[number] for number in ended])
            self._value_what_was_cut(networks[0], rewards, known, [(n, infos[n]) for n in ended])
            starts: Any = self._last_episode_starts
            rollout_buffer.add(
                known, actions, rewards, starts, *map(torch.from_numpy, (values, log_chances))
            )
            self._last_episode_starts = dones
            self._last_obs = seen = after  # type: ignore[assignment]  # one box, hence one array
        known = self._known(env, seen)
        last = networks[0].value(known)
        rollout_buffer.compute_returns_and_advantage(torch.from_numpy(last), dones)
        callback.update_locals(locals())
        callback.on_rollout_end()
        return True

    def _known(self, env: Any, seen: Rows) -> Rows:
        """Return what the critic knows (n, …): what the agents see (n, S), and perhaps more."""
        return seen

    def _known_at_last(self, known: Rows, numbers: list[int], last: Rows) -> Rows:
        """Return what it knows of what agents saw last. known: (n, …) before that decision."""
        return last

    def _draw(self, network: GaussianMlp, known: Rows) -> tuple[Rows, Rows, Rows]:
        """Return actions (n, A), values (n,) and the logarithms of the actions' chances (n,)."""
        log_spread = self.policy.log_std.data.numpy()

        def draw() -> tuple[Rows, Rows]:
            means = network.act(known)
            noise = torch.randn(means.shape).numpy()  # the numbers that SB3's distribution draws
            squares = np.square(noise).sum(axis=1)
            log_chances = -0.5 * squares - np.float32((log_spread + HALF_LOG_TAU).sum())
            return means + noise * np.exp(log_spread), log_chances

        (actions, log_chances), values = self._together([draw, partial(network.value, known)])
        return actions, values, log_chances

    def _together(self, jobs: Sequence[Callable[[], Any]]) -> list[Any]:
        """Return what jobs return, the first of which is done here, the others by the pool."""
        if self._pool is None:
            return [job() for job in jobs]
        first, *others = jobs
        waiting = [self._pool.submit(job) for job in others]
        return [first(), *(each.result() for each in waiting)]

    def _value_what_was_cut(
        self,
        network: GaussianMlp,
        rewards: Rows,
        known: Rows,
        ended: list[tuple[int, dict[str, Any]]],
    ) -> None:
        """Add to rewards what episodes that time alone ended were still worth."""
        cut = [(n, info) for n, info in ended if info.get("TimeLimit.truncated", False)]
        if cut:
            last = np.stack([info["terminal_observation"] for _, info in cut])
            numbers = [n for n, _ in cut]
            rows = self._known_at_last(known, numbers, last.astype(np.float32))
            rewards[numbers] += self.gamma * network.value(rows)

    def train(self) -> None:
        """Take the gradient steps of one rollout."""
        networks = self._networks()
        if not networks:
            super().train()
            return
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        for network in networks:
            network.renew()
        limit: Any = self.clip_range
        clip = float(limit(self._current_progress_remaining))
        told: list[Told] = []
        for _ in range(self.n_epochs):
            self._n_updates += 1
            if not all(self._step(rows, networks, clip, told) for rows in self._minibatches()):
                break
        self._log(told, clip)

    def _minibatches(self) -> Iterator[NDArray[np.int64]]:
        """Yield the rows of each minibatch of an epoch, drawn as SB3's buffer does."""
        buffer: Any = self.rollout_buffer
        size = buffer.buffer_size * buffer.n_envs
        order = np.random.permutation(size)  # noqa: NPY002  # the generator that SB3 seeds
        if not buffer.generator_ready:
            names = ("observations", "actions", "values", "log_probs", "advantages", "returns")
            for name in names:
                buffer.__dict__[name] = buffer.swap_and_flatten(buffer.__dict__[name])
            buffer.generator_ready = True
        for first in range(0, size, self.batch_size):
            yield order[first : first + self.batch_size]

    def _step(
        self,
        rows: NDArray[np.int64],
        networks: list[GaussianMlp],
        clip: float,
        told: list[Told],
    ) -> bool:
        """Take one gradient step; return whether to go on, as `target_kl` says."""
        buffer: Any = self.rollout_buffer
        gains = buffer.advantages.take(rows)
        if self.normalize_advantage and len(rows) > 1:
            gains = (gains - gains.mean()) / (gains.std(ddof=1) + np.float32(1e-8))
        log_spread = self.policy.log_std.data.numpy()
        parts = max(min(len(networks), len(rows) // LEAST_ROWS), 1)
        edges = np.linspace(0, len(rows), parts + 1).astype(int)
        jobs: list[Callable[[], Told]] = []
        for network, (first, last) in zip(networks, pairwise(edges), strict=False):
            chosen = rows[first:last]
            lesson = Lesson(
                known=buffer.observations.take(chosen, axis=0).reshape(len(chosen), -1),
                acted=buffer.actions.take(chosen, axis=0),
                advantages=gains[first:last],
                returns=buffer.returns.take(chosen),
                log_chances=buffer.log_probs.take(chosen),
                share=1.0 / len(rows),
            )
            jobs.append(partial(network.teach_actor, lesson, log_spread, clip))
            jobs.append(partial(network.teach_critic, lesson, self.vf_coef))
        found = self._together(jobs)
        total = Told(*(sum(values) for values in zip(*map(_numbers, found), strict=True)))
        told.append(total)
        if self.target_kl is not None and total.change > 1.5 * self.target_kl:
            return False
        self._descend(networks[:parts])
        return True

    def _descend(self, networks: list[GaussianMlp]) -> None:
        """Add the gradients of all parts up, and let the optimiser take a step."""
        first, *others = networks
        for other in others:
            for mine, theirs in zip(first.gradients, other.gradients, strict=True):
                np.add(mine, theirs, out=mine)
        spread = first.spread_gradient
        np.subtract(spread, np.float32(self.ent_coef), out=spread)
        for parameter, gradient in self._gradients:  # an optimiser steps whatever has a gradient
            parameter.grad = gradient if parameter.requires_grad else None
        torch.nn.utils.clip_grad_norm_([one for one, _ in self._gradients], self.max_grad_norm)
        self.policy.optimizer.step()
        for network in self._parts:
            network.renew()

    def _gradients_of(self, network: GaussianMlp) -> list[tuple[nn.Parameter, torch.Tensor]]:
        """Return the policy's parameters with their gradients, in the memory of a network."""
        policy: Any = self.policy
        actor = [*policy.mlp_extractor.policy_net, policy.action_net]
        critic = [*policy.mlp_extractor.value_net, policy.value_net]
        modules = [*actor[::2], *critic[::2]]
        parameters = [policy.log_std, *(each for one in modules for each in (one.weight, one.bias))]
        return list(zip(parameters, map(torch.from_numpy, network.gradients), strict=True))

    def _log(self, told: list[Told], clip: float) -> None:
        """Record what SB3 records."""
        buffer: Any = self.rollout_buffer
        policy_loss, value_loss, change, clipped = np.mean([_numbers(one) for one in told], axis=0)
        spread = self.policy.log_std.data.numpy()
        entropy = float((spread + HALF_LOG_TAU + 0.5).sum())
        loss = policy_loss + self.vf_coef * value_loss - self.ent_coef * entropy
        variance = explained_variance(buffer.values.flatten(), buffer.returns.flatten())
        for name, value in {
            "entropy_loss": -entropy,
            "policy_gradient_loss": policy_loss,
            "value_loss": value_loss,
            "approx_kl": change,
            "clip_fraction": clipped,
            "loss": loss,
            "explained_variance": variance,
            "std": float(np.exp(spread).mean()),
        }.items():
            self.logger.record(f"train/{name}", value)
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")
        self.logger.record("train/clip_range", clip)


def _numbers(told: Told) -> tuple[float, float, float, float]:
    return told.policy_loss, told.value_loss, told.change, told.clipped
