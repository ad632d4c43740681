"""Who watches a training: shows it, tries the policy out, keeps the best, ends it in time."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure

from race_agents.policies.registry import BEST
from race_agents.training.budget import Budget
from race_agents.training.checkpoint import CURRICULUM, companions_in, save_checkpoint
from race_agents.training.curriculum import Curriculum
from race_agents.training.curve import Point, append
from race_agents.training.evaluation import Examiner, Marks
from race_agents.training.normaliser import Normaliser
from race_agents.training.self_play import SelfPlay
from race_agents.training.settings import Settings
from race_server.storage.results.ratings import Rating

CURVE, LATEST = "curve.csv", "latest.pt"
TELL_S = 1.0  # between two looks at the figures
ROWS = 200  # of the curve between two evaluations' rows, over a whole training, at most


@dataclass(frozen=True)
class TrainingProgress:
    """What is told of a training under way."""

    share: float
    steps: int
    steps_per_s: float
    reward: float | None
    crash_rate: float | None
    best_lap_s: float | None
    method: str  # how it learns: by imitation, or an algorithm's name
    marks: Marks | None = None
    ratings: tuple[Rating, ...] = ()  # where they have just changed, the strongest first
    stage: str = ""  # of the curriculum, in words


Tell = Callable[[TrainingProgress], None]


class TrainingCallback(BaseCallback):
    """Called by the learner at every decision."""

    def __init__(
        self,
        settings: Settings,
        folder: Path,
        world: Normaliser,
        pace: Budget,
        tell: Tell,
        best_score: float = -np.inf,
        self_play: SelfPlay | None = None,
        log: Path | None = None,
    ) -> None:
        """Watch a training whose files go into `folder`. log: a folder for TensorBoard."""
        super().__init__()
        self.settings = settings
        self.pace = pace
        self.self_play = self_play
        stages = companions_in(world).get(CURRICULUM)
        self.stages = stages if isinstance(stages, Curriculum) else None
        tried = settings.evaluation
        self.examiner = Examiner(settings, tried.tracks, tried.first_seed)
        self.best: list[Marks] = []
        self.best_score = best_score
        self.last: list[Marks] = []
        self.reached = False
        self.method: str = settings.algorithm.name
        self._folder = folder
        self._world = world
        self._tell = tell
        self._log = configure(str(log), ["tensorboard"]) if log is not None else None
        self._told = time.monotonic()
        self._told_steps = pace.done
        self._rate = 0.0
        self._rows = int(pace.share * ROWS)
        self._tries = int(pace.share * settings.evaluation.times)

    def decide(self, seen: NDArray[np.float32]) -> NDArray[Any]:
        """Return the learner's best actions."""
        actions: NDArray[Any] = self.model.predict(
            self._world.normalize_obs(seen),
            deterministic=True,
        )[0]
        return actions

    def imitated(self, decisions: int) -> bool:
        """Take note of decisions outside of the learner's own worlds; return whether to go on."""
        self.pace.done += decisions
        if time.monotonic() - self._told > TELL_S:
            self._look()
        self._examine_in_time()
        return not self.reached

    def _on_step(self) -> bool:
        self.pace.done += self.training_env.num_envs
        if time.monotonic() - self._told > TELL_S:
            self._look()
        return not (self.pace.is_over or self.reached)

    def _on_rollout_start(self) -> None:
        # Between rollouts, so that no policy is tried out half-way through its lessons.
        if self.self_play is not None and self.self_play.go_on(self.model, self.pace.done):
            self._look(rated=True)
        self._examine_in_time()

    def _examine_in_time(self) -> None:
        if int(self.pace.share * self.settings.evaluation.times) > self._tries:
            self.examine()

    def examine(self) -> None:
        """Try the policy out, and keep it if it is the best so far."""
        self._tries = int(self.pace.share * self.settings.evaluation.times)
        self._look()  # so that no time of trying out counts as that of learning's pace
        self.last = self.examiner.examine(self.decide)
        save_checkpoint(self._folder / LATEST, self.model, self._world, self.pace)
        score = self.last[-1].score(self.settings.evaluation.score)
        if score > self.best_score:
            self.best, self.best_score = self.last, score
            save_checkpoint(self._folder / BEST, self.model, self._world, self.pace, score)
        self.reached = self.last[-1].reaches(self.settings.goal)
        self._look(self.last[-1])

    def _look(self, marks: Marks | None = None, *, rated: bool = False) -> None:
        now = time.monotonic()
        if self.pace.done > self._told_steps:
            self._rate = (self.pace.done - self._told_steps) / max(now - self._told, 1e-6)
        self._told, self._told_steps = now, self.pace.done
        news = self._news(self._rate, marks)
        if rated and self.self_play is not None:
            news = replace(news, ratings=tuple(self.self_play.ratings))
        self._tell(news)
        row = int(self.pace.share * ROWS)
        if marks is not None or rated or row > self._rows:
            self._rows = row
            self._note(self._point(news))

    def _note(self, point: Point) -> None:
        append(self._folder / CURVE, point)
        if self._log is None:
            return
        for name, value in asdict(point).items():
            if value is not None:
                self._log.record(f"race/{name}", value)
        self._log.dump(point.steps)

    def _news(self, rate: float, marks: Marks | None) -> TrainingProgress:
        episodes = list(self.model.ep_info_buffer or ())
        laps = [row["best_lap_s"] for row in episodes if row["best_lap_s"] > 0.0]
        return TrainingProgress(
            share=self.pace.share,
            steps=self.pace.done,
            steps_per_s=rate,
            reward=float(np.mean([row["r"] for row in episodes])) if episodes else None,
            crash_rate=float(np.mean([row["crashes"] for row in episodes])) if episodes else None,
            best_lap_s=min(laps, default=None),
            method=self.method,
            marks=marks,
            stage=str(self.stages) if self.stages else "",
        )

    def _point(self, news: TrainingProgress) -> Point:
        marks = news.marks
        rated = self.self_play.newest if self.self_play is not None else None
        return Point(
            minutes=self.pace.seconds / 60.0,
            steps=news.steps,
            steps_per_s=news.steps_per_s,
            learning_rate=float(self.model.lr_schedule(1.0)),
            reward=news.reward,
            crash_rate=news.crash_rate,
            best_lap_s=news.best_lap_s,
            tried_speed=marks.speed if marks else None,
            tried_crash_rate=marks.crash_rate if marks else None,
            tried_best_lap_s=marks.best_lap_s if marks else None,
            tried_reward=marks.reward if marks else None,
            rating=rated.mu if rated else None,
            rating_sigma=rated.sigma if rated else None,
            stage=self.stages.number if self.stages else None,
        )
