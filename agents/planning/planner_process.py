"""Plans asked for: made at once, or by another process where this one interprets its kernels.

A driver's own process never compiles, and a search in plain Python would take minutes.
"""

import atexit
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from typing import Any, TypeVar

import numpy as np

from race_agents.planning.parking_plan import parked_pose, plan_to_slot
from race_agents.planning.path import Path
from race_agents.planning.unexpected import Chart
from race_server.core.kernels.geometry import Pose, along_arc
from race_server.core.kernels.jit import INTERPRET
from race_server.core.parking_order import ParkingOrder
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError

Found = TypeVar("Found")


def ask_apart(find: Callable[..., Found], *task: Any) -> "Future[Found]":
    """Return what a function of a module returns for a task, once another process has called it.

    The future raises `PlanError` where the function does, or where that process has ended.
    """
    if not _process().is_alive():
        _process.cache_clear()
    return _process().ask(find, task)


def ask_plan(
    vehicle: Vehicle, start: Pose, order: ParkingOrder, chart: Chart, angle: float, steps: int
) -> "Future[Path]":
    """Return the path of `plan_to_slot`, or its error, now or once it is found."""
    if INTERPRET:
        return ask_apart(plan_to_slot, vehicle, start, order, chart, angle, steps)
    answer: Future[Path] = Future()
    try:
        answer.set_result(plan_to_slot(vehicle, start, order, chart, angle, steps))
    except PlanError as error:
        answer.set_exception(error)
    return answer


def get_ready(vehicle: Vehicle, order: ParkingOrder) -> None:
    """Start the process that plans, if it is another one, before a vehicle waits for its plan."""
    if INTERPRET:
        # A plan without steps fails, after all that it calls was compiled or loaded. There are
        # no walls, as one at the start would end it before.
        goal = parked_pose(order.slot, vehicle)
        start = along_arc(goal, 0.0, vehicle.length)
        nothing = Chart(np.zeros((0, 4)), np.zeros((0, 6)))
        ask_apart(plan_to_slot, vehicle, start, order, nothing, 0.0, 0)


class PlannerProcess:
    """A process that plans, one task after the other."""

    def __init__(self) -> None:
        """Start it. Before its first answer it may have to compile, which takes minutes."""
        environment = {**os.environ, "RACE_SERVER_INTERPRET": "0"}
        command = [sys.executable, "-m", "race_agents.planning.planner_process"]
        self._process = subprocess.Popen(
            command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="planner")

    def is_alive(self) -> bool:
        """Return whether it answers."""
        return self._process.poll() is None

    def ask(self, find: Callable[..., Found], task: tuple[Any, ...]) -> "Future[Found]":
        """Return an answer that is yet to come. task: the arguments of the function."""
        return self._thread.submit(self._answer, find, task)

    def _answer(self, find: Callable[..., Any], task: tuple[Any, ...]) -> Any:
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            pickle.dump((find, task), process.stdin)
            process.stdin.flush()
            answer = pickle.load(process.stdout)
        except (OSError, EOFError) as error:
            raise PlanError(f"the planner's process has ended: {process.poll()}") from error
        if isinstance(answer, PlanError):
            raise answer
        return answer

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        # A question that is under way ends with the process; only then its pipes are closed.
        self._thread.shutdown(cancel_futures=True)
        self._process.communicate()


@cache
def _process() -> PlannerProcess:
    process = PlannerProcess()
    atexit.register(process.close)
    return process


def _serve() -> None:
    """Answer until the driver's process ends."""
    answers = sys.stdout.buffer
    sys.stdout = sys.stderr
    while True:
        try:
            find, task = pickle.load(sys.stdin.buffer)
        except (EOFError, OSError, KeyboardInterrupt):
            return
        try:
            answer: object = find(*task)
        except PlanError as error:
            answer = error
        except Exception as error:  # of one task; the next is another's
            answer = PlanError(f"the planner raised {type(error).__name__}: {error}")
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    _serve()
