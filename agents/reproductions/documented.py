"""highway-env's own examples, there and here: hindsight that parks, PPO that follows a road.

Each runs as its documentation prints it (`scripts/parking_her.ipynb` and `sb3_racetracks_ppo.py` of
https://github.com/Farama-Foundation/HighwayEnv), with the name of the environment as the only
difference. Figures are counts of starts: `own` of them a success, `crash` of them a crash.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

import gymnasium
import torch
from stable_baselines3 import PPO, SAC, HerReplayBuffer
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor

from race_agents.reproductions.exam import FIRST_SEED
from race_agents.reproductions.many_cars import ManyCars
from race_agents.reproductions.plan import Learned, ParkingExam, TrainingScale
from race_agents.reproductions.watch import OVER_TIME, Watch, mean_return
from race_agents.training.budget import Budget
from race_agents.training.settings import Settings
from race_server.envs.compatible.racetrack import SPEED
from race_server.envs.registration import PARK_COMPATIBLE, RACETRACK_COMPATIBLE
from race_server.scenario.highway import make_highway
from race_server.scenario.track.load import load_course

DECISION_S = 0.2  # of both
OURS = (PARK_COMPATIBLE, RACETRACK_COMPATIBLE)
Tell = Callable[[float], None]


@dataclass(frozen=True)
class ExamplesExam(ParkingExam):
    """An exam of what the examples have learned: once from each of some starts."""

    curve_head: ClassVar[str] = "share of the last 100 episodes that succeed"

    def words(self, scale: TrainingScale) -> str:
        """Return a text on how a policy is examined."""
        return (
            f"each then drives from {scale.starts} starts that no training had, without exploration"
        )


@dataclass(frozen=True)
class HindsightExample:
    """SAC with hindsight in a car park without walls; several at once where that is ours."""

    environment: str

    def give(self, settings: Settings, starts: int, tell: Tell) -> Learned:
        """Train and examine."""

        def learner(cars: VecEnv) -> BaseAlgorithm:
            return SAC(
                "MultiInputPolicy",
                cars,
                replay_buffer_class=HerReplayBuffer,
                replay_buffer_kwargs={"n_sampled_goal": 4, "goal_selection_strategy": "future"},
                learning_rate=settings.algorithm.learning_rate,
                policy_kwargs={"net_arch": list(settings.network.layers)},
                seed=settings.seed,
                device="cpu",
                **settings.algorithm.options,
            )

        config = {"add_walls": False}
        return _learned(self.environment, config, settings, learner, starts, tell)


@dataclass(frozen=True)
class RoadExample:
    """PPO on a race track."""

    environment: str

    def give(self, settings: Settings, starts: int, tell: Tell) -> Learned:
        """Train and examine."""
        layers = list(settings.network.layers)

        def learner(cars: VecEnv) -> BaseAlgorithm:
            return PPO(
                "MlpPolicy",
                cars,
                policy_kwargs={"net_arch": {"pi": layers, "vf": layers}},
                learning_rate=settings.algorithm.learning_rate,
                seed=settings.seed,
                device="cpu",
                **settings.algorithm.options,
            )

        return _learned(self.environment, {}, settings, learner, starts, tell)


class Lap(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Calls it a success if an episode on a road lasts for a whole lap."""

    def reset(self, **options: Any) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        self._decisions = 0
        return self.env.reset(**options)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Move on by one decision; a lap ends the episode."""
        seen, reward, is_over, is_cut, info = self.env.step(action)
        self._decisions += 1
        is_success = not is_over and self._decisions >= decisions_of_a_lap()
        return seen, reward, is_over, is_cut or is_success, {**info, "is_success": is_success}


@cache
def decisions_of_a_lap() -> int:
    """Return the decisions that a lap of `racetrack-v0` takes at its speed.

    Raises:
        TrackError: highway-env is not installed.
    """
    return round(load_course("highway:racetrack-v0").length / SPEED / DECISION_S)


def make_example(environment: str, config: dict[str, Any]) -> Any:
    """Return an environment by its id, of highway-env or of ours, as an example has it.

    Raises:
        ScenarioError: highway-env is not installed.
    """
    if environment in OURS:
        env = gymnasium.make(environment, config=config)
    else:
        env = make_highway(environment, **config)
    return Lap(env) if "racetrack" in environment.lower() else env


def _learned(
    environment: str,
    config: dict[str, Any],
    settings: Settings,
    make: Callable[[VecEnv], BaseAlgorithm],
    starts: int,
    tell: Tell,
) -> Learned:
    """Train and examine; the clock runs while it learns."""
    torch.set_num_threads(1)
    budget = Budget.of(settings)
    cars: VecEnv
    if settings.worlds > 1 and environment == PARK_COMPATIBLE:
        cars = ManyCars(gymnasium.make_vec(environment, num_envs=settings.worlds, config=config))
    else:
        cars = DummyVecEnv([lambda: make_example(environment, config)] * settings.worlds)
    learner = make(VecMonitor(cars, info_keywords=("is_success",)))
    watch = Watch(settings, budget, tell)
    learner.learn(budget.steps_left, callback=watch)
    cars.close()
    figures = _examined(make_example(environment, config), learner, starts)
    spent = {
        "learning_cpu_s": watch.cpu_s,
        "learning_return": mean_return(watch.curve),
        "decisions_a_second": budget.done / watch.cpu_s,
    }
    share = "share that succeeds"
    over_time = [(at, value) for at, (_, value) in zip(watch.cpu_times, watch.curve, strict=True)]
    return Learned(budget.done, figures | spent, watch.curve, {share + OVER_TIME: over_time})


def _examined(env: Any, learner: BaseAlgorithm, starts: int) -> dict[str, Any]:
    """Drive from each start once, without exploration."""
    counts = {"starts": starts, "own": 0, "crash": 0}
    for number in range(starts):
        seen, _ = env.reset(seed=FIRST_SEED + number)
        is_done, info = False, {}
        while not is_done:
            action, _ = learner.predict(seen, deterministic=True)
            seen, _, is_over, is_cut, info = env.step(action)
            is_done = is_over or is_cut
        counts["own"] += bool(info["is_success"])
        counts["crash"] += bool(info["crashed"])
    env.close()
    return counts
