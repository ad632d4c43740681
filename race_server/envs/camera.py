"""Rendering for the environments that show one race."""

from typing import Any

from race_server.core.state import part_of
from race_server.envs.batch import Batch
from race_server.envs.render.picture import Picture
from race_server.envs.render.window import Window
from race_server.errors import ScenarioError

RENDER_MODES = ("human", "rgb_array")
VECTOR_RENDER_MODES = ("rgb_array",)


class Camera:
    """Shows races of a batch, in a window or as arrays."""

    def __init__(self, batch: Batch, mode: str | None) -> None:
        if mode is not None and mode not in RENDER_MODES:
            raise ScenarioError(
                f"render mode {mode!r} is unknown; choose one of {', '.join(RENDER_MODES)}"
            )
        self.mode = mode
        self._batch = batch
        self._pictures: dict[int, Picture] = {}
        self._window: Window | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy begins with: no window and no pictures."""
        return {"mode": self.mode, "_batch": self._batch, "_pictures": {}, "_window": None}

    def follow(self) -> None:
        """Show the race as it is in the window, where the mode is `human`: after reset and step."""
        if self.mode == "human":
            self.shoot()

    def shoot(self, w: int = 0) -> Any:
        """Return a race as (height, width, 3) bytes; None where it is shown in a window."""
        if self.mode is None:
            return None
        scenario = int(self._batch.buffers.rounds["scenario"][w])
        if scenario not in self._pictures:
            self._pictures[scenario] = Picture(self._batch.scenarios[scenario].course)
        followed = 0 if self._batch.learners == 1 else -1
        world = part_of(self._batch.world, w, w + 1)
        frame = self._pictures[scenario].draw(world, followed=followed)
        if self.mode == "rgb_array":
            return frame
        if self._window is None:
            self._window = Window()
        self._window.show(frame)
        return None

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            self._window.close()
            self._window = None


class VectorCamera(Camera):
    """Shows all races of a batch at once, as arrays alone."""

    def __init__(self, batch: Batch, mode: str | None) -> None:
        """Take a batch. mode: None or rgb_array.

        Raises:
            ScenarioError: there is no such mode.
        """
        if mode is not None and mode not in VECTOR_RENDER_MODES:
            raise ScenarioError(
                f"render mode {mode!r} of a vector: choose rgb_array; Gymnasium's "
                "HumanRendering shows that in a window"
            )
        super().__init__(batch, mode)

    def shoot_all(self) -> tuple[Any, ...] | None:
        """Return the race of each learning kart as (height, width, 3) bytes; None without mode."""
        if self.mode is None:
            return None
        frames = [self.shoot(w) for w in range(self._batch.worlds)]
        return tuple(frame for frame in frames for _ in range(self._batch.learners))
