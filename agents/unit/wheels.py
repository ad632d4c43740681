"""Whether the wheels tell the kart's speed: not while they are locked, or spin.

Wheels that push turn a little faster than the kart drives, wheels that brake a little slower: tyres
slip in proportion to the pull, and are taken to be as stiff along as across. A kart cannot change
its speed faster than its tyres can push it. Wheels that do have lost the road; they are believed
again once they agree with the speed that the other sensors tell.
"""

import math
from collections import deque
from dataclasses import dataclass, field

from race_server.core.vehicles import GRAVITY, Vehicle

# What tyres can do is multiplied by this: grip is a little better somewhere.
MARGIN = 1.5
# The change of speed is taken over this time [s]: over a single step it would be noise.
WINDOW_S = 0.07
# The wheels agree within this [m/s], or share of the speed, for this time [s].
AGREE, AGREE_SHARE, AGREE_S = 0.3, 0.04, 0.1
# No kart slides for longer [s]: its speed is then unknown, and the wheels say what it is.
MOST_S = 4.0
# Deviation at a stand [m/s], as a share of the speed, and that share under a pull of 1 g. How far
# slip is not as expected lasts as long as the pull: it counts more than noise of this size.
DEVIATION, SHARE, PULL_SHARE = 0.03, 0.01, 0.3
# Tyres that slip by more than this no longer push in proportion.
MOST_SLIP = 0.2


@dataclass
class Wheels:
    """The wheels' speed, and whether it is the kart's."""

    hold: float  # [m/s²] that the tyres can do
    yields: float  # [s²/m] slip of the tyres per pull
    _recent: deque[tuple[float, float]] = field(default_factory=deque)
    _lost_s: float = math.inf  # when the wheels lost the road
    _agree_s: float = math.inf  # since when they agree again

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Wheels":
        """Return the wheels of a vehicle."""
        return cls(MARGIN * vehicle.grip * GRAVITY, 1.0 / (GRAVITY * vehicle.cornering))

    def trusted(
        self, speed: float, estimate: float, pull: float, time_s: float
    ) -> tuple[float, float] | None:
        """Return the kart's speed and its deviation [m/s], or None while the wheels do not tell it.

        speed: of the wheels; estimate: of the kart, as far as it is known without them [m/s]; pull:
        its acceleration ahead [m/s²], under which wheels slip.
        """
        if self._recent and time_s < self._recent[-1][0]:  # the clock was set back
            self._recent.clear()
            self._lost_s = time_s if self.is_lost else math.inf
            self._agree_s = math.inf
        self._recent.append((time_s, speed))
        while time_s - self._recent[0][0] > WINDOW_S:
            self._recent.popleft()
        slip = max(-MOST_SLIP, min(math.copysign(self.yields, speed) * pull, MOST_SLIP))
        told = speed / (1.0 + slip)
        self._judge(speed, told - estimate, estimate, time_s)
        if self._lost_s < math.inf:
            return None
        unsure = SHARE + PULL_SHARE * abs(pull) / GRAVITY
        return told, math.hypot(DEVIATION, unsure * abs(told))

    @property
    def is_lost(self) -> bool:
        """Whether the wheels are locked, or spin."""
        return self._lost_s < math.inf

    def _judge(self, speed: float, off: float, estimate: float, time_s: float) -> None:
        then_s, then = self._recent[0]
        if time_s > then_s and abs(speed - then) > self.hold * max(time_s - then_s, WINDOW_S):
            if self._lost_s == math.inf:
                self._lost_s = time_s
            self._agree_s = math.inf
            return
        if self._lost_s == math.inf:
            return
        if abs(off) > AGREE + AGREE_SHARE * abs(estimate):
            self._agree_s = math.inf
        elif self._agree_s == math.inf:
            self._agree_s = time_s
        if time_s - self._agree_s >= AGREE_S or time_s - self._lost_s > MOST_S:
            self._lost_s = self._agree_s = math.inf
