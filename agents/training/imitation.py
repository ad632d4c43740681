"""The warm start: a policy imitates before it learns by reward.

It learns from a teacher in the states that it reaches itself, since the teacher's own path does not
show how to return to it: DAgger, Ross et al., AISTATS 2011,
https://arxiv.org/abs/1011.0686
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3 import PPO

from race_agents.training.budget import Budget
from race_agents.training.demonstrations import pairs_for
from race_agents.training.greedy_teacher import GreedyTeacher
from race_agents.training.lines import Say, find_lines
from race_agents.training.normaliser import Normaliser
from race_agents.training.schedule import deviations
from race_agents.training.settings import PLANNER, Settings
from race_agents.training.supervised import Memory, SupervisedSteps
from race_agents.training.tasks import training_task
from race_agents.training.teacher import Teacher, shown_to_both
from race_agents.training.warm_start_settings import WarmStart
from race_server.envs.actions import CONTINUOUS, CONTROL, CRAWLED, PACED, action_kind
from race_server.envs.batch import Batch
from race_server.envs.vector import after_an_episode
from race_server.errors import ScenarioError

FIRM = 1e12  # observations after which means are fixed
LOOKED_AT = 20_000  # observations whose spread is measured
EPISODES = 100  # the last ones, for the figures

# Called with the decisions since the last call; returns whether to continue.
Pass = Callable[[int], bool]


class School:
    """The worlds in which a learner drives and a teacher gives the labels."""

    def __init__(self, settings: Settings, say: Say) -> None:
        """Compute the teacher's lines and build the worlds.

        Raises:
            RaceError: there is no such teacher, or it cannot teach the task.
        """
        wanted, task = settings.warm_start, training_task(settings)
        if wanted.teacher != PLANNER:
            task = shown_to_both(task, wanted.teacher)
            scenarios = find_lines(task.scenarios, wanted.margin, settings.threads, say)
            task = replace(task, scenarios=scenarios)
        after = after_an_episode(task.count_learners())
        self.batch = Batch(
            task,
            worlds=settings.worlds,
            # Seeds other than those of reinforcement learning, so that both show more places.
            seed=settings.seed + settings.worlds,
            after=after,
            threads=settings.threads,
        )
        self.teacher: Teacher | GreedyTeacher
        if wanted.teacher != PLANNER:
            self.teacher = Teacher(wanted, self.batch)
        else:
            self.teacher = GreedyTeacher(self.batch, say, cell=wanted.cell)
        self.karts = self.batch.worlds * self.batch.learners
        self._begun = np.ones((self.batch.worlds, self.batch.learners), np.bool_)

    def look(self, size: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return observations of the learners (n, size) and their labels (n, A).

        Labels are not numbers where the teacher knows no way out.
        """
        seen = self.batch.observations
        labels = self.teacher.labels(seen, self._begun)
        return seen.reshape(self.karts, -1)[:, :size].copy(), labels

    def move(self, actions: NDArray[np.float32]) -> list[dict[str, Any]]:
        """Step every race by one decision; return the episodes that ended."""
        self.teacher.record_driven(actions)
        self.batch.step(actions)
        self._begun = (self.batch.terminated | self.batch.truncated).astype(np.bool_)
        return [self.batch.episode_of(w, k) for w, k in np.argwhere(self._begun)]


