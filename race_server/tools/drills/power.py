"""Cut what a race has written at random bytes, as a power failure does, and kill what writes it.

A server races in lock-step and is killed. Then its recording and the log of its results file are
cut again and again. Nothing but what lies in the last, broken chunk or commit may be lost, and what
cannot be read at all must be one clear error. Nothing that was announced may be lost by a kill.
"""

import random
import shutil
import tempfile
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from race_server.competition.launch import START_S
from race_server.errors import RecordingError, ResultsError
from race_server.storage.recording.reader import Line, read_lines, read_recording
from race_server.storage.recording.seekable import SeekableRecording
from race_server.storage.results.queries import all_laps
from race_server.tools.drills.replay import replay_of
from race_server.tools.drills.report import SmallDrill, document_of
from race_server.tools.drills.server_process import SESSION, server_process, wait_until
from race_server.tools.drills.torn import chunk_ends, commit_ends
from race_server.tools.drills.writer_kills import kill_writers

SMALL = SmallDrill("--cuts 20 --kills 10", 22, "torn_commits")

LAPS = 40  # in the results file, before the server is killed
RERUN_EVERY = 50  # cuts of a recording after which its race is driven again


@dataclass(frozen=True)
class WrittenRace:
    """What a killed server has left."""

    recording: Path
    results: Path
    log: Path  # of the results file


@dataclass
class CutReport:
    """What was read after the cuts of one file."""

    cuts: int = 0
    refused: int = 0  # with one clear error
    faults: list[str] = field(default_factory=list)


def drill_power(
    cuts: int, kills: int, *, seed: int = 1, tell: Callable[[int], None] = lambda _: None
) -> dict[str, Any]:
    """Cut a recording and a results file at `cuts` bytes each, and return the figures.

    kills: of a process that writes; tell: called with the number of cuts and kills so far.
    """
    chance = random.Random(seed)
    tell(0)
    with tempfile.TemporaryDirectory(prefix="drill-") as name:
        race = _write(Path(name))
        scratch = Path(name, "cut")
        scratch.mkdir()
        figures = {
            "recording_bytes": race.recording.stat().st_size,
            "log_bytes": race.log.stat().st_size,
            "chunks": len(chunk_ends(race.recording.read_bytes())),
            "commits": len(commit_ends(race.log.read_bytes())),
        }
        recording = cut_recording(race.recording, scratch, cuts, chance, tell)
        results = cut_results(race, scratch, cuts, chance, lambda done: tell(cuts + done))
        killed = kill_writers(
            race.recording, scratch, kills, chance, lambda done: tell(2 * cuts + done)
        )
    return document_of(
        [*recording.faults, *results.faults, *killed.faults],
        cuts=recording.cuts + results.cuts,
        kills=killed.kills,
        torn_commits=killed.torn_commits,
        torn_chunks=killed.torn_chunks,
        **figures,
        refused_recordings=recording.refused,
        refused_results=results.refused,
        seed=seed,
    )


def _write(folder: Path) -> WrittenRace:
    """Let a server write a race, and kill it in the middle."""
    results = folder / "results.sqlite"
    words = ["--track", "oval-report", "--karts", "4", "--laps", "1000", "--pace", "lockstep"]
    words += ["--fill", "pure_pursuit,follow_gap,avoider", "--wait-for", "0"]
    words += ["--record", str(folder), "--results", str(results)]

    def has_laps() -> bool:
        if place.server.poll() is not None:
            raise RecordingError(f"the server has ended: {place.last_words()}")
        return results.exists() and len(all_laps(results)) >= LAPS

    with server_process(words) as place:
        wait_until(has_laps, START_S, f"{LAPS} laps")
        place.server.kill()
        place.server.wait()
    return WrittenRace(folder / f"{SESSION}.journal.mcap", results, Path(f"{results}-wal"))


def cut_recording(
    path: Path, scratch: Path, cuts: int, chance: random.Random, tell: Callable[[int], None]
) -> CutReport:
    """Cut a recording at random bytes; every message of a whole chunk must be read."""
    data, report = path.read_bytes(), CutReport()
    ends = chunk_ends(data)
    # Messages up to the end of each chunk, by reading the file that ends there.
    piece, counts = scratch / "race.mcap", [0]
    for end in ends:
        piece.write_bytes(data[:end])
        counts.append(_count_messages(piece))
    for number in range(cuts):
        tell(number)
        at = chance.randrange(len(data))
        piece.write_bytes(data[:at])
        report.cuts += 1
        expected = counts[bisect_right(ends, at)]
        try:
            _read_cut(piece, at, expected, report, is_rerun=number % RERUN_EVERY == 0)
        except RecordingError:
            report.refused += 1
            if expected:
                report.faults.append(f"a recording cut at byte {at} is refused")
        # Whatever comes out is what the drill is there to find.
        except Exception as error:
            report.faults.append(f"a recording cut at byte {at}: {type(error).__name__}: {error}")
    return report


def _count_messages(path: Path) -> int:
    return sum(isinstance(line, Line) for line in read_lines(path))


def _read_cut(piece: Path, at: int, expected: int, report: CutReport, *, is_rerun: bool) -> None:
    """Read a cut recording in every way in which one is read.

    Raises:
        RecordingError: it holds no beginning of a race.
    """
    found = _count_messages(piece)
    if found != expected:
        report.faults.append(f"a recording cut at byte {at}: {found} messages, not {expected}")
    recording = read_recording(piece)
    with SeekableRecording(piece) as seekable:
        if seekable.last_tick != recording.last_tick:
            report.faults.append(f"a recording cut at byte {at} ends at two ticks")
    if not is_rerun:
        return
    if fault := replay_of(recording).fault:
        report.faults.append(f"a recording cut at byte {at} {fault}")


def cut_results(
    race: WrittenRace, scratch: Path, cuts: int, chance: random.Random, tell: Callable[[int], None]
) -> CutReport:
    """Cut the log of a results file at random bytes; every whole commit must be read."""
    data, report = race.log.read_bytes(), CutReport()
    ends = commit_ends(data)
    laps = [_laps_of(race, scratch, data[:end]) for end in (0, *ends)]
    # Each commit holds what those before hold, and the last one all that the race had.
    if any(not before <= after for before, after in pairwise(laps)):
        report.faults.append("a commit holds less than the one before")
    if len(laps[-1]) < LAPS:
        report.faults.append(f"the last commit holds {len(laps[-1])} laps, not {LAPS}")
    for number in range(cuts):
        tell(number)
        at = chance.randrange(len(data))
        report.cuts += 1
        try:
            found = _laps_of(race, scratch, data[:at])
        except ResultsError:
            report.refused += 1
            report.faults.append(f"a results file cut at byte {at} of its log is refused")
            continue
        # Whatever comes out is what the drill is there to find.
        except Exception as error:
            report.faults.append(f"results cut at byte {at}: {type(error).__name__}: {error}")
            continue
        if found != laps[bisect_right(ends, at)]:
            report.faults.append(f"results cut at byte {at} of the log hold other laps")
    return report


def _laps_of(race: WrittenRace, scratch: Path, log: bytes) -> set[tuple[int, int, int]]:
    """Return the laps that are read where the log is cut short."""
    piece = scratch / "results.sqlite"
    for old in scratch.glob("results.sqlite*"):
        old.unlink()
    shutil.copyfile(race.results, piece)
    Path(f"{piece}-wal").write_bytes(log)
    return {(row["seat"], row["lap"], row["time_us"]) for row in all_laps(piece)}
