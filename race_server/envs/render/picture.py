"""A picture of a race: its background drawn once, and what moves blended over it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from race_server.core import codes
from race_server.core.state import World
from race_server.envs.render.backdrop import background_of
from race_server.envs.render.lot import draw_round
from race_server.envs.render.order import draw_order
from race_server.envs.render.pieces import draw_items, draw_kart
from race_server.envs.render.view import view_of
from race_server.errors import ScenarioError
from race_server.scenario.track.course import Course


class Picture:
    """One course from above, ready to be drawn with the karts of any moment."""

    def __init__(self, course: Course, size: tuple[int, int] = (960, 720)) -> None:
        if min(size) < 64:
            raise ScenarioError(f"a picture of {size[0]} x {size[1]} pixels: choose at least 64")
        self._view = view_of(course, size)
        self._background = background_of(course, self._view)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [px]."""
        return self._view.size

    def pixel_of(self, x: float, y: float) -> tuple[int, int]:
        """Return column and row of the pixel at a place [m] of the world."""
        column, row = np.floor(self._view.pixels(np.array([[x, y]]))[0])
        return int(column), int(row)

    def draw(
        self, world: World, w: int = 0, names: Sequence[str] = (), followed: int = -1
    ) -> NDArray[np.uint8]:
        """Return world `w` as an image (height, width, 3).

        names: of its karts; followed: the kart whose slot stands out, -1 for none.
        """
        frame = self._background.copy()
        draw_round(frame, self._view, world, w, followed)
        draw_items(frame, self._view, world, w)
        present = [k for k, body in enumerate(world.bodies[w]) if body.status != codes.ABSENT]
        # Karts that race are drawn over those that retired.
        for k in sorted(present, key=lambda k: world.bodies[w, k].status != codes.RETIRED):
            draw_kart(frame, self._view, world, w, k)
        draw_order(frame, self._view, world, w, present, names)
        return frame
