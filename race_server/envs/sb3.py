"""Stable-Baselines3's vector environment on a batch; needs the extra `train`."""

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from race_server.envs.batch import Batch, Curriculum
from race_server.envs.global_state import own_states
from race_server.envs.round_options import RoundOptions
from race_server.envs.spaces import action_space, masks_for, observation_space
from race_server.envs.task import Task
from race_server.envs.vector import after_an_episode
from race_server.errors import ScenarioError

Array = NDArray[Any]


class KartVecEnv(VecEnv):
    """W races of L learning karts as W · L environments.

    Each kart gets its `done` at its own step, with `terminal_observation`,
    `TimeLimit.truncated`, and an `episode` like that of SB3's Monitor, with the figures of the
    task's discipline. Alone in its race a kart begins a new one then; among others it comes back
    into it, and in a lot it waits until all are done.
    """

    def __init__(
        self,
        task: Task,
        *,
        worlds: int = 1,
        seed: int = 0,
        threads: int = 1,
        curriculum: Curriculum | None = None,
    ) -> None:
        """Build the batch.

        curriculum: asked before races begin and whenever episodes have ended, with the number of
        decisions so far and the figures of those episodes, for the weights of the task's
        scenarios; None keeps them.

        Raises:
            ScenarioError, DriverError: the task makes no race.
        """
        learners = task.count_learners()
        self.batch = Batch(
            task, worlds=worlds, seed=seed, after=after_an_episode(learners), threads=threads
        )
        super().__init__(
            worlds * learners, observation_space(self.batch.layout), action_space(task.action)
        )
        self.seed(seed)  # the first reset begins with it, as after a call of `seed`
        self.curriculum = curriculum
        self._decisions = 0
        self._actions: Array = np.zeros(0)
        self._since()

    def _since(self) -> None:
        """Count the time of episodes from now on."""
        self._begun = time.monotonic()

    def reset(self) -> Array:
        """Begin new races and return what all karts see, shape (n, size).

        Options are those of `set_options`, as for `Batch.reset`; karts of a race share them.

        Raises:
            ScenarioError: the task has not what they ask for, or karts of one race ask for two
                things.
        """
        asked = self._asked_of_worlds()
        self._ask([])
        first = self._seeds[0]
        if all(each == asked[0] for each in asked):
            self.batch.reset(first, self._options[0])
        else:
            for w in range(self.batch.worlds):
                seeds = None if first is None else [first + w]
                self.batch.reset(seeds, self._options[w * self.batch.learners], [w])
        self._reset_seeds()
        self._reset_options()
        return self._seen()

    def _asked_of_worlds(self) -> list[RoundOptions]:
        """Return what `set_options` asked of each race."""
        learners, asked = self.batch.learners, [RoundOptions.of(each) for each in self._options]
        if len(asked) != self.num_envs:
            raise ScenarioError(f"options of {len(asked)} karts for {self.num_envs}: give as many")
        for number, each in enumerate(asked):
            if each != asked[number - number % learners]:
                raise ScenarioError(
                    f"options of kart {number} are others than those of kart "
                    f"{number - number % learners}, which is in the same race: give the same"
                )
        return asked[::learners]

    def change(self, task: Task, seed: int) -> None:
        """Race another task with as many learning karts from now on; `reset` comes next.

        How often each scenario is drawn stays as it was, where there are as many.
        """
        before = self.batch
        self.batch = Batch(
            task,
            worlds=before.worlds,
            seed=seed,
            after=after_an_episode(before.learners),
            threads=before.threads,
        )
        if self.batch.buffers.odds.shape == before.buffers.odds.shape:
            self.batch.buffers.odds[:] = before.buffers.odds
        self.seed(seed)
        before.close()

    @property
    def active(self) -> NDArray[np.bool_]:
        """Which karts are in an episode, and not waiting for the others', shape (n,)."""
        active: NDArray[np.bool_] = self.batch.buffers.idle.ravel() == 0
        return active

    @property
    def race_states(self) -> Array:
        """What is known of the race of each kart, shape (n, S): see `global_state.names_of`.

        The tick is followed by its own kart, then by all others in the order of their numbers.
        """
        return own_states(self.batch.world, range(self.batch.learners))

    def step_async(self, actions: Array) -> None:
        """Take the actions of all karts, shape (n, A)."""
        self._actions = actions

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Move every race on by one decision."""
        batch = self.batch
        batch.step(self._actions)
        self._decisions += self.num_envs
        cut = batch.truncated.ravel()
        dones = (batch.terminated.ravel() | cut).astype(np.bool_)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        ended = np.flatnonzero(dones)
        for number in ended:
            infos[number] = self._last_words(int(number), truncated=bool(cut[number]))
        if len(ended):
            self._ask([infos[number]["episode"] for number in ended])
        return self._seen(), batch.rewards.ravel().copy(), dones, infos

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which discrete actions of each kart count, shape (n, 15)."""
        return masks_for(self.action_space, self.batch.buffers.idle.ravel())

    def save_state(self) -> bytes:
        """Return the state of all races, see `Batch.save_state`."""
        return self.batch.save_state()

    def load_state(self, state: bytes) -> Array:
        """Put all races into a saved state, of as many or of one; return the observations."""
        self.batch.load_state(state)
        return self._seen()

    def _ask(self, episodes: Sequence[dict[str, Any]]) -> None:
        """Ask the curriculum how often each scenario is drawn from now on."""
        if self.curriculum is None:
            return
        weights = self.curriculum(self._decisions, episodes)
        if weights is not None:
            self.batch.set_odds(weights)

    def _seen(self) -> Array:
        # SB3 stores the observation before the step after the step: it needs its own copy.
        return self.batch.observations.reshape(self.num_envs, -1).copy()

    def _last_words(self, number: int, *, truncated: bool) -> dict[str, Any]:
        return self._told(*divmod(number, self.batch.learners), truncated=truncated)

    def _told(self, w: int, k: int, *, truncated: bool) -> dict[str, Any]:
        """Return what is told of an episode that ended, of kart k in world w."""
        episode = self.batch.episode_of(w, k)
        episode["t"] = round(time.monotonic() - self._begun, 6)
        return {
            "terminal_observation": self.batch.terminal[w, k].copy(),
            "TimeLimit.truncated": truncated,
            "episode": episode,
        }

    def close(self) -> None:
        """End the batch's threads."""
        self.batch.close()

    # What SB3 asks of the environments behind a vector environment

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of this object, once for each environment asked for."""
        return [getattr(self, attr_name)] * len(self._numbers(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of this object."""
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of this object, once for each environment asked for.

        `action_masks`, for which sb3-contrib asks, gives each environment its own, (15,).
        """
        if method_name == "action_masks":
            masks = self.action_masks()
            return [masks[number] for number in self._numbers(indices)]
        method = getattr(self, method_name)
        return [method(*method_args, **method_kwargs) for _ in self._numbers(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each: nothing is wrapped, though episodes are monitored."""
        return [False] * len(self._numbers(indices))

    def _numbers(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))

    @property
    def render_mode(self) -> None:
        """None: hundreds of races make no picture."""
        return None

    @render_mode.setter
    def render_mode(self, value: Any) -> None:
        pass
