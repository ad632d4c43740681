"""The budget of a training: minutes, or decisions."""

import time
from dataclasses import dataclass

from race_agents.training.settings import Settings


@dataclass
class Budget:
    """The elapsed share of a training, across interruptions. Its clock starts stopped."""

    minutes: float | None
    steps: int | None
    spent_s: float = 0.0  # before this process
    done: int = 0  # decisions so far
    _begun: float | None = None  # not yet

    @classmethod
    def of(cls, settings: Settings) -> "Budget":
        """Return the unspent budget of settings."""
        return cls(settings.minutes, settings.steps)

    def __str__(self) -> str:
        """Return what is spent, in words."""
        if self.steps is not None:
            return f"{self.done} of {self.steps} decisions"
        return f"{self.seconds / 60.0:.1f} of {self.minutes:g} minutes"

    def start(self) -> None:
        """Start the clock: preparation before it is not training."""
        self._begun = time.monotonic()

    def stop(self) -> None:
        """Stop the clock."""
        self.spent_s, self._begun = self.seconds, None

    @property
    def seconds(self) -> float:
        """Time spent so far [s]."""
        return self.spent_s + (time.monotonic() - self._begun if self._begun is not None else 0.0)

    @property
    def share(self) -> float:
        """Elapsed share of the training, 0 to 1."""
        if self.steps is not None:
            return min(self.done / self.steps, 1.0)
        return min(self.seconds / (60.0 * (self.minutes or 1.0)), 1.0)

    def share_since(self, begin: float) -> float:
        """Return the elapsed share of the part after a share of the training, 0 to 1."""
        return max(self.share - begin, 0.0) / max(1.0 - begin, 1e-9)

    @property
    def is_over(self) -> bool:
        """Whether the budget is spent."""
        return self.share >= 1.0

    @property
    def steps_left(self) -> int:
        """Decisions that are left; practically unlimited for a budget in minutes."""
        return max(self.steps - self.done, 0) if self.steps is not None else 10**12
