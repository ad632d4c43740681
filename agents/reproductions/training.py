"""One training of a reproduction: one row with one seed, trained, examined, and saved."""

import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from race_agents.reproductions.exam import examine
from race_agents.reproductions.plan import Exam, Reproduction, TrainingScale, Variant
from race_agents.reproductions.world import actions_of, world_of
from race_agents.training.budget import Budget
from race_agents.training.learner import learner_of
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import as_toml, read_settings
from race_server.errors import ScenarioError

POINTS = 40  # of the curve of a training
FORMAT = 1  # of the files; files of another format are made again

# Tables of the settings that no training here uses: their keys and defaults are not in the digest.
UNUSED = (
    *("self_play", "curriculum", "warm_start", "cloning", "gail", "curiosity"),
    *("evaluation", "goal"),
)

Tell = Callable[[float], None]  # called with the share of the training that is done


@dataclass(frozen=True)
class Training:
    """One training and its exam."""

    row: Variant
    seed: int
    settings: Settings
    exam: Exam

    @property
    def key(self) -> str:
        """Return a digest of everything that the result depends on."""
        # Nor those of parking where it races: they came later.
        unused = UNUSED if self.settings.parks else (*UNUSED, "parking")
        settings = as_toml(self.settings, without=unused)
        words = f"{FORMAT} {settings} {self.row.twist} {self.exam!r}"
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
    return Training(row, seed, settings, replace(plan.exam, seconds=scale.exam_s))


def _check_plain(settings: Settings, preset: str) -> None:
    """Check that a training uses the reward of the race alone.

    Raises:
        ScenarioError: it uses more.
    """
    wanted = {
        "warm_start": settings.warm_start.is_wanted,
        "self_play": settings.self_play.seats,
        "curriculum": settings.curriculum,
        "cloning": settings.cloning.demonstrations,
        "gail": settings.gail.demonstrations,
        "curiosity": settings.curiosity.bonus,
    }
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
    world = world_of(training.settings, training.row.twist, budget)
    learner = learner_of(training.settings, world, budget, None)
    watch = _Watch(budget, tell)
    begun = time.process_time()
    learner.learn(budget.steps_left, callback=watch)
    learning_s = time.process_time() - begun
    world.close()

    def decide(seen: Any) -> Any:
        answers = learner.predict(world.normalize_obs(seen), deterministic=True)[0]
        return actions_of(training.row.twist, answers)

    figures = asdict(examine(training.settings, training.exam, decide))
    figures["learning_cpu_s"] = learning_s
    figures["learning_return"] = mean_return(watch.curve)
    return {
        "row": training.row.name,
        "seed": training.seed,
        "key": training.key,
        "steps": budget.done,
        "figures": figures,
        "curve": watch.curve,
    }


def mean_return(curve: list[tuple[int, float]]) -> float | None:
    """Return the mean of a curve; time before its first point counts as that point."""
    if not curve:
        return None
    returns = [value for _, value in curve]
    earlier = max(POINTS - len(returns), 0)
    return float(np.mean([returns[0]] * earlier + returns))


class _Watch(BaseCallback):
    """Counts decisions and records the mean return of the last hundred episodes."""

    def __init__(self, budget: Budget, tell: Tell) -> None:
        super().__init__()
        self.budget = budget
        self.curve: list[tuple[int, float]] = []
        self._points = 0
        self._tell = tell

    def _on_step(self) -> bool:
        self.budget.done += self.training_env.num_envs
        if int(self.budget.share * POINTS) > self._points:
            self._points = int(self.budget.share * POINTS)
            # Among many agents it takes a while until the first episode is over.
            if self.model.ep_info_buffer:
                mean = np.mean([row["r"] for row in self.model.ep_info_buffer])
                self.curve.append((self.budget.done, float(mean)))
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
