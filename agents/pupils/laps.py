"""Laps of a simulated pupil: a driver of the reference line, on the line of a pupil."""

from race_server.coaching.lap import Lap, lap_on
from race_server.competition.time_trial.gaps import NONE, Gap
from race_server.competition.time_trial.lap import COLUMNS
from race_server.competition.time_trial.run import Attempt
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.driver import driver_named
from race_server.scenario.track.course import Course
from race_server.scenario.track.line import ReferenceLine

DRIVER = "raceline"


def drive_lap(
    course: Course, vehicle: str, line: ReferenceLine, seed: int, gap: Gap = NONE
) -> Lap | None:
    """Return a flying lap along a line; None where the kart did not come round.

    gap: what of the kart is not as it should be.
    """
    spec = RunSpec(DRIVER, course.name, vehicle, gap, seed, laps=1)
    attempt = Attempt(spec, course, driver_named(DRIVER), line)
    remark = attempt.drive(lambda _: None)
    laps = attempt.outcome("", remark, failed=False).laps
    if not laps:
        return None
    lap = laps[0]
    return lap_on(course, DRIVER, lap.time_us, dict(zip(COLUMNS, lap.trace, strict=True)))
