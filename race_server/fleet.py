"""The real karts of a session: what they tell goes into the world, and what they must obey back."""

from typing import Any

import numpy as np

from race_server import codes
from race_server.messages import Doubt, Pose, Trust
from race_server.params import Vehicle
from race_server.state import PLACEMENT, Floats, World
from race_server.track.course import Course
from race_server.tracking import MICROSECONDS, Gates, Orders, Tracker

# A point this many kart lengths beyond the borders is not on the course.
BEYOND_LENGTHS = 1.0
# The centre line is looked at about every so many metres.
LOOK_M = 0.5


class Fleet:
    """The trackers of all real karts, by seat."""

    def __init__(self, course: Course) -> None:
        """Begin with none."""
        step = max(round(LOOK_M / course.spacing), 1)
        self._line: Floats = course.line[::step, :2]
        width = course.half_widths[::step].max(axis=1) + course.kerb + course.grass
        self._widths: Floats = width + 0.5 * step * course.spacing
        self.trackers: dict[int, Tracker] = {}
        self._lengths: dict[int, float] = {}

    def __contains__(self, seat: int) -> bool:
        return seat in self.trackers

    def admit(self, seat: int, vehicle: Vehicle) -> None:
        """Expect a real kart on a seat."""
        self.trackers[seat] = Tracker(Gates.of(vehicle))
        self._lengths[seat] = vehicle.length

    def dismiss(self, seat: int) -> None:
        """Expect it no more."""
        self.trackers.pop(seat, None)

    def begin(self, world: World, now_us: int) -> None:
        """Expect all of them on the grid of a new race."""
        for seat, tracker in self.trackers.items():
            kart = world.karts[0, seat]
            place = Pose(0, float(kart.x), float(kart.y), float(kart.heading), 0.0)
            self.trackers[seat] = tracker.at_start(place, now_us)

    def take(self, seat: int, pose: Pose, arrived_us: int) -> Doubt:
        """Take a pose that arrived and return what speaks against it."""
        is_inside = self.is_inside(pose.x, pose.y, BEYOND_LENGTHS * self._lengths[seat])
        return self.trackers[seat].take(pose, arrived_us, is_inside=is_inside)

    def is_inside(self, x: float, y: float, beyond: float) -> bool:
        """Return whether a point lies on the course or at most `beyond` [m] outside."""
        distances = np.hypot(self._line[:, 0] - x, self._line[:, 1] - y)
        return bool((distances <= self._widths + beyond).any())

    def follow(self, world: World, now_us: int) -> Floats:
        """Return where the real karts are now, shape (n, 10), see state.PLACEMENT."""
        rows = [
            row
            for seat, tracker in self.trackers.items()
            if (row := _placement(seat, tracker, world, now_us)) is not None
        ]
        # As it may be recorded, so that a recording holds exactly what acted.
        return np.array(rows, np.float32).reshape(-1, len(PLACEMENT)).astype(np.float64)

    def orders(self, seat: int) -> Orders:
        """Return the orders of a real kart."""
        return self.trackers[seat].orders

    def figures(self, now_us: int) -> list[dict[str, Any]]:
        """Return what is known of each real kart's link, as plain data."""
        return [
            {
                "seat": seat,
                "trust": tracker.trust.name.lower(),
                "doubt": tracker.doubt.name.lower(),
                "pose_age_s": tracker.age_s(now_us),
                "clock_offset_us": round(tracker.clock.offset_us),
                "delay_s": tracker.clock.delay_us / MICROSECONDS,
                "poses": tracker.poses,
                "refused": {doubt.name.lower(): n for doubt, n in tracker.refused.items()},
            }
            for seat, tracker in self.trackers.items()
        ]


def _placement(seat: int, tracker: Tracker, world: World, now_us: int) -> tuple[float, ...] | None:
    """Return the row of one kart; None while it has not been heard of yet."""
    kart, flag = world.karts[0, seat], int(world.races[0].flag)
    if kart.status == codes.ABSENT:
        return None
    tracker.follow(now_us)
    stops = kart.status != codes.RACING
    what = (float(kart.speed_cap), float(kart.thrust_scale), flag, int(kart.yellow), tracker.trust)
    tracker.orders.change((*what, stops), now_us)
    pose = tracker.pose_at(now_us)
    if tracker.trust is Trust.SIMULATED or pose is None:
        return None
    return (
        *(seat, int(tracker.trust), int(tracker.doubt)),
        *(pose.x, pose.y, pose.heading, pose.speed, pose.lateral_speed, pose.yaw_rate),
        pose.steering,
    )
