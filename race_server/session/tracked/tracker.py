"""One real kart as it is followed through a race."""

from collections import Counter
from dataclasses import dataclass, field, replace

from race_server.core.clock import MICROSECONDS
from race_server.core.link_clock import LinkClock
from race_server.core.messages import Pose, PoseFault, Trust
from race_server.session.tracked.orders import Orders
from race_server.session.tracked.plausibility import PlausibilityLimits, doubt_of, is_jump, predict

# Time without an accepted pose after which a kart is doubtful, then suspended, then out.
DOUBT_S, SUSPEND_S, OUT_S = 0.4, 2.0, 20.0
# Number and duration of agreeing poses in a row before a kart is believed again.
AGREEING, AGREEING_S = 8, 0.25
# The first pose is due this long after tracking begins, and not before the start.
FIRST_S = 1.0


@dataclass
class Tracker:
    """One real kart: what is known of it, and how far that is believed."""

    gates: PlausibilityLimits
    clock: LinkClock = field(default_factory=LinkClock)
    orders: Orders = field(default_factory=Orders)
    trust: Trust = Trust.SIMULATED
    doubt: PoseFault = PoseFault.NONE
    poses: int = 0
    refused: Counter[PoseFault] = field(default_factory=Counter)
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

        lights_s: time until the lights go out: until then no kart is in another's way.
        """
        since_us = now_us + round(max(lights_s - FIRST_S, 0.0) * MICROSECONDS)
        return Tracker(self.gates, self.clock, _known=pose, _known_us=now_us, _changed_us=since_us)

    def resumed(self, place: Pose, now_us: int) -> "Tracker":
        """Return a tracker for the rest of a race whose server was killed.

        A kart that was trusted has as long as at the start to send a pose again.
        """
        trust = Trust.SIMULATED if self.trust is Trust.TRUSTED else self.trust
        orders = self.orders.resumed(now_us)
        return Tracker(
            self.gates,
            orders=orders,
            trust=trust,
            doubt=self.doubt,
            _known=place,
            _known_us=now_us,
            _changed_us=now_us,
        )

    def receive(self, pose: Pose, arrived_us: int, *, is_inside: bool) -> PoseFault:
        """Receive a pose and return its fault."""
        self.poses += 1
        self._heard_us = arrived_us
        self.clock.record(pose.stamp_us, arrived_us, pose.echo_us)
        at_us = pose.stamp_us + self.clock.offset_us
        age_s = (arrived_us - at_us) / MICROSECONDS
        doubt = doubt_of(pose, age_s, self.gates, is_inside=is_inside)
        if doubt is PoseFault.NONE:
            doubt = self._compare(pose, at_us)
        else:
            self._agreeing = 0
        if doubt is not PoseFault.NONE:
            self.refused[doubt] += 1
        if doubt is not PoseFault.NONE or self.trust is Trust.TRUSTED:
            self.doubt = doubt
        return doubt

    def _compare(self, pose: Pose, at_us: float) -> PoseFault:
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
                return PoseFault.JUMP
            self._known, self._known_us = pose, at_us
        return PoseFault.NONE

    def follow(self, now_us: int, *, is_racing: bool = True) -> None:
        """Update how far the kart is believed.

        A trusted kart whose race is over may leave: it stands where it was, and is not missed.
        """
        if self.trust is Trust.OUT or (self.trust is Trust.TRUSTED and not is_racing):
            return
        is_deaf = self.orders.is_unheard(now_us)
        waited = (now_us - self._changed_us) / MICROSECONDS
        if self.trust is Trust.TRUSTED:
            if is_deaf:
                self._change(Trust.DOUBTFUL, PoseFault.DEAF, now_us)
            elif self.age_s(now_us) > DOUBT_S:
                heard = now_us - self._heard_us < DOUBT_S * MICROSECONDS
                why = (self.doubt or PoseFault.STALE) if heard else PoseFault.SILENT
                self._change(Trust.DOUBTFUL, why, now_us)
        elif not is_deaf and self._agrees(now_us):
            self._known, self._known_us = self._last, self._last_us
            self._change(Trust.TRUSTED, PoseFault.NONE, now_us)
        elif self.trust is Trust.SIMULATED and is_racing and waited > FIRST_S:
            self._change(Trust.DOUBTFUL, self.doubt or PoseFault.SILENT, now_us)
        elif self.trust is Trust.DOUBTFUL and waited > SUSPEND_S:
            self._change(Trust.SUSPENDED, self.doubt, now_us)
        elif self.trust is Trust.SUSPENDED and waited > OUT_S:
            self._change(Trust.OUT, self.doubt, now_us)

    def _agrees(self, now_us: int) -> bool:
        """Return whether the newest poses in a row agree with one another for long enough."""
        is_fresh = now_us - self._last_us < DOUBT_S * MICROSECONDS
        lasted_s = (self._last_us - self._agreeing_since_us) / MICROSECONDS
        return is_fresh and self._agreeing >= AGREEING and lasted_s >= AGREEING_S

    def _change(self, trust: Trust, doubt: PoseFault, now_us: int) -> None:
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
