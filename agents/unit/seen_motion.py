"""How fast a kart drives by what needs no wheels: borders come nearer, and fixes go on.

Wheels that tell a stand, and an estimate that follows them, do not show that they have failed.
"""

import math
from dataclasses import dataclass

import numpy as np

from race_agents.unit.borders import middle_of
from race_agents.unit.readings import Fix, Readings
from race_agents.unit.safety import Echoes
from race_server.core import codes

# Borders tell the kart's own speed by this number of echoes at least, within this angle [rad] of
# its nose, and that is known for this long [s].
BORDERS, FRONT, SEEN_S = 4, 0.8, 0.6
WIDENS = math.tan(FRONT)
# Two fixes this long [s] apart tell how far the kart came, less this multiple of their deviation.
APART_S, SURE = 0.5, 6.0
# Faster [m/s] is no speed of a kart.
MOST_SPEED = 200.0


@dataclass
class SeenMotion:
    """The speed [m/s] that borders and fixes tell, and what is sure of it."""

    nose: float  # [m] from the rear axle forward to the radar
    _seen_s: float = -math.inf  # when something told a speed
    _speed: float = 0.0
    _surely: float = 0.0
    _place: tuple[float, float, float] | None = None  # when and where [m] the kart was by a fix

    def take(self, readings: Readings) -> None:
        """Take what some readings tell."""
        now_s, echoes, fix = readings.time_s, readings.echoes, readings.fix
        told = [
            None if echoes is None else self._by_borders(echoes, readings.yaw_rate),
            None if fix is None else self._by_fixes(fix, now_s),
        ]
        if known := [each for each in told if each is not None and abs(each[0]) <= MOST_SPEED]:
            self._seen_s = now_s
            self._speed, self._surely = map(max, zip(*known, strict=True))

    def speed(self, now_s: float) -> float:
        """Return the speed [m/s] that was told last, 0 where that is long ago."""
        return self._speed if self._is_fresh(now_s) else 0.0

    def surely(self, now_s: float) -> float:
        """Return the speed [m/s] that the kart has at least, 0 where nothing tells it."""
        return self._surely if self._is_fresh(now_s) else 0.0

    def _is_fresh(self, now_s: float) -> bool:
        return 0.0 <= now_s - self._seen_s <= SEEN_S

    def _by_fixes(self, fix: Fix, now_s: float) -> tuple[float, float] | None:
        """Return the speed [m/s] that a fix tells, or else the way since an earlier one."""
        if fix.speed is not None:
            return fix.speed, max(fix.speed - SURE * fix.speed_deviation, 0.0)
        was = self._place
        if was is None or not 0.0 <= now_s - was[0] <= 2.0 * APART_S:
            self._place = now_s, fix.x, fix.y
            return None
        if now_s - was[0] < APART_S:
            return None
        self._place = now_s, fix.x, fix.y
        way = math.hypot(fix.x - was[1], fix.y - was[2]) - SURE * fix.deviation
        speed = max(way, 0.0) / (now_s - was[0])
        return speed, speed

    def _by_borders(self, echoes: Echoes, turn: float) -> tuple[float, float] | None:
        """Return the speed [m/s] at which borders come nearer, None where few are seen.

        turn: [rad/s] of the gyro, by which the radar swings aside; may be no number, or wrong.
        """
        ahead = echoes.x - self.nose
        used = (echoes.kinds == codes.BORDER) & (np.abs(echoes.y) < WIDENS * ahead)
        used &= np.isfinite(echoes.closing)
        if np.count_nonzero(used) < BORDERS:
            return None
        far = np.hypot(ahead[used], echoes.y[used])
        swing = 0.0 if math.isnan(turn) else self.nose * turn
        told, aside = echoes.closing[used] * far / ahead[used], echoes.y[used] / ahead[used]
        # Of a gyro that is wrong no kart that stands becomes one that drives.
        speed = min(middle_of(told), middle_of(told - swing * aside), key=abs)
        return speed, speed
