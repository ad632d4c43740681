"""What gyro and accelerometer say while a kart stands is their error."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

# A kart rests when its wheels stood for this time [s], and nothing was felt or turned beyond noise.
REST_S = 0.5
WHEELS, TURN, FELT = 0.15, 0.15, 1.5  # [m/s], [rad/s], [m/s²] about the mean
# A bias that was measured for this long [s] at least is subtracted, and no more than this is kept.
LEAST_S, MOST_S = 1.0, 20.0
# Wheels or gyro that are silent for longer [s] may have missed that the kart drives off.
MISSES_S = 0.06
# Larger ones [rad/s], [m/s²] are no bias: the kart is carried, or stands on a slope.
MOST_TURN, MOST_FELT = 0.2, 1.0


@dataclass
class Inertial:
    """The accelerometer's bias, and whether the kart rests."""

    bias: NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))  # [m/s²] ahead, left
    rests: bool = False
    _mean: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))  # turn, felt
    _since_s: float = 0.0
    _heard_s: float = 0.0
    _count: int = 0

    def watch(
        self, wheels: float, turn: float, felt: tuple[float, float] | None, time_s: float
    ) -> None:
        """Take one reading. wheels: [m/s]; turn: [rad/s] of the gyro; felt: [m/s²]."""
        self._heard_s = time_s
        told = np.array([turn, *(felt or (0.0, 0.0))])
        if self._count == 0:
            self._since_s, self._mean = time_s, told
        stands = abs(wheels) < WHEELS
        if self._count > 5:
            off = np.abs(told - self._mean)
            stands &= bool(off[0] < TURN and off[1] < FELT and off[2] < FELT)
        if not stands or abs(turn) > MOST_TURN or bool((np.abs(told[1:]) > 2.0 * FELT).any()):
            self.forget()
            return
        self._count += 1
        self._mean = self._mean + (told - self._mean) / self._count
        lasted_s = time_s - self._since_s
        self.rests = lasted_s >= REST_S
        if felt is not None and LEAST_S <= lasted_s <= MOST_S:
            if bool((np.abs(self._mean[1:]) < MOST_FELT).all()):
                self.bias = self._mean[1:]

    def miss(self, time_s: float) -> None:
        """Note that wheels or gyro tell nothing now: the kart is not known to rest."""
        self.rests = False
        if not 0.0 <= time_s - self._heard_s <= MISSES_S:
            self.forget()

    def forget(self) -> None:
        """Take it that the kart moves, or may."""
        self._count, self.rests = 0, False
