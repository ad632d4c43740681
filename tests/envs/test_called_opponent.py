"""Functions as drivers of karts that do not learn."""

from typing import Any

import numpy as np
import pytest

from race_server.envs import Batch, CalledOpponent
from race_server.errors import DriverError
from support.tasks import ring_task


def ahead(seen: Any) -> Any:
    """Drive ahead at a fifth of the throttle."""
    return np.tile([0.0, 0.2, 0.0, 0.0], (len(seen), 1))


def test_all_karts_that_share_a_function_cost_one_call() -> None:
    calls: list[tuple[int, ...]] = []

    def decide(seen: Any) -> Any:
        calls.append(seen.shape)
        return ahead(seen)

    other = CalledOpponent(decide, preset="radar")
    batch = Batch(ring_task(4, opponents=(other,), learners=1), worlds=3)
    size = batch.opponents[0].layout.size
    for _ in range(5):
        batch.step(np.zeros((3, 1, 3), np.float32))
    assert calls == [(9, size)] * 5
    speeds = batch.world.bodies["speed"]
    assert (speeds[:, 1:] > 0.02).all()
    assert (speeds[:, 0] < 0.001).all()


def test_functions_and_drivers_race_side_by_side_and_repeat_in_turn() -> None:
    opponents = (CalledOpponent(ahead, name="mine"), "pure_pursuit")
    batch = Batch(ring_task(5, opponents=opponents, learners=1))
    assert [(each.name, each.karts) for each in batch.opponents] == [
        ("mine", (1, 3)),
        ("pure_pursuit", (2, 4)),
    ]


@pytest.mark.parametrize("answer", [np.zeros((1, 3)), np.full((2, 4), np.nan)])
def test_a_function_that_answers_something_else_is_named(answer: Any) -> None:
    other = CalledOpponent(lambda seen: answer, name="mine")
    batch = Batch(ring_task(3, opponents=(other,), learners=1))
    with pytest.raises(DriverError, match=r"opponent mine answers 2 karts with shape"):
        batch.step(np.zeros((1, 1, 3), np.float32))
