"""The reference limit of lap times: computed before the first run, or the reason why not."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from race_server.competition.time_trial.figures import LimitTime
from race_server.competition.time_trial.lap import COLUMNS
from race_server.core.state import Floats
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import RaceError
from race_server.scenario.raceline.reference import Raceline, reference_limit
from race_server.scenario.track.load import load_course


@dataclass
class LapLimits:
    """The limits of all tracks and vehicles of a trial."""

    times: dict[tuple[str, str], LimitTime] = field(default_factory=dict)  # by track and vehicle
    lines: dict[tuple[str, str], Raceline] = field(default_factory=dict)


def limits_of(places: Sequence[tuple[str, str]]) -> LapLimits:
    """Return the limit of each track and vehicle, or the reason why there is none."""
    limits = LapLimits()
    for track, vehicle in places:
        try:
            line = reference_limit(load_course(track), vehicle_named(vehicle)).minimum_time
        except RaceError as error:
            limits.times[track, vehicle] = LimitTime(None, str(error))
        else:
            limits.times[track, vehicle] = LimitTime(line.time_s)
            limits.lines[track, vehicle] = line
    return limits


def trace_of_line(line: Raceline, length: float) -> Floats:
    """Return the limit's lap as the trace of a lap, shape (C, N); `length` of the course [m].

    Steering angle and pedals are unknown, and zero.
    """
    closed = [np.append(row, row[0]) for row in (line.x, line.y, line.speed)]
    steps = np.diff(np.append(line.distance, line.length))
    mean = 0.5 * (closed[2][:-1] + closed[2][1:])
    times = np.concatenate([[0.0], np.cumsum(steps / mean)])
    times *= line.time_s / times[-1]
    # The frame of the limit begins at the line, as laps do.
    progress = np.append(line.progress, length)
    trace = np.zeros((len(COLUMNS), len(progress)))
    trace[:5] = times, progress, *closed
    return trace
