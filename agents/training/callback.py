"""Monitor a training: report it, evaluate the policy, save the best, end it in time."""

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
from race_agents.training.divergence import check_sound
from race_agents.training.evaluation import (
    Examiner,
    Marks,
    basis_of,
    learning_figures,
    learning_words,
)
from race_agents.training.normaliser import Normaliser
from race_agents.training.self_play import SelfPlay
from race_agents.training.settings import Settings
from race_agents.training.tasks import validation_courses
from race_server.storage.results.ratings import Rating

CURVE, LATEST = "curve.csv", "latest.pt"
TELL_S = 1.0  # between two progress reports
SAVE_S = 10.0  # between two checkpoints, at least
ROWS = 200  # of the curve besides those of evaluations, over a whole training, at most


@dataclass(frozen=True)
class TrainingProgress:
    """Progress of a training."""

    share: float
    steps: int
    steps_per_s: float
    reward: float | None
    figures: str  # of the last episodes, in a few words
    method: str  # imitation, or the name of the algorithm
    marks: Marks | None = None
    ratings: tuple[Rating, ...] = ()  # if they have just changed, the strongest first
    stage: str = ""  # of the curriculum, as text


Tell = Callable[[TrainingProgress], None]


class TrainingCallback(BaseCallback):
    """Called by the learner at every decision."""

    def __init__(
        self,
        settings: Settings,
        folder: Path,
        world: Normaliser,
        budget: Budget,
        tell: Tell,
        best_score: float = -np.inf,
        self_play: SelfPlay | None = None,
        log: Path | None = None,
    ) -> None:
        """Monitor a training whose files go into `folder`. log: a folder for TensorBoard."""
        super().__init__()
        self.settings = settings
        self.budget = budget
        self.self_play = self_play
        stages = companions_in(world).get(CURRICULUM)
        self.stages = stages if isinstance(stages, Curriculum) else None
        tried = settings.evaluation
        self.examiner = Examiner(settings, validation_courses(settings), tried.first_seed)
        self.best: list[Marks] = []
        self.best_score = best_score
        self.last: list[Marks] = []
        self.reached = False
        self.method: str = settings.algorithm.name
        self._folder = folder
        self._world = world
        self._tell = tell
        self._log = configure(str(log), ["tensorboard"]) if log is not None else None
        self._told = self._saved = time.monotonic()
        self._told_steps = budget.done
        self._rate = 0.0
        self._rows = int(budget.share * ROWS)
        self._tries = int(budget.share * settings.evaluation.times)

    def decide(self, seen: NDArray[np.float32]) -> NDArray[Any]:
        """Return the learner's best actions."""
        actions: NDArray[Any] = self.model.predict(
            self._world.normalize_obs(seen),
            deterministic=True,
        )[0]
        return actions

    def imitated(self, decisions: int) -> bool:
        """Count decisions outside of the learner's own worlds; return whether to continue."""
        self.budget.done += decisions
        if time.monotonic() - self._told > TELL_S:
            self._look()
        self._save_in_time()
        self._examine_in_time()
        return not self.reached

    def _on_step(self) -> bool:
        self.budget.done += self.training_env.num_envs
        if time.monotonic() - self._told > TELL_S:
            self._look()
        # Steps end with a whole rollout, which is learned from; minutes end at once.
        is_late = self.budget.steps is None and self.budget.is_over
        return not (is_late or self.reached)

    def _on_rollout_start(self) -> None:
        check_sound(self.model)
        # Between rollouts, so that no policy is evaluated between its gradient steps.
        self._save_in_time()
        if self.self_play is not None and self.self_play.go_on(self.model, self.budget.done):
            self._look(rated=True)
        self._examine_in_time()

    def _save_in_time(self) -> None:
        if time.monotonic() - self._saved > SAVE_S:
            self._save()

    def _examine_in_time(self) -> None:
        if int(self.budget.share * self.settings.evaluation.times) > self._tries:
            self.examine()

    def examine(self) -> None:
        """Evaluate the policy, and save it if it is the best so far, or reaches the goal.

        Raises:
            DivergedError: the network has diverged.
        """
        self._tries = int(self.budget.share * self.settings.evaluation.times)
        self._look()  # so that the time of the evaluation does not count in the rate of learning
        self._save()
        self.last = self.examiner.examine(self.decide)
        score = self.last[-1].score(self.settings.evaluation.score)
        self.reached = self.last[-1].reaches(self.settings.goal)
        if score > self.best_score or self.reached:
            self.best, self.best_score = self.last, score
            basis = basis_of(self.settings)
            save_checkpoint(self._folder / BEST, self.model, self._world, self.budget, score, basis)
        self._look(self.last[-1])

    def _save(self) -> None:
        """Save what is learned, so that a training that is killed goes on from there.

        Raises:
            DivergedError: the network has diverged: what was saved last stays.
        """
        check_sound(self.model)
        save_checkpoint(self._folder / LATEST, self.model, self._world, self.budget)
        self._saved = time.monotonic()

    def _look(self, marks: Marks | None = None, *, rated: bool = False) -> None:
        now = time.monotonic()
        if self.budget.done > self._told_steps:
            self._rate = (self.budget.done - self._told_steps) / max(now - self._told, 1e-6)
        self._told, self._told_steps = now, self.budget.done
        news = self._news(self._rate, marks)
        if rated and self.self_play is not None:
            news = replace(news, ratings=tuple(self.self_play.ratings))
        self._tell(news)
        row = int(self.budget.share * ROWS)
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

    @property
    def _episodes(self) -> list[dict[str, Any]]:
        """The last hundred episodes."""
        return list(self.model.ep_info_buffer or ())

    def _news(self, rate: float, marks: Marks | None) -> TrainingProgress:
        episodes = self._episodes
        return TrainingProgress(
            share=self.budget.share,
            steps=self.budget.done,
            steps_per_s=rate,
            reward=float(np.mean([row["r"] for row in episodes])) if episodes else None,
            figures=learning_words(self.settings, learning_figures(self.settings, episodes)),
            method=self.method,
            marks=marks,
            stage=str(self.stages) if self.stages else "",
        )

    def _point(self, news: TrainingProgress) -> Point:
        marks = news.marks
        rated = self.self_play.newest if self.self_play is not None else None
        return Point(
            minutes=self.budget.seconds / 60.0,
            steps=news.steps,
            steps_per_s=news.steps_per_s,
            learning_rate=float(self.model.lr_schedule(1.0)),
            reward=news.reward,
            **learning_figures(self.settings, self._episodes),
            **(marks.point() if marks else {}),
            rating=rated.mu if rated else None,
            rating_sigma=rated.sigma if rated else None,
            stage=self.stages.number if self.stages else None,
        )
