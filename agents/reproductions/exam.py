"""Figures of a trained policy, which starts again after each crash."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.reproductions.plan import Exam
from race_agents.training.settings import Settings
from race_agents.training.tasks import evaluation_tasks
from race_server.envs.batch import Batch
from race_server.envs.buffers import RESET_WORLD
from race_server.envs.racing.reward_terms import TERMS
from race_server.scenario.track.sets import names_of

Decide = Callable[[NDArray[np.float32]], NDArray[Any]]

FIRST_SEED = 70_000  # far from those of training
# After a start ranks are sorted for the first time, which gains no place.
SETTLED_S = 1.0
_AT = {name: number for number, name in enumerate(TERMS)}


@dataclass(frozen=True)
class Figures:
    """Figures of a policy in an exam, over all tracks and starts."""

    minutes: float  # of driving
    reward: float  # of a decision, crashes included
    speed: float  # [m/s]
    nearest: float  # [m] mean distance to the nearest obstacle
    crashes: int
    crashes_per_minute: float
    stops: int  # episodes that ended without a crash: the kart stood, or drove the wrong way
    places_per_minute: float  # gained, less those lost
    laps: int  # whole ones, from a start or flying
    median_lap_s: float | None
    best_lap_s: float | None


def examine(settings: Settings, exam: Exam, decide: Decide) -> Figures:
    """Drive a policy on all tracks of an exam."""
    race = settings.race.model_copy(update={"karts": 1, "opponents": ()})
    tried = settings.evaluation.model_copy(update={"seconds": exam.seconds})
    changed: dict[str, Any] = {"evaluation": tried, **({"race": race} if exam.alone else {})}
    courses = names_of(exam.tracks.names, exam.tracks.set)
    tasks = evaluation_tasks(settings.model_copy(update=changed), courses)
    tally = _Tally(settings.decision_s)
    for task in tasks.values():
        begun = task.with_options(random_start=exam.random_start, most_steps=0)
        batch = Batch(begun, worlds=exam.seeds, seed=FIRST_SEED, after=RESET_WORLD)
        tally.drive(batch, decide, round(exam.seconds / settings.decision_s))
        batch.close()
    return tally.figures()


class _Tally:
    """Counts over several batches."""

    def __init__(self, decision_s: float) -> None:
        self._decision_s = decision_s
        self.rewards: list[NDArray[Any]] = []
        self.terms: list[NDArray[Any]] = []
        self.laps_us: list[int] = []
        self.crashes = self.ends = 0
        self.places = 0.0

    def drive(self, batch: Batch, decide: Decide, steps: int) -> None:
        seen = batch.reset(FIRST_SEED)
        laps = np.zeros(batch.worlds, np.int64)
        settled = round(SETTLED_S / self._decision_s)
        for _ in range(steps):
            young = batch.buffers.episodes["steps"][:, 0] < settled
            batch.step(decide(seen.reshape(batch.worlds, -1)))
            terms = batch.buffers.terms[:, 0]
            self.rewards.append(batch.rewards[:, 0].copy())
            self.terms.append(terms.copy())
            self.places += float(terms[~young, _AT["places"]].sum())
            over = batch.terminated[:, 0].astype(bool)
            self.ends += int(over.sum())
            self.crashes += int((terms[:, _AT["crash"]] > 0.0).sum())
            # A world that was reset keeps the figures of its last episode elsewhere.
            episodes = batch.buffers.episodes[:, 0]
            now = np.where(over, batch.buffers.ended[:, 0]["laps"], episodes["laps"])
            last = np.where(over, batch.buffers.ended[:, 0]["last_lap_us"], episodes["last_lap_us"])
            self.laps_us += [int(lap) for lap in last[now > laps]]
            laps = np.where(over, 0, now)

    def figures(self) -> Figures:
        terms = np.concatenate(self.terms)
        minutes = len(terms) * self._decision_s / 60.0
        laps = np.array(self.laps_us) / 1e6
        return Figures(
            minutes=minutes,
            reward=float(np.concatenate(self.rewards).mean()),
            speed=float(terms[:, _AT["speed"]].mean()),
            nearest=float(terms[:, _AT["range"]].mean()),
            crashes=self.crashes,
            crashes_per_minute=self.crashes / minutes,
            stops=self.ends - self.crashes,
            places_per_minute=self.places / minutes,
            laps=len(laps),
            median_lap_s=float(np.median(laps)) if len(laps) else None,
            best_lap_s=float(laps.min()) if len(laps) else None,
        )
