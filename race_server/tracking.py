"""Where a real kart is, and whether to believe it. Pure: times come in as numbers.

A pose is as old as it took to get here. The kart's clock is set against ours by the quickest
messages, the kart is moved on along an arc from then to now, and what no kart can have done is
refused: a refused pose never gets into the world. While none can be believed the kart stays where
it was last known to be, touches nobody, and is in the end taken out.
"""

import math
from collections import Counter, deque
from dataclasses import dataclass, field, replace

from race_server.messages import Doubt, Pose, Trust
from race_server.params import GRAVITY, Vehicle

MICROSECONDS = 1_000_000
# A pose older than this is of no use; one lost message and 90 ms of delay at 10 Hz are less.
STALE_S = 0.4
# So long without a pose that is believed makes a kart doubtful, then parks it, then ends its race.
DOUBT_S, PARK_S, OUT_S = 0.4, 2.0, 20.0
# So many poses in a row, over at least this time, must agree before a kart is believed again.
AGREEING, AGREEING_S = 8, 0.25
# Nobody expects the first pose sooner than this, nor before the start.
FIRST_S = 1.0
# A kart that does not acknowledge what it must obey for so long cannot be relied on.
DEAF_S = 1.5
# More orders than a server can have given that was killed before they were written down.
UNWRITTEN = 3600
LEAST_QUALITY = 0.2
# What a message may be late by, as the clock sees it; it counts at the kart's speed.
JITTER_S = 0.03
STRAIGHT = 1e-4  # [rad/s] turns slower than this are driven as straight lines


@dataclass(frozen=True)
class Gates:
    """What a kart of a kind can do at most."""

    speed: float  # [m/s] ahead
    reverse: float  # [m/s]
    acceleration: float  # [m/s²]
    jump: float  # [m] by which a pose may miss where the kart was expected
    deviation: float  # [m] a position less certain than this is of no use

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Gates":
        """Return the gates of a vehicle: its limits, a boost, and some room."""
        return cls(
            speed=1.3 * vehicle.top_speed + 0.5,
            reverse=2.0 * vehicle.reverse_speed + 0.5,
            acceleration=2.0 * vehicle.grip * GRAVITY,
            jump=0.5 * vehicle.length,
            deviation=vehicle.length,
        )


def predict(pose: Pose, dt: float) -> Pose:
    """Return a pose `dt` seconds later, at the same speeds and the same yaw rate.

    The velocity turns with the body, so the way is an arc (constant turn rate and velocity).
    """
    w = pose.yaw_rate
    along, aside = dt, 0.5 * w * dt * dt
    if abs(w) > STRAIGHT:
        along, aside = math.sin(w * dt) / w, (1.0 - math.cos(w * dt)) / w
    ahead = pose.speed * along - pose.lateral_speed * aside
    left = pose.speed * aside + pose.lateral_speed * along
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    return replace(
        pose,
        x=pose.x + ahead * cos - left * sin,
        y=pose.y + ahead * sin + left * cos,
        heading=pose.heading + w * dt,
    )


def is_jump(before: Pose, after: Pose, dt: float, gates: Gates) -> bool:
    """Return whether a kart cannot have got from one pose to the other in `dt` seconds."""
    if dt < 0.0:
        return True
    expected = predict(before, dt)
    miss = math.hypot(after.x - expected.x, after.y - expected.y)
    room = gates.jump + 3.0 * after.deviation + 0.5 * gates.acceleration * dt * dt
    return miss > room + JITTER_S * abs(before.speed)


def doubt_of(pose: Pose, age_s: float, gates: Gates, *, is_inside: bool) -> Doubt:
    """Return what speaks against a pose, looked at alone."""
    if age_s > STALE_S:
        return Doubt.STALE
    if pose.quality < LEAST_QUALITY or pose.deviation > gates.deviation:
        return Doubt.POOR
    if not -gates.reverse <= pose.speed <= gates.speed:
        return Doubt.SPEED
    return Doubt.NONE if is_inside else Doubt.OFF_WORLD


