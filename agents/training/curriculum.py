"""The curriculum: which tracks are drawn, stage by stage."""

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

from race_agents.training.budget import Budget
from race_agents.training.settings import Settings
from race_server.errors import ScenarioError
from race_server.scenario.track.sets import names_of

NONE_YET = -1  # in place of the number of a stage


class Curriculum:
    """Says which stage of a training runs.

    The next one begins once enough episodes of the stage succeed, or at its share of the training.
    """

    def __init__(self, settings: Settings, pace: Budget) -> None:
        """Work out the weights of each stage.

        Raises:
            ScenarioError: a stage names a track that is not trained on.
        """
        names = names_of(settings.tracks.names, settings.tracks.set)
        self.stages = sorted(settings.curriculum, key=lambda stage: stage.after)
        for track in (track for stage in self.stages for track in stage.tracks):
            if track not in names:
                raise ScenarioError(
                    f"curriculum: {track!r} is not trained on; choose from {', '.join(names)}"
                )
        self._weights = [
            # Of each track there is a scenario for each number of karts.
            [float(name in (stage.tracks or names)) for name in names for _ in settings.race.sizes]
            for stage in self.stages
        ]
        self._pace = pace
        self._karts = settings.worlds * settings.race.learners
        self._number = self._told = NONE_YET
        self._since = 0  # decisions of all karts before the stage
        self._successes: deque[bool] = deque()

    def __call__(
        self, decisions: int, episodes: Sequence[Mapping[str, Any]]
    ) -> Sequence[float] | None:
        """Return the weights of the stage that begins now; None while it lasts.

        decisions: of all karts so far; episodes: those that have ended now, none at a reset.
        """
        self._note(decisions, episodes)
        while self._is_over():
            self._number += 1
            self._successes.clear()
            # Who has just ended an episode has begun the next one already. At a reset all begin
            # after this.
            self._since = decisions if episodes else decisions - 1
        if self._number == self._told:
            return None
        self._told = self._number
        return self._weights[self._number]

    def _note(self, decisions: int, episodes: Sequence[Mapping[str, Any]]) -> None:
        """Take note of the episodes that belong to the stage."""
        if self._number == NONE_YET:
            return
        stage = self.stages[self._number]
        for episode in episodes:
            if episode["l"] * self._karts < decisions - self._since:
                has_laps = episode["laps"] >= stage.success_laps
                self._successes.append(has_laps and not episode["crashes"])
        while len(self._successes) > stage.episodes:
            self._successes.popleft()

    def _is_over(self) -> bool:
        following = self._number + 1
        if following >= len(self.stages):
            return False
        return self._has_succeeded() or self.stages[following].after <= self._pace.share

    def _has_succeeded(self) -> bool:
        if self._number == NONE_YET:
            return False
        stage = self.stages[self._number]
        if stage.until_success is None or len(self._successes) < stage.episodes:
            return False
        return self.success_rate >= stage.until_success

    # What others read

    @property
    def number(self) -> int:
        """Number of the stage that runs, from 1 on; 0 before the first."""
        return self._number + 1

    @property
    def success_rate(self) -> float:
        """Share of the stage's last episodes that succeeded; 0 before the first is over."""
        return sum(self._successes) / max(len(self._successes), 1)

    def __str__(self) -> str:
        """Return in words which stage runs."""
        if self._number == NONE_YET:
            return "before the first stage"
        words = f"stage {self.number} of {len(self.stages)}"
        stage = self.stages[self._number]
        if stage.until_success is None or self.number == len(self.stages):
            return words
        return f"{words}, {100.0 * self.success_rate:.0f} % succeed"

    # A training that goes on

    def state(self) -> dict[str, Any]:
        """Return where the curriculum stands, as plain data."""
        return {"number": self._number, "successes": [int(one) for one in self._successes]}

    def take_up(self, state: Mapping[str, Any]) -> None:
        """Go on where `state` was taken."""
        self._number = min(int(state["number"]), len(self.stages) - 1)
        self._told, self._since = NONE_YET, -1
        self._successes = deque(bool(one) for one in state["successes"])
