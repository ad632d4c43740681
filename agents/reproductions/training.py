"""One training of a reproduction: one row with one seed, trained, examined, and saved."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from race_agents.reproductions.demonstration import imitating
from race_agents.reproductions.exam import Decide, examine
from race_agents.reproductions.parking_exam import examine_parking
from race_agents.reproductions.plan import (
    Exam,
    Learned,
    ParkingExam,
    Reproduction,
    TrainingScale,
    Variant,
)
from race_agents.reproductions.watch import Watch, mean_return, reached_at, settled_at
from race_agents.reproductions.world import actions_of, world_of
from race_agents.training.budget import Budget
from race_agents.training.companion_callbacks import callbacks_beside
from race_agents.training.folder import versions
from race_agents.training.learner import learner_of
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import as_toml, read_settings
from race_server.errors import ScenarioError
from race_server.kept_file import write_together

FORMAT = 1  # of the files; files of another format are made again

# Tables of the settings that no training here uses: their keys and defaults are not in the digest.
UNUSED = ("self_play", "warm_start", "evaluation", "goal", "policies")
# Those that only trainings to park use.
PARKING = ("curriculum", "cloning", "gail", "curiosity", "parking", "hurl")

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
        if self.row.lesson is not None:
            words += f" {self.row.lesson!r}"
        return hashlib.sha256(words.encode()).hexdigest()[:16]


def trainings_of(plan: Reproduction, scale: TrainingScale) -> list[Training]:
    """Return all trainings of a reproduction in the order of running, seed by seed.

    Raises:
        ScenarioError: the settings are not valid.
    """
    return [
        _training(plan, scale, row, seed)
        for seed in range(1, scale.seeds + 1)
        for row in plan.rows
        if seed <= plan.runs_of(row, scale)
    ]


def _training(plan: Reproduction, scale: TrainingScale, row: Variant, seed: int) -> Training:
    steps = max(round(scale.steps * row.steps_share), 1)
    quick = row.quick_changes if scale is plan.quick else ()
    changes = (*plan.changes, *row.changes, *scale.changes, *quick)
    words = ["minutes=none", f"steps={steps}", *changes, f"seed={seed}", f"title={row.name!r}"]
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
        "policies": settings.policies,
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
    found = _learned(training, tell)
    return {
        "row": training.row.name,
        "seed": training.seed,
        "key": training.key,
        "steps": found.steps,
        "versions": versions(),
        "figures": found.figures,
        "curve": found.curve,
        "curves": found.curves,
    }


def _learned(training: Training, tell: Tell) -> Learned:
    """Return what comes out of a training: by its row's lesson, or by its settings."""
    if training.row.lesson is not None:
        assert isinstance(training.exam, ParkingExam)
        return training.row.lesson.give(training.settings, training.exam.starts, tell)
    budget = Budget.of(training.settings)
    with imitating(training.settings, training.row.imitates, training.demonstrated) as settings:
        world = world_of(settings, training.row.twist, budget)
        learner = learner_of(settings, world, budget, None)
        watch = Watch(settings, budget, tell)
        callbacks = [watch, *callbacks_beside(settings, world, budget)]
        learner.learn(budget.steps_left, callback=callbacks)
    world.close()

    def decide(seen: Any) -> Any:
        answers = learner.predict(world.normalize_obs(seen), deterministic=True)[0]
        return actions_of(training.row.twist, answers)

    figures = _figures(training, decide)
    figures["learning_cpu_s"] = watch.cpu_s
    figures["learning_return"] = mean_return(watch.curve)
    if training.settings.parks:
        figures["settled_cpu_s"] = settled_at(watch.curve, watch.cpu_times)
        figures["decisions_to_80"] = reached_at(watch.curve, 0.8)
    return Learned(budget.done, figures, watch.curve, watch.curves)


def _figures(training: Training, decide: Decide) -> dict[str, Any]:
    """Return the figures of a trained policy."""
    exam = training.exam
    if isinstance(exam, ParkingExam):
        return examine_parking(training.settings, exam, decide)
    return asdict(examine(training.settings, exam, decide))


def read_outcome(path: Path, training: Training) -> dict[str, Any] | None:
    """Return the saved outcome of a training; None if missing, damaged, or of other settings."""
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and found.get("key") == training.key else None


def write_outcome(path: Path, outcome: dict[str, Any]) -> None:
    """Save the outcome of a training, atomically."""
    write_together({path: (json.dumps(outcome) + "\n").encode()})
