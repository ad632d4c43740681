"""Karts of one policy in races in which several policies learn.

All policies share one batch. Each learns in its thread, with the learner that it would have alone,
but one thread runs at a time and in a fixed order, so that the same settings give the same
policies: each decides for its karts in turn, and the last of them moves the races on.
"""

import threading
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from race_agents.training.policy_settings import PolicySettings
from race_agents.training.settings import Settings
from race_agents.training.tasks import training_task
from race_server.core.observation import layout_of
from race_server.envs.action_shapes import finite
from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER
from race_server.envs.global_state import own_states
from race_server.envs.rewards import weights_of
from race_server.envs.sb3 import KartVecEnv
from race_server.envs.spaces import action_space, masks_for, observation_space
from race_server.envs.task import Task

Array = NDArray[Any]


class OtherEnded(Exception):  # noqa: N818  # it ends a thread, and is no error of that thread
    """Another policy ended with an error, so that this one cannot go on."""


@dataclass
class Turns:
    """Lets one of several threads run at a time, in the order of their numbers."""

    count: int
    stopped: bool = False  # by a person
    failed: bool = False
    _present: list[int] = field(init=False)
    _gates: list[threading.Semaphore] = field(init=False)

    def __post_init__(self) -> None:
        """Let all wait but the first."""
        self._present = list(range(self.count))
        self._gates = [threading.Semaphore(int(number == 0)) for number in self._present]

    def wait(self, number: int) -> None:
        """Wait until it is this thread's turn."""
        self._gates[number].acquire()

    def pass_on(self, number: int) -> None:
        """Let the next one run."""
        place = self._present.index(number)
        self._gates[self._present[(place + 1) % len(self._present)]].release()

    def is_last(self, number: int) -> bool:
        """Return whether all others have had their turn."""
        return number == self._present[-1]

    def leave(self, number: int) -> None:
        """Let the next one run, and never this thread again."""
        self.pass_on(number)
        self._present.remove(number)


def shared_task(settings: Settings) -> Task:
    """Return the task of races in which several policies learn: it shows what any of them sees.

    Raises:
        RaceError: the settings are not valid.
    """
    rays = settings.lidar.rays
    views = [layout_of(one.observation or settings.observation, rays) for one in settings.policies]
    parts = tuple(dict.fromkeys(name for view in views for name in view.slices))
    return training_task(settings.model_copy(update={"observation": parts}))


class SharedRaces:
    """The batch in which several policies learn, and whose turn it is."""

    def __init__(self, settings: Settings, seed: int | None = None) -> None:
        """Build the batch of settings with `policies`. seed: default: that of the settings.

        Raises:
            RaceError: the settings are not valid.
        """
        self.batch = Batch(
            shared_task(settings),
            worlds=settings.worlds,
            seed=settings.seed if seed is None else seed,
            after=REENTER,
            threads=settings.threads,
        )
        self.turns = Turns(len(settings.policies))

    def decide(self, number: int, karts: range, actions: Array) -> None:
        """Put the actions of karts into the batch, and wait until all races are a decision on.

        Raises:
            ScenarioError: they are no numbers, as this policy has diverged.
            KeyboardInterrupt: a person stopped all policies.
            OtherEnded: another policy failed.
        """
        finite(actions)  # before they are among those of policies that have not diverged
        mine = self.batch.buffers.actions[:, karts.start : karts.stop]
        mine[...] = actions.reshape(mine.shape)
        self._move_on(number)
        self.turns.pass_on(number)
        self.turns.wait(number)
        if self.turns.failed:
            raise OtherEnded
        if self.turns.stopped:
            raise KeyboardInterrupt

    def leave(self, number: int, karts: range) -> None:
        """Let the other policies go on; these karts roll from now on."""
        self.batch.buffers.actions[:, karts.start : karts.stop] = 0.0
        self._move_on(number)
        self.turns.leave(number)

    def _move_on(self, number: int) -> None:
        if self.turns.is_last(number) and not self.turns.failed:
            self.batch.step()


class Seats(KartVecEnv):
    """The karts of one policy, with its own observation and reward, as W · L environments."""

    def __init__(self, races: SharedRaces, settings: Settings, number: int) -> None:
        """Take the seats of one of the policies of settings."""
        batch, policy = races.batch, settings.policies[number]
        first = sum(one.karts for one in settings.policies[:number])
        layout = layout_of(policy.observation or settings.observation, settings.lidar.rays)
        whole = batch.layout.slices
        self.batch, self.races, self.number = batch, races, number
        self.karts = range(first, first + policy.karts)
        self.curriculum = None
        self._places = np.concatenate(
            [np.arange(whole[name].start, whole[name].stop) for name in layout.slices]
        )
        self._weights = _weights(settings, policy, batch)
        self._team = policy.team
        VecEnv.__init__(
            self,
            batch.worlds * policy.karts,
            observation_space(layout),
            action_space(batch.task.action),
        )
        self._totals = np.zeros((batch.worlds, policy.karts))
        self._actions: Array = np.zeros(0)
        self._since()

    @property
    def active(self) -> NDArray[np.bool_]:
        """Which karts are in an episode, shape (n,)."""
        active: NDArray[np.bool_] = self._mine(self.batch.buffers.idle).ravel() == 0
        return active

    @property
    def race_states(self) -> Array:
        """What is known of the race of each kart, see `KartVecEnv.race_states`."""
        return own_states(self.batch.world, self.karts)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which discrete actions of each kart count, shape (n, 15)."""
        return masks_for(self.action_space, self._mine(self.batch.buffers.idle).ravel())

    def reset(self) -> Array:
        """Return what the karts see: the races of all policies go on."""
        self._reset_seeds()
        return self._seen()

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Move the races on once all policies have decided."""
        self.races.decide(self.number, self.karts, self._actions)
        cut = self._mine(self.batch.truncated).ravel()
        dones = (self._mine(self.batch.terminated).ravel() | cut).astype(np.bool_)
        rewards = self._mine(self.batch.buffers.terms) @ self._weights
        rewards += self._team * (rewards.mean(axis=1, keepdims=True) - rewards)
        self._totals += rewards
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for number in np.flatnonzero(dones):
            infos[number] = self._last_words(int(number), truncated=bool(cut[number]))
        self._totals[dones.reshape(self._totals.shape)] = 0.0
        return self._seen(), rewards.ravel().astype(np.float32), dones, infos

    def _mine(self, rows: Array) -> Array:
        """Return the rows (W, L, …) of this policy's karts of those of all, (W, karts, …)."""
        return rows[:, self.karts.start : self.karts.stop]

    def _seen(self) -> Array:
        seen = self._mine(self.batch.observations)[..., self._places]
        return seen.reshape(self.num_envs, -1)

    def _last_words(self, number: int, *, truncated: bool) -> dict[str, Any]:
        w, place = divmod(number, len(self.karts))
        told = self._told(w, self.karts[place], truncated=truncated)
        told["terminal_observation"] = told["terminal_observation"][self._places]
        told["episode"]["r"] = float(self._totals[w, place])
        return told

    def close(self) -> None:
        """Leave the batch to the other policies."""


def _weights(settings: Settings, policy: PolicySettings, batch: Batch) -> Array:
    discipline = batch.task.discipline
    reward = policy.reward or settings.reward
    return weights_of(reward, discipline.terms, discipline.rewards)
