"""Gymnasium: one car under the rules of an environment of highway-env."""

from collections.abc import Mapping
from typing import Any, ClassVar

import gymnasium

from race_server.envs.camera import Camera
from race_server.envs.compatible.cars import Array, Cars, each, numbers_of
from race_server.envs.compatible.config import Config, config_of
from race_server.envs.round_options import known_options
from race_server.envs.single import OneKart


class CompatibleEnv(gymnasium.Env[Any, Array]):
    """One car, by the names and numbers of an environment of highway-env."""

    metadata = OneKart.metadata
    cars_of: ClassVar[type[Cars]]

    def __init__(
        self, config: Mapping[str, Any] | None = None, render_mode: str | None = None
    ) -> None:
        """Build the world. config: changes of highway-env's configuration.

        Raises:
            ScenarioError: the configuration is not valid.
            TrackError: highway-env is needed for its roads, and is not installed.
        """
        self.render_mode = render_mode
        self._build(config or {})

    def _build(self, changes: Mapping[str, Any]) -> None:
        self.cars = type(self).cars_of(changes, 1)
        pace = self.cars.batch.task.decisions_per_s
        self.metadata = {**self.metadata, "render_fps": pace}
        self.observation_space = self.cars.observation_space
        self.action_space = self.cars.action_space
        self._camera = Camera(self.cars.batch, self.render_mode)

    @classmethod
    def default_config(cls) -> Config:
        """Return the configuration of an environment that is given none."""
        return config_of(cls.__name__, cls.cars_of.defaults, {}, ())

    @property
    def config(self) -> Config:
        """The configuration; change it by `reset(options={"config": {...}})`."""
        return self.cars.config

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin a new episode; with a seed the same one again. options: changes as `config`.

        Raises:
            ScenarioError: the configuration is not valid.
        """
        super().reset(seed=seed)
        if config := known_options(options, ("config",)).get("config"):
            self._build({**self.config, **config})
        self.cars.begin(0, seed, self.np_random)
        self._camera.follow()
        action = self.action_space.sample()
        return self._seen(), self._told(self.cars.infos(action[None]), action)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Move on by one decision. action: (A,), each -1 to 1.

        Raises:
            ScenarioError: the action has another shape, or is no number.
        """
        moved = self.cars.move(numbers_of(action, self.action_space.shape)[None])
        self._camera.follow()
        reward, over, cut = moved.rewards.item(0), moved.over.item(0), moved.cut.item(0)
        return self._seen(), reward, over, cut, self._told(moved.infos, action)

    def _seen(self) -> Any:
        return each(self.cars.observe(), lambda values: values[0].copy())

    def _told(self, infos: dict[str, Any], action: Any) -> dict[str, Any]:
        return {**each(infos, lambda values: values.tolist()[0]), "action": action}

    def render(self) -> Any:
        """Return the world as a picture (`rgb_array`), or show it in a window (`human`)."""
        return self._camera.shoot()

    def close(self) -> None:
        """Close the window."""
        self._camera.close()
        self.cars.batch.close()
