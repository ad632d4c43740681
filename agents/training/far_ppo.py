"""PPO whose rollouts come from runners: elsewhere on this machine, or on others.

A rollout is counted once all of its parts are there, and a part that a runner did not bring back is
asked of another one. So nothing is counted twice, whatever is killed.
"""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from race_agents.training.far_runner import KEPT, Parameters, Rollout, Runner, parameters_of
from race_agents.training.fast_ppo import FastPpo
from race_agents.training.settings import Settings
from race_server.core.observation import layout_of
from race_server.core.seeds import resumed_seed
from race_server.envs.spaces import action_space, observation_space
from race_server.errors import ScenarioError

Array = NDArray[Any]


class Crew(Protocol):
    """Runners of one training."""

    def begin(self, seed: int) -> None:
        """Build the runners; the worlds of the first have the seeds from `seed` on."""

    def collect(self, parameters: Parameters) -> list[Rollout]:
        """Return all parts of a rollout, in order.

        Raises:
            ScenarioError: no runner is left.
        """

    def close(self) -> None:
        """End the runners."""


class HereCrew:
    """Runners in this process, one after the other."""

    def __init__(self, settings: Settings, runners: int) -> None:
        """Share the worlds of settings among runners."""
        self._settings, self._worlds = settings, worlds_of_each(settings, runners)
        self.runners: list[Runner] = []
        self._count = runners

    def begin(self, seed: int) -> None:
        """Build the runners."""
        starts = [seed + number * self._worlds for number in range(self._count)]
        self.runners = [Runner(self._settings, self._worlds, start) for start in starts]

    def collect(self, parameters: Parameters) -> list[Rollout]:
        """Return all parts of a rollout."""
        return [runner.collect(parameters) for runner in self.runners]

    def close(self) -> None:
        """End the runners."""
        for runner in self.runners:
            runner.close()


def worlds_of_each(settings: Settings, runners: int) -> int:
    """Return how many worlds each runner has.

    Raises:
        ScenarioError: they cannot be shared evenly.
    """
    if runners < 1 or settings.worlds % runners:
        fitting = [str(n) for n in range(1, settings.worlds + 1) if not settings.worlds % n]
        raise ScenarioError(
            f"{runners} runners: worlds = {settings.worlds} cannot be shared evenly; choose one of "
            f"{', '.join(fitting)}"
        )
    return settings.worlds // runners


def check_far(settings: Settings) -> None:
    """Refuse what runners cannot do.

    Raises:
        ScenarioError: the settings ask for it.
    """
    wrong = {
        f"algorithm {settings.algorithm.name}": settings.algorithm.name != "ppo",
        "policies": bool(settings.policies),
        "self_play": bool(settings.self_play.seats),
        "curriculum": bool(settings.curriculum),
        "warm_start": settings.warm_start.is_wanted,
        "gail": bool(settings.gail.demonstrations),
        "curiosity": settings.curiosity.bonus > 0.0,
        "parking.shaping = hurl": settings.mixes,
        "several vehicles of a lot": settings.parks and settings.race.learners > 1,
    }
    names = [name for name, is_wrong in wrong.items() if is_wrong]
    if names:
        raise ScenarioError(
            f"{', '.join(names)}: runners collect for ppo alone; leave this out, or train without "
            "--ray"
        )


class FarKarts(VecEnv):
    """What the karts of all runners are to the learner: their number and their spaces."""

    def __init__(self, settings: Settings) -> None:
        """Take the place of the karts of settings."""
        layout = layout_of(settings.observation, settings.lidar.rays)
        count = settings.worlds * settings.race.learners
        super().__init__(count, observation_space(layout), action_space(settings.action))
        self._size = layout.size

    def reset(self) -> Array:
        """Return nothing seen, (n, S): the runners know."""
        return np.zeros((self.num_envs, self._size), np.float32)

    def step_async(self, actions: Array) -> None:
        """Refuse: runners step."""
        raise NotImplementedError

    def step_wait(self) -> Any:
        """Refuse: runners step."""
        raise NotImplementedError

    def close(self) -> None:
        """Do nothing: runners are closed by themselves."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return None for each: SB3 asks whether there are pictures."""
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: there is nothing to set."""
        raise NotImplementedError

    def env_method(
        self, method_name: str, *arguments: Any, indices: Any = None, **more: Any
    ) -> Any:
        """Refuse: there is nothing to call."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each."""
        return [False] * self.num_envs


class FarPpo(FastPpo):
    """PPO that learns here from what a crew collects."""

    def __init__(self, *arguments: Any, crew: Crew, **options: Any) -> None:
        """Take the options of `FastPpo`. crew: not yet begun."""
        self.crew = crew
        self._begun = False
        super().__init__(*arguments, **options)

    def _excluded_save_params(self) -> list[str]:
        return [*super()._excluded_save_params(), "crew"]

    def _setup_model(self) -> None:
        super()._setup_model()
        # Its own karts see nothing; what is seen is counted below.
        self._world.training = False

    @property
    def _world(self) -> Any:
        return self._vec_normalize_env

    def collect_rollouts(
        self, env: VecEnv, callback: Any, rollout_buffer: Any, n_rollout_steps: int
    ) -> bool:
        """Fill the buffer with what the runners decided; return False where a callback ends it."""
        if not self._begun:
            self._begun = True
            done, seed = self.num_timesteps, int(self.seed or 0)
            self.crew.begin(resumed_seed(seed, done) if done else seed)
        callback.on_rollout_start()
        parts = self.crew.collect(parameters_of(self, self._world))
        rollout_buffer.reset()
        for name in KEPT:
            whole = np.concatenate([part.arrays[name] for part in parts], axis=1)
            getattr(rollout_buffer, name)[...] = whole
        rollout_buffer.pos, rollout_buffer.full = n_rollout_steps, True
        for part in parts:
            self._world.obs_rms.update_from_moments(*part.seen)
            self._world.ret_rms.update_from_moments(*part.returns)
            assert self.ep_info_buffer is not None
            self.ep_info_buffer.extend(part.episodes)
        for _ in range(n_rollout_steps):
            self.num_timesteps += env.num_envs
            if not callback.on_step():
                return False
        callback.on_rollout_end()
        return True
