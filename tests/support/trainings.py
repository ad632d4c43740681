"""Small trainings for tests, and policies that drive beside the kart that they learned in."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from race_agents.drivers.learned import Learned
from race_agents.policies.session import Policy
from race_agents.training.budget import Budget
from race_agents.training.export import export_policy, metadata_from
from race_agents.training.learner import learner_of, world_of
from race_agents.training.normaliser import Normaliser
from race_agents.training.run import TrainingResult
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import courses_of
from race_server.competition.time_trial.run import numbers_of
from race_server.core.observation import Observation
from race_server.envs.batch import Batch

# Trains by a preset with changes, once for all tests of a process.
Train = Callable[[str, tuple[str, ...]], TrainingResult]

# A minute on the oval instead of many minutes on many courses.
SMALL = (
    "minutes=none",
    "tracks={names = ['oval']}",
    "network.layers=[16]",
    "evaluation.tracks={names = ['oval']}",
    "evaluation.final={names = ['oval']}",
    "algorithm.options={n_steps = 50, batch_size = 200, n_epochs = 1}",
)
# Two thousand decisions.
QUICK = (
    *SMALL,
    "steps=2000",
    "worlds=8",
    "lidar.rays=21",
    "evaluation.seeds=2",
    "evaluation.times=2",
    "evaluation.seconds=3.0",
)


def untrained(settings: Settings) -> tuple[Budget, Normaliser, Any]:
    """Return a learner that has learned nothing, the world that it is to learn in, and its pace."""
    budget = Budget.of(settings)
    world = world_of(settings, budget)
    return budget, world, learner_of(settings, world, budget, None)


def write_untrained(path: Path, preset: str, *changes: str) -> Path:
    """Write a policy before it has learned."""
    wanted = read_settings(preset, changes)
    _, world, learner = untrained(wanted)
    export_policy(path, learner, world, metadata_from(wanted, courses_of(wanted)))
    world.close()
    return path


def side_by_side(
    trained: Batch, raced: Batch, policy: Policy, driver: Learned, steps: int
) -> Iterator[tuple[float, float]]:
    """Yield where the kart is that a policy drives as in training, and that of its driver [m].

    raced: shows what a live race shows, and takes controls.
    """
    for step in range(steps):
        trained.step(policy.decide(trained.observations[:, 0]))
        seen = Observation(3 * step, raced.layout, raced.observations[0, 0].copy())
        raced.step(numbers_of(driver.act(seen)))
        if trained.terminated[0, 0]:
            return
        yield float(trained.world.bodies[0, 0].x), float(raced.world.bodies[0, 0].x)


WANTED_SPEED = 3.0  # [m/s]
PEDAL, WHEEL = 1.0, 0.3  # per m/s too slow, per m that is more room on the left


def write_lapping_policy(path: Path) -> None:
    """Write a policy that laps without having learned: two neurons, set by hand.

    One keeps a speed, the other steers to the side where the lidar sees further.
    """
    settings = read_settings(
        "time-trial-ppo",
        [
            *SMALL,
            "steps=1",
            "observation=['lidar', 'speed']",
            "action=continuous",
            "lidar.rays=21",
            "network={layers = [2]}",
        ],
    )
    _, world, learner = untrained(settings)
    policy = learner.policy
    for parameter in policy.parameters():
        parameter.data.zero_()
    hidden, answer = policy.mlp_extractor.policy_net[0], policy.action_net
    side = np.sign(np.arange(21) - 10) / 10.0  # the mean of the left less that of the right
    hidden.weight.data[0, 21] = -PEDAL
    hidden.bias.data[0] = PEDAL * WANTED_SPEED
    for ray in range(21):
        hidden.weight.data[1, ray] = WHEEL * side[ray]
    answer.weight.data[0, 0] = answer.weight.data[1, 1] = 1.0
    export_policy(path, learner, world, metadata_from(settings, ("oval",)))
    world.close()
