"""A state and how sure it is, corrected by readings that pass a gate.

Readings that are refused again and again raise doubt in the state itself. Arrays this small are
multiplied by `dot`, which takes half the time of `@`.
"""

import math

import numpy as np

from race_agents.unit.motion import (
    BIAS,
    COMPLIANCE,
    DELAY,
    HEADING,
    IDENTITY,
    SCALE,
    SIZE,
    SLIDE,
    Floats,
    wrap,
)

# 99.9 % of all honest readings of one and of two numbers pass these squares.
GATE_ONE, GATE_TWO = 10.83, 13.82
# After this many readings of a sensor refused in a row: the filter is wrong, not they.
MOST_REFUSED = 5
# Variances of a heading that is known to about 20 degrees [rad²], and of a slide [m²/s²] that was
# not noticed.
ROUGH, UNNOTICED = 0.15, 4.0


class Corrected:
    """State and covariance of a filter, see `race_agents.unit.motion`."""

    def __init__(self) -> None:
        """Begin without any knowledge."""
        self.state: Floats = np.zeros(SIZE)
        self.covariance: Floats = np.zeros((SIZE, SIZE))
        self.squares: dict[str, float] = {}
        self._refused: dict[str, int] = {}  # readings in a row that were not believed

    def _see_one(
        self,
        sensor: str,
        residual: float,
        row: Floats,
        deviation: float,
        most: int | None = MOST_REFUSED,
    ) -> bool:
        """Take one number; False if it was not believed.

        most: readings refused in a row before the state is doubted, None: it never is.
        """
        shared = self.covariance.dot(row)
        spread = float(row.dot(shared)) + deviation**2
        square = residual**2 / spread
        self.squares[sensor] = square
        if not square <= GATE_ONE:  # what is no number is refused, too
            self._doubt(sensor, np.array([residual]), row[None], most)
            return False
        self._refused[sensor] = 0
        self._correct(shared, residual, spread)
        return True

    def _correct(self, shared: Floats, residual: float, spread: float) -> None:
        """Correct state and covariance by one number.

        shared: its covariance with the state; spread: the variance of its residual.
        """
        gain = shared / spread
        self.state = state = self.state + gain * residual
        if abs(state[HEADING]) > math.pi:
            state[HEADING] = wrap(float(state[HEADING]))
        self.covariance = self.covariance - gain[:, None].dot(shared[None])

    def _update(self, sensor: str, residual: Floats, slope: Floats, noise: Floats) -> bool:
        """Take two numbers at once; False if they were not believed."""
        shared = slope.dot(self.covariance)
        spread = shared.dot(slope.T) + noise
        (first, both), (_, second) = spread.tolist()
        inverse = np.array([[second, -both], [-both, first]]) / (first * second - both * both)
        self.squares[sensor] = float(residual @ inverse @ residual)
        if not self.squares[sensor] <= GATE_TWO:
            return False
        self._refused[sensor] = 0
        gain = shared.T.dot(inverse)
        self.state = self.state + gain.dot(residual)
        self.state[HEADING] = wrap(float(self.state[HEADING]))
        keep = IDENTITY - gain.dot(slope)
        covariance = keep.dot(self.covariance).dot(keep.T) + gain.dot(noise).dot(gain.T)
        self.covariance = 0.5 * (covariance + covariance.T)
        return True

    def _doubt(self, sensor: str, residual: Floats, slope: Floats, most: int | None) -> None:
        """Count a refusal; after too many in a row doubt the state by as much as it misses.

        But not what drifts and never jumps (bias, scale, compliance, delay). A filter with a wrong
        position has a wrong heading too, by an unknown amount: it must not be made to explain the
        position.
        """
        if most is None:
            return
        self._refused[sensor] = self._refused.get(sensor, 0) + 1
        if self._refused[sensor] > most:
            self._refused[sensor] = 0
            slope = slope.copy()
            slope[:, [HEADING, BIAS, SCALE, COMPLIANCE, DELAY]] = 0.0
            self.covariance = self.covariance + slope.T @ np.diag(residual**2) @ slope
            if sensor in {"position", "range"}:
                doubts = np.zeros(SIZE)
                doubts[[HEADING, SLIDE]] = ROUGH, UNNOTICED
                self.covariance = self.covariance + np.diag(doubts)
