"""Race after race for an hour before many spectators: does the server grow?

One server keeps recordings and results of all races. Its memory, files and threads are read every
few seconds; a straight line through the memory tells what it gains in an hour.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from race_server.live.client.steward import StewardClient
from race_server.net.auth.token import read_token
from race_server.net.transport import ClientLink
from race_server.tools.drills.load import crowded_server
from race_server.tools.drills.report import SmallDrill, document_of
from race_server.tools.drills.server_process import SESSION, ServerProcess, ticks_between

SMALL = SmallDrill("--minutes 0.2 --karts 8 --spectators 10", 20, "memory_slope_mb_per_h")

# The steward restarts the race this often [s], or after a third of a shorter drill.
RACE_S = 120.0
PERIOD_S = 2.0  # between two readings
# Not counted: this share of the time, in which caches fill.
WARM_UP = 0.2
# What the server may gain: once, because pools of memory grow in steps, and in an hour [MB].
ONCE_MB, HOURLY_MB = 16.0, 20.0
# Files and threads that it may have more at the end than after the warm-up: a scrape, a login.
MORE = 6
MEMORY, FILES = "process_resident_memory_bytes", "process_open_fds"
Sample = tuple[float, float, float, float]  # time [s], memory [MB], files, threads


def drill_soak(
    minutes: float,
    karts: int,
    spectators: int,
    *,
    tell: Callable[[int], None] = lambda _: None,
) -> dict[str, Any]:
    """Race for some minutes and return how the server has grown.

    tell: called with the seconds passed so far.
    """
    tell(0)
    with tempfile.TemporaryDirectory(prefix="drill-") as folder:
        words = ["--record", folder, "--results", str(Path(folder, "results.sqlite"))]
        with crowded_server(words, karts, spectators) as (place, _, _):
            before = place.figures()
            samples = _sample(place, 60.0 * minutes, tell)
            after = place.figures()
        written = sum(path.stat().st_size for path in Path(folder).iterdir()) / 1e6
    ticks, missed = ticks_between(before, after)
    kept = np.array(samples[round(WARM_UP * len(samples)) :])
    slope = memory_slope(kept)
    return document_of(
        _judge(kept, slope),
        minutes=minutes,
        karts=karts,
        spectators=spectators,
        races=round(after["race_epoch"]),
        memory_slope_mb_per_h=round(slope, 2),
        memory_start_mb=round(float(kept[0, 1]), 1),
        memory_end_mb=round(float(kept[-1, 1]), 1),
        files=round(kept[-1, 2]),
        threads=round(kept[-1, 3]),
        missed_ticks=round(missed),
        missed_share=round(missed / max(ticks + missed, 1.0), 5),
        written_mb=round(written, 1),
    )


def _sample(place: ServerProcess, seconds: float, tell: Callable[[int], None]) -> list[Sample]:
    """Read memory, files and threads of the server for some time, race after race."""
    samples: list[Sample] = []
    race_s = again_s = min(RACE_S, seconds / 3.0)
    token, begun = read_token(place.address, SESSION), time.monotonic()
    with ClientLink(place.address, SESSION) as link:
        steward = StewardClient(link, token, "drill")
        while (gone := time.monotonic() - begun) < seconds:
            tell(round(gone))
            if gone > again_s:
                again_s += race_s
                steward.decide("restart")
            figures, threads = place.figures(), threads_of(place.server.pid)
            samples.append((gone, figures[MEMORY] / 1e6, figures[FILES], threads))
            time.sleep(min(PERIOD_S, max(seconds - gone, 0.0)))
    return samples


def threads_of(process: int) -> float:
    """Return the number of threads of a process (Linux: /proc)."""
    folder = Path(f"/proc/{process}/task")
    return float(len(list(folder.iterdir()))) if folder.exists() else 0.0


def memory_slope(samples: np.ndarray) -> float:
    """Return what the memory gains [MB/h]. samples: (N, 4) rows of `Sample`."""
    hours, memory = samples[:, 0] / 3600.0, samples[:, 1]
    return float(np.polyfit(hours, memory, 1)[0]) if len(samples) > 1 else 0.0


def _judge(samples: np.ndarray, slope: float) -> list[str]:
    """Return what grew. Missed ticks are for the load drill: here the clients take the cores."""
    hours = float(samples[-1, 0] - samples[0, 0]) / 3600.0
    faults = []
    if (gained := slope * hours) > ONCE_MB + HOURLY_MB * hours:
        faults.append(f"the server gained {gained:.0f} MB of memory, {slope:.0f} MB/h")
    for column, what in ((2, "files"), (3, "threads")):
        first, last = samples[0, column], samples[-1, column]
        if last > first + MORE:
            faults.append(f"the server has {last:.0f} {what}, after {first:.0f} at first")
    return faults
