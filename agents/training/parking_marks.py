"""Figures of a policy that parks, and of the episodes in which it learns."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from race_agents.training.race_marks import Decide
from race_agents.training.settings import Goal
from race_server.competition.parking_tally import COLLISIONS, ParkingTally
from race_server.envs.batch import Batch

Episode = Mapping[str, Any]


@dataclass(frozen=True)
class ParkingMarks:
    """Figures of a policy in one lot over all seeds, or in all lots."""

    lot: str
    reward: float  # of an episode, the mean
    tally: ParkingTally

    courses: ClassVar[str] = "lots"
    heads: ClassVar[tuple[str, ...]] = (
        *("parked [%]", "aligned [%]", "collisions [%]", "people hit [%]", "time [s]"),
    )

    @property
    def course(self) -> str:
        """The name of the lot."""
        return self.lot

    @property
    def hits(self) -> float:
        """Share of the episodes that ended at a wall, a block, a vehicle or a person."""
        return self.tally.collisions / max(self.tally.episodes, 1)

    def reaches(self, goal: Goal) -> bool:
        """Return whether all parts of a goal are reached; never without any part."""
        wanted = goal.model_dump(exclude_none=True)
        return bool(wanted) and (
            self.tally.success_rate >= wanted.get("parked", 0.0)
            and self.tally.aligned_rate >= wanted.get("aligned", 0.0)
            and self.hits <= wanted.get("hits", 1.0)
        )

    def score(self, kind: str) -> float:
        """Return the score by which policies are compared, higher is better."""
        if kind == "return":
            return self.reward
        return 0.5 * (self.tally.success_rate + self.tally.aligned_rate)

    def cells(self) -> tuple[str, ...]:
        """Return the figures as text, one for each of `heads`."""
        tally = self.tally
        return (
            _with_bounds(tally.success_rate, tally.success_interval),
            _with_bounds(tally.aligned_rate, tally.aligned_interval),
            f"{100.0 * self.hits:.1f}",
            f"{100.0 * tally.hit_people / max(tally.episodes, 1):.1f}",
            "–" if tally.time_s_median is None else f"{tally.time_s_median:.1f}",
        )

    def __str__(self) -> str:
        """Return the figures in one line."""
        tally = self.tally
        return (
            f"{_percent(tally.success_rate)} park, {_percent(tally.aligned_rate)} aligned, "
            f"{tally.collisions} collisions and {tally.hit_people} hits of people in "
            f"{tally.episodes}"
        )

    def row(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return {"lot": self.lot, "reward": self.reward, **asdict(self.tally)}

    def point(self) -> dict[str, float | None]:
        """Return the figures under their names in the curve."""
        return {
            "tried_parked": self.tally.success_rate,
            "tried_aligned": self.tally.aligned_rate,
            "tried_hits": self.hits,
            "tried_reward": self.reward,
        }


def learning_figures(episodes: Sequence[Episode]) -> dict[str, float | None]:
    """Return the figures of episodes of a training, under their names in the curve."""
    if not episodes:
        return dict.fromkeys(("parked", "aligned", "hits"))
    return {
        "parked": float(np.mean([one["is_success"] for one in episodes])),
        "aligned": float(np.mean([one["aligned"] for one in episodes])),
        "hits": float(np.mean([one["ending"] in COLLISIONS for one in episodes])),
    }


def learning_words(figures: Mapping[str, float | None]) -> str:
    """Return the figures of a training's episodes in a few words."""
    return ", ".join(
        f"{name} {'–' if value is None else _percent(value)}" for name, value in figures.items()
    )


def park(batch: Batch, decide: Decide, seed: int) -> list[Episode]:
    """Return the episodes of a policy in all worlds of a batch, the first of `seed`."""
    seen = batch.reset(seed)
    while not batch.buffers.idle.all():
        batch.step(decide(seen.reshape(-1, batch.layout.size)))
    return [batch.episode_of(w, k) for w in range(batch.worlds) for k in range(batch.learners)]


def marks_of(name: str, episodes: Sequence[Episode]) -> ParkingMarks:
    """Return the figures of episodes in a lot, or in several that have a name together."""
    reward = float(np.mean([one["r"] for one in episodes]))
    return ParkingMarks(name, reward, ParkingTally.of(episodes))


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _with_bounds(share: float, bounds: tuple[float, float]) -> str:
    """Return a share and the bounds of its interval of 95 %, in percent."""
    return f"{100.0 * share:.1f} ({100.0 * bounds[0]:.1f} to {100.0 * bounds[1]:.1f})"
