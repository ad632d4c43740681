"""The course of a drive, from nothing but its lidar, its speed and its yaw rate.

The mapping is that of the driver `mapper`: scans are fitted one among the last ones, the lap is
closed where a scan fits the walls of its start, and the walls along the path become borders.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from race_agents.planning.charted_course import (
    borders_along,
    points_between,
    refine,
    scale_of,
    walled_path,
)
from race_agents.planning.lap_survey import LapSurvey, dead_reckoning
from race_agents.planning.wall_map import Pose, compose, read_scan
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError
from race_server.scenario.sensors import Lidar

# Size of a piece of wall and of a cell of the map [body widths].
CELL = 0.55
# Scans in a row that fit nothing, until a survey begins again.
PATIENCE = 6

STILL: Pose = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class SensorLog:
    """What a vehicle measured while it drove, at equal steps of time."""

    ranges: Floats  # (N, R) [m] of the lidar, right to left, 0 for a drop-out
    speed: Floats  # (N,) [m/s]
    yaw_rate: Floats  # (N,) [rad/s]
    step_s: float
    field: float  # [rad] between the outermost rays
    reach: float  # [m]


@dataclass(frozen=True, eq=False)
class SurveyedCourse:
    """A course as a drive shows it."""

    points: Floats  # (N, 4) x, y, half-width left, half-width right [m]
    scale: str  # of the vehicle that drove
    scans: int  # that it was made from
    driven_m: float  # from the first of them to the last
    closing_m: float  # error of scans and odometry over the lap, before it was closed


def survey_drive(
    log: SensorLog, vehicle: Vehicle, report: Callable[[float], None] = lambda share: None
) -> SurveyedCourse:
    """Return the course of the first lap that closes.

    Its frame is that of the first scan: there lies the timing line, x points ahead. report: is
    called with the share of the work that is done.

    Raises:
        PlanError: no lap closes.
        RaceError: no course fits between the walls.
    """
    cell = CELL * vehicle.width
    survey = LapSurvey(cell, vehicle.length)
    motion, moved, way = STILL, STILL, 0.0
    ranges = np.zeros(0)
    longest = 0.0
    for number, seen in enumerate(log.ranges):
        # The rear axle rolls along; how far it slides aside the scans tell.
        turning = float(log.yaw_rate[number])
        now = (float(log.speed[number]), vehicle.rear_axle * turning, turning)
        step = dead_reckoning(motion, now, log.step_s) if number else STILL
        moved, way, motion = compose(moved, step), way + float(np.hypot(*step[:2])), now
        if np.array_equal(seen, ranges):
            continue
        ranges = seen
        scan = read_scan(seen.astype(np.float64), log.field, log.reach, Lidar().ahead, cell)
        survey.add(scan, moved, way)
        moved, way = STILL, 0.0
        longest = max(longest, survey.ways[-1])
        end = survey.closing()
        if survey.failures >= PATIENCE or survey.is_past:
            survey = LapSurvey(cell, vehicle.length)
            continue
        report(0.5 * number / len(log.ranges))
        if end is None:
            continue
        closing = float(np.hypot(*(np.array(survey.poses[-1][:2]) - end.pose[:2])))
        report(0.5)
        poses = refine(survey.scans, survey.closed(end.pose), cell)
        path, walls = walled_path(survey.scans, poses, cell)
        report(0.8)
        scale = scale_of(vehicle)
        points = points_between(*borders_along(path, walls), path, scale)
        report(1.0)
        return SurveyedCourse(points, scale, len(survey.scans), survey.ways[-1], closing)
    raise PlanError(
        f"no lap closes: the longest stretch on which scans fit one another is {longest:.1f} m; "
        "the drive must come back to where it began, on a course with walls in the lidar's reach"
    )
