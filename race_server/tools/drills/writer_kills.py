"""Kill a process that does nothing but write a race down, at any moment of a commit or a chunk.

In a race commits are rare and short. Here one follows the other, so that most kills fall into one.
"""

import multiprocessing
import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count, cycle
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from race_server.errors import RaceError
from race_server.session.lap_log import Lap
from race_server.storage.recording.channels import LAPS
from race_server.storage.recording.reader import Line, read_lines, read_recording
from race_server.storage.recording.recorder import Recorder
from race_server.storage.results.queries import all_laps
from race_server.storage.results.store import Entry, Race, Store
from race_server.storage.results.writer import Writer
from race_server.tools.drills.torn import is_torn

# The kill comes this long after the first lap is announced, at most [s].
LATEST_S = 0.03
LINES_PER_LAP = 20  # of a recorded race, written between two laps
START_S = 30.0


@dataclass
class WriterKillReport:
    """What was read after the kills."""

    kills: int = 0
    torn_commits: int = 0
    torn_chunks: int = 0
    faults: list[str] = field(default_factory=list)


def kill_writers(
    recording: Path, folder: Path, kills: int, chance: random.Random, tell: Callable[[int], None]
) -> WriterKillReport:
    """Kill a writing process `kills` times; every lap that it announced must be in both files.

    recording: of a race, whose messages are written again.
    """
    report = WriterKillReport()
    context: Any = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    for number in range(kills):
        tell(number)
        place = folder / f"kill-{number}"
        place.mkdir()
        ours, theirs = context.Pipe(duplex=False)
        process = context.Process(target=write_laps, args=(recording, place, theirs), daemon=True)
        process.start()
        theirs.close()
        if not ours.poll(START_S):
            process.kill()
            raise RaceError(f"a process that writes laps announced none within {START_S:g} s")
        time.sleep(chance.uniform(0.0, LATEST_S))
        process.kill()
        process.join()
        report.kills += 1
        _check(place, _last_of(ours), report)
    return report


def _last_of(pipe: Connection) -> int:
    """Return the last lap that was announced."""
    last = 0
    try:
        while pipe.poll():
            last = pipe.recv()
    except EOFError:
        pass
    return last


def _check(place: Path, announced: int, report: WriterKillReport) -> None:
    results, recording = place / "results.sqlite", place / "race.mcap"
    report.torn_commits += is_torn(Path(f"{results}-wal"))
    report.torn_chunks += is_torn(recording)
    try:
        kept = {row["lap"] for row in all_laps(results)}
        recorded = {lap for _, lap, _, _ in read_recording(recording).laps}
    except RaceError as error:
        report.faults.append(f"after a kill: {error}")
        return
    for name, laps in (("results file", kept), ("recording", recorded)):
        if missing := announced - len(laps & set(range(1, announced + 1))):
            report.faults.append(f"{missing} of {announced} announced laps are not in the {name}")


def write_laps(recording: Path, place: Path, announce: Connection) -> None:
    """Write laps until this process is killed; a lap is announced once it is written."""
    lines = [line for line in read_lines(recording) if isinstance(line, Line)]
    others = cycle(line for line in lines[1:] if line.kind is not LAPS)
    file = (place / "race.mcap").open("wb")
    race = Race(
        *("2026-01-01T00:00:00.000+00:00", "drill", "track", "digest", "tt02", 0, "real", 1),
        *("rules", "server"),
        entries=(Entry(0, "driver", "1", "tt02"),),
    )
    with (
        Writer(Store(place / "results.sqlite"), print) as writer,
        Recorder(file, "drill", lines[0].time_ns, print) as recorder,
    ):
        recorder.copy(lines[0])
        writer.submit(race)
        for number in count(1):
            for _ in range(LINES_PER_LAP):
                recorder.copy(next(others))
            lap = Lap(0, number, 1_000_000 + number, (1_000_000 + number,), True, number)
            recorder.record_lap(lap)
            tickets = writer.submit(lap), recorder.flush()
            if all(ticket.wait(START_S) for ticket in tickets):
                announce.send(number)
