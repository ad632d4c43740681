"""A vector environment of Gymnasium, as Stable-Baselines3 asks for one."""

from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from stable_baselines3.common.vec_env import VecEnv

from race_server.envs.compatible.cars import Array, each


class ManyCars(VecEnv):
    """Sub-environments that begin again in the same step."""

    def __init__(self, cars: VectorEnv[Any, Array, Array]) -> None:
        """Take a vector environment."""
        self.cars = cars  # which is asked for its attributes at once
        super().__init__(cars.num_envs, cars.single_observation_space, cars.single_action_space)

    def reset(self) -> Any:
        """Begin new episodes, with the seed that was set, if one was."""
        seen, _ = self.cars.reset(seed=self._seeds[0])
        self._reset_seeds()
        return seen

    def step_async(self, actions: Array) -> None:
        """Keep the actions."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Array, Array, list[dict[str, Any]]]:
        """Move on by one decision."""
        seen, rewards, over, cut, told = self.cars.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for number in np.flatnonzero(over | cut).tolist():
            infos[number] = {
                **_row(told["final_info"], number),
                "terminal_observation": _row(told["final_obs"], number),
                "TimeLimit.truncated": bool(cut[number] and not over[number]),
            }
        return seen, rewards.astype(np.float32), over | cut, infos

    def close(self) -> None:
        """End the batch."""
        self.cars.close()

    def env_method(
        self, method_name: str, *arguments: Any, indices: Any = None, **named: Any
    ) -> list[Any]:
        """Call a method of all together, once."""
        return [getattr(self.cars, method_name)(*arguments, **named)]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of all together, for each."""
        return [getattr(self.cars, attr_name)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of all together."""
        setattr(self.cars, attr_name, value)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that none is wrapped."""
        return [False] * self.num_envs


def _row(values: Any, number: int) -> Any:
    """Return what one of all has of arrays, however deep they lie."""

    def pick(array: Array) -> Any:
        return array[number]

    return each(values, pick)
