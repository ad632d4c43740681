"""What a driver of a time trial drives against: the best attempt of all, and its own best.

They are cut out of the recordings of the event, so a server that is started again has them, too.
"""

from pathlib import Path

import numpy as np

from race_server.competition.race_day.day import attempt_title
from race_server.competition.race_day.formats import LAP, TimeTrial
from race_server.competition.race_day.ledger import TrialResult, TrialRow
from race_server.competition.race_day.record import Team
from race_server.competition.recorded_laps import recorded_laps
from race_server.competition.time_trial.lap import PROGRESS, TIME, TrialLap, X, Y
from race_server.core.clock import MICROSECONDS
from race_server.core.state import Floats
from race_server.errors import RaceError
from race_server.logs import Log
from race_server.net.wire.ghosts import GhostFrame
from race_server.storage.recording.reader import read_recording
from race_server.storage.recording.scenario_codec import unpack_scenario
from race_server.storage.recording.seekable import SeekableRecording


class EventGhosts:
    """The attempts of one event, as far as they were recorded."""

    def __init__(self, folder: Path, pattern: str, event: str, log: Log) -> None:
        """Look at nothing yet. pattern: of the names of its recordings in the folder."""
        self._folder, self._pattern, self._event, self._log = folder, pattern, event, log
        self._seen: set[Path] = set()
        self._paths: dict[str, Path] = {}  # by title of the attempt
        self._traces: dict[str, Floats | None] = {}  # (4, N) time, x, y, distance

    def for_attempt(
        self, trial: TrialResult, team: str, seats: dict[str, int]
    ) -> tuple[GhostFrame, ...]:
        """Return the best attempt so far, and that of a team if it is another one."""
        best = trial.rows[0]
        own = next((row for row in trial.rows if row.team == team), best)
        rows = [best] if own is best else [best, own]
        found = (self._ghost_of(trial, row, seats[row.team], is_best=row is best) for row in rows)
        return tuple(ghost for ghost in found if ghost is not None)

    def _ghost_of(
        self, trial: TrialResult, row: TrialRow, seat: int, *, is_best: bool
    ) -> GhostFrame | None:
        stage = trial.stage
        if row.time_us >= round(stage.failure_s * MICROSECONDS):
            return None
        number = row.times_us.index(row.time_us) + 1
        title = attempt_title(stage, Team(row.team, ""), number)
        trace = self._trace_of(title, stage, seat)
        if trace is None:
            return None
        time_us = round(float(trace[0, -1]) * MICROSECONDS)
        from_lights = stage.counts != LAP
        samples = (values.astype(np.float32) for values in trace)
        return GhostFrame(row.team, seat, is_best, from_lights, time_us, *samples)

    def _trace_of(self, title: str, stage: TimeTrial, seat: int) -> Floats | None:
        """Return what counts of an attempt, (4, N); None where it was not recorded, or not yet."""
        if title not in self._traces:
            self._look()
            if title not in self._paths:
                return None
            self._traces[title] = self._cut_out(self._paths[title], stage, seat)
        return self._traces[title]

    def _cut_out(self, path: Path, stage: TimeTrial, seat: int) -> Floats | None:
        """Return what counts in the recording of an attempt, (4, N); None for nothing."""
        try:
            laps = [one.lap for one in recorded_laps(read_recording(path)).laps if one.seat == seat]
        except RaceError as error:
            self._log.warn("an attempt is no ghost", recording=path.name, why=str(error))
            return None
        if stage.counts == LAP:
            counted = [lap for lap in laps if lap.is_clean and lap.number >= stage.first_lap]
            laps = [min(counted, key=lambda lap: lap.time_us)] if counted else []
        return _joined(laps) if laps else None

    def _look(self) -> None:
        """Learn which attempts the recordings are of, those that came since the last look."""
        for path in sorted(self._folder.glob(self._pattern)):
            if path in self._seen:
                continue
            self._seen.add(path)
            try:
                with SeekableRecording(path) as recording:
                    start = recording.start
                    occasion = unpack_scenario(start.setting, start.arrays).occasion
            except RaceError as error:
                self._log.warn("a recording is left out", recording=path.name, why=str(error))
                continue
            if occasion is not None and occasion.event == self._event:
                self._paths[occasion.title] = path  # of one that was driven again the newer


def _joined(laps: list[TrialLap]) -> Floats:
    """Return laps as one: time [s] since the first began, x, y, and distance [m], (4, N)."""
    parts, time, distance = [], 0.0, 0.0
    for lap in laps:
        trace = lap.trace[[TIME, X, Y, PROGRESS]] + np.array([[time], [0.0], [0.0], [distance]])
        parts.append(trace)
        time, distance = time + lap.time_s, float(trace[3, -1])
    return np.hstack(parts)
