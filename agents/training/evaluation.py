"""Evaluation of a policy on courses and seeds that it did not learn on."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.training import parking_marks, race_marks
from race_agents.training.parking_marks import Episode, ParkingMarks
from race_agents.training.race_marks import Decide, RaceMarks
from race_agents.training.settings import Settings
from race_agents.training.tasks import evaluation_tasks
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY

Marks = RaceMarks | ParkingMarks


@dataclass
class Examiner:
    """The worlds in which policies are evaluated, built once."""

    settings: Settings
    courses: tuple[str, ...]
    first_seed: int
    batches: dict[str, Batch] = field(default_factory=dict)

    def _batch(self, name: str) -> Batch:
        if not self.batches:
            seeds = self.settings.evaluation.seeds
            for course, task in evaluation_tasks(self.settings, self.courses).items():
                self.batches[course] = Batch(task, worlds=seeds, seed=self.first_seed, after=STAY)
        return self.batches[name]

    def examine(self, decide: Decide) -> list[Marks]:
        """Return marks for each course, and for all of them at the end."""
        seed, seconds = self.first_seed, self.settings.evaluation.seconds
        if self.settings.parks:
            driven, vehicles = self.park(decide), self.settings.race.learners
            every = [episode for episodes in driven.values() for episode in episodes]
            every_lot = [parking_marks.marks_of(*one, vehicles) for one in driven.items()]
            return [*every_lot, parking_marks.marks_of("all", every, vehicles)]
        raced = [
            race_marks.race(name, self._batch(name), decide, seed, seconds) for name in self.courses
        ]
        return [*raced, race_marks.together(raced)]

    def park(self, decide: Decide) -> dict[str, list[Episode]]:
        """Return the episodes of a policy in each lot, one for each seed."""
        return {
            name: parking_marks.park(self._batch(name), decide, self.first_seed)
            for name in self.courses
        }

    def observations(self, decide: Decide, steps: int) -> NDArray[np.float32]:
        """Return observations of karts that a policy drives, shape (n, size)."""
        batch = self._batch(self.courses[0])
        first = batch.reset(self.first_seed)
        seen = [first.reshape(-1, batch.layout.size).copy()]
        for _ in range(steps):
            batch.step(decide(seen[-1]))
            seen.append(batch.observations.reshape(-1, batch.layout.size).copy())
        return np.concatenate(seen)

    def close(self) -> None:
        """Close the worlds."""
        for batch in self.batches.values():
            batch.close()


def basis_of(settings: Settings) -> str:
    """Return, as text, what a score of an evaluation depends on: others compare with none of it."""
    unused = {"times", "final", "final_lots"}
    tables: dict[str, Any] = {
        "evaluation": settings.evaluation.model_dump(
            mode="json", exclude=unused, exclude_defaults=True
        )
    }
    by_return = settings.evaluation.score == "return"
    if by_return:
        tables["reward"] = settings.reward
    if settings.parks:
        judged = None if by_return else {"lots", "level", "limit_s"}
        tables["parking"] = settings.parking.model_dump(
            mode="json", include=judged, exclude_defaults=True
        )
    return json.dumps(tables, sort_keys=True)


def learning_figures(
    settings: Settings, episodes: Sequence[Mapping[str, Any]]
) -> dict[str, float | None]:
    """Return the figures of a training's last episodes, under their names in the curve."""
    kind = parking_marks if settings.parks else race_marks
    return kind.learning_figures(episodes)


def learning_words(settings: Settings, figures: Mapping[str, float | None]) -> str:
    """Return these figures in a few words."""
    kind = parking_marks if settings.parks else race_marks
    return kind.learning_words(figures)