class LinkClock:
    """Sets a kart's clock against ours by the quickest messages of the last half minute.

    What a message takes at least is half the shortest time that the kart needed to answer one of
    ours, which the kart echoes; a kart that echoes nothing is taken to be as late as `assumed_s`.
    """

    BUCKET_US, BUCKETS = 3 * MICROSECONDS, 10
    # A clock that is this far off all at once has been set anew.
    RESET_US = 2 * MICROSECONDS

    def __init__(self, assumed_s: float = 0.0) -> None:
        """Know nothing yet."""
        self._assumed_us = assumed_s * MICROSECONDS
        # Of each bucket of time: its number, shortest arrival less stamp, shortest round trip, and
        # arrival less stamp of the message that made it.
        self._buckets: deque[list[float]] = deque(maxlen=self.BUCKETS)

    def note(self, stamp_us: int, arrived_us: int, echo_us: int = 0) -> None:
        """Take note of a message: stamped by the kart, arrived by our clock."""
        gap = float(arrived_us - stamp_us)
        if self._buckets and gap - self._gap_us > self.RESET_US:
            self._buckets.clear()
        number = arrived_us // self.BUCKET_US
        if not self._buckets or self._buckets[-1][0] != number:
            self._buckets.append([number, gap, math.inf, gap])
        bucket = self._buckets[-1]
        bucket[1] = min(bucket[1], gap)
        trip = arrived_us - echo_us
        if echo_us and 0 <= trip < min(self.RESET_US, bucket[2]):
            bucket[2:] = trip, gap

    @property
    def _gap_us(self) -> float:
        return min((bucket[1] for bucket in self._buckets), default=0.0)

    @property
    def _quickest(self) -> tuple[float, float]:
        """Round trip [µs] and arrival less stamp of the quickest answer."""
        rows = ((bucket[2], bucket[3]) for bucket in self._buckets)
        return min(rows, default=(math.inf, 0.0))

    @property
    def delay_us(self) -> float:
        """What a message takes at least [µs]."""
        trip, _ = self._quickest
        return 0.5 * trip if trip < math.inf else self._assumed_us

    @property
    def offset_us(self) -> float:
        """What to add to a stamp of the kart to have the time of our clock [µs]."""
        trip, gap = self._quickest
        return gap - 0.5 * trip if trip < math.inf else self._gap_us - self._assumed_us


@dataclass
class Orders:
    """What a kart must obey, numbered, and how far it has acknowledged that."""

    sequence: int = 0
    acknowledged: int = 0
    _what: tuple[float, ...] = ()
    _since_us: int = 0

    def taken_up(self, now_us: int) -> "Orders":
        """Return the orders for the rest of a race whose server was killed: all are repeated.

        Their numbers are higher than any that the kart may have heard of and nobody wrote down.
        """
        return Orders(self.sequence + UNWRITTEN, self.acknowledged, _since_us=now_us)

    def change(self, what: tuple[float, ...], now_us: int) -> None:
        """Number the orders anew if they are others than before."""
        if what != self._what:
            if self.acknowledged == self.sequence:
                self._since_us = now_us
            self._what = what
            self.sequence += 1

    def acknowledge(self, sequence: int, now_us: int) -> None:
        """Take note of what the kart says it obeys."""
        if self.acknowledged < sequence <= self.sequence:
            self.acknowledged = sequence
            self._since_us = now_us

    @property
    def is_open(self) -> bool:
        """Whether the newest orders are not acknowledged yet."""
        return self.acknowledged < self.sequence

    def is_unheard(self, now_us: int) -> bool:
        """Return whether no order was acknowledged for too long."""
        return self.is_open and now_us - self._since_us > DEAF_S * MICROSECONDS


