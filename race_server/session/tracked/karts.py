"""The real karts of a session: their poses go into the world, and orders go back to them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from race_server.core import codes
from race_server.core.alert import Alert
from race_server.core.clock import MICROSECONDS, TICKS_PER_SECOND
from race_server.core.driven import are_driven
from race_server.core.messages import Pose, PoseFault, Trust
from race_server.core.state import PLACEMENT, Floats, Ints, World
from race_server.core.telemetry import Telemetry
from race_server.core.vehicles import Vehicle
from race_server.scenario.track.course import Course
from race_server.session.tracked.orders import Orders
from race_server.session.tracked.plausibility import PlausibilityLimits
from race_server.session.tracked.told import Told
from race_server.session.tracked.tracker import Tracker

# A point this many kart lengths beyond the borders is not on the course.
BEYOND_LENGTHS = 1.0
# Distance between the samples of the centre line that are searched, about.
LOOK_M = 0.5
# A kart tells what it does and how it is five times a second; after these times without [s] an
# alert holds no more, and its state is not known.
ALERTED_S, KNOWN_S = 1.0, 2.0


@dataclass(frozen=True, eq=False)
class Placements:
    """Where real karts were put before a tick, and how far they knew what to obey."""

    tick: int
    rows: Floats  # (n, 10), see state.PLACEMENT
    orders: Ints  # (n, 2) numbers of the newest orders given, and of the newest acknowledged


class TrackedKarts:
    """The trackers of all real karts, by seat."""

    def __init__(self, course: Course) -> None:
        """Begin with none."""
        step = max(round(LOOK_M / course.spacing), 1)
        self._line: Floats = course.line[::step, :2]
        width = course.half_widths[::step].max(axis=1) + course.kerb + course.grass
        self._widths: Floats = width + 0.5 * step * course.spacing
        # A car park has no line, but its area.
        self._area: Floats | None = None if len(course.line) else course.borders.reshape(-1, 2)
        self.trackers: dict[int, Tracker] = {}
        self._hear_nothing()
        self._lengths: dict[int, float] = {}

    def _hear_nothing(self) -> None:
        """Forget all that karts have told."""
        self.alerts: Told[Alert] = Told("alert", ALERTED_S)  # of karts with anything to say
        self.telemetry: Told[Telemetry] = Told("telemetry", KNOWN_S)

    def __contains__(self, seat: int) -> bool:
        return seat in self.trackers

    def admit(self, seat: int, vehicle: Vehicle) -> None:
        """Expect a real kart on a seat."""
        self.trackers[seat] = Tracker(PlausibilityLimits.of(vehicle))
        self.alerts.forget(seat)
        self.telemetry.forget(seat)
        self._lengths[seat] = vehicle.length

    def dismiss(self, seat: int) -> None:
        """Expect it no more."""
        self.trackers.pop(seat, None)
        self.alerts.forget(seat)
        self.telemetry.forget(seat)

    def begin(self, world: World, now_us: int) -> None:
        """Expect all of them on the grid of a new race."""
        self._hear_nothing()
        race = world.races[0]
        lights_s = int(race.start_tick - race.tick) / TICKS_PER_SECOND
        for seat, tracker in self.trackers.items():
            place = _place_of(world, seat)
            self.trackers[seat] = tracker.at_start(place, now_us, lights_s=lights_s)

    def recall(self, placements: Placements) -> None:
        """Know again what was known of the karts that a recording places."""
        for row, orders in zip(placements.rows, placements.orders, strict=True):
            if tracker := self.trackers.get(int(row[0])):
                tracker.trust, tracker.doubt = Trust(int(row[1])), PoseFault(int(row[2]))
                tracker.orders.sequence, tracker.orders.acknowledged = map(int, orders)

    def resume(self, world: World, now_us: int) -> None:
        """Continue a race whose server was killed: expect all karts about where they were."""
        for seat, tracker in self.trackers.items():
            self.trackers[seat] = tracker.resumed(_place_of(world, seat), now_us)

    def placed(self, tick: int, rows: Floats) -> Placements:
        """Return placements as they are recorded."""
        orders = [self.orders(int(seat)) for seat in rows[:, 0]]
        numbers = [(known.sequence, known.acknowledged) for known in orders]
        return Placements(tick, rows, np.array(numbers, np.int64))

    def receive(self, seat: int, pose: Pose, arrived_us: int) -> PoseFault:
        """Receive a pose and return its fault."""
        is_inside = self.is_inside(pose.x, pose.y, BEYOND_LENGTHS * self._lengths[seat])
        return self.trackers[seat].receive(pose, arrived_us, is_inside=is_inside)

    def is_inside(self, x: float, y: float, beyond: float) -> bool:
        """Return whether a point lies on the course or at most `beyond` [m] outside."""
        if self._area is not None:
            low, high = self._area.min(axis=0) - beyond, self._area.max(axis=0) + beyond
            return bool(low[0] <= x <= high[0] and low[1] <= y <= high[1])
        distances = np.hypot(self._line[:, 0] - x, self._line[:, 1] - y)
        return bool((distances <= self._widths + beyond).any())

    def follow(self, world: World, now_us: int) -> Floats:
        """Return where the real karts are now, shape (n, 10), see state.PLACEMENT."""
        statuses, driven = world.bodies["status"][0], are_driven(world)
        for seat, tracker in self.trackers.items():
            if statuses[seat] != codes.ABSENT:
                tracker.follow(now_us, is_racing=bool(driven[seat]))
        self.give_orders(world, now_us)
        rows = [
            row
            for seat, tracker in self.trackers.items()
            if (row := _placement(seat, tracker, world, now_us)) is not None
        ]
        # As it may be recorded, so that a recording holds exactly what acted.
        return np.array(rows, np.float32).reshape(-1, len(PLACEMENT)).astype(np.float64)

    def give_orders(self, world: World, now_us: int, *, is_paused: bool = False) -> None:
        """Give each kart new orders where they are others than before.

        is_paused: the clock of the race stands, and every kart with it.
        """
        flag, driven = int(world.races[0].flag), are_driven(world)
        for seat, tracker in self.trackers.items():
            body, racer = world.bodies[0, seat], world.racers[0, seat]
            if body.status == codes.ABSENT:
                continue
            caps = float(body.speed_cap), float(body.thrust_scale)
            stops = is_paused or not driven[seat]
            what = (*caps, flag, int(racer.yellow), tracker.trust, stops)
            tracker.orders.change(what, now_us)

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


def _place_of(world: World, seat: int) -> Pose:
    """Return where a kart is in the world, as a pose."""
    body = world.bodies[0, seat]
    return Pose(
        stamp_us=0,
        x=float(body.x),
        y=float(body.y),
        heading=float(body.heading),
        speed=float(body.speed),
        lateral_speed=float(body.lateral_speed),
        yaw_rate=float(body.yaw_rate),
        steering=float(body.steering),
    )


def _placement(seat: int, tracker: Tracker, world: World, now_us: int) -> tuple[float, ...] | None:
    """Return the row of one kart; None before its first pose."""
    body = world.bodies[0, seat]
    if body.status == codes.ABSENT:
        return None
    # A kart that was trusted before its server was killed is not moved by the simulation since.
    trust = tracker.trust or Trust(int(body.trust))
    pose = tracker.pose_at(now_us)
    if trust is Trust.SIMULATED or pose is None:
        return None
    return (
        *(seat, int(trust), int(tracker.doubt)),
        *(pose.x, pose.y, pose.heading, pose.speed, pose.lateral_speed, pose.yaw_rate),
        pose.steering,
    )
