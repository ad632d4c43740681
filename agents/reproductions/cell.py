"""A cell: one row under one seed, trained, examined, and kept in one file."""

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
FORMAT = 1  # of the files; files of another are made anew

# Tables of the settings that no cell uses: a new key in them, or another default, changes no cell.
UNUSED = ("self_play", "curriculum", "warm_start", "gail", "curiosity", "evaluation", "goal")

Tell = Callable[[float], None]  # called with the share of the cell that is done


@dataclass(frozen=True)
class TrainingJob:
    """One training and its exam."""

    row: Variant
    seed: int
    settings: Settings
    exam: Exam

    @property
    def key(self) -> str:
        """Return a digest of everything that decides what comes out."""
        settings = as_toml(self.settings, without=UNUSED)
        words = f"{FORMAT} {settings} {self.row.twist} {self.exam!r}"
        return hashlib.sha256(words.encode()).hexdigest()[:16]


def cells_of(plan: Reproduction, scale: TrainingScale) -> list[TrainingJob]:
    """Return all cells of a reproduction, seed by seed, so that every row has one early.

    That is also the order in which they are driven.

    Raises:
        ScenarioError: the settings make no training.
    """
    return [
        _cell(plan, scale, row, seed) for seed in range(1, scale.seeds + 1) for row in plan.rows
    ]


def _cell(plan: Reproduction, scale: TrainingScale, row: Variant, seed: int) -> TrainingJob:
    steps = max(round(scale.steps * row.steps_share), 1)
    quick = row.quick_changes if scale is plan.quick else ()
    changes = (*plan.changes, *row.changes, *scale.changes, *quick)
    words = [*changes, "minutes=none", f"steps={steps}", f"seed={seed}", f"title={row.name!r}"]
    settings = read_settings(plan.preset, words)
    _check_plain(settings, plan.preset)
    if row.twist.choices:
        # Settings know no picking among increments: what arrives at the world are increments.
        settings = settings.model_copy(update={"action": "increments"})
    return TrainingJob(row, seed, settings, replace(plan.exam, seconds=scale.exam_s))


def _check_plain(settings: Settings, preset: str) -> None:
    """Do nothing for a training by the race's own reward alone; cells know no other.

    Raises:
        ScenarioError: the settings want more.
    """
    wanted = {
        "warm_start": settings.warm_start.is_wanted,
        "self_play": settings.self_play.seats,
        "curriculum": settings.curriculum,
        "gail": settings.gail.demonstrations,
        "curiosity": settings.curiosity.bonus,
    }
    if names := [name for name, value in wanted.items() if value]:
        raise ScenarioError(
            f"preset {preset!r} has {', '.join(names)}: a reproduction learns by the race's "
            "reward alone; build it on another preset"
        )


def drive_cell(cell: TrainingJob, tell: Tell = lambda _: None) -> dict[str, Any]:
    """Train and examine one cell.

    Raises:
        RaceError: the settings make no training.
    """
    pace = Budget.of(cell.settings)
    world = world_of(cell.settings, cell.row.twist, pace)
    learner = learner_of(cell.settings, world, pace, None)
    watch = _Watch(pace, tell)
    begun = time.process_time()
    learner.learn(pace.steps_left, callback=watch)
    learning_s = time.process_time() - begun
    world.close()

    def decide(seen: Any) -> Any:
        answers = learner.predict(world.normalize_obs(seen), deterministic=True)[0]
        return actions_of(cell.row.twist, answers)

    figures = asdict(examine(cell.settings, cell.exam, decide))
    figures["learning_cpu_s"] = learning_s
    figures["learning_return"] = mean_return(watch.curve)
    return {
        "row": cell.row.name,
        "seed": cell.seed,
        "key": cell.key,
        "steps": pace.done,
        "figures": figures,
        "curve": watch.curve,
    }


def mean_return(curve: list[tuple[int, float]]) -> float | None:
    """Return the mean of a curve; before its first point it counts as that one."""
    if not curve:
        return None
    returns = [value for _, value in curve]
    earlier = max(POINTS - len(returns), 0)
    return float(np.mean([returns[0]] * earlier + returns))


class _Watch(BaseCallback):
    """Keeps the pace and notes the return of the last hundred episodes."""

    def __init__(self, pace: Budget, tell: Tell) -> None:
        super().__init__()
        self.pace = pace
        self.curve: list[tuple[int, float]] = []
        self._points = 0
        self._tell = tell

    def _on_step(self) -> bool:
        self.pace.done += self.training_env.num_envs
        if int(self.pace.share * POINTS) > self._points:
            self._points = int(self.pace.share * POINTS)
            # Among many agents it takes a while until the first episode is over.
            if self.model.ep_info_buffer:
                mean = np.mean([row["r"] for row in self.model.ep_info_buffer])
                self.curve.append((self.pace.done, float(mean)))
            self._tell(self.pace.share)
        return True


def read_cell(path: Path, cell: TrainingJob) -> dict[str, Any] | None:
    """Return what is known of a cell; None if it is not there, damaged, or of other settings."""
    try:
        found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and found.get("key") == cell.key else None


def write_cell(path: Path, outcome: dict[str, Any]) -> None:
    """Keep a cell; whoever is killed here leaves no half file behind."""
    aside = path.with_suffix(".part")
    aside.write_text(json.dumps(outcome) + "\n", encoding="utf-8")
    aside.replace(path)
