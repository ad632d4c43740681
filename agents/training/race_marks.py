"""Figures of a policy that races, and of the episodes in which it learns."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from race_agents.training.settings import Goal
from race_server.core import codes
from race_server.core.clock import TICKS_PER_SECOND
from race_server.envs.batch import Batch

# Takes observations (n, size), returns actions (n, A).
Decide = Callable[[NDArray[np.float32]], NDArray[Any]]


@dataclass(frozen=True)
class RaceMarks:
    """Figures of a policy on one course over all seeds, or on all courses."""

    track: str
    speed: float  # [m/s] along the centre line until the time limit, crashes included
    crash_rate: float  # share of the karts that crashed
    laps: float  # of a kart
    best_lap_s: float | None
    reward: float  # of an episode, the mean
    runs: int

    courses: ClassVar[str] = "tracks"
    heads: ClassVar[tuple[str, ...]] = ("speed [m/s]", "crash rate", "laps", "best lap [s]")

    @property
    def course(self) -> str:
        """The name of the track."""
        return self.track

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

    def cells(self) -> tuple[str, ...]:
        """Return the figures as text, one for each of `heads`."""
        lap = "–" if self.best_lap_s is None else f"{self.best_lap_s:.2f}"
        return f"{self.speed:.2f}", f"{self.crash_rate:.2f}", f"{self.laps:.1f}", lap

    def __str__(self) -> str:
        """Return the figures in one line."""
        lap = "no lap" if self.best_lap_s is None else f"best lap {self.best_lap_s:.2f} s"
        return f"{self.speed:.2f} m/s, {100.0 * self.crash_rate:.0f} % crash, {lap}"

    def row(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return asdict(self)

    def point(self) -> dict[str, float | None]:
        """Return the figures under their names in the curve."""
        return {
            "tried_speed": self.speed,
            "tried_crash_rate": self.crash_rate,
            "tried_best_lap_s": self.best_lap_s,
            "tried_reward": self.reward,
        }


def learning_figures(episodes: Sequence[Mapping[str, Any]]) -> dict[str, float | None]:
    """Return the figures of episodes of a training, under their names in the curve."""
    laps = [float(row["best_lap_s"]) for row in episodes if row["best_lap_s"] > 0.0]
    crashes = [float(row["crashes"]) for row in episodes]
    return {
        "crash_rate": float(np.mean(crashes)) if crashes else None,
        "best_lap_s": min(laps, default=None),
    }


def learning_words(figures: Mapping[str, float | None]) -> str:
    """Return the figures of a training's episodes in a few words."""
    lap, crashes = figures["best_lap_s"], figures["crash_rate"]
    words = "–" if lap is None else f"{lap:.2f} s"
    return f"lap {words}, crashes {'–' if crashes is None else f'{100.0 * crashes:.0f} %'}"


def race(name: str, batch: Batch, decide: Decide, seed: int, seconds: float) -> RaceMarks:
    """Return the figures of a policy in all worlds of a batch.

    seconds: until an episode is over.
    """
    seen = batch.reset(seed)
    learners, decision_s = batch.learners, batch.task.decision_ticks / TICKS_PER_SECOND
    begun = batch.world.racers["distance"][:, :learners].copy()
    times, cut = np.zeros(begun.shape), np.zeros(begun.shape, np.bool_)
    for step in range(round(seconds / decision_s)):
        batch.step(decide(seen.reshape(-1, batch.layout.size)))
        over = (batch.terminated | batch.truncated).astype(bool)
        times[over] = (step + 1) * decision_s
        cut |= batch.truncated.astype(bool)
        if batch.buffers.idle.all():
            break
    ended = batch.buffers.ended
    # A kart that crashed, or stood until it was out, could have used the rest of the time; a
    # kart that finished could not.
    done = cut | (ended["status"] == codes.FINISHED)
    metres = batch.world.racers["distance"][:, :learners] - begun
    speeds: NDArray[Any] = metres / np.where(done, np.maximum(times, decision_s), seconds)
    laps = ended["best_lap_us"][ended["best_lap_us"] > 0]
    return RaceMarks(
        track=name,
        speed=float(speeds.mean()),
        crash_rate=float((ended["crashes"] > 0).mean()),
        laps=float(ended["laps"].mean()),
        best_lap_s=float(laps.min()) / 1e6 if len(laps) else None,
        reward=float(ended["total"].mean()),
        runs=int(speeds.size),
    )


def together(marks: Sequence[RaceMarks]) -> RaceMarks:
    """Return the means over several courses."""

    def mean(name: str) -> float:
        return float(np.mean([getattr(one, name) for one in marks]))

    laps = [one.best_lap_s for one in marks if one.best_lap_s is not None]
    return RaceMarks(
        track="all",
        speed=mean("speed"),
        crash_rate=mean("crash_rate"),
        laps=mean("laps"),
        best_lap_s=min(laps, default=None),
        reward=mean("reward"),
        runs=sum(one.runs for one in marks),
    )
