"""A chart of the course, made while a driver drives its first lap by the lidar.

Scan matching and odometry map the walls, the lap is closed, and another process finds the fastest
line between them. From then on the pose that a scan has on the map tells where the line leads.
"""

import math
import time
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np

from race_agents.planning.charted_course import Chart, ask_chart
from race_agents.planning.drive_survey import CELL, PATIENCE, STILL
from race_agents.planning.gap_way import MOUNT
from race_agents.planning.lap_survey import LapSurvey, dead_reckoning
from race_agents.planning.line_view import LineView
from race_agents.planning.tactics import STANDSTILL
from race_agents.planning.wall_map import Scan, WallMap, compose, read_scan
from race_agents.planning.wayfinder import Wayfinder, places_along
from race_server.core.clock import TICK_S
from race_server.core.driver import Briefing
from race_server.core.observation import Observation
from race_server.core.state import Floats
from race_server.errors import PlanError

# The line takes effect so much later [s] than the lap closed, and as much more for each metre of
# it. A world that is faster than the clock waits meanwhile, so that runs do not depend on it where
# the solver is in time.
LATER_S, LATER_PER_M = 4.0, 0.1
MOST_WAIT_S = 1.0  # in one decision
# A kart that stands this long [s] on its chart has a wrong one; a second of driving makes up for
# this much of it. After this number of wrong charts a course is not charted again.
STUCK_S, MADE_UP, MOST_WRONG = 4.0, 0.05, 2
# Places to look for a lost kart lie this far apart [body lengths].
APART = 1.5


