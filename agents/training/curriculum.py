"""The curriculum: which tracks or lots are drawn, stage by stage, and how far from the slot."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from race_agents.training.budget import Budget
from race_agents.training.settings import Settings, Stage
from race_agents.training.tasks import choices_of, courses_of
from race_server.errors import ScenarioError

NONE_YET = -1  # in place of the number of a stage


class Curriculum:
    """Decides which stage of a training runs.

    The next stage begins once enough episodes of this one succeed, or at its share of the training.
    """

    def __init__(self, settings: Settings, budget: Budget) -> None:
        """Compute the weights of each stage.

        Raises:
            ScenarioError: a stage names a track or lot that is not trained on, or a distance
                without lots.
        """
        self.stages = sorted(settings.curriculum, key=lambda stage: stage.after)
        self._weights = [_weights(stage, settings) for stage in self.stages]
        self._budget = budget
        self._karts = settings.worlds * settings.race.learners
        self._number = self._told = NONE_YET
        self._since = 0  # decisions of all karts before the stage
        self._successes: deque[bool] = deque()

    def __call__(
        self, decisions: int, episodes: Sequence[Mapping[str, Any]]
    ) -> Sequence[float] | None:
        """Return the weights of a stage that begins now, None otherwise.

        decisions: of all karts so far; episodes: those that have ended now, none at a reset.
        """
        self._note(decisions, episodes)
        while self._is_over():
            self._number += 1
            self._successes.clear()
            # A kart that has just ended an episode has begun the next one already. At a reset all
            # begin after this.
            self._since = decisions if episodes else decisions - 1
        if self._number == self._told:
            return None
        self._told = self._number
        return self._weights[self._number]

    def _note(self, decisions: int, episodes: Sequence[Mapping[str, Any]]) -> None:
        """Count the episodes that belong to the stage."""
        if self._number == NONE_YET:
            return
        stage = self.stages[self._number]
        for episode in episodes:
            if episode["l"] * self._karts < decisions - self._since:
                self._successes.append(_is_success(stage, episode))
        while len(self._successes) > stage.episodes:
            self._successes.popleft()

    def _is_over(self) -> bool:
        following = self._number + 1
        if following >= len(self.stages):
            return False
        return self._has_succeeded() or self.stages[following].after <= self._budget.share

    def _has_succeeded(self) -> bool:
        if self._number == NONE_YET:
            return False
        stage = self.stages[self._number]
        if stage.until_success is None or len(self._successes) < stage.episodes:
            return False
        return self.success_rate >= stage.until_success

    # Read by others

    @property
    def number(self) -> int:
        """Number of the stage that runs, from 1 on; 0 before the first."""
        return self._number + 1

    @property
    def success_rate(self) -> float:
        """Share of the stage's last episodes that succeeded; 0 before the first has ended."""
        return sum(self._successes) / max(len(self._successes), 1)

    def __str__(self) -> str:
        """Return a text on the present stage."""
        if self._number == NONE_YET:
            return "before the first stage"
        words = f"stage {self.number} of {len(self.stages)}"
        stage = self.stages[self._number]
        if stage.until_success is None or self.number == len(self.stages):
            return words
        return f"{words}, {100.0 * self.success_rate:.0f} % succeed"

    # Checkpoints

    def state(self) -> dict[str, Any]:
        """Return the state of the curriculum as plain data."""
        return {"number": self._number, "successes": [int(one) for one in self._successes]}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a state that `state` returned."""
        self._number = min(int(state["number"]), len(self.stages) - 1)
        self._told, self._since = NONE_YET, -1
        self._successes = deque(bool(one) for one in state["successes"])


def _weights(stage: Stage, settings: Settings) -> list[float]:
    """Return the weight of each scenario of the task to learn."""
    courses = courses_of(settings)
    here, elsewhere = (stage.lots, stage.tracks) if settings.parks else (stage.tracks, stage.lots)
    unknown = [*elsewhere, *(name for name in here if name not in courses)]
    if unknown:
        raise ScenarioError(
            f"curriculum: {unknown[0]!r} is not trained on; choose from {', '.join(courses)}"
        )
    if stage.distance is not None and not settings.parks:
        raise ScenarioError(
            f"curriculum: distance = {list(stage.distance)} without parking.lots: only in a lot "
            "is there a slot to be that far from"
        )
    wanted = here or courses
    return [
        float(choice.course in wanted and choice.distance == stage.distance)
        for choice in choices_of(settings)
    ]


def _is_success(stage: Stage, episode: Mapping[str, Any]) -> bool:
    if "is_success" in episode:  # of a lot
        return bool(episode["is_success"])
    return bool(episode["laps"] >= stage.success_laps and not episode["crashes"])
