"""Every drill at a small size, one after the other.

A drill takes part if its module, called as its command, names a `SMALL` size.
Each runs as that command, in a process with a time limit, so that no drill disturbs the next.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from race_server.tools import drills
from race_server.tools.drills.report import SmallDrill, document_of

# A drill that takes this many times as long as it should, and a minute, is ended.
PATIENCE, MORE_S = 4.0, 60.0


def small_drills() -> dict[str, SmallDrill]:
    """Return the small size of every drill, by name."""
    found = {}
    for module in iter_modules(drills.__path__):
        small = getattr(import_module(f"{drills.__name__}.{module.name}"), "SMALL", None)
        if isinstance(small, SmallDrill):
            found[module.name] = small
    return found


def run_all(
    sizes: Mapping[str, SmallDrill], *, tell: Callable[[int], None] = lambda _: None
) -> dict[str, Any]:
    """Run drills and return a document with a row for each.

    tell: called with the share of the work that is done, in seconds of `SmallDrill.seconds`.
    """
    rows: list[dict[str, Any]] = []
    done = 0.0
    for name, small in sizes.items():
        rows.append(_row_of(name, small, partial(_tell_sum, tell, done)))
        done += small.seconds
        tell(round(done))
    failed = [f"{row['name']}: {row['why']}" for row in rows if not row["ok"]]
    return document_of(failed, seconds=round(sum(row["seconds"] for row in rows)), drills=rows)


def _tell_sum(tell: Callable[[int], None], before: float, gone: float) -> None:
    tell(round(before + gone))


def _row_of(name: str, small: SmallDrill, tell: Callable[[float], None]) -> dict[str, Any]:
    begun = time.monotonic()
    document = _run(name, small, tell)
    seconds = round(time.monotonic() - begun, 1)
    value: Any = document
    for word in small.figure.split("."):
        value = value.get(word) if isinstance(value, dict) else None
    figure = document.get("skipped", f"{small.figure} = {value}")
    row = {"name": name, "ok": document["ok"], "why": document["why"], "seconds": seconds}
    return {**row, "figure": figure}


def _run(name: str, small: SmallDrill, tell: Callable[[float], None]) -> dict[str, Any]:
    """Run a drill as its command, and return its document."""
    command = [sys.executable, "-m", "race_server", "drill", name, "--json"]
    process = subprocess.Popen(
        [*command, *small.options.split()],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "NO_COLOR": "1"},
    )
    begun = time.monotonic()
    limit_s = PATIENCE * small.seconds + MORE_S
    while True:
        tell(min(time.monotonic() - begun, small.seconds))
        try:
            told, complaints = process.communicate(timeout=0.5)
            break
        except subprocess.TimeoutExpired:
            if time.monotonic() - begun > limit_s:
                process.kill()
                process.communicate()
                return document_of([f"it did not end within {limit_s:.0f} s"])
    try:
        document: dict[str, Any] = json.loads(told.splitlines()[-1])
    except (IndexError, ValueError):
        lines = complaints.strip().splitlines() or ["it ended without a word"]
        return document_of([lines[-1]])
    return document
