"""Figures of a policy that parks, and of the episodes in which it learns."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

import numpy as np

from race_agents.training.race_marks import Decide
from race_agents.training.settings import Goal
from race_server.competition.parking_tally import COLLISIONS, ParkingTally
from race_server.competition.team_tally import TeamTally
from race_server.envs.batch import Batch

Episode = Mapping[str, Any]


@dataclass(frozen=True)
class ParkingMarks:
    """Figures of a policy in one lot over all seeds, or in all lots."""

    lot: str
    reward: float  # of an episode, the mean
    tally: ParkingTally
    teams: TeamTally | None = None  # where several learn in a lot

    courses: ClassVar[str] = "lots"

    @property
    def heads(self) -> tuple[str, ...]:
        """The names and units of `cells`."""
        own = ("parked [%]", "aligned [%]", "collisions [%]", "people hit [%]", "time [s]")
        of_all = ("all parked [%]", "rounds with a contact [%]", "stuck [%]")
        return own if self.teams is None else (*own, *of_all)

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
        tally, teams = self.tally, self.teams
        own = (
            _with_bounds(tally.success_rate, tally.success_interval),
            _with_bounds(tally.aligned_rate, tally.aligned_interval),
            f"{100.0 * self.hits:.1f}",
            f"{100.0 * tally.hit_people / max(tally.episodes, 1):.1f}",
            "–" if tally.time_s_median is None else f"{tally.time_s_median:.1f}",
        )
        if teams is None:
            return own
        return (
            *own,
            _with_bounds(teams.all_parked_rate, teams.all_parked_interval),
            f"{100.0 * teams.contacts / max(teams.rounds, 1):.1f}",
            f"{100.0 * teams.stuck / max(teams.rounds, 1):.1f}",
        )

    def __str__(self) -> str:
        """Return the figures in one line."""
        tally = self.tally
        words = (
            f"{_percent(tally.success_rate)} park, {_percent(tally.aligned_rate)} aligned, "
            f"{tally.collisions} collisions and {tally.hit_people} hits of people in "
            f"{tally.episodes}"
        )
        if self.teams is None:
            return words
        return f"{words}; all {self.teams.vehicles} in {_percent(self.teams.all_parked_rate)}"

    def row(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        row = {"lot": self.lot, "reward": self.reward, **asdict(self.tally)}
        return row if self.teams is None else {**row, "teams": asdict(self.teams)}

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


def marks_of(name: str, episodes: Sequence[Episode], vehicles: int = 1) -> ParkingMarks:
    """Return the figures of episodes in a lot, or in several that have a name together.

    vehicles: of a round; its episodes are neighbours.
    """
    reward = float(np.mean([one["r"] for one in episodes]))
    teams = TeamTally.of(episodes, vehicles) if vehicles > 1 else None
    return ParkingMarks(name, reward, ParkingTally.of(episodes), teams)


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"


def _with_bounds(share: float, bounds: tuple[float, float]) -> str:
    """Return a share and the bounds of its interval of 95 %, in percent."""
    return f"{100.0 * share:.1f} ({100.0 * bounds[0]:.1f} to {100.0 * bounds[1]:.1f})"
