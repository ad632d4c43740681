"""A path made ready for a vehicle, with or without a trailer, and how far it was followed."""

import math
from typing import Any

import numpy as np

from race_agents.planning.path import Path
from race_agents.planning.path_follower import (
    ANGLE,
    ARRIVED,
    GEAR,
    HEADING,
    LAST,
    LEFT,
    X,
    Y,
    follow,
    make_track,
)
from race_agents.planning.towed_follower import follow_towed, make_towed_track, rear_axles
from race_agents.planning.towed_path import TowedPath, behind
from race_agents.planning.unexpected import safe_speed
from race_server.core.free_space.footprint import Point, convert
from race_server.core.free_space.rig import rig_of
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.motion import Command, Motion
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle

# A vehicle that has left its way by more than this, to the side [m] or turned [rad], is astray; so
# is one whose hitch has another angle than planned, by more than this [rad].
LOST, TURNED_AWAY, BENT_AWAY = 0.3, 0.3, 0.25


class Way:
    """A track of a vehicle, and the point of it that was passed last."""

    def __init__(self, path: Path, vehicle: Vehicle, pace: float) -> None:
        """Make a path ready. pace: most speed [m/s].

        Raises:
            PlanError: the path has no arcs.
        """
        self._vehicle = vehicle
        self._rig = rig_of(vehicle, 0.0, 1.0) if vehicle.trailers else None
        if isinstance(path, TowedPath):
            self.track = make_towed_track(path, vehicle, pace)
        else:
            self.track = make_track(path, vehicle, pace)
        self.progress = np.zeros(1)
        self._box = np.zeros(6)

    def middles(self, most: int) -> Floats:
        """Return the way of the middle of the body, (N, 2) [m], its ends and cusps included.

        most: N at most, unless there are more cusps.
        """
        track = self.track
        cusps = np.unique(track[:, LAST]).astype(int)
        evenly = np.linspace(0, len(track) - 1, max(most - len(cusps), 2)).astype(int)
        axles = rear_axles(track[np.union1d(cusps, evenly)], self._vehicle)
        return convert(axles, self._vehicle, Point.REAR_AXLE, Point.MIDDLE)[:, :2]

    def command(self, record: Any, motion: Motion, angle: float, cap: float) -> Command:
        """Return what to do now to stay on the way.

        record: VEHICLE; motion: of the centre of gravity; angle: at the hitch [rad], 0 without a
        trailer; cap: most speed [m/s].
        """
        if self._rig is None:
            return follow(self.track, self.progress, record, motion, cap)
        return follow_towed(self.track, self.progress, record, self._rig, motion, angle, cap)

    def safe_speed(self, record: Any, points: Floats, count: int) -> float:
        """Return the most speed [m/s] at which the vehicle can stop before what it sees.

        record: VEHICLE; points: (N, 3), of which the first `count` count.
        """
        return safe_speed(self.track, self.progress, record, self._rig, points, count, self._box)

    @property
    def is_last(self) -> bool:
        """Whether nothing but the end of the way lies ahead; the last step may be a short one."""
        point, end = int(self.progress[0]), len(self.track) - 1
        following = min(point + 1, end)
        is_last_leg = bool(self.track[point, LAST] == end)
        return is_last_leg and bool(self.track[following, LEFT] <= ARRIVED)

    def is_lost(self, motion: Motion, angle: float) -> bool:
        """Return whether the vehicle is astray."""
        row = self.track[int(self.progress[0])]
        axle = axle_of(motion, self._vehicle)
        if self._rig is not None and row[GEAR] < 0.0:
            poses = behind(np.array(axle), np.array(angle), self._vehicle.trailers[0])
            axle = Pose(*poses.tolist())
        x, y, heading = (float(row[column]) for column in (X, Y, HEADING))
        cos, sin = math.cos(heading), math.sin(heading)
        aside = (axle.y - y) * cos - (axle.x - x) * sin
        turn = math.remainder(axle.heading - heading, 2.0 * math.pi)
        is_bent = self._rig is not None and abs(angle - row[ANGLE]) > BENT_AWAY
        return is_bent or abs(aside) > LOST or abs(turn) > TURNED_AWAY


def axle_of(motion: Motion, vehicle: Vehicle) -> Pose:
    """Return the pose of the rear axle of a vehicle whose centre of gravity moves so."""
    place = np.array([motion.x, motion.y, motion.heading])
    return Pose(*convert(place, vehicle, Point.GRAVITY, Point.REAR_AXLE).tolist())
