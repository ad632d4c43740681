"""Tasks of drivers in parallel processes, so that a driver can break no task but its own.

A pool of the standard library breaks as a whole when one of its processes dies, and cannot end one
that is stuck in machine code.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, Protocol, TypeVar

from race_server.competition.time_trial.run import START_LIMIT_S, Tell, now
from race_server.core.kernels.jit import kernel_cache

# A process that is silent for longer than the limit of its driver and this time is killed [s].
SLACK_S = 8.0
# The same before its first message: it may have to compile the simulation [s].
PREPARATION_S = 600.0

# What a task tells in place of its laps, before it begins: it solves the limit of its course.
SOLVING = -1

Report = Callable[[int, int], None]  # number of a task, laps driven so far or SOLVING


class Task(Protocol):
    """What one process does at a time."""

    @property
    def decision_limit_s(self) -> float:
        """If it tells nothing for this time [s], it has stalled."""


Spec = TypeVar("Spec", bound=Task)
Outcome = TypeVar("Outcome")


@dataclass(frozen=True)
class Work(Generic[Spec, Outcome]):
    """How a task is done, and what is said of one whose process was lost, or that raised.

    lost: is given the task, when it began, and why, in words.
    """

    drive: Callable[[Spec, Tell], Outcome]
    lost: Callable[[Spec, str, str], Outcome]


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    number: int = -1  # of the task that it does
    deadline: float = 0.0
    laps: int = -1
    begun_at: str = field(default_factory=now)


def run_all(
    work: Work[Spec, Outcome],
    specs: Sequence[Spec],
    jobs: int = 0,
    report: Report = lambda _number, _laps: None,
) -> Generator[tuple[int, Outcome], None, None]:
    """Yield number and outcome of each task as it finishes.

    jobs: parallel processes; 0: one for each core. Closing the iterator early, as Ctrl-C does, ends
    the processes.
    """
    todo = deque(range(len(specs)))
    jobs = min(jobs or os.cpu_count() or 1, len(specs))
    workers: list[_Worker] = []
    try:
        while todo or workers:
            while todo and len(workers) < jobs:
                workers.append(_assign(_start(work), todo.popleft(), specs))
            for worker in _polled(workers):
                outcome = _receive(worker, work, specs[worker.number], report)
                if outcome is None:
                    continue
                yield worker.number, outcome
                if todo and worker.process.is_alive():
                    _assign(worker, todo.popleft(), specs)
                else:
                    workers.remove(worker)
                    _end(worker)
    finally:
        for worker in workers:
            worker.process.kill()
            _end(worker)


def is_ready() -> bool:
    """Return whether the training world, in which trials run, is compiled for this machine."""
    return any(kernel_cache().rglob("decide.decide*.nbc"))


def _start(work: Work[Spec, Outcome]) -> _Worker:
    methods = multiprocessing.get_all_start_methods()
    # A server that has imported the simulation once forks processes that are ready at once.
    context: Any = multiprocessing.get_context("forkserver" if "forkserver" in methods else None)
    if "forkserver" in methods:
        context.set_forkserver_preload(["race_server.competition.time_trial.run"])
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs, work), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, ours)


def _assign(worker: _Worker, number: int, specs: Sequence[Spec]) -> _Worker:
    worker.number, worker.laps, worker.begun_at = number, -1, now()
    worker.deadline = time.monotonic() + PREPARATION_S + START_LIMIT_S
    with contextlib.suppress(OSError):  # it has died: the next poll reports it
        worker.pipe.send(specs[number])
    return worker


def _polled(workers: Sequence[_Worker]) -> list[_Worker]:
    """Return the workers that sent a message, ended, or exceeded their deadline."""
    ready = set(wait([worker.pipe for worker in workers], timeout=0.25))
    late = time.monotonic()
    return [w for w in workers if w.pipe in ready or w.deadline < late]


def _receive(
    worker: _Worker, work: Work[Spec, Outcome], spec: Spec, report: Report
) -> Outcome | None:
    """Return the outcome of a worker's task, None while it goes on."""
    if not worker.pipe.poll():
        worker.process.kill()
        worker.process.join()
        return _lost(worker, work, spec, "stuck in machine code, its process was ended")
    try:
        message = worker.pipe.recv()
    except (EOFError, OSError):
        worker.process.join()
        why = f"its process died ({_exit_words(worker.process.exitcode)})"
        return _lost(worker, work, spec, why)
    if not isinstance(message, int):
        outcome: Outcome = message
        return outcome
    if message == SOLVING:
        limit_s = PREPARATION_S + START_LIMIT_S
    else:
        # The first decision has the time limit of the start.
        limit_s = START_LIMIT_S if worker.laps < 0 else spec.decision_limit_s
    worker.deadline = time.monotonic() + limit_s + SLACK_S
    worker.laps = message
    report(worker.number, worker.laps)
    return None


def _lost(worker: _Worker, work: Work[Spec, Outcome], spec: Spec, why: str) -> Outcome:
    laps = f"after {max(worker.laps, 0)} laps: " if worker.laps > 0 else ""
    return work.lost(spec, worker.begun_at, f"{laps}{why}")


def _exit_words(code: int | None) -> str:
    if code is not None and code < 0:
        return signal.Signals(-code).name
    return f"exit status {code}"


def _end(worker: _Worker) -> None:
    with contextlib.suppress(OSError):
        worker.pipe.send(None)
    worker.pipe.close()
    worker.process.join()


def _work(pipe: Connection, work: Work[Spec, Outcome]) -> None:
    """Do one task after another."""
    # Ctrl-C is for the parent process, which ends this one.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Output of a driver must not mix with the JSON document on stdout.
    sys.stdout.flush()
    os.dup2(2, 1)
    with contextlib.suppress(EOFError, OSError):
        while (spec := pipe.recv()) is not None:
            try:
                outcome = work.drive(spec, pipe.send)
            except Exception as error:
                outcome = work.lost(spec, now(), f"{type(error).__name__}: {error}")
            pipe.send(outcome)
