"""A vehicle's way among those of others: it is announced, and driven as far as it is cleared."""

import math

import numpy as np

from race_agents.planning.path_follower import ANGLE, BRAKE_SHARE, LEFT
from race_agents.planning.towed_follower import rear_axles
from race_server.core.box_rows import boxes_of
from race_server.core.free_space.footprint import Point, convert
from race_server.core.state import BODY, Floats
from race_server.core.traffic import APART, Traffic
from race_server.core.vehicles import GRAVITY, Vehicle, vehicle_record

# Time until brakes act [s], and how far before the end of a clearance [m] a vehicle stops.
REACTION_S, SHORT = 0.25, 0.1
# Slower than this [m/s] it is not worth to drive on.
LEAST = 0.1


class Passage:
    """The way of one vehicle, from its announcement on."""

    def __init__(self, traffic: Traffic, number: int, track: Floats, vehicle: Vehicle) -> None:
        """Prepare a way. number: of the vehicle; track: (S, COLUMNS), see `path_follower`."""
        self._traffic, self._number = traffic, number
        axles, points = rear_axles(track, vehicle), np.arange(len(track))
        steps = np.hypot(*np.diff(axles[:, :2], axis=0).T)
        self._driven = np.concatenate([[0.0], np.cumsum(steps)])  # (S,) [m] from the start
        # How far corners have moved, in sum, at each point of the track: places are as far apart.
        corners = _corners_of(_boxes_on(axles, track[:, ANGLE], vehicle))
        moves = np.hypot(*np.moveaxis(np.diff(corners, axis=0), -1, 0)).max(axis=(1, 2))
        moved = np.concatenate([[0.0], np.cumsum(moves)])
        evenly = np.interp(np.arange(0.0, moved[-1], APART), moved, points)
        # (P,) places as numbers of points, those in between as fractions.
        self._places = np.union1d(evenly, points[(track[:, LEFT] <= 0.0) | (points == points[-1])])
        placed = [np.interp(self._places, points, row) for row in (*axles.T[:2], track[:, ANGLE])]
        heading = np.interp(self._places, points, np.unwrap(axles[:, 2]))
        self._boxes = _boxes_on(np.column_stack([*placed[:2], heading]), placed[2], vehicle)
        self._reached = np.interp(self._places, points, self._driven)  # (P,) [m] the same

    def open(self) -> bool:
        """Announce the way; False where it would block others."""
        return self._traffic.announce(self._number, self._boxes)

    @property
    def is_open(self) -> bool:
        """Whether it is still announced: what is parked or out has no way left."""
        return self._traffic.has_way(self._number)

    def close(self) -> None:
        """Let others know that this way is not driven any more."""
        self._traffic.withdraw(self._number)

    def speed(self, point: int, vehicle: Vehicle) -> float:
        """Return the most speed [m/s] at which a vehicle can stop where its clearance ends.

        point: of the track, passed last.
        """
        passed = int(np.searchsorted(self._places, point, side="right")) - 1
        cleared = self._traffic.clear(self._number, passed)
        if cleared == len(self._places) - 1:
            return math.inf
        left = float(self._reached[cleared] - self._driven[point]) - SHORT
        brakes = BRAKE_SHARE * (vehicle.brake_force / vehicle.mass + vehicle.rolling * GRAVITY)
        lag = brakes * REACTION_S
        speed = math.sqrt(lag * lag + 2.0 * brakes * max(left, 0.0)) - lag
        return speed if speed >= LEAST else 0.0

    def is_obstructed(self) -> bool:
        """Return whether a vehicle that has no way stands on this one."""
        return self._traffic.is_obstructed(self._number)


def _boxes_on(axles: Floats, angles: Floats, vehicle: Vehicle) -> Floats:
    """Return the boxes of a vehicle where its rear axle has P poses, (P, U, 6), see `boxes_of`.

    axles: (P, 3); angles: (P,) [rad] at the hitch, of no meaning without a trailer.
    """
    bodies = np.zeros(len(axles), BODY)
    bodies["x"], bodies["y"], heading = convert(axles, vehicle, Point.REAR_AXLE, Point.GRAVITY).T
    bodies["heading"] = heading
    if vehicle.trailers:
        bodies["trailers"]["heading"][:, 0] = heading - angles
    return boxes_of(bodies, np.repeat(vehicle_record(vehicle), len(axles)))


def _corners_of(boxes: Floats) -> Floats:
    """Return the corners of boxes, (P, U, 6), as (P, U, 4, 2) [m]."""
    x, y, cos, sin, half_length, half_width = np.moveaxis(boxes, -1, 0)[..., None]
    along, across = half_length * (1.0, 1.0, -1.0, -1.0), half_width * (1.0, -1.0, -1.0, 1.0)
    return np.stack([x + along * cos - across * sin, y + along * sin + across * cos], axis=-1)
