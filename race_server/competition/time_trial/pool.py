"""Runs side by side: processes of our own, so that a driver can take down no run but its own.

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
from typing import Any

from race_server.competition.time_trial.run import START_LIMIT_S, Run, Tell, drive_run, now
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.kernels.jit import kernel_cache

# A process that says nothing for so long beyond the limit of its driver is ended.
SLACK_S = 8.0
# The same before it says anything: it may have to compile the simulation first.
PREPARATION_S = 600.0

Drive = Callable[[RunSpec, Tell], Run]
Report = Callable[[int, int], None]  # number of a cell, laps that it has driven


@dataclass
class _Worker:
    process: Any
    pipe: Connection
    number: int = -1  # of the cell that it drives
    deadline: float = 0.0
    laps: int = -1
    begun_at: str = field(default_factory=now)


def run_cells(
    cells: Sequence[RunSpec],
    jobs: int = 0,
    report: Report = lambda _number, _laps: None,
    drive: Drive = drive_run,
) -> Generator[tuple[int, Run], None, None]:
    """Yield the number and the outcome of each cell as it is done.

    jobs: processes at a time; 0: one for each core. Whoever stops early, by Ctrl-C too, ends the
    processes by closing the iterator.
    """
    todo = deque(range(len(cells)))
    jobs = min(jobs or os.cpu_count() or 1, len(cells))
    workers: list[_Worker] = []
    try:
        while todo or workers:
            while todo and len(workers) < jobs:
                workers.append(_hand_over(_start(drive), todo.popleft(), cells))
            for worker in _heard(workers):
                run = _take(worker, cells, report)
                if run is None:
                    continue
                yield worker.number, run
                if todo and worker.process.is_alive():
                    _hand_over(worker, todo.popleft(), cells)
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


def _start(drive: Drive) -> _Worker:
    methods = multiprocessing.get_all_start_methods()
    # A server that has imported the simulation once forks processes that are ready at once.
    context: Any = multiprocessing.get_context("forkserver" if "forkserver" in methods else None)
    if "forkserver" in methods:
        context.set_forkserver_preload(["race_server.competition.time_trial.run"])
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs, drive), daemon=True)
    process.start()
    theirs.close()
    return _Worker(process, ours)


def _hand_over(worker: _Worker, number: int, cells: Sequence[RunSpec]) -> _Worker:
    worker.number, worker.laps, worker.begun_at = number, -1, now()
    worker.deadline = time.monotonic() + PREPARATION_S + START_LIMIT_S
    with contextlib.suppress(OSError):  # it has died: the next look at it says so
        worker.pipe.send(cells[number])
    return worker


def _heard(workers: Sequence[_Worker]) -> list[_Worker]:
    """Return those that have something to say, and those from which nothing will come."""
    ready = set(wait([worker.pipe for worker in workers], timeout=0.25))
    late = time.monotonic()
    return [w for w in workers if w.pipe in ready or w.deadline < late]


def _take(worker: _Worker, cells: Sequence[RunSpec], report: Report) -> Run | None:
    """Return the outcome of a worker's cell, None while it is under way."""
    cell = cells[worker.number]
    if not worker.pipe.poll():
        worker.process.kill()
        worker.process.join()
        return _lost(worker, cell, "stuck in machine code, its process was ended")
    try:
        said = worker.pipe.recv()
    except (EOFError, OSError):
        worker.process.join()
        return _lost(worker, cell, f"its process died ({_exit_words(worker.process.exitcode)})")
    if isinstance(said, Run):
        return said
    # The first decision has the limit of a start.
    limit_s = START_LIMIT_S if worker.laps < 0 else cell.decision_limit_s
    worker.deadline = time.monotonic() + limit_s + SLACK_S
    worker.laps = int(said)
    report(worker.number, worker.laps)
    return None


def _lost(worker: _Worker, cell: RunSpec, remark: str) -> Run:
    laps = f"after {max(worker.laps, 0)} laps: " if worker.laps > 0 else ""
    return Run(cell, worker.begun_at, remark=f"{laps}{remark}", failed=True)


def _exit_words(code: int | None) -> str:
    if code is not None and code < 0:
        return signal.Signals(-code).name
    return f"exit status {code}"


def _end(worker: _Worker) -> None:
    with contextlib.suppress(OSError):
        worker.pipe.send(None)
    worker.pipe.close()
    worker.process.join()


def _work(pipe: Connection, drive: Drive) -> None:
    """Drive one cell after another."""
    # Ctrl-C is for the process that a person started; that one ends us.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # What a driver prints must not come between the lines of a JSON document.
    sys.stdout.flush()
    os.dup2(2, 1)
    with contextlib.suppress(EOFError, OSError):
        while (cell := pipe.recv()) is not None:
            try:
                run = drive(cell, pipe.send)
            except Exception as error:
                run = Run(cell, now(), remark=f"{type(error).__name__}: {error}", failed=True)
            pipe.send(run)
