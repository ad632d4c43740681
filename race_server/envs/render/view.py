"""How a course is fitted into a picture."""

from dataclasses import dataclass

import numpy as np

from race_server.core.state import Floats
from race_server.scenario.track.course import Course

_ROWS = 10.0  # heights of the text block for which room is kept, in rows
COLUMNS = 11.0  # and its width, in text heights
# Corners of a square of half side 1.
SQUARE: Floats = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])


@dataclass(frozen=True)
class View:
    """How metres become pixels: x to the right, y up in the world and down in the picture."""

    size: tuple[int, int]
    scale: float  # [px/m]
    left: float  # [px] where x = 0 lies
    top: float  # [px] where y = 0 lies

    def pixels(self, points: Floats) -> Floats:
        """Return the pixel coordinates of points (N, 2) in metres."""
        return points * (self.scale, -self.scale) + (self.left, self.top)

    def finer(self, detail: int) -> "View":
        """Return the same view with `detail` times as many pixels along either axis."""
        size = (self.size[0] * detail, self.size[1] * detail)
        return View(size, self.scale * detail, self.left * detail, self.top * detail)

    @property
    def text(self) -> int:
        """Height of the text [px]."""
        return max(10, round(min(self.size[0] / 64.0, self.size[1] / 48.0)))

    @property
    def row(self) -> float:
        """Distance between two rows of text [px]."""
        return 1.45 * self.text


def view_of(course: Course, size: tuple[int, int]) -> View:
    """Fit a course beside or below the text block, whichever leaves it larger."""
    points = course.borders.reshape(-1, 2)
    low, high = points.min(axis=0), points.max(axis=0)
    text = View(size, 1.0, 0.0, 0.0)
    beside, below = (COLUMNS * text.text, 0.0), (0.0, _ROWS * text.row)
    margin = 0.035 * min(size)

    def scale(taken: tuple[float, float]) -> float:
        return float(np.min((np.array(size) - taken - 2.0 * margin) / np.maximum(high - low, 1e-6)))

    taken = max(beside, below, key=scale)
    fit = scale(taken)
    middle = 0.5 * (np.array(size) + taken)
    centre = 0.5 * (low + high)
    return View(size, fit, float(middle[0] - fit * centre[0]), float(middle[1] + fit * centre[1]))


def turned(points: Floats, angle: float) -> Floats:
    """Return points (N, 2) turned about the origin."""
    cos, sin = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[cos, sin], [-sin, cos]]))
