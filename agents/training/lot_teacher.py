"""What teachers in a lot share: they look where the vehicle of each world is."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from race_server.envs.batch import Batch
from race_server.errors import ScenarioError

Labels = NDArray[np.float32]


class LotTeacher(ABC):
    """Knows what the only vehicle of every world of a batch is to do."""

    def __init__(self, batch: Batch, *actions: str) -> None:
        """Keep the batch. actions: kinds that it answers with, a speed and steering each.

        Raises:
            ScenarioError: the vehicles have other actions, or do not learn alone.
        """
        if batch.task.action not in actions:
            raise ScenarioError(
                f"action = {batch.task.action!r}: a teacher in a lot answers with a speed and "
                f"steering; choose {' or '.join(map(repr, actions))}"
            )
        if batch.learners != 1:
            raise ScenarioError(
                f"race.learners = {batch.learners}: a teacher in a lot has one vehicle in each; "
                "choose 1"
            )
        self._batch, self._vehicle = batch, batch.scenarios[0].vehicle_of(0)

    @abstractmethod
    def labels(self, seen: NDArray[np.float32], begun: NDArray[np.bool_]) -> Labels:
        """Return the actions that it would take, shape (W, 2); not a number where it knows none.

        seen: what the learners see; begun: (W, 1) true where an episode has just begun.
        """

    def record_driven(self, actions: NDArray[np.float32]) -> None:  # noqa: B027 no duty
        """Do nothing: it looks where the vehicles are."""
