"""Evaluation of a policy on courses and seeds that it did not learn on."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.training.settings import Goal, Settings, Tracks
from race_agents.training.tasks import decision_s, evaluation_tasks
from race_server.core import codes
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.scenario.track.sets import names_of

# Takes observations (n, size), returns actions (n, A).
Decide = Callable[[NDArray[np.float32]], NDArray[Any]]


@dataclass(frozen=True)
class Marks:
    """Figures of a policy on one course over all seeds, or on all courses."""

    track: str
    speed: float  # [m/s] along the centre line until the time limit, crashes included
    crash_rate: float  # share of the karts that crashed
    laps: float  # of a kart
    best_lap_s: float | None
    reward: float  # of an episode, the mean
    runs: int

    def reaches(self, goal: Goal) -> bool:
        """Return whether all parts of a goal are reached; never without any part."""
        wanted = goal.model_dump(exclude_none=True)
        lap = self.best_lap_s if self.best_lap_s is not None else np.inf
        return bool(wanted) and (
            self.speed >= wanted.get("speed", 0.0)
            and self.crash_rate <= wanted.get("crash_rate", 1.0)
            and lap <= wanted.get("best_lap_s", np.inf)
        )

    def score(self, kind: str) -> float:
        """Return the score by which policies are compared, higher is better."""
        return self.speed if kind == "speed" else self.reward


@dataclass
class Examiner:
    """The worlds in which policies are evaluated, built once."""

    settings: Settings
    tracks: Tracks
    first_seed: int
    batches: dict[str, Batch] = field(default_factory=dict)

    @property
    def _names(self) -> tuple[str, ...]:
        return names_of(self.tracks.names, self.tracks.set)

    def _batch(self, name: str) -> Batch:
        if not self.batches:
            seeds = self.settings.evaluation.seeds
            for track, task in evaluation_tasks(self.settings, self.tracks).items():
                self.batches[track] = Batch(task, worlds=seeds, seed=self.first_seed, after=STAY)
        return self.batches[name]

    def examine(self, decide: Decide) -> list[Marks]:
        """Return marks for each track, and for all of them at the end."""
        marks = [self._examine_on(name, decide) for name in self._names]
        return [*marks, _together(marks)]

    def observations(self, decide: Decide, steps: int) -> NDArray[np.float32]:
        """Return observations of karts that a policy drives, shape (n, size)."""
        batch = self._batch(self._names[0])
        first = batch.reset(self.first_seed)
        seen = [first.reshape(-1, batch.layout.size).copy()]
        for _ in range(steps):
            batch.step(decide(seen[-1]))
            seen.append(batch.observations.reshape(-1, batch.layout.size).copy())
        return np.concatenate(seen)

    def _examine_on(self, name: str, decide: Decide) -> Marks:
        batch = self._batch(name)
        seen = batch.reset(self.first_seed)
        learners = batch.learners
        begun = batch.world.racers["distance"][:, :learners].copy()
        times, cut = np.zeros(begun.shape), np.zeros(begun.shape, np.bool_)
        horizon = self.settings.evaluation.seconds
        for step in range(round(horizon / decision_s())):
            batch.step(decide(seen.reshape(-1, batch.layout.size)))
            over = (batch.terminated | batch.truncated).astype(bool)
            times[over] = (step + 1) * decision_s()
            cut |= batch.truncated.astype(bool)
            if batch.buffers.idle.all():
                break
        ended = batch.buffers.ended
        crashed = ended["crashes"] > 0
        # A kart that crashed, or stood until it was out, could have used the rest of the time; a
        # kart that finished could not.
        done = cut | (ended["status"] == codes.FINISHED)
        metres = batch.world.racers["distance"][:, :learners] - begun
        speeds = metres / np.where(done, np.maximum(times, decision_s()), horizon)
        laps = ended["best_lap_us"][ended["best_lap_us"] > 0]
        return Marks(
            track=name,
            speed=float(speeds.mean()),
            crash_rate=float(crashed.mean()),
            laps=float(ended["laps"].mean()),
            best_lap_s=float(laps.min()) / 1e6 if len(laps) else None,
            reward=float(ended["total"].mean()),
            runs=int(speeds.size),
        )

    def close(self) -> None:
        """Close the worlds."""
        for batch in self.batches.values():
            batch.close()


def _together(marks: list[Marks]) -> Marks:
    def mean(name: str) -> float:
        return float(np.mean([asdict(one)[name] for one in marks]))

    laps = [one.best_lap_s for one in marks if one.best_lap_s is not None]
    return Marks(
        track="all",
        speed=mean("speed"),
        crash_rate=mean("crash_rate"),
        laps=mean("laps"),
        best_lap_s=min(laps, default=None),
        reward=mean("reward"),
        runs=sum(one.runs for one in marks),
    )
