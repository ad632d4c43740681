"""Laps as spectators of a live race see them: through snapshots, without pedals."""

import math
from collections.abc import Sequence

import numpy as np

from race_server.coaching.lap import Lap, lap_on, with_pedals_felt
from race_server.competition.live_laps import LiveLaps, SeenLap
from race_server.competition.time_trial.gaps import DECISION_TICKS
from race_server.competition.time_trial.lap import COLUMNS, TIME, Mark
from race_server.core.clock import MICROSECONDS, TICK_S
from race_server.core.messages import Cleanness, Event, EventKind, Flag, Phase, Status
from race_server.net.wire.spectate import (
    HAZARD,
    KART,
    SnapshotFrame,
    SnapshotWriter,
    decode_snapshot,
)
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.track.course import Course

# Columns of a snapshot's karts that notes have, too.
SHOWN = ("progress", "x", "y", "speed", "steering")


def spectated_lap(
    course: Course,
    name: str,
    notes: Sequence[tuple[float, ...]],
    marks: Sequence[Mark],
    bounds: Bounds,
) -> Lap | None:
    """Return the flying lap of a run from the snapshots of its decisions; None where it has none.

    notes, marks: of the run, see `race_server.competition.time_trial.lap`.
    """
    laps, writer, found = LiveLaps(course.length), SnapshotWriter(), list[SeenLap]()
    for number, mark in enumerate(marks, start=1):
        tick = math.floor((mark.end_us / MICROSECONDS - notes[0][TIME]) / TICK_S)
        laps.hear([Event(number, tick, EventKind.LAP, 0, number, mark.time_us, Cleanness.CLEAN)])
    for number, note in enumerate(notes):
        row = np.zeros(1, KART)
        row["status"] = Status.RACING
        for column in SHOWN:
            row[column] = note[COLUMNS.index(column)]
        tick = DECISION_TICKS * number
        frame = SnapshotFrame(
            *(0, 0, tick, 0.0, Phase.RUNNING, Flag.GREEN, row),
            np.zeros(0, np.uint8),
            np.zeros(0, HAZARD),
        )
        laps.see(decode_snapshot(writer.write(frame)))
        found += laps.ended()
    found += laps.ended(is_over=True)
    flying = [one.lap for one in found if one.lap.is_flying]
    if not flying:
        return None
    lap = flying[-1]
    return with_pedals_felt(lap_on(course, name, lap.time_us, lap.columns), bounds)