class Charting:
    """What a kart knows of its course by its lidar, speed and yaw rate."""

    def __init__(self, briefing: Briefing) -> None:
        """Begin with nothing known of the course."""
        self._briefing = briefing
        self._cell = CELL * briefing.vehicle.width
        self._tick = -1
        self._motion = STILL
        self._ranges: Floats = np.zeros(0)
        self._moved, self._way, self._scan_tick = STILL, 0.0, 0
        self._wrong = 0  # charts
        self._begin()

    def _begin(self) -> None:
        """Forget the course."""
        self._survey: LapSurvey | None = LapSurvey(self._cell, self._briefing.vehicle.length)
        self._finder: Wayfinder | None = None
        self._chart: Chart | None = None
        self._view: LineView | None = None
        self._asked: Future[Chart] | None = None
        self._stood_s = 0.0

    def look(self, observation: Observation) -> Observation | None:
        """Take in what is seen, at each decision; return what the line of the chart adds to it.

        observation: of the preset `lidar`. None: there is no chart yet, or the kart is lost on it.
        """
        self._reckon(observation)
        ranges = observation["lidar"].astype(np.float64)
        if not np.array_equal(ranges, self._ranges):
            self._ranges = ranges
            self._take_scan(ranges, observation.tick)
            self._moved, self._way, self._scan_tick = STILL, 0.0, observation.tick
        if self._asked is not None:
            self._await_chart(observation.tick)
        if self._stood_s > STUCK_S:
            self._wrong += 1
            self._begin()
        finder, view = self._finder, self._view
        if finder is None or view is None or finder.is_lost:
            return None
        step = 0.5 * self._briefing.vehicle.length
        return view.observe(observation, compose(finder.pose, self._moved), step)

    @property
    def meets_others(self) -> bool:
        """Whether the last scan showed what is no wall of the chart."""
        return self._view is not None and len(self._view.others) > 0

    def _reckon(self, observation: Observation) -> None:
        """Move on by odometry."""
        see = observation.scalar
        motion = (see("speed"), see("lateral_speed"), see("yaw_rate"))
        seconds = (observation.tick - self._tick) * TICK_S if self._tick >= 0 else 0.0
        step = dead_reckoning(self._motion, motion, seconds)
        self._moved = compose(self._moved, step)
        self._way += math.hypot(step[0], step[1])
        self._motion, self._tick = motion, observation.tick
        if abs(motion[0]) > STANDSTILL:
            self._stood_s = max(self._stood_s - MADE_UP * seconds, 0.0)
        elif self._view is not None and not _is_held(observation):
            self._stood_s += seconds

    def _take_scan(self, ranges: Floats, tick: int) -> None:
        briefing = self._briefing
        field, reach = briefing.lidar_field, briefing.lidar_reach
        scan = read_scan(ranges, field, reach, MOUNT, self._cell)
        if self._survey is not None:
            self._survey_on(self._survey, scan, tick)
        elif self._finder is not None:
            self._find(self._finder, scan, tick)

    def _survey_on(self, survey: LapSurvey, scan: Scan, tick: int) -> None:
        """Add a scan to the lap; where it closes, ask for its chart."""
        if not survey.poses:
            if not scan.is_placed or self._wrong >= MOST_WRONG:
                return  # its start would not be known again, or its chart is wrong each time
            self._began_tick = tick
        survey.add(scan, self._moved, self._way)
        end = survey.closing()
        if survey.failures >= PATIENCE or survey.is_past:
            self._begin()
            return
        if end is None:
            return
        poses = survey.closed(end.pose)
        x, y, heading = poses[-1]
        turn = math.copysign(2.0 * math.pi, heading)
        self._finder = Wayfinder(survey.map_at(poses), (x, y, heading - turn))
        task = (survey.scans, poses, self._cell, self._briefing.vehicle)
        thread = ThreadPoolExecutor(1, thread_name_prefix="chart")
        self._asked = thread.submit(ask_chart, *task)
        thread.shutdown(wait=False)
        self._asked_tick, self._asked_at = tick, time.monotonic()
        self._driven_s = (tick - self._began_tick) * TICK_S
        self._ready_s = LATER_S + LATER_PER_M * survey.ways[-1]
        self._survey = None

    def _find(self, finder: Wayfinder, scan: Scan, tick: int) -> None:
        """Find the pose of a scan."""
        seconds = (tick - self._scan_tick) * TICK_S
        finder.move(scan, self._moved, self._way)
        if finder.is_lost and self._chart is not None:
            course, length = self._chart.course, self._briefing.vehicle.length
            places = places_along(course.line, course.spacing, APART * length)
            finder.search(scan, places)
        elif finder.is_lost:
            self._begin()
        if self._view is not None and not finder.is_lost:
            field = self._briefing.lidar_field
            self._view.look(self._ranges, field, MOUNT, finder.pose, seconds)

    def _await_chart(self, tick: int) -> None:
        """Take up the chart once it is due; give its solver as much time as the world has.

        A world that waits has as much as it may take for each decision until then; another one as
        much as it is ahead of the clock.
        """
        assert self._asked is not None
        passed = (tick - self._asked_tick) * TICK_S
        clock_s = 0.0 if self._briefing.waits else time.monotonic() - self._asked_at
        ahead = passed - clock_s
        if ahead > 0.0 and not self._asked.done():
            try:
                self._asked.exception(timeout=min(ahead, MOST_WAIT_S))
            except TimeoutError:
                return
        if passed < self._ready_s or not self._asked.done():
            return
        asked, self._asked = self._asked, None
        try:
            chart = asked.result()
        except PlanError:
            self._begin()
            return
        if float(np.sum(chart.line.spacing / chart.line.speed)) > self._driven_s:
            self._begin()  # slower than the lap it was made from: a border is wrong somewhere
            return
        walls = WallMap(chart.points, chart.normals, self._cell)
        if self._finder is not None:
            self._finder = Wayfinder(walls, self._finder.pose)
        self._chart = chart
        self._view = LineView(chart.line, walls, self._briefing.vehicle)


def _is_held(observation: Observation) -> bool:
    """Return whether a kart stands because it is to."""
    see = observation.scalar
    told = max(see(part) for part in ("lights", "finished", "wrong_way", "rescue_offered"))
    return told > 0.0 or see("speed_cap") < STANDSTILL
