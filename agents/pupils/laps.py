"""Laps of simulated pupils, each along another line."""

from race_agents.pupils.line_follower import LineFollower
from race_agents.pupils.spectated import spectated_lap
from race_server.coaching.lap import Lap, lap_on
from race_server.competition.time_trial.gaps import NONE, Gap
from race_server.competition.time_trial.run import Attempt
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.driver import driver_named
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.track.course import Course
from race_server.scenario.track.line import ReferenceLine

# The driver of the lap that all pupils begin from, and what others are called.
RACER, PUPIL = "raceline", "pupil"


def drive_lap(
    course: Course,
    vehicle: str,
    line: ReferenceLine,
    seed: int,
    gap: Gap = NONE,
    *,
    racer: bool = False,
    seen_by: Bounds | None = None,
) -> Lap | None:
    """Return a flying lap along a line; None where the kart did not come round.

    gap: what of the kart is not as it should be; racer: a racing driver drives it, with its
    margins, in place of a pupil, who follows the line as it is; seen_by: return it as spectators of
    a live race see it, who know these bounds of the vehicle.
    """
    name = RACER if racer else PUPIL
    spec = RunSpec(name, course.name, vehicle, gap, seed, laps=1)
    attempt = Attempt(spec, course, driver_named(RACER) if racer else LineFollower(), line)
    remark = attempt.drive(lambda _: None)
    if seen_by is not None:
        return spectated_lap(course, name, attempt.notes, attempt.marks, seen_by)
    laps = attempt.outcome("", remark, failed=False).laps
    if not laps:
        return None
    lap = laps[0]
    return lap_on(course, name, lap.time_us, lap.columns)
