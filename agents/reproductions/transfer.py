"""Lessons of the reproduction of the transfer: to a second simulator, and to another motion.

Figures are counts of starts: `own` by the criterion of the world that a policy is tried in, `goal`
and `parked` by our levels of these names, `crash`; `home` is `own` in the world that it learned in.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import gymnasium
import torch
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv

from race_agents.policies.registry import policy_path
from race_agents.policies.session import Policy
from race_agents.reproductions.exam import Decide
from race_agents.reproductions.kart_there import KartThere, similar_kart
from race_agents.reproductions.parking_exam import examine_parking
from race_agents.reproductions.parking_v0 import SHARE, examine_there, make_parking_v0
from race_agents.reproductions.plan import Learned, ParkingExam
from race_agents.reproductions.watch import Watch, mean_return
from race_agents.training.budget import Budget
from race_agents.training.companion_callbacks import callbacks_beside
from race_agents.training.hindsight import hindsight_learner, slackened, vehicles_of
from race_agents.training.learner import learner_of, world_of
from race_agents.training.normaliser import Normaliser
from race_agents.training.policy_start import begin_with_policy
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import as_toml, set_key, settings_of
from race_agents.training.tasks import training_task
from race_agents.training.view import ObservationView
from race_server.competition.parking_tally import COLLISIONS
from race_server.core.observation import layout_of
from race_server.envs.parking.goal import PARTS, GoalView
from race_server.scenario.text_files import parse_toml
from race_server.second.similarity import Similarity

Tell = Callable[[float], None]

LEVELS = ("goal", "parked")


@dataclass(frozen=True)
class Hindsight:
    """SAC with hindsight on `Kart/ParkGoal-v0`."""

    def give(self, settings: Settings, starts: int, tell: Tell) -> Learned:
        """Train and examine."""
        budget = Budget.of(settings)
        vehicles = vehicles_of(settings)
        learner, watch = hindsight_learner(settings, vehicles), Watch(settings, budget, tell)
        learner.learn(budget.steps_left, callback=watch)
        vehicles.close()
        parking = settings.parking.model_copy(update={"limit_s": 0.0})
        asked = settings.model_copy(update={"observation": PARTS, "parking": parking})
        layout = layout_of(PARTS, settings.lidar.rays)
        view = GoalView.of(training_task(asked), layout, "sparse")

        def decide(seen: Any) -> Any:
            return slackened(learner.predict(view.split(seen), deterministic=True)[0])

        return _learned(figures_in_lot(asked, starts, decide), watch)


@dataclass(frozen=True)
class HindsightThere:
    """SAC with hindsight on `parking-v0` as it is: its goals, its reward, its network's view."""

    def give(self, settings: Settings, starts: int, tell: Tell) -> Learned:
        """Train and examine."""
        torch.set_num_threads(1)
        budget = Budget.of(settings)
        vehicles = DummyVecEnv([_watched(make_parking_v0)] * settings.worlds)
        learner = SAC(
            "MultiInputPolicy",
            vehicles,
            learning_rate=settings.algorithm.learning_rate,
            replay_buffer_class=HerReplayBuffer,
            replay_buffer_kwargs={"n_sampled_goal": 4},
            policy_kwargs={"net_arch": list(settings.network.layers)},
            seed=settings.seed,
            device="cpu",
            **settings.algorithm.options,
        )
        watch = Watch(settings, budget, tell)
        learner.learn(budget.steps_left, callback=watch)
        vehicles.close()

        def act(seen: Any) -> Any:
            return learner.predict(seen, deterministic=True)[0]

        found = examine_there(make_parking_v0(), lambda: None, act, starts // SHARE)
        return _learned(found, watch)


@dataclass(frozen=True)
class Bundled:
    """A bundled policy as it is, in `parking-v0` or, without a place, where settings say."""

    name: str = "parking-1"
    there: bool = True
    similar: bool = True  # as a kart of another size, and not metres for metres

    def give(self, settings: Settings, starts: int, tell: Tell) -> Learned:
        """Examine."""
        decide = Policy(policy_path(self.name)).decide
        tell(0.5)
        if not self.there:
            return Learned(0, _untrained(figures_in_lot(settings, starts, decide)), [])
        kart = KartThere(settings, similar_kart(settings) if self.similar else Similarity())
        return Learned(0, _untrained(_figures_there(kart, starts, decide)), [])


@dataclass(frozen=True)
class OnThere:
    """PPO in `parking-v0`, going on from a bundled policy that learned at home, or from nothing."""

    name: str = ""
    similar: bool = True  # as a kart of another size, and not metres for metres

    def give(self, settings: Settings, starts: int, tell: Tell) -> Learned:
        """Train and examine."""
        budget = Budget.of(settings)
        similar = similar_kart(settings) if self.similar else Similarity()
        kart = KartThere(settings, similar)
        karts = DummyVecEnv([_watched(lambda: KartThere(settings, similar))] * settings.worlds)
        world = Normaliser(karts, ObservationView.of(settings), norm_reward=False)
        learner = learner_of(settings, world, budget, None)
        if self.name:
            begin_with_policy(policy_path(self.name), learner, world)
            world.training = False  # what it has learned depends on the means of home
        watch = Watch(settings, budget, tell)
        callbacks = [watch, *callbacks_beside(settings, world, budget)]
        learner.learn(budget.steps_left, callback=callbacks)

        def decide(seen: Any) -> Any:
            return learner.predict(world.normalize_obs(seen), deterministic=True)[0]

        found = _figures_there(kart, starts, decide)
        world.close()
        return _learned(found, watch)


@dataclass(frozen=True)
class Moved:
    """PPO by the settings, tried where they are changed."""

    changes: tuple[str, ...]  # of the settings, for the exam

    def give(self, settings: Settings, starts: int, tell: Tell) -> Learned:
        """Train, unless this process has just done so, and examine at home and away."""
        decide, watch = _taught(as_toml(settings, without=("title",)))
        tell(0.9)
        home = figures_in_lot(settings, starts, decide)
        words = parse_toml(as_toml(settings))
        for change in self.changes:
            set_key(words, change)
        away = figures_in_lot(settings_of(words, "changes of the exam"), starts, decide)
        return _learned({**away, "home": home["own"], "home_starts": starts}, watch)


@lru_cache(maxsize=1)
def _taught(settings: str) -> tuple[Decide, Watch]:
    """Return what settings, as TOML, teach; rows that differ in the exam share it."""
    asked = settings_of(parse_toml(settings), "settings")
    budget = Budget.of(asked)
    world = world_of(asked, budget)
    learner, watch = learner_of(asked, world, budget, None), Watch(asked, budget, lambda _: None)
    callbacks = [watch, *callbacks_beside(asked, world, budget)]
    learner.learn(budget.steps_left, callback=callbacks)
    world.close()

    def decide(seen: Any) -> Any:
        return learner.predict(world.normalize_obs(seen), deterministic=True)[0]

    return decide, watch


def figures_in_lot(settings: Settings, starts: int, decide: Decide) -> dict[str, Any]:
    """Return figures of a policy in the lots of settings, by their level and by others of ours."""
    found = {}
    for level in dict.fromkeys((settings.parking.level, *LEVELS)):
        parking = settings.parking.model_copy(update={"level": level})
        asked = settings.model_copy(update={"parking": parking})
        found[level] = examine_parking(asked, ParkingExam(starts), decide)
    own = found[settings.parking.level]
    return {
        "starts": own["starts"],
        "own": own["parked"],
        **{level: found[level]["parked"] for level in LEVELS},
        "crash": sum(own[name] for name in COLLISIONS),
        "time_s": own["time_s"],
    }


def _figures_there(kart: KartThere, starts: int, decide: Decide) -> dict[str, Any]:
    def act(_: Any) -> Any:
        return kart.controls(decide(kart.seen()[None])[0])

    return examine_there(kart.env, kart.begin, act, starts // SHARE)


def _watched(make: Callable[[], Any]) -> Callable[[], gymnasium.Env[Any, Any]]:
    return lambda: Monitor(make(), info_keywords=("is_success",))


def _untrained(figures: dict[str, Any]) -> dict[str, Any]:
    nothing = {"home": 0, "home_starts": 0, "learning_cpu_s": None, "learning_return": None}
    return nothing | figures


def _learned(figures: dict[str, Any], watch: Watch) -> Learned:
    spent = {"learning_cpu_s": watch.cpu_s, "learning_return": mean_return(watch.curve)}
    return Learned(watch.budget.done, _untrained(figures) | spent, watch.curve)