@dataclass
class Tracker:
    """One real kart: what is known of it, and how far that is believed."""

    gates: Gates
    clock: LinkClock = field(default_factory=LinkClock)
    orders: Orders = field(default_factory=Orders)
    trust: Trust = Trust.SIMULATED
    doubt: Doubt = Doubt.NONE
    poses: int = 0
    refused: Counter[Doubt] = field(default_factory=Counter)
    _known: Pose | None = None  # the last one believed, and when the kart was there
    _known_us: float = 0.0
    _last: Pose | None = None  # the last one that came, good or bad
    _last_us: float = 0.0
    _agreeing: int = 0  # poses in a row that agree, up to the last one
    _agreeing_since_us: float = 0.0
    _heard_us: int = 0
    _changed_us: int = 0

    def at_start(self, pose: Pose, now_us: int, *, lights_s: float = 0.0) -> "Tracker":
        """Return a tracker that expects the kart on the grid; its clock is known from before.

        lights_s: time until the lights go out: until then nobody is in anybody's way.
        """
        since_us = now_us + round(max(lights_s - FIRST_S, 0.0) * MICROSECONDS)
        return Tracker(self.gates, self.clock, _known=pose, _known_us=now_us, _changed_us=since_us)

    def taken_up(self, place: Pose, now_us: int) -> "Tracker":
        """Return a tracker for the rest of a race whose server was killed.

        A kart that was trusted has as long as at the start to be heard of again.
        """
        trust = Trust.SIMULATED if self.trust is Trust.TRUSTED else self.trust
        orders = self.orders.taken_up(now_us)
        return Tracker(
            self.gates,
            orders=orders,
            trust=trust,
            doubt=self.doubt,
            _known=place,
            _known_us=now_us,
            _changed_us=now_us,
        )

    def take(self, pose: Pose, arrived_us: int, *, is_inside: bool) -> Doubt:
        """Take a pose that arrived and return what speaks against it."""
        self.poses += 1
        self._heard_us = arrived_us
        self.clock.note(pose.stamp_us, arrived_us, pose.echo_us)
        at_us = pose.stamp_us + self.clock.offset_us
        age_s = (arrived_us - at_us) / MICROSECONDS
        doubt = doubt_of(pose, age_s, self.gates, is_inside=is_inside)
        if doubt is Doubt.NONE:
            doubt = self._compare(pose, at_us)
        else:
            self._agreeing = 0
        if doubt is not Doubt.NONE:
            self.refused[doubt] += 1
        if doubt is not Doubt.NONE or self.trust is Trust.TRUSTED:
            self.doubt = doubt
        return doubt

    def _compare(self, pose: Pose, at_us: float) -> Doubt:
        """Hold a pose against the one before, and against what is known."""
        before, self._last = self._last, pose
        before_us, self._last_us = self._last_us, at_us
        dt = (at_us - before_us) / MICROSECONDS
        if before is not None and self._agreeing and not is_jump(before, pose, dt, self.gates):
            self._agreeing += 1
        else:
            self._agreeing, self._agreeing_since_us = 1, at_us
        if self.trust is Trust.TRUSTED and self._known is not None:
            since = (at_us - self._known_us) / MICROSECONDS
            if is_jump(self._known, pose, since, self.gates):
                return Doubt.JUMP
            self._known, self._known_us = pose, at_us
        return Doubt.NONE

    def follow(self, now_us: int, *, is_racing: bool = True) -> None:
        """Work out how far the kart is believed now.

        A trusted kart whose race is over may leave: it stands where it was, and is not missed.
        """
        if self.trust is Trust.OUT or (self.trust is Trust.TRUSTED and not is_racing):
            return
        is_deaf = self.orders.is_unheard(now_us)
        waited = (now_us - self._changed_us) / MICROSECONDS
        if self.trust is Trust.TRUSTED:
            if is_deaf:
                self._turn(Trust.DOUBTFUL, Doubt.DEAF, now_us)
            elif self.age_s(now_us) > DOUBT_S:
                heard = now_us - self._heard_us < DOUBT_S * MICROSECONDS
                why = (self.doubt or Doubt.STALE) if heard else Doubt.SILENT
                self._turn(Trust.DOUBTFUL, why, now_us)
        elif not is_deaf and self._agrees(now_us):
            self._known, self._known_us = self._last, self._last_us
            self._turn(Trust.TRUSTED, Doubt.NONE, now_us)
        elif self.trust is Trust.SIMULATED and is_racing and waited > FIRST_S:
            self._turn(Trust.DOUBTFUL, self.doubt or Doubt.SILENT, now_us)
        elif self.trust is Trust.DOUBTFUL and waited > PARK_S:
            self._turn(Trust.PARKED, self.doubt, now_us)
        elif self.trust is Trust.PARKED and waited > OUT_S:
            self._turn(Trust.OUT, self.doubt, now_us)

    def _agrees(self, now_us: int) -> bool:
        """Return whether the newest poses in a row agree with one another for long enough."""
        is_fresh = now_us - self._last_us < DOUBT_S * MICROSECONDS
        lasted_s = (self._last_us - self._agreeing_since_us) / MICROSECONDS
        return is_fresh and self._agreeing >= AGREEING and lasted_s >= AGREEING_S

    def _turn(self, trust: Trust, doubt: Doubt, now_us: int) -> None:
        self.trust, self.doubt, self._changed_us = trust, doubt, now_us

    def age_s(self, now_us: float) -> float:
        """Return how long ago the kart was where it is known to have been [s]."""
        return (now_us - self._known_us) / MICROSECONDS

    def pose_at(self, now_us: float) -> Pose | None:
        """Return where the kart is now; a doubtful one stands where it was last known."""
        if self._known is None:
            return None
        dt = min(max(self.age_s(now_us), 0.0), DOUBT_S)
        pose = predict(self._known, dt)
        if self.trust in {Trust.TRUSTED, Trust.SIMULATED}:
            return pose
        return replace(pose, speed=0.0, lateral_speed=0.0, yaw_rate=0.0)
