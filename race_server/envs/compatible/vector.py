"""Gymnasium's vector form: many cars at once under the rules of an environment of highway-env."""

from typing import Any

import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from race_server.envs.camera import VECTOR_RENDER_MODES, VectorCamera
from race_server.envs.compatible.cars import Array, Cars, Moved, each, numbers_of
from race_server.envs.round_options import known_options
from race_server.envs.single import OneKart
from race_server.errors import ScenarioError


class CompatibleVector(VectorEnv[Any, Array, Array]):
    """W cars, each in its own world, through one batch.

    Autoreset mode: same step. The observation of a car whose episode has ended is the first of its
    next one; the last one is in `infos["final_obs"]`.
    """

    metadata = {  # noqa: RUF012  # as Gymnasium declares it
        "autoreset_mode": AutoresetMode.SAME_STEP,
        "render_modes": list(VECTOR_RENDER_MODES),
        "render_fps": OneKart.metadata["render_fps"],
    }

    def __init__(self, cars: Cars, render_mode: str | None = None) -> None:
        """Take the worlds of a batch. render_mode: None or rgb_array, one picture for each car.

        Raises:
            ScenarioError: there is no such mode.
        """
        self.cars = cars
        self.render_mode = render_mode
        self._camera = VectorCamera(cars.batch, render_mode)
        self.num_envs = cars.batch.worlds
        pace = cars.batch.task.decisions_per_s
        self.metadata = {**self.metadata, "render_fps": pace}
        self.single_observation_space = cars.observation_space
        self.single_action_space = cars.action_space
        self.observation_space = batch_space(cars.observation_space, self.num_envs)
        self.action_space = batch_space(cars.action_space, self.num_envs)
        self._chances = [np_random()[0] for _ in range(self.num_envs)]

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin new episodes: environment n with `seed + n`, or with its own of a list.

        The configuration is that of all, and stays.

        Raises:
            ScenarioError: a list has not as many seeds, or there are options.
        """
        known_options(options, ())
        if isinstance(seed, int | np.integer):
            seed = [int(seed) + number for number in range(self.num_envs)]
        seeds = [None] * self.num_envs if seed is None else list(seed)
        if len(seeds) != self.num_envs:
            raise ScenarioError(
                f"{len(seeds)} seeds for {self.num_envs} environments: give as many"
            )
        for w, one in enumerate(seeds):
            if one is not None:
                self._chances[w] = np_random(one)[0]
            self.cars.begin(w, one, self._chances[w])
        actions = self.action_space.sample()
        return self._seen(), _marked(self._told(actions))

    def step(self, actions: Array) -> tuple[Any, Array, Array, Array, dict[str, Any]]:
        """Move all on by one decision. actions: (W, A), each -1 to 1.

        Raises:
            ScenarioError: the actions have another shape, or are no numbers.
        """
        moved = self.cars.move(numbers_of(actions, self.action_space.shape))
        rewards, over, cut, told = Moved(*(each(part, np.copy) for part in moved))
        infos, ended = told | {"action": actions}, over | cut
        if ended.any():
            last = {"final_obs": self._seen(), "final_info": _marked(infos, ended)}
            for w in np.flatnonzero(ended):
                self.cars.begin(int(w), None, self._chances[w])
            infos = self._told(actions) | last
        return self._seen(), rewards, over, cut, _marked(infos, ended)

    def _seen(self) -> Any:
        return each(self.cars.observe(), np.copy)

    def _told(self, actions: Array) -> dict[str, Any]:
        return each(self.cars.infos(actions), np.copy) | {"action": actions}

    def render(self) -> tuple[Array, ...] | None:
        """Return a picture of the world of each car, (height, width, 3) bytes."""
        return self._camera.shoot_all()

    def close_extras(self, **_: Any) -> None:
        """End the batch."""
        self.cars.batch.close()


def _marked(infos: dict[str, Any], ended: Array | None = None) -> dict[str, Any]:
    """Return infos with a mask for each: of all, and of the final ones where an episode ended."""
    marks: dict[str, Any] = {}
    for name, values in infos.items():
        size = len(values) if not isinstance(values, dict) else len(_first(values))
        is_final = name.startswith("final_")
        marks[f"_{name}"] = ended if is_final and ended is not None else np.ones(size, np.bool_)
    return infos | marks


def _first(values: Any) -> Array:
    """Return an array of a dictionary of arrays."""
    while isinstance(values, dict):
        values = next(iter(values.values()))
    return np.asarray(values)
