"""What is written down while a policy learns: the figure of the last hundred episodes."""

import time
from collections.abc import Callable

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from race_agents.training.budget import Budget
from race_agents.training.settings import Settings

POINTS = 40  # of the curve of a training
# Curves of a training to park: figures of the last hundred episodes.
CURVES = {
    "share that parked": "is_success",
    "return of an episode": "r",
    "length of an episode, decisions": "l",
}
OVER_TIME = " over processor time"  # in the name of a curve: its points are at seconds
SETTLED = 0.9  # share of the final figure at which something counts as learned


def settled_at(curve: list[tuple[int, float]], cpu_times: list[float]) -> float | None:
    """Return the processor time [s] at which a curve first reached 90 % of where it ended.

    The end is the mean of its last tenth; None if that is nothing.
    """
    end = float(np.mean([value for _, value in curve[-POINTS // 10 :]])) if curve else 0.0
    if end <= 0.0:
        return None
    reached = zip(curve, cpu_times, strict=True)
    return next(at for (_, value), at in reached if value >= SETTLED * end)


def reached_at(curve: list[tuple[int, float]], share: float) -> float | None:
    """Return the decisions after which a curve first reached a share, None if it never did."""
    return next((float(at) for at, value in curve if value >= share), None)


def mean_return(curve: list[tuple[int, float]]) -> float | None:
    """Return the mean of a curve; time before its first point counts as that point."""
    if not curve:
        return None
    returns = [value for _, value in curve]
    earlier = max(POINTS - len(returns), 0)
    return float(np.mean([returns[0]] * earlier + returns))


class Watch(BaseCallback):
    """Counts decisions and records figures of the last hundred episodes.

    Of a race that is the mean return, in a lot the share that parked.
    """

    def __init__(self, settings: Settings, budget: Budget, tell: Callable[[float], None]) -> None:
        """Watch a training. tell: takes the share of it that is done."""
        super().__init__()
        self.budget = budget
        self.curve: list[tuple[int, float]] = []
        self.curves: dict[str, list[tuple[float, float]]] = (
            {name: [] for name in CURVES} if settings.parks else {}
        )
        self.cpu_times: list[float] = []  # [s] at each point of the curve
        self._figure = "is_success" if settings.parks else "r"
        self._begun = time.process_time()
        self._took: float | None = None  # [s], once the training is over
        self._points = 0
        self._tell = tell

    @property
    def cpu_s(self) -> float:
        """Processor time of the training so far [s]; what comes after its end does not count."""
        return time.process_time() - self._begun if self._took is None else self._took

    def _on_training_end(self) -> None:
        self._took = self.cpu_s

    def _mean(self, figure: str) -> float:
        return float(np.mean([row[figure] for row in self.model.ep_info_buffer or ()]))

    def _on_step(self) -> bool:
        self.budget.done += self.training_env.num_envs
        if int(self.budget.share * POINTS) > self._points:
            self._points = int(self.budget.share * POINTS)
            # Among many agents it takes a while until the first episode is over.
            if self.model.ep_info_buffer:
                self.curve.append((self.budget.done, self._mean(self._figure)))
                for name, curve in self.curves.items():
                    curve.append((self.budget.done, self._mean(CURVES[name])))
                self.cpu_times.append(self.cpu_s)
            self._tell(self.budget.share)
        return True