class Imitation:
    """A whole warm start."""

    def __init__(self, settings: Settings, learner: Any, world: Normaliser, say: Say) -> None:
        """Prepare teacher, demonstrations and memory.

        Raises:
            RaceError: one of them does not exist or does not fit.
        """
        wanted = settings.warm_start
        if not isinstance(learner, PPO) or not hasattr(world.action_space, "low"):
            raise ScenarioError(
                f"warm_start with algorithm.name = {settings.algorithm.name!r} and action = "
                f"{settings.action!r}: only ppo with continuous actions can imitate"
            )
        if wanted.teacher and settings.curriculum:
            raise ScenarioError(
                f"warm_start.teacher = {wanted.teacher!r} with a curriculum: a teacher shows all "
                "tracks from the beginning; leave one of them out"
            )
        self._wanted, self._learner, self._world, self._say = wanted, learner, world, say
        space: Any = world.observation_space
        actions: Any = world.action_space
        self._low, self._high = actions.low, actions.high
        self._size, width = space.shape[0], actions.shape[0]
        self._memory = Memory(wanted.memory, self._size, width)
        weights, quantiles = _weights(wanted, settings.action, width)
        self._lessons = SupervisedSteps(wanted, learner, world, weights, quantiles)
        self._chance = np.random.default_rng(settings.seed)
        self._episodes: deque[dict[str, Any]] = deque(maxlen=EPISODES)
        # SB3 continues with them later, if both exist.
        learner.ep_info_buffer, learner.ep_success_buffer = self._episodes, deque(maxlen=EPISODES)
        if wanted.demonstrations:
            seen, labels = pairs_for(settings, Path(wanted.demonstrations))
            means: Any = world.obs_rms
            means.update(seen)
            self._memory.add(world.view(seen), labels)
        self._school = School(settings, say) if wanted.teacher else None
        self._errors = np.zeros(width)
        self._next_look = 1  # once there are this many labels
        self._taught = np.zeros(self._school.karts if self._school else 0, np.bool_)

    def go(self, budget: Budget, passed: Pass) -> None:
        """Imitate until its share of the training is over, or `passed` returns False."""
        while not budget.is_over and budget.share < self._wanted.share:
            elapsed = budget.share / self._wanted.share
            if self._school is not None:
                for _ in range(self._wanted.decisions):
                    self._drive(self._school, elapsed)
            self._learn(elapsed)
            # With demonstrations alone no kart drives: count as many decisions as if they did.
            if not passed(self._wanted.decisions * self._world.num_envs):
                break
        policy = self._learner.policy
        policy.log_std.data.copy_(deviations(self._wanted.imitated_log_std, policy.log_std))
        show_the_critic(policy)
        # The network depends on these means: those of a few demonstrations would soon change.
        means: Any = self._world.obs_rms
        means.count = max(means.count, FIRM)
        figures = ", ".join(f"{error:.3f}" for error in self._errors)
        self._say(f"imitation: {self._memory.count} labels, mean errors of the actions {figures}")

    def _learn(self, elapsed: float) -> None:
        memory, lessons = self._memory, self._lessons
        if memory.count >= self._next_look:
            lessons.look_at(memory.draw(LOOKED_AT, self._chance)[0])
            self._next_look = 2 * memory.count
        for _ in range(self._wanted.lessons):
            viewed, labels = memory.draw(self._wanted.batch_size, self._chance)
            self._errors += 0.02 * (lessons.learn(viewed, labels, elapsed) - self._errors)

    def _drive(self, school: School, elapsed: float) -> None:
        """Step by one decision, driven by the learner and at first also by the teacher."""
        wanted = self._wanted
        seen, labels = school.look(self._size)
        known = np.isfinite(labels).all(axis=1)
        self._memory.add(self._world.view(seen[known]), labels[known])
        means: Any = self._world.obs_rms
        means.update(seen)
        actions = self._lessons.answer(seen)
        taught = self._taught_now(elapsed) & known
        actions[taught] = labels[taught]
        actions += self._chance.normal(0.0, wanted.noise, actions.shape).astype(np.float32)
        actions = np.clip(actions, self._low, self._high)
        # Without a way out straight on: the first thing that is hit ends the episode.
        actions[~known] = np.eye(actions.shape[1], dtype=np.float32)[0]
        self._episodes.extend(school.move(actions))

    def _taught_now(self, elapsed: float) -> NDArray[np.bool_]:
        """Return which karts the teacher drives now, shape (n,)."""
        wanted, count = self._wanted, len(self._taught)
        share = 1.0 - elapsed / wanted.teacher_drives if wanted.teacher_drives > 0.0 else 0.0
        drawn = self._chance.random(count) < max(share, wanted.teacher_keeps)
        if wanted.stretch > 1:
            drawn = np.where(self._chance.random(count) * wanted.stretch < 1.0, drawn, self._taught)
        self._taught = drawn
        return drawn

    def close(self) -> None:
        """Close the worlds."""
        if self._school is not None:
            self._school.batch.close()


def show_the_critic(policy: Any) -> None:
    """Start the critic with the layers of the actor, and a value of zero.

    A network that has not learned to ignore the noise of a lidar first fits that noise.
    """
    layers = policy.mlp_extractor
    layers.value_net.load_state_dict(layers.policy_net.state_dict())
    for numbers in (policy.value_net.weight, policy.value_net.bias):
        numbers.data.zero_()


def _weights(
    wanted: WarmStart, action: str, width: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return weight and quantile of the errors of each number of an action, each (A,)."""
    weights, quantiles = np.ones(width, np.float32), np.full(width, 0.5, np.float32)
    if action_kind(action) in {CONTINUOUS, PACED, CRAWLED}:
        weights[1], quantiles[0] = wanted.steering_weight, wanted.quantile
    elif action_kind(action) == CONTROL:
        weights[0] = wanted.steering_weight
        quantiles[1:3] = wanted.quantile, 1.0 - wanted.quantile  # throttle and brake
    return weights, quantiles
