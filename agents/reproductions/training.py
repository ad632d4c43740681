"""One training of a reproduction: one row with one seed, trained, examined, and saved."""

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from race_agents.reproductions.demonstration import imitating
from race_agents.reproductions.exam import Decide, examine
from race_agents.reproductions.parking_exam import examine_parking
from race_agents.reproductions.plan import (
    Exam,
    ParkingExam,
    Reproduction,
    TrainingScale,
    Variant,
)
from race_agents.reproductions.world import actions_of, world_of
from race_agents.training.budget import Budget
from race_agents.training.cloning import Cloning
from race_agents.training.hurl import Mixing
from race_agents.training.learner import learner_of
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import as_toml, read_settings
from race_server.errors import ScenarioError

POINTS = 40  # of the curve of a training
FORMAT = 1  # of the files; files of another format are made again

# Tables of the settings that no training here uses: their keys and defaults are not in the digest.
UNUSED = ("self_play", "warm_start", "evaluation", "goal")
# Those that only trainings to park use.
PARKING = ("curriculum", "cloning", "gail", "curiosity", "parking", "hurl")
# Curves of a training to park: figures of the last hundred episodes.
CURVES = {
    "share that parked": "is_success",
    "return of an episode": "r",
    "length of an episode, decisions": "l",
}
SETTLED = 0.9  # share of the final figure at which something counts as learned

Tell = Callable[[float], None]  # called with the share of the training that is done


@dataclass(frozen=True)
class Training:
    """One training and its exam."""

    row: Variant
    seed: int
    settings: Settings
    exam: Exam | ParkingExam
    demonstrated: int = 0  # decisions of a demonstration

    @property
    def key(self) -> str:
        """Return a digest of everything that the result depends on."""
        unused = UNUSED if self.settings.parks else (*UNUSED, *PARKING)
        settings = as_toml(self.settings, without=unused)
        words = f"{FORMAT} {settings} {self.row.twist} {self.exam!r}"
        if self.row.imitates:
            words += f" {self.row.imitates} {self.demonstrated}"
        return hashlib.sha256(words.encode()).hexdigest()[:16]


def trainings_of(plan: Reproduction, scale: TrainingScale) -> list[Training]:
    """Return all trainings of a reproduction in the order of running, seed by seed.

    Raises:
        ScenarioError: the settings are not valid.
    """
    return [
        _training(plan, scale, row, seed) for seed in range(1, scale.seeds + 1) for row in plan.rows
    ]


def _training(plan: Reproduction, scale: TrainingScale, row: Variant, seed: int) -> Training:
    steps = max(round(scale.steps * row.steps_share), 1)
    quick = row.quick_changes if scale is plan.quick else ()
    changes = (*plan.changes, *row.changes, *scale.changes, *quick)
    words = [*changes, "minutes=none", f"steps={steps}", f"seed={seed}", f"title={row.name!r}"]
    settings = read_settings(plan.preset, words)
    _check_plain(settings, plan.preset)
    if row.twist.choices:
        # Settings have no choice among increments: the world receives increments.
        settings = settings.model_copy(update={"action": "increments"})
    demonstrated = scale.demonstrated if row.imitates else 0
    return Training(row, seed, settings, plan.exam.at(scale), demonstrated)


def _check_plain(settings: Settings, preset: str) -> None:
    """Check that a training uses the reward of the race alone, or what helps to learn to park.

    Raises:
        ScenarioError: it uses more.
    """
    wanted = {
        "warm_start": settings.warm_start.is_wanted,
        "self_play": settings.self_play.seats,
        "cloning": settings.cloning.demonstrations,
        "gail": settings.gail.demonstrations,
    }
    if not settings.parks:
        aids = {"curriculum": settings.curriculum, "curiosity": settings.curiosity.bonus}
        wanted |= aids
    if names := [name for name, value in wanted.items() if value]:
        raise ScenarioError(
            f"preset {preset!r} has {', '.join(names)}: a reproduction learns by the race's "
            "reward alone; build it on another preset"
        )


