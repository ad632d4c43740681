"""Steps per second of a batch, or of any environment with Gymnasium's or PettingZoo's `step`."""

import time
from collections.abc import Callable
from typing import Any

from race_server.core.state import Floats
from race_server.envs.batch import Batch

WARM_UP_SHARE = 0.25  # of the measured time, before it
TAPE = 400  # decisions that are recorded and replayed through an interface for one race


def batch_rate(batch: Batch, act: Callable[[Batch], Floats], seconds: float) -> float:
    """Return agent-steps per second of time in `Batch.step` alone, and close the batch.

    act: the actions of the next decision, (W, L, A).
    """
    try:
        batch.step(act(batch))  # the first call compiles
        _run(batch, act, WARM_UP_SHARE * seconds)
        return _run(batch, act, seconds)
    finally:
        batch.close()


def _run(batch: Batch, act: Callable[[Batch], Floats], seconds: float) -> float:
    # On one core CPU time is measured, which excludes other load; on several, wall time.
    clock = time.process_time if batch.threads == 1 else time.perf_counter
    steps, spent = 0, 0.0
    while spent < seconds:
        actions = act(batch)
        begun = clock()
        batch.step(actions)
        spent += clock() - begun
        steps += batch.worlds * batch.learners
    return steps / spent


def state_times(batch: Batch, times: int = 200) -> dict[str, float]:
    """Return µs of CPU time a world in which the state of a batch is saved, and loaded."""
    state = batch.save_state()
    calls: dict[str, Callable[[], object]] = {
        "save_us": batch.save_state,
        "load_us": lambda: batch.load_state(state),
    }
    spent = {}
    for name, call in calls.items():
        begun = time.process_time()
        for _ in range(times):
            call()
        spent[name] = 1e6 * (time.process_time() - begun) / times / batch.worlds
    batch.close()
    return spent


def replay_rate(
    env: Any, act: Callable[[], Any], is_done: Callable[[Any], bool], seconds: float
) -> float:
    """Return steps per second of CPU time in `env.step` alone.

    One run is driven by `act`; the measured ones repeat its actions from the same seed, so that
    nothing happens between two steps.
    """
    env.reset(seed=0)
    tape: list[Any] = []
    while len(tape) < TAPE:
        tape.append(act())
        if is_done(env.step(tape[-1])):
            break
    steps, spent = 0, 0.0
    while spent < seconds:
        env.reset(seed=0)
        begun = time.process_time()
        for actions in tape:
            env.step(actions)
        spent += time.process_time() - begun
        steps += len(tape)
    return steps / spent


def vector_rate(env: Any, act: Callable[[], Any], seconds: float) -> float:
    """Return steps per second of CPU time in a vector's `step`, new episodes included."""
    env.reset(seed=0)
    env.step(act())  # the first call compiles
    steps, spent = 0, 0.0
    while spent < seconds:
        actions = act()
        begun = time.process_time()
        env.step(actions)
        spent += time.process_time() - begun
        steps += env.num_envs
    env.close()
    return steps / spent


def is_over(outcome: tuple[Any, ...]) -> bool:
    """Return whether Gymnasium's `step` ended an episode."""
    return bool(outcome[2] or outcome[3])


def ratio(ours: float | None, theirs: float | None) -> float | None:
    """Return how many times faster ours is; None where one of the two was not measured."""
    return None if ours is None or theirs is None else round(ours / theirs, 2)
