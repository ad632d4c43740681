"""The training world of a reproduction: that of `race train`, adapted to a report."""

from functools import partial
from itertools import product
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnvWrapper

from race_agents.reproductions.plan import Twist
from race_agents.training.budget import Budget
from race_agents.training.learner import world_of as training_world_of
from race_agents.training.normaliser import Normaliser
from race_agents.training.settings import Settings
from race_server.core.observation import Layout
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.sb3 import KartVecEnv
from race_server.scenario.sensors import Lidar

Array = NDArray[Any]

# Increments of speed and steering that a policy picks from; the reports name none.
CHOICES = np.array(list(product((-1.0, 0.0, 1.0), (-1.0, -0.5, 0.0, 0.5, 1.0))), np.float32)


def actions_of(twist: Twist, answers: Array) -> Array:
    """Return the actions that a policy's answers mean, shape (n, A)."""
    actions = CHOICES[np.asarray(answers, np.int64).ravel()] if twist.choices else answers
    if twist.steering_share == 1.0:
        return actions
    return actions * np.array([1.0, twist.steering_share], np.float32)


class Twisted(VecEnvWrapper):
    """Karts with the actions and rewards of a report."""

    def __init__(self, karts: KartVecEnv, twist: Twist) -> None:
        """Wrap the karts of a learner."""
        chosen = spaces.Discrete(len(CHOICES)) if twist.choices else karts.action_space
        super().__init__(karts, action_space=chosen)
        self.twist = twist
        self.crashes = 0

    def reset(self) -> Any:
        """Start new races."""
        return self.venv.reset()

    def step_async(self, actions: Array) -> None:
        """Take the answers of a policy."""
        self.venv.step_async(actions_of(self.twist, actions))

    def step_wait(self) -> Any:
        """Move on by one decision; with growing crashes the n-th costs n more."""
        seen, rewards, dones, infos = self.venv.step_wait()
        for number in np.flatnonzero(dones):
            episode = infos[number]["episode"]
            self.crashes += episode["crashes"]
            if self.twist.growing_crash and episode["crashes"]:
                rewards[number] -= self.crashes
                episode["r"] -= self.crashes
        return seen, rewards, dones, infos


def world_of(settings: Settings, twist: Twist, budget: Budget) -> Normaliser:
    """Return the karts that learn.

    Raises:
        RaceError: the settings are not valid.
    """
    # In a lot nothing is twisted but the scaling, and judges may add to the reward.
    around = None if settings.parks else partial(Twisted, twist=twist)
    world = training_world_of(settings, budget, around)
    world.norm_obs = twist.scaling != "none"
    if twist.scaling == "largest":
        karts: KartVecEnv = world.unwrapped  # type: ignore[assignment]
        seen: Any = world.obs_rms
        seen.mean = np.zeros_like(seen.mean)
        seen.var = largest_values(karts.batch.layout, settings.vehicle) ** 2
        world.training = False
    return world


def largest_values(layout: Layout, vehicle: str) -> NDArray[np.float64]:
    """Return the divisor of each number of an observation, shape (size,)."""
    car = vehicle_named(vehicle)
    known = {
        "lidar": Lidar().reach,
        "lidar_before": Lidar().reach,
        "speed": car.top_speed,
        "steering": car.steering_limit,
    }
    largest = np.ones(layout.size)
    for name, place in layout.slices.items():
        largest[place] = known.get(name, 1.0)
    return largest