def run_training(training: Training, tell: Tell = lambda _: None) -> dict[str, Any]:
    """Train and examine one policy.

    Raises:
        RaceError: the settings are not valid.
    """
    budget = Budget.of(training.settings)
    with imitating(training.settings, training.row.imitates, training.demonstrated) as settings:
        world = world_of(settings, training.row.twist, budget)
        learner = learner_of(settings, world, budget, None)
        watch = _Watch(settings, budget, tell)
        callbacks: list[BaseCallback] = [watch]
        if settings.cloning.demonstrations:
            callbacks.append(Cloning(settings, world, budget))
        if settings.mixes:
            callbacks.append(Mixing(settings, budget))
        learner.learn(budget.steps_left, callback=callbacks)
    learning_s = watch.cpu_s
    world.close()

    def decide(seen: Any) -> Any:
        answers = learner.predict(world.normalize_obs(seen), deterministic=True)[0]
        return actions_of(training.row.twist, answers)

    figures = _figures(training, decide)
    figures["learning_cpu_s"] = learning_s
    figures["learning_return"] = mean_return(watch.curve)
    if training.settings.parks:
        figures["settled_cpu_s"] = settled_at(watch.curve, watch.cpu_times)
        figures["decisions_to_80"] = reached_at(watch.curve, 0.8)
    return {
        "row": training.row.name,
        "seed": training.seed,
        "key": training.key,
        "steps": budget.done,
        "figures": figures,
        "curve": watch.curve,
        "curves": watch.curves,
    }


def _figures(training: Training, decide: Decide) -> dict[str, Any]:
    """Return the figures of a trained policy."""
    exam = training.exam
    if isinstance(exam, ParkingExam):
        return examine_parking(training.settings, exam, decide)
    return asdict(examine(training.settings, exam, decide))


def settled_at(curve: list[tuple[int, float]], cpu_times: list[float]) -> float | None:
    """Return the processor time [s] at which a curve first reached 90 % of where it ended.

    The end is the mean of its last tenth; None if that is nothing.
    """
    end = float(np.mean([value for _, value in curve[-POINTS // 10 :]])) if curve else 0.0
    if end <= 0.0:
        return None
    reached = zip(curve, cpu_times, strict=True)
    return next(at for (_, value), at in reached if value >= SETTLED * end)


def reached_at(curve: list[tuple[int, float]], share: float) -> float | None:
    """Return the decisions after which a curve first reached a share, None if it never did."""
    return next((float(at) for at, value in curve if value >= share), None)


def mean_return(curve: list[tuple[int, float]]) -> float | None:
    """Return the mean of a curve; time before its first point counts as that point."""
    if not curve:
        return None
    returns = [value for _, value in curve]
    earlier = max(POINTS - len(returns), 0)
    return float(np.mean([returns[0]] * earlier + returns))


class _Watch(BaseCallback):
    """Counts decisions and records figures of the last hundred episodes.

    Of a race that is the mean return, in a lot the share that parked.
    """

    def __init__(self, settings: Settings, budget: Budget, tell: Tell) -> None:
        super().__init__()
        self.budget = budget
        self.curve: list[tuple[int, float]] = []
        self.curves: dict[str, list[tuple[int, float]]] = (
            {name: [] for name in CURVES} if settings.parks else {}
        )
        self.cpu_times: list[float] = []  # [s] at each point of the curve
        self._figure = "is_success" if settings.parks else "r"
        self._begun = time.process_time()
        self._points = 0
        self._tell = tell

    @property
    def cpu_s(self) -> float:
        """Processor time so far [s]."""
        return time.process_time() - self._begun

    def _mean(self, figure: str) -> float:
        return float(np.mean([row[figure] for row in self.model.ep_info_buffer or ()]))

    def _on_step(self) -> bool:
        self.budget.done += self.training_env.num_envs
        if int(self.budget.share * POINTS) > self._points:
            self._points = int(self.budget.share * POINTS)
            # Among many agents it takes a while until the first episode is over.
            if self.model.ep_info_buffer:
                self.curve.append((self.budget.done, self._mean(self._figure)))
                for name, curve in self.curves.items():
                    curve.append((self.budget.done, self._mean(CURVES[name])))
                self.cpu_times.append(self.cpu_s)
            self._tell(self.budget.share)
        return True


def read_outcome(path: Path, training: Training) -> dict[str, Any] | None:
    """Return the saved outcome of a training; None if missing, damaged, or of other settings."""
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and found.get("key") == training.key else None


def write_outcome(path: Path, outcome: dict[str, Any]) -> None:
    """Save the outcome of a training, atomically."""
    aside = path.with_suffix(".part")
    aside.write_text(json.dumps(outcome) + "\n", encoding="utf-8")
    aside.replace(path)
